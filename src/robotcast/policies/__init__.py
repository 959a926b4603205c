"""Policies: forward models learned from casts, actions chosen by them, and how far casts end."""
