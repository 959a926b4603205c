"""Targets, and the action to take for each."""
