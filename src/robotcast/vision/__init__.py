"""Camera calibration and the tracking of the free end in video."""
