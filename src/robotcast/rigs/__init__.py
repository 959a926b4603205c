"""Rigs that execute casts: the virtual one, recorded sets."""
