"""The room that the arm takes up: a capsule around each of its straight pieces.

The capsules hold the collision meshes of the UR5 in ROS-Industrial's `ur_description` (commit
a7a2c54, made from the maker's models), but for the cable's connector at the foot. Joint housings
reach beyond the axes on which the pieces meet, so capsules may begin before their piece and end
beyond it. The hand is what the gripper's sheet says, rounded up.
"""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.ur5 import LINKS


@dataclass(frozen=True)
class Capsule:
    """All points within `radius_m` of a piece that is drawn out by so much at its two ends."""

    radius_m: float
    before_m: float = 0.0
    beyond_m: float = 0.0


LINK_CAPSULES: dict[str, Capsule] = {
    "column": Capsule(0.075, beyond_m=0.03),
    "shoulder": Capsule(0.068, beyond_m=0.04),
    "upper arm": Capsule(0.06),
    "elbow": Capsule(0.068, before_m=0.04, beyond_m=0.02),
    "forearm": Capsule(0.046),
    "wrist 1": Capsule(0.05, before_m=0.03, beyond_m=0.02),
    "wrist 2": Capsule(0.05, before_m=0.03, beyond_m=0.02),
    "wrist 3": Capsule(0.05, before_m=0.03),
    "gripper": Capsule(0.05),
    "fingers": Capsule(0.012),
}


def capsule_axis(points_m: np.ndarray, link: str) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends (..., 3) [m] of the axis of a link's capsule.

    Parameters
    ----------
    points_m : ndarray of shape (..., 11, 3), as `link_points` returns them.
    """
    index, capsule = LINKS.index(link), LINK_CAPSULES[link]
    start, end = points_m[..., index, :], points_m[..., index + 1, :]
    along = end - start
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return start - capsule.before_m * along, end + capsule.beyond_m * along
