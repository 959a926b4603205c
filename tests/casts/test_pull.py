import numpy as np
import pytest

from robotcast.casts.curves import PlanLimits
from robotcast.casts.plan import plan_pull, pull_action

LIMITS = PlanLimits()


def test_the_held_end_moves_along_one_ray_from_rest_to_rest() -> None:
    planned = plan_pull(pull_action(0.6, 0.81, 0.6, 0.2), r0_m=0.6, limits=LIMITS)
    x, y, yaw = planned.tool.pose.T
    assert np.arctan2(y, x) == pytest.approx(np.full(len(x), 0.6))
    assert yaw == pytest.approx(np.full(len(x), 0.6))
    radius = np.hypot(x, y)
    assert (radius[0], radius[-1]) == pytest.approx((0.81, 0.6))
    assert (np.diff(radius) <= 1e-12).all()
    speed = -np.diff(radius) / np.diff(planned.tool.t_s)
    assert speed.max() == pytest.approx(0.2, rel=0.01)
    assert max(speed[0], speed[-1]) < 0.01


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((0.6, 0.6, 0.81, 0.2), "r2 ≤ r1"),
        ((0.6, 0.81, 0.3, 0.2), "0.5 ≤ r2"),
        ((2.0, 0.81, 0.6, 0.2), "must not exceed 1.5 rad"),
        ((0.6, 0.81, 0.6, 0.0), "vmax must be positive"),
    ],
)
def test_a_pull_that_cannot_be_is_refused(numbers, said) -> None:
    with pytest.raises(ValueError, match=said):
        plan_pull(pull_action(*numbers), r0_m=0.6, limits=LIMITS)
