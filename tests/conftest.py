"""robotcast is imported before NumPy, as by its commands: it says how that computes."""

import robotcast  # noqa: F401
