"""A loopback UR controller that the genuine compiled ur_rtde client connects to."""
