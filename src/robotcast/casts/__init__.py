"""The cast: its action, the planned tool motion, grids of actions."""
