"""Where policies are tested (paper, "Experiments"), and what their errors there are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.cluster.vq import kmeans2

from robotcast.casts.table import read_table

_CELL_M, _EDGE_M, _OUTLINE_BINS = 0.05, 0.1, 72
_BOOTSTRAP_DRAWS, _BOOTSTRAP_SEED = 2000, 0


@dataclass(frozen=True)
class Board:
    """The surface on which a target may lie: x from 0 to its length, y about 0."""

    length_m: float
    width_m: float

    def holds(self, points_m: np.ndarray) -> np.ndarray:
        """Tell which points (n, 2) lie on the board, 10 cm from its edges; (n,) of bool."""
        x, y = points_m.T
        along = (x > _EDGE_M) & (x < self.length_m - _EDGE_M)
        return along & (np.abs(y) < self.width_m / 2 - _EDGE_M)


def rest_side(endpoints_m: np.ndarray) -> float:
    """Return +1 when most of `endpoints_m` (n, 2) lie on the left half (y > 0), −1 otherwise."""
    return 1.0 if np.median(endpoints_m[:, 1]) > 0 else -1.0


def read_targets(path: Path, board: Board) -> np.ndarray:
    """Read one target a row, columns x and y [m] in the robot base's frame, as (k, 2)."""
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; expected a table of targets")
    table = read_table(path, ("x", "y"))
    x, y = table.columns["x"], table.columns["y"]
    if not len(x):
        raise ValueError(f"{path}: holds no target")
    length, half = board.length_m, board.width_m / 2
    board_is = f"x from 0 to {length:g} m and y from {-half:g} to {half:g} m"
    table.refuse_where(
        (x < 0) | (x > length) | (np.abs(y) > half),
        lambda row: f"({x[row]:g}, {y[row]:g}) m lies off the board, {board_is}",
    )
    return np.stack([x, y], axis=1)


def spread_targets(endpoints_m: np.ndarray, count: int, board: Board) -> np.ndarray:
    """Spread `count` targets (count, 2) over the well-populated reachable area of the usual half.

    They depend on `endpoints_m` (n, 2) of D_sim alone, so every policy of a cable is tested on the
    same ones: cells of 5 cm that hold enough endpoints are clustered by Lloyd's algorithm, started
    from farthest points; no random number enters. Ordered by angle about the robot base.
    """
    side = rest_side(endpoints_m)
    usual = (endpoints_m[:, 1] * side > 0) & board.holds(endpoints_m)
    cells = _populated_cells(endpoints_m[usual])
    if len(cells) < count:
        raise ValueError(
            f"the reachable area holds {len(cells)} cells of {100 * _CELL_M:.0f} cm with enough "
            f"simulated endpoints, too few for {count} targets: generate more casts"
        )
    centres, _ = kmeans2(cells, _farthest_points(cells, count), iter=30, minit="matrix")
    targets = cells[np.linalg.norm(centres[:, None] - cells, axis=2).argmin(axis=1)]
    return targets[np.lexsort((targets[:, 0], np.arctan2(targets[:, 1], targets[:, 0])))]


def reachable_outline(endpoints_m: np.ndarray) -> np.ndarray:
    """Return the closed outline (m, 2) of where the free end can come to rest, both halves.

    For every 5° about the robot base: from the 1st to the 99th percentile of the distance.
    """
    both = np.concatenate([endpoints_m, endpoints_m * np.array([1.0, -1.0])])
    angle, distance = np.arctan2(both[:, 1], both[:, 0]), np.linalg.norm(both, axis=1)
    edges = np.linspace(-np.pi, np.pi, _OUTLINE_BINS + 1)
    which = np.clip(np.digitize(angle, edges) - 1, 0, _OUTLINE_BINS - 1)
    counts = np.bincount(which, minlength=_OUTLINE_BINS)
    used = np.flatnonzero(counts >= max(2, 0.1 * np.median(counts[counts > 0])))
    middles = (edges[used] + edges[used + 1]) / 2
    limits = np.array([np.percentile(distance[which == b], [1, 99]) for b in used])
    angles = np.concatenate([middles, middles[::-1]])
    radii = np.concatenate([limits[:, 1], limits[::-1, 0]])
    outline = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return np.concatenate([outline, outline[:1]])


def tool_sector(actions: np.ndarray) -> tuple[float, float, float]:
    """Return the part of an annulus that the held end sweeps over `actions` (n, 6), mirrored too.

    Inner and outer radius [m] about the robot base, and half the angle [rad].
    """
    theta1, r1, theta2, r2, _, _ = actions.T
    radii, angles = np.stack([r1, r2]), np.stack([theta1, theta2])
    return float(radii.min()), float(radii.max()), float(np.abs(angles).max())


def _populated_cells(points: np.ndarray) -> np.ndarray:
    """Return the centres (m, 2) of cells that hold at least a quarter of the usual number."""
    if not len(points):
        return np.empty((0, 2))
    cells, counts = np.unique(np.floor(points / _CELL_M).astype(int), axis=0, return_counts=True)
    apart = np.abs(cells[:, None] - cells).max(axis=2)
    around = ((apart <= 1) * counts).sum(axis=1)
    return (cells[around >= 0.25 * np.median(around)] + 0.5) * _CELL_M


def _farthest_points(cells: np.ndarray, count: int) -> np.ndarray:
    """Pick `count` cells, each farthest from those picked before; the middle one first."""
    picked = [int(np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin())]
    distance = np.linalg.norm(cells - cells[picked[0]], axis=1)
    while len(picked) < count:
        picked.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(cells - cells[picked[-1]], axis=1))
    return cells[picked]


@dataclass(frozen=True)
class ErrorParts:
    """Root mean squares of the parts of a policy's errors, in the unit of the endpoints."""

    repeatability: float  # how far repeats scatter about their mean, which no model can lower
    model: float  # how far that mean lies from the target

    @property
    def repeatability_share(self) -> float:
        """The part of the mean square error that is repeatability, from 0 to 1."""
        own, total = self.repeatability**2, self.repeatability**2 + self.model**2
        return own / total if total > 0 else 0.0


def error_parts(ends: Sequence[np.ndarray], targets: Sequence[np.ndarray]) -> ErrorParts | None:
    """Split the mean square error at targets that were cast at more than once; None without any.

    `ends` are of shape (repeats, 2), one a target; `targets` of shape (2,). The scatter of the
    mean itself is taken off the model's part.
    """
    scattered, missed = [], []
    for points, target in zip(ends, targets, strict=True):
        if len(points) > 1:
            scattered.append(points.var(axis=0, ddof=1).sum())
            away = np.square(points.mean(axis=0) - target).sum()
            missed.append(away - scattered[-1] / len(points))
    means = (float(np.sqrt(max(np.mean(part), 0.0))) for part in (scattered, missed) if part)
    return ErrorParts(*means) if scattered else None


def median_interval(errors: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the median of all errors (Efron 1979).

    `errors` are of shape (repeats,), one a target; none is empty. Whole targets are drawn, with all
    their repeats: casts at one target fail together.
    """
    random, n = np.random.default_rng(_BOOTSTRAP_SEED), len(errors)
    draws = (random.integers(n, size=n) for _ in range(_BOOTSTRAP_DRAWS))
    medians = [np.median(np.concatenate([errors[k] for k in drawn])) for drawn in draws]
    low, high = np.percentile(medians, [50 * (1 - 0.95), 50 * (1 + 0.95)])
    return float(low), float(high)
