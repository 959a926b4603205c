"""The cast: its action, the planned tool motion, grids of actions and their filters."""
