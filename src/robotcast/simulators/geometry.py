"""The geometry of a cable cut into a planar chain of rigid segments.

The chain lies in the board's plane. Its generalised coordinates are the held end's x, y and
yaw, then one hinge angle per segment, followed by a stretch where the segment stretches.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

TOOL_DOFS = 3
GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class ChainGeometry:
    """How a cable is cut into segments and hinges.

    A hinge stands for the bending of the cable around it, and sits in the middle of what it
    stands for. Between segments that is one segment length l. At the gripper it is the first
    l/2, so the first hinge sits at l/4, at the end of a stub that is part of the gripper.

    Some segments slide along themselves, and each such slide stands for the stretching of the
    cable nearest to it: a few are enough, because a cable stretches as a whole long before its
    parts do on their own.

    Attributes
    ----------
    stub_m : distance from the held end to the first hinge.
    lengths_m : ndarray of shape (n,), from each hinge to the next, the last to the free end.
    bends_m : ndarray of shape (n,), the length of cable whose bending each hinge carries.
    stretching : bool ndarray of shape (n,), which segments stretch.
    """

    stub_m: float
    lengths_m: np.ndarray
    bends_m: np.ndarray
    stretching: np.ndarray

    @classmethod
    def of_cable(cls, length_m: float, segments: int, stretches: int = 0) -> "ChainGeometry":
        """Cut a cable into `segments` of equal length but for the first (see above).

        `stretches` of them stretch, each in the middle of an equal part of the cable.
        """
        if not 0 <= stretches <= segments:
            raise ValueError(f"of {segments} segments, 0 to {segments} stretch, got {stretches}")
        full = length_m / segments
        lengths, bends = np.full(segments, full), np.full(segments, full)
        lengths[0] -= 0.25 * full
        bends[0] = 0.5 * full
        stretching = np.zeros(segments, dtype=bool)
        stretching[[(2 * part + 1) * segments // (2 * stretches) for part in range(stretches)]] = 1
        return cls(0.25 * full, lengths, bends, stretching)

    @cached_property
    def dofs(self) -> int:
        """How many generalised coordinates the chain has."""
        return TOOL_DOFS + len(self.lengths_m) + int(self.stretching.sum())

    @cached_property
    def hinges(self) -> np.ndarray:
        """Which generalised coordinates are the hinges' angles, int (n,)."""
        before = np.cumsum(self.stretching) - self.stretching
        return TOOL_DOFS + np.arange(len(self.lengths_m)) + before

    @cached_property
    def slides(self) -> np.ndarray:
        """Which generalised coordinates are the segments' stretches, int (n,); −1 for none."""
        return np.where(self.stretching, self.hinges + 1, -1)

    @cached_property
    def stretches_m(self) -> np.ndarray:
        """The length of cable whose stretching each slide carries; they add up to the cable."""
        hinge_m = self.stub_m + np.cumsum(self.lengths_m) - self.lengths_m
        at_m, end_m = hinge_m[self.stretching], self.stub_m + self.lengths_m.sum()
        bounds_m = np.concatenate([[0.0], 0.5 * (at_m[1:] + at_m[:-1]), [end_m]])
        return np.diff(bounds_m[: len(at_m) + 1])

    @cached_property
    def half_m(self) -> np.ndarray:
        """Half the segments' lengths, float32 (n,)."""
        return (0.5 * self.lengths_m).astype(np.float32)


def capsule_inertia(mass_kg: np.ndarray, length_m: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the inertia [kg m²] of a solid rod about its centre, across its axis."""
    return mass_kg * (length_m**2 / 12 + radius_m**2 / 4)
