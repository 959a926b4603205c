import numpy as np
import pytest

from robotcast.casts.grid import ActionGrid, GridCounts
from robotcast.casts.limits import PlanLimits
from robotcast.policies.choosing.choice import Choice, choose_actions
from robotcast.policies.choosing.refinement import Neighbourhood, refine_choices

GRID = ActionGrid(
    theta1_rad=(0.3, 1.0),
    theta2_rad=(-0.9, -0.1),
    r2_m=(0.55, 0.75),
    alpha_rad=(0.0, 1.5),
    vmax_m_s=(1.6, 2.2),
    counts=GridCounts(theta1=4, theta2=4, r2=3, alpha=3, vmax=2),
)
LIMITS = PlanLimits()
TARGETS = np.array([[0.8, -0.5], [1.0, -0.3], [0.9, 0.4]])
FAR = np.array([[3.0, -0.5]])


def anything(actions: np.ndarray) -> np.ndarray:
    return np.ones(len(actions), dtype=bool)


@pytest.fixture(scope="module")
def candidates() -> np.ndarray:
    return GRID.candidates(0.6, LIMITS)


@pytest.fixture(scope="module")
def about() -> Neighbourhood:
    return Neighbourhood.of(GRID, 0.6, LIMITS)


@pytest.fixture(scope="module")
def choices(world, candidates) -> list[Choice]:
    return choose_actions(world, candidates, TARGETS)


def usual_half(choice: Choice) -> np.ndarray:
    turned = choice.action if choice.action.theta1_rad > 0 else choice.action.mirrored()
    return turned.as_array()


def test_the_predicted_miss_falls_to_nothing_within_reach(world, choices, about) -> None:
    refined = refine_choices(world, choices, about, anything)
    assert max(c.miss_m for c in refined) < 0.1 * max(c.miss_m for c in choices)
    assert all(c.reachable for c in refined)


def test_the_prediction_is_that_of_the_refined_action(world, choices, about) -> None:
    for choice in refine_choices(world, choices, about, anything):
        mirror = [1, 1 if choice.action.theta1_rad > 0 else -1]
        assert world.predict(usual_half(choice)[None])[0] * mirror == pytest.approx(
            choice.predicted_m
        )


def test_an_action_stays_within_the_grid_and_one_spacing_of_its_candidate(
    world, choices, about
) -> None:
    for before, after in zip(choices, refine_choices(world, choices, about, anything), strict=True):
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


def test_where_nothing_is_safe_the_candidates_stay(world, choices, about) -> None:
    refined = refine_choices(world, choices, about, lambda a: np.zeros(len(a), bool))
    assert [c.action for c in refined] == [c.action for c in choices]


def test_a_mirrored_target_is_refined_to_the_mirror_image(world, candidates, about) -> None:
    pair = choose_actions(world, candidates, np.array([[0.8, -0.5], [0.8, 0.5]]))
    right, left = refine_choices(world, pair, about, anything)
    assert left.action == right.action.mirrored()
    assert left.predicted_m == pytest.approx(right.predicted_m * [1, -1])


def test_a_target_out_of_reach_is_said_so_with_the_nearest_point(world, candidates, about) -> None:
    (choice,) = refine_choices(world, choose_actions(world, candidates, FAR), about, anything)
    assert not choice.reachable
    reached = world.predict(candidates)
    assert choice.miss_m <= np.linalg.norm(reached - FAR, axis=1).min()
    assert choice.out_of_reach().startswith("(3.00, -0.50) m is out of reach; the nearest point")
