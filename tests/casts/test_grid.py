from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from robotcast.build import build
from robotcast.casts.plan import ActionGrid, GridCounts, PlanLimits

with initialize_config_dir(str(Path(__file__).parents[2] / "conf"), version_base=None):
    CONFIG = compose("config").casts
LIMITS: PlanLimits = build(CONFIG["limits"])


def ranges() -> dict:
    collected = CONFIG.grids.collected
    return {k: tuple(v) for k, v in collected.items() if k not in ("counts", "_target_")}


def test_candidates_are_the_whole_grid_with_r1_between_r0_and_r2():
    numbers = ranges()
    small = ActionGrid(**numbers, counts=GridCounts(3, 2, 4, 2, 2))
    actions = small.curves(0.6, LIMITS).actions
    assert actions.shape == (96, 6)
    assert len(np.unique(actions, axis=0)) == 96
    assert np.unique(actions[:, 0]).tolist() == pytest.approx(np.linspace(*small.theta1_rad, 3))
    between = (actions[:, 1] - 0.6) * (actions[:, 1] - actions[:, 3])
    assert np.all(between <= 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"theta1_rad": (-0.3, 1.0)}, "theta1_rad must be positive"),
        ({"theta2_rad": (-1.0, 0.1)}, "theta2_rad must be negative"),
        ({"alpha_rad": (-0.1, 1.0)}, "alpha_rad must be zero or positive"),
    ],
)
def test_only_the_left_half_is_a_grid(change, message):
    numbers = ranges()
    with pytest.raises(ValueError, match=message):
        ActionGrid(**numbers | change, counts=GridCounts(2, 2, 2, 2, 2))


def test_a_grid_that_cannot_be_planned_is_refused():
    with pytest.raises(ValueError, match="count of alpha must be at least 1, got 0"):
        GridCounts(2, 2, 2, 0, 2)
    numbers = ranges()
    fast = ActionGrid(**numbers | {"vmax_m_s": (1.0, 3.0)}, counts=GridCounts(2, 2, 2, 2, 2))
    with pytest.raises(ValueError, match=r"vmax must be in \(0, 2.5\]"):
        fast.curves(0.6, LIMITS)
