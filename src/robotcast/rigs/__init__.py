"""Rigs that execute casts: the virtual one, a UR5, recorded sets; what an arm can do."""
