"""Many simulations at once: side by side in a batch, and in processes of their own."""
