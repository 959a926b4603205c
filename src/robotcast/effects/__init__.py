"""Effects that a simulator of a cast may lack, each one small class."""
