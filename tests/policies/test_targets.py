import numpy as np
import pytest

from robotcast.policies.choosing.targets import (
    Board,
    reachable_outline,
    spread_targets,
    tool_sector,
)

BOARD = Board(length_m=1.55, width_m=2.45)
MIRROR = np.array([1.0, -1.0])


@pytest.fixture(scope="module")
def casts(world) -> tuple[np.ndarray, np.ndarray]:
    actions = world.actions(2500)
    return actions, world.endpoints(actions)


def test_targets_are_reachable_and_apart(casts) -> None:
    _, ends = casts
    targets = spread_targets(ends, 16, BOARD)
    assert targets.shape == (16, 2)
    assert np.linalg.norm(targets[:, None] - ends, axis=2).min(axis=1).max() < 0.05
    apart = np.linalg.norm(targets[:, None] - targets, axis=2) + np.eye(16)
    assert apart.min() > 0.08


def test_targets_lie_on_the_half_where_casts_usually_rest(casts) -> None:
    _, ends = casts
    assert (spread_targets(ends, 16, BOARD)[:, 1] < 0).all()
    mirrored = spread_targets(ends * MIRROR, 16, BOARD)
    assert (mirrored[:, 1] > 0).all()


def test_the_order_of_casts_does_not_move_targets(casts) -> None:
    _, ends = casts
    order = np.random.default_rng(0).permutation(len(ends))
    shuffled = spread_targets(ends[order], 16, BOARD)
    assert np.array_equal(shuffled, spread_targets(ends, 16, BOARD))


def test_stray_endpoints_attract_no_target(casts) -> None:
    _, ends = casts
    strayed = ends.copy()
    strayed[0] = [0.1, -1.4]
    targets = spread_targets(strayed, 16, BOARD)
    assert np.linalg.norm(targets - strayed[0], axis=1).min() > 0.3


def test_targets_lie_on_the_board(casts) -> None:
    _, ends = casts
    small = Board(length_m=0.9, width_m=1.2)
    targets = spread_targets(ends, 12, small)
    assert (np.abs(targets[:, 1]) < 0.6).all()
    assert (targets[:, 0] < 0.9).all()


def test_too_few_endpoints_are_refused(casts) -> None:
    _, ends = casts
    with pytest.raises(ValueError, match="too few for 16 targets"):
        spread_targets(ends[:5], 16, BOARD)


def test_the_outline_is_closed_and_symmetric(casts) -> None:
    _, ends = casts
    outline = reachable_outline(ends)
    assert np.array_equal(outline[0], outline[-1])
    mirrored = outline * MIRROR
    nearest = np.linalg.norm(mirrored[:, None] - outline, axis=2).min(axis=1)
    assert nearest.max() < 1e-9


def test_the_tool_sector_holds_every_turn_and_end(casts) -> None:
    actions, _ = casts
    sector = tool_sector(actions)
    assert sector.half_angle_rad == pytest.approx(np.abs(actions[:, [0, 2]]).max())
    assert sector.inner_m <= actions[:, [1, 3]].min()
    assert sector.outer_m >= actions[:, [1, 3]].max()
