"""Recorded casts: the files of each, and the session that collects them."""
