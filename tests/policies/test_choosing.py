from typing import Any

import numpy as np
import pytest

from robotcast.build import build_rig
from robotcast.casts.curves import PlanLimits
from robotcast.casts.plan import ActionGrid, plan_pull
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.choosing import (
    CastAndPull,
    Choice,
    Neighbourhood,
    choose_actions,
    refine_choices,
    with_spread,
)
from tests.stages import configured

CABLE = Cable("made up", 0.63, 0.03, 0.01, 0.02)
BASELINE = CastAndPull(land_r_m=0.81, r_min_m=0.55, pull_m_s=0.2, angle_rad=1.5)
GRID = ActionGrid(
    theta1_rad=(0.3, 1.0),
    theta2_rad=(-0.9, -0.1),
    r2_m=(0.55, 0.75),
    alpha_rad=(0.0, 1.5),
    vmax_m_s=(1.6, 2.2),
    counts=dict(theta1=4, theta2=4, r2=3, alpha=3, vmax=2),
)
LIMITS = PlanLimits()
TARGETS = np.array([[0.8, -0.5], [1.0, -0.3], [0.9, 0.4]])
FAR = np.array([[3.0, -0.5]])


class Uneven:
    """Knows the world, and says of every action by itself how far casts scatter about it."""

    def __init__(self, world, least_m: float, most_m: float) -> None:
        self._world, self._range, self.asked, self.batches = world, (least_m, most_m), 0, 0

    def predict(self, actions: np.ndarray) -> np.ndarray:
        self.batches += 1
        return self._world.predict(actions)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        self.asked += len(actions)
        part = np.sin(1e4 * actions.sum(axis=1)) ** 2
        return np.interp(part, [0, 1], self._range)[:, None] * [1.0, 0.5]


@pytest.mark.parametrize("caution", [0.0, 2.0])
@pytest.mark.parametrize("most_m", [0.0, 0.05, 0.5, 5.0])
def test_the_least_expected_miss_of_all_candidates_is_chosen(world, most_m, caution) -> None:
    candidates = world.actions(3000)
    model: Any = Uneven(world, 0.0, most_m)
    targets = np.array([*TARGETS, [2.5, -0.2]])
    choices = choose_actions(model, candidates, targets, caution)
    scatter = caution * np.square(model.spread(candidates)).sum(axis=1)
    for (x, y), choice in zip(targets, choices, strict=True):
        away = np.square(world.predict(candidates) - [x, -abs(y)]).sum(axis=1)
        chosen = usual_half(choice)
        np.testing.assert_allclose(chosen, candidates[(away + scatter).argmin()])
        end = choice.predicted_m * [1, 1 if y < 0 else -1]
        assert world.predict(chosen[None])[0] == pytest.approx(end)


def test_all_targets_share_a_prediction_and_the_few_spreads_that_matter(world) -> None:
    candidates = world.actions(3000)
    model: Any = Uneven(world, 0.01, 0.05)
    choose_actions(model, candidates, TARGETS[:2])
    assert model.asked < 300
    assert model.batches == 1


def test_no_candidate_is_refused(world) -> None:
    with pytest.raises(ValueError, match="no candidate action"):
        choose_actions(world, np.zeros((0, 6)), TARGETS)


def test_a_target_is_out_of_reach_only_when_no_candidate_is_predicted_near_it(world) -> None:
    class SureOfOne:
        """Sure of the first candidate alone, which ends far from the target."""

        def predict(self, actions):
            return world.predict(actions)

        def spread(self, actions):
            first = (actions == candidates[0]).all(axis=1)
            return np.where(first, 0.0, 5.0)[:, None] * np.ones(2)

    candidates = world.actions(300)
    near, far = world.predict(candidates)[5], np.array([3.0, -0.5])
    model: Any = SureOfOne()
    within, beyond = choose_actions(model, candidates, np.array([near, far]))
    assert within.miss_m > 0.03
    assert within.reachable
    assert not beyond.reachable
    assert "the nearest point within reach is" in beyond.out_of_reach()


def anything(actions: np.ndarray) -> np.ndarray:
    return np.ones(len(actions), dtype=bool)


@pytest.fixture(scope="module")
def candidates() -> np.ndarray:
    return GRID.curves(0.6, LIMITS).actions


@pytest.fixture(scope="module")
def about() -> Neighbourhood:
    return Neighbourhood(GRID, 0.6, LIMITS)


@pytest.fixture(scope="module")
def choices(world, candidates) -> list[Choice]:
    return choose_actions(world, candidates, TARGETS)


@pytest.fixture(scope="module")
def refined(world, choices, about) -> list[Choice]:
    return refine_choices(world, choices, about, anything)


def usual_half(choice: Choice) -> np.ndarray:
    turned = choice.action if choice.action.theta1_rad > 0 else choice.action.mirrored()
    return turned.as_array()


def test_the_predicted_miss_of_the_refined_action_falls_to_nothing(world, choices, refined) -> None:
    assert max(c.miss_m for c in refined) < 0.1 * max(c.miss_m for c in choices)
    for choice in refined:
        assert choice.reachable
        end = choice.predicted_m * [1, 1 if choice.action.theta1_rad > 0 else -1]
        assert world.predict(usual_half(choice)[None])[0] == pytest.approx(end)


def test_an_action_stays_within_the_grid_and_one_spacing_of_its_candidate(
    choices, refined, about
) -> None:
    for before, after in zip(choices, refined, strict=True):
        moved = usual_half(after) - usual_half(before)
        others = [0, 2, 3, 4]
        assert (np.abs(moved[others]) <= about.spacing[others] + 1e-12).all()
        assert moved[5] == 0
        assert (usual_half(after)[others] >= about.lower[others]).all()
        assert (usual_half(after)[others] <= about.upper[others]).all()


def test_the_safe_set_is_never_left_and_the_miss_never_rises(world, candidates, about) -> None:
    def slow_turns(actions: np.ndarray) -> np.ndarray:
        return actions[:, 0] + actions[:, 3] < 1.2

    chosen = choose_actions(world, candidates[slow_turns(candidates)], TARGETS)
    refined = refine_choices(world, chosen, about, slow_turns)
    assert slow_turns(np.stack([usual_half(c) for c in refined])).all()
    assert all(r.miss_m <= c.miss_m for r, c in zip(refined, chosen, strict=True))
    stood = refine_choices(world, chosen, about, lambda a: np.zeros(len(a), bool))
    assert [c.action for c in stood] == [c.action for c in chosen]


def test_a_mirrored_target_gets_the_mirror_cast_which_is_as_sure(world, candidates, about) -> None:
    pair = choose_actions(world, candidates, np.array([[0.8, -0.5], [0.8, 0.5]]))
    for right, left in (pair, refine_choices(world, with_spread(world, pair), about, anything)):
        assert left.action == right.action.mirrored()
        assert left.predicted_m == pytest.approx(right.predicted_m * [1, -1])
        assert left.spread_m == pytest.approx(right.spread_m, nan_ok=True)
    assert right.spread_m == pytest.approx(np.array([0.02, 0.01]) / pair[0].action.vmax_m_s)


def test_a_target_out_of_reach_is_said_so_with_the_nearest_point(world, candidates, about) -> None:
    (choice,) = refine_choices(world, choose_actions(world, candidates, FAR), about, anything)
    assert not choice.reachable
    reached = world.predict(candidates)
    assert choice.miss_m <= np.linalg.norm(reached - FAR, axis=1).min()
    assert choice.out_of_reach().startswith("(3.00, -0.50) m is out of reach; the nearest point")


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
    rig = build_rig(configured())
    (choice,) = BASELINE.choose(rig.cable, on_ray(1.25, -0.8)[None])
    planned = plan_pull(choice.action, r0_m=rig.r0_m, limits=PlanLimits())
    end = rig.simulate_truth(planned, 9_000).cable.end_m[-1, :2]
    assert np.linalg.norm(end - choice.target_m) < 0.05
