"""Real2Sim2Real experiments for Planar Robot Casting."""
