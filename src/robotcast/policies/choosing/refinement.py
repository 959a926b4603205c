"""From the best candidate of the grid to the best action about it, through the model's gradient."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.curves import plan_curves
from robotcast.casts.grid import ActionGrid
from robotcast.casts.limits import PlanLimits
from robotcast.policies.choosing.choice import Choice
from robotcast.policies.learning.forward_model import SmoothPredictor

Feasible = Callable[[np.ndarray], np.ndarray]

_ROUNDS = 8
_SHORTENINGS = (1.0, 0.5, 0.25, 0.1)
_DAMPING_M = 0.005  # what moves the endpoint by less than this a grid spacing is hardly used
_NUDGE = 1e-4  # of a spacing, to see how r₁ follows
_R1 = ACTION_COLUMNS.index("r1")
_GRID = tuple(ACTION_COLUMNS.index(n) for n in ("theta1", "theta2", "r2", "alpha", "vmax"))
_MOVED = tuple(ACTION_COLUMNS.index(name) for name in ("theta1", "theta2", "r2", "alpha"))


@dataclass(frozen=True)
class Neighbourhood:
    """Where an action may move about its candidate.

    v_max stays: the grids know two values of it, and nothing tells a model what lies between.

    Attributes
    ----------
    lower, upper : ndarray of shape (6,), ends of the grid that the candidates are of.
    spacing : ndarray of shape (6,), of the grid; an action stays within one of its candidate.
    with_r1 : fills in r₁ of actions (n, 6), which follows from the other coordinates.
    """

    lower: np.ndarray
    upper: np.ndarray
    spacing: np.ndarray
    with_r1: Callable[[np.ndarray], np.ndarray]

    @classmethod
    def of(cls, grid: ActionGrid, r0_m: float, limits: PlanLimits) -> "Neighbourhood":
        """Return where the candidates of a grid may move."""

        def with_r1(actions: np.ndarray) -> np.ndarray:
            actions = actions.copy()
            actions[:, _R1] = np.nan
            return plan_curves(actions, r0_m, limits).actions

        lower, upper = np.full(6, -np.inf), np.full(6, np.inf)
        spacing = np.full(6, np.inf)
        for column, (first, last, count) in zip(_GRID, grid.axes(), strict=True):
            lower[column], upper[column] = min(first, last), max(first, last)
            spacing[column] = abs(last - first) / max(count - 1, 1)
        return cls(lower, upper, spacing, with_r1)


def refine_choices(
    model: SmoothPredictor, choices: Sequence[Choice], about: Neighbourhood, feasible: Feasible
) -> list[Choice]:
    """Move every choice towards its target by damped Gauss–Newton steps of least change.

    A step is taken only where it lowers the predicted miss and the arm can do the new action
    and its mirror image: the predicted miss never rises, and the safe set is never left.

    Parameters
    ----------
    feasible : tells which actions (m, 6) the arm can do, and their mirror images too.
    """
    if not choices:
        return []
    given = np.stack([c.action.as_array() for c in choices])
    mirror = np.where(given[:, [0]] < 0, [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0], 1.0)
    flips = np.where(given[:, [0]] < 0, [1.0, -1.0], 1.0)
    start = given * mirror  # the half that the candidates are of
    targets = np.stack([c.target_m for c in choices]) * flips
    lower = np.maximum(about.lower, start - about.spacing)
    upper = np.minimum(about.upper, start + about.spacing)
    actions, ends = start, np.stack([c.predicted_m for c in choices]) * flips
    for _ in range(_ROUNDS):
        steps = _steps(model, actions, targets - ends, about, (lower, upper))
        moved = False
        for part in _SHORTENINGS:
            tried = about.with_r1(np.clip(actions + part * steps, lower, upper))
            reached = model.predict(tried)
            better = _miss(reached, targets) < _miss(ends, targets) - 1e-6
            rows = np.flatnonzero(better)
            rows = rows[feasible(tried[rows])] if len(rows) else rows
            actions, ends = actions.copy(), ends.copy()
            actions[rows], ends[rows] = tried[rows], reached[rows]
            steps[rows] = 0.0  # taken; the others are tried shorter
            moved = moved or len(rows) > 0
        if not moved:
            break
    return [
        replace(c, action=Action.from_array(a), predicted_m=e)
        for c, a, e in zip(choices, actions * mirror, ends * flips, strict=True)
    ]


def _steps(
    model: SmoothPredictor,
    actions: np.ndarray,
    wanted_m: np.ndarray,
    about: Neighbourhood,
    bounds: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return steps (k, 6) that would bring endpoints nearer by `wanted_m` (k, 2).

    A coordinate that stands on a bound and would leave it is held, and the others do its part.
    """
    moved = list(_MOVED)
    slopes = model.slopes(actions)
    along = slopes[:, :, moved] + slopes[:, :, [_R1]] * _r1_slopes(actions, about)[:, None]
    along = along * about.spacing[moved]
    lower, upper = (bound[:, moved] for bound in bounds)
    part = _least_change(along, wanted_m)
    for _ in moved:
        here = actions[:, moved]
        held = ((here >= upper) & (part > 0)) | ((here <= lower) & (part < 0))
        along = np.where(held[:, None], 0.0, along)
        part = _least_change(along, wanted_m)
    steps = np.zeros_like(actions)
    steps[:, moved] = part * about.spacing[moved]
    return steps


def _least_change(along: np.ndarray, wanted_m: np.ndarray) -> np.ndarray:
    """Return the damped steps (k, 4) of least length with `along` (k, 2, 4) @ step ≈ wanted."""
    turned = along.transpose(0, 2, 1)
    square = along @ turned + _DAMPING_M**2 * np.eye(2)
    return (turned @ np.linalg.solve(square, wanted_m[:, :, None]))[..., 0]


def _r1_slopes(actions: np.ndarray, about: Neighbourhood) -> np.ndarray:
    """Return how r₁ follows the coordinates that move, (k, 4)."""
    nudged = np.repeat(actions[:, None], len(_MOVED), axis=1)
    sizes = _NUDGE * about.spacing[list(_MOVED)]
    for place, column in enumerate(_MOVED):
        inward = np.where(actions[:, column] + sizes[place] > about.upper[column], -1.0, 1.0)
        nudged[:, place, column] += inward * sizes[place]
    change = (nudged - actions[:, None])[..., list(_MOVED)].diagonal(axis1=1, axis2=2)
    r1 = about.with_r1(nudged.reshape(-1, 6))[:, _R1].reshape(len(actions), -1)
    return (r1 - actions[:, [_R1]]) / change


def _miss(ends_m: np.ndarray, targets_m: np.ndarray) -> np.ndarray:
    return np.linalg.norm(ends_m - targets_m, axis=1)
