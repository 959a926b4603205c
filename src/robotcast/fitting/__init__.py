"""Parameters and their least-squares fit, for any model."""
