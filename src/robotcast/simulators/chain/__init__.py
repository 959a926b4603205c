"""The cable as a chain in the plane, stepped by MuJoCo."""
