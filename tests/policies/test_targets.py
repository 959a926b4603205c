from pathlib import Path

import numpy as np
import pytest

from robotcast.policies.targets import (
    Board,
    error_parts,
    median_interval,
    reachable_outline,
    read_targets,
    spread_targets,
    tool_sector,
)

BOARD = Board(length_m=1.55, width_m=2.45)
MIRROR = np.array([1.0, -1.0])
RANDOM = np.random.default_rng(0)
PLACES = [np.array([1.0, -0.2 * k]) for k in range(400)]


@pytest.fixture(scope="module")
def actions(world) -> np.ndarray:
    return world.actions(2500)


@pytest.fixture(scope="module")
def ends(world, actions) -> np.ndarray:
    return world.endpoints(actions)


@pytest.fixture(scope="module")
def targets(ends) -> np.ndarray:
    return spread_targets(ends, 16, BOARD)


def test_targets_are_reachable_and_apart(ends, targets) -> None:
    assert targets.shape == (16, 2)
    assert np.linalg.norm(targets[:, None] - ends, axis=2).min(axis=1).max() < 0.05
    apart = np.linalg.norm(targets[:, None] - targets, axis=2) + np.eye(16)
    assert apart.min() > 0.08


def test_targets_lie_on_the_half_where_casts_usually_rest(ends, targets) -> None:
    assert (targets[:, 1] < 0).all()
    assert (spread_targets(ends * MIRROR, 16, BOARD)[:, 1] > 0).all()


def test_the_order_of_casts_does_not_move_targets(ends, targets) -> None:
    order = np.random.default_rng(0).permutation(len(ends))
    assert np.array_equal(spread_targets(ends[order], 16, BOARD), targets)


def test_stray_endpoints_attract_no_target(ends) -> None:
    strayed = ends.copy()
    strayed[0] = [0.1, -1.4]
    targets = spread_targets(strayed, 16, BOARD)
    assert np.linalg.norm(targets - strayed[0], axis=1).min() > 0.3


def test_targets_lie_on_the_board(ends) -> None:
    targets = spread_targets(ends, 12, Board(length_m=0.9, width_m=1.2))
    assert (np.abs(targets[:, 1]) < 0.6).all()
    assert (targets[:, 0] < 0.9).all()


def test_too_few_endpoints_are_refused(ends) -> None:
    with pytest.raises(ValueError, match="too few for 16 targets"):
        spread_targets(ends[:5], 16, BOARD)


def test_the_outline_is_closed_and_symmetric(ends) -> None:
    outline = reachable_outline(ends)
    assert np.array_equal(outline[0], outline[-1])
    mirrored = outline * MIRROR
    nearest = np.linalg.norm(mirrored[:, None] - outline, axis=2).min(axis=1)
    assert nearest.max() < 1e-9


def test_the_tool_sector_holds_every_turn_and_end(actions) -> None:
    inner_m, outer_m, half_rad = tool_sector(actions)
    assert half_rad == pytest.approx(np.abs(actions[:, [0, 2]]).max())
    assert inner_m <= actions[:, [1, 3]].min()
    assert outer_m >= actions[:, [1, 3]].max()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "targets.csv"


def test_targets_are_read_in_their_order(path: Path) -> None:
    path.write_text("name,x,y\nfar,1.2,-0.4\nnear,0.9,1\n")
    assert read_targets(path, BOARD).tolist() == [[1.2, -0.4], [0.9, 1.0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,z\n1,2\n", "column y is missing; expected x, y, found x, z"),
        ("x,y\n1,0.2\n,0.3\n", "line 3: x must be a finite number, got an empty cell"),
        ("x,y\n1,left\n", "line 2: y must be a finite number"),
        ("x,y\n1,nan\n", "line 2: y must be a finite number, got 'nan'"),
        ("x,y\n1,0.2\n1.6,0\n", "line 3: (1.6, 0) m lies off the board, x from 0 to 1.55 m"),
        ("x,y\n", "holds no target"),
        ("", "expected the names of the columns"),
    ],
)
def test_bad_targets_get_one_clear_message(path: Path, text: str, said: str) -> None:
    path.write_text(text)
    with pytest.raises(ValueError) as caught:
        read_targets(path, BOARD)
    assert str(caught.value).startswith(str(path))
    assert said in str(caught.value)


def test_a_missing_file_is_named(path: Path) -> None:
    with pytest.raises(ValueError, match=r"targets\.csv: there is no such file"):
        read_targets(path, BOARD)


def executed(offset_m: float, scatter_m: float, repeats: int) -> list[np.ndarray]:
    away = np.array([offset_m, 0.0])
    return [t + away + RANDOM.normal(0, scatter_m, (repeats, 2)) for t in PLACES]


@pytest.mark.parametrize("repeats", [2, 5])
def test_scatter_and_offset_are_told_apart_whatever_the_number_of_repeats(repeats) -> None:
    parts = error_parts(executed(0.04, 0.02, repeats), PLACES)
    assert parts is not None
    assert parts.repeatability == pytest.approx(0.02 * np.sqrt(2), rel=0.1)
    assert parts.model == pytest.approx(0.04, rel=0.1)
    assert parts.repeatability_share == pytest.approx(1 / 3, abs=0.06)


def test_casts_without_repeats_tell_no_parts() -> None:
    assert error_parts(executed(0.04, 0.02, 1), PLACES) is None


def test_the_interval_of_the_median_holds_it_and_narrows_with_targets() -> None:
    def width(count: int) -> float:
        errors = [np.abs(RANDOM.normal(3, 1, 5)) for _ in range(count)]
        low, high = median_interval(errors)
        assert low <= np.median(np.concatenate(errors)) <= high
        return high - low

    assert width(200) < 0.6 * width(16)


def test_repeats_of_one_target_do_not_count_as_independent() -> None:
    errors = [np.full(5, e) for e in RANDOM.normal(3, 1, 16)]
    alone = median_interval([e[:1] for e in errors])
    assert median_interval(errors) == pytest.approx(alone, rel=0.2)
