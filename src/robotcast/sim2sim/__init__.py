"""The Sim2Sim study: how near optimizers come to parameters that are known (paper, tuning)."""
