"""Where policies are tested, and the areas drawn behind the targets (paper, "Experiments")."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.policies.choosing.choice import rest_side

_CELL_M = 0.05
_EDGE_M = 0.1
_OUTLINE_BINS = 72


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


@dataclass(frozen=True)
class Sector:
    """The part of an annulus about the robot base that the held end sweeps."""

    inner_m: float
    outer_m: float
    half_angle_rad: float


def spread_targets(endpoints_m: np.ndarray, count: int, board: Board) -> np.ndarray:
    """Spread `count` targets evenly over the well-populated reachable area of the usual half.

    The targets depend on D_sim alone, so every policy of a cable is tested on the same ones, and
    no random number enters: cells of 5 cm that hold enough endpoints are clustered by Lloyd's
    algorithm, started from farthest points.

    Parameters
    ----------
    endpoints_m : ndarray of shape (n, 2), where the casts of D_sim ended.

    Returns
    -------
    ndarray of shape (count, 2) [m], ordered by angle about the robot base.
    """
    side = rest_side(endpoints_m)
    usual = (endpoints_m[:, 1] * side > 0) & board.holds(endpoints_m)
    cells = _populated_cells(endpoints_m[usual])
    if len(cells) < count:
        raise ValueError(
            f"the reachable area holds {len(cells)} cells of {100 * _CELL_M:.0f} cm with enough "
            f"simulated endpoints, too few for {count} targets: generate more casts"
        )
    centres = _lloyd(cells, _farthest_points(cells, count))
    nearest = np.linalg.norm(centres[:, None] - cells, axis=2).argmin(axis=1)
    targets = cells[nearest]
    return targets[np.lexsort((targets[:, 0], np.arctan2(targets[:, 1], targets[:, 0])))]


def reachable_outline(endpoints_m: np.ndarray) -> np.ndarray:
    """Return the closed outline (m, 2) of where the free end can come to rest, both halves.

    For every 5° about the robot base: from the 1st to the 99th percentile of the distance.
    """
    both = np.concatenate([endpoints_m, endpoints_m * np.array([1.0, -1.0])])
    angle = np.arctan2(both[:, 1], both[:, 0])
    distance = np.linalg.norm(both, axis=1)
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


def tool_sector(actions: np.ndarray) -> Sector:
    """Return the sector that the held end sweeps over `actions` (n, 6) and their mirror images."""
    theta = actions[:, [ACTION_COLUMNS.index("theta1"), ACTION_COLUMNS.index("theta2")]]
    radius = actions[:, [ACTION_COLUMNS.index("r1"), ACTION_COLUMNS.index("r2")]]
    return Sector(
        inner_m=float(radius.min()),
        outer_m=float(radius.max()),
        half_angle_rad=float(np.abs(theta).max()),
    )


def _populated_cells(points: np.ndarray) -> np.ndarray:
    """Return the centres (m, 2) of cells that hold at least a quarter of the usual number."""
    cells, counts = np.unique(np.floor(points / _CELL_M).astype(int), axis=0, return_counts=True)
    if len(cells) == 0:
        return np.empty((0, 2))
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


def _lloyd(cells: np.ndarray, centres: np.ndarray, rounds: int = 30) -> np.ndarray:
    """Move each centre to the mean of the cells nearest to it, `rounds` times."""
    for _ in range(rounds):
        owner = np.linalg.norm(cells[:, None] - centres, axis=2).argmin(axis=1)
        centres = np.stack(
            [
                cells[owner == k].mean(axis=0) if (owner == k).any() else centre
                for k, centre in enumerate(centres)
            ]
        )
    return centres
