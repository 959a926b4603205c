"""Simulators of a cast; all answer the same simulate call."""
