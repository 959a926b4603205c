"""The measurement set: casts as they were executed and tracked, on disk and in memory."""
