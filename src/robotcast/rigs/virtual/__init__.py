"""The virtual rig: a simulated arm, cable, board and camera that stand in for the robot."""
