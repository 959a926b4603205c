"""Where a model misses what was measured, and how far repeats scatter."""
