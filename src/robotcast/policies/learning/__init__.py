"""Forward models: where a cast comes to rest, learned from real and simulated casts."""
