"""Jerk-limited maximum-velocity moves from rest to rest, by ruckig."""

import ruckig

PIECES = 7
"""Pieces of constant jerk in one move."""


class RestToRest:
    """Solves one move after another without allocating a solver for each.

    Parameters
    ----------
    acceleration, jerk : largest magnitudes, in the unit of the distance per s² and s³.
    """

    def __init__(self, acceleration: float, jerk: float) -> None:
        self._solver = ruckig.Ruckig(1)
        self._trajectory = ruckig.Trajectory(1)
        self._input = ruckig.InputParameter(1)
        self._input.max_acceleration = [acceleration]
        self._input.max_jerk = [jerk]

    def solve(self, distance: float, velocity: float) -> tuple[list[float], list[float]]:
        """Return the durations [s] and jerks of the seven pieces of the fastest move.

        Parameters
        ----------
        distance : how far to go, > 0.
        velocity : largest velocity on the way, > 0.
        """
        self._input.target_position = [distance]
        self._input.max_velocity = [velocity]
        result = self._solver.calculate(self._input, self._trajectory)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise ValueError(f"no jerk-limited move of {distance} at {velocity} per s: {result}")
        profile = self._trajectory.profiles[0][0]
        return profile.t, profile.j
