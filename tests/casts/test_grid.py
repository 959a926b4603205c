from dataclasses import replace

import numpy as np
import pytest

from robotcast.build import build
from robotcast.casts.plan import ActionGrid, PlanLimits
from tests.stages import configured

CONFIG = configured().casts
LIMITS: PlanLimits = build(CONFIG["limits"])
GRID: ActionGrid = build(CONFIG.grids.collected)
SMALL = replace(GRID, counts=dict(theta1=3, theta2=2, r2=4, alpha=2, vmax=2))


def test_candidates_are_the_whole_grid_with_r1_between_r0_and_r2():
    actions = SMALL.curves(0.6, LIMITS).actions
    assert actions.shape == (96, 6)
    assert len(np.unique(actions, axis=0)) == 96
    assert np.unique(actions[:, 0]).tolist() == pytest.approx(np.linspace(*SMALL.theta1_rad, 3))
    between = (actions[:, 1] - 0.6) * (actions[:, 1] - actions[:, 3])
    assert np.all(between <= 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"theta1_rad": (-0.3, 1.0)}, "theta1_rad must be positive"),
        ({"theta2_rad": (-1.0, 0.1)}, "theta2_rad must be negative"),
        ({"alpha_rad": (-0.1, 1.0)}, "alpha_rad must be zero or positive"),
        ({"counts": {"alpha": 0}}, "count of alpha must be at least 1, got 0"),
    ],
)
def test_what_is_no_grid_of_the_left_half_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(SMALL, **change)


def test_a_grid_that_cannot_be_planned_is_refused():
    with pytest.raises(ValueError, match=r"vmax must be in \(0, 2.5\]"):
        replace(SMALL, vmax_m_s=(1.0, 3.0)).curves(0.6, LIMITS)
