"""Simulators of a cast, which all answer the same simulate call (`simulator`)."""
