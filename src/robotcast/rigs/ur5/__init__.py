"""A real UR5 under a webcam, behind the same `Rig` as the virtual one."""
