from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from robotcast.build import build_rig
from robotcast.casts.limits import PlanLimits
from robotcast.casts.pull import plan_pull
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.choosing.cast_and_pull import CastAndPull

ROOT = Path(__file__).resolve().parents[2]
CABLE = Cable("made up", 0.63, 0.03, 0.01, 0.02)
BASELINE = CastAndPull(land_r_m=0.81, r_min_m=0.55, pull_m_s=0.2, angle_rad=1.5)


def on_ray(radius_m: float, angle_rad: float) -> np.ndarray:
    return radius_m * np.array([np.cos(angle_rad), np.sin(angle_rad)])


def test_a_target_within_reach_is_where_the_free_end_is_pulled_to() -> None:
    (choice,) = BASELINE.choose(CABLE, on_ray(1.3, -0.7)[None])
    assert choice.predicted_m == pytest.approx(on_ray(1.3, -0.7))
    assert choice.action.theta1_rad == choice.action.theta2_rad == pytest.approx(-0.7)
    assert choice.action.r2_m == pytest.approx(1.3 - 0.63)
    assert choice.reachable


@pytest.mark.parametrize(("target_m", "nearest_m"), [(0.8, 0.55 + 0.63), (1.6, 0.81 + 0.63)])
def test_a_target_too_near_or_too_far_is_missed_along_its_ray(target_m, nearest_m) -> None:
    (choice,) = BASELINE.choose(CABLE, on_ray(target_m, 0.4)[None])
    assert choice.predicted_m == pytest.approx(on_ray(nearest_m, 0.4))
    assert not choice.reachable


@pytest.mark.slow
@pytest.mark.rig
def test_the_free_end_of_the_virtual_rig_comes_to_rest_on_the_ray() -> None:
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=["rig.workers=1"])
    rig = build_rig(config)
    (choice,) = BASELINE.choose(rig.cable, on_ray(1.25, -0.8)[None])
    planned = plan_pull(choice.action, r0_m=rig.r0_m, limits=PlanLimits())
    end = rig.simulate_truth(planned, 9_000).cable.end_m[-1, :2]
    assert np.linalg.norm(end - choice.target_m) < 0.05
