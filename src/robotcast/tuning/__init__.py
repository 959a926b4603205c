"""Tuning simulator parameters to measured casts."""
