"""From a target to an action: a forward model's, refined along its gradient, or a plain pull."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from robotcast.casts.action import ACTION_COLUMNS, MIRROR, Action
from robotcast.casts.curves import PlanLimits, plan_curves
from robotcast.casts.plan import ActionGrid, pull_action
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.forward_model import ForwardModel
from robotcast.policies.targets import rest_side

Feasible = Callable[[np.ndarray], np.ndarray]

_ASKED_FIRST = 64  # candidates nearest to a target whose spread is asked for at once
_OUT_OF_REACH_M = 0.03  # predicted miss from which on a target is said to be out of reach
_ROUNDS = 8  # of refining
_SHORTENINGS = (1.0, 0.5, 0.25, 0.1)
_DAMPING_M = 0.005  # what moves the endpoint by less than this a grid spacing is hardly used
_NUDGE = 1e-4  # of a spacing, to see how r₁ follows
_R1 = ACTION_COLUMNS.index("r1")
_GRID = [ACTION_COLUMNS.index(name) for name in ("theta1", "theta2", "r2", "alpha", "vmax")]
_MOVED = _GRID[:4]  # v_max stays: the grids know two values of it, and no model what lies between


@dataclass(frozen=True)
class Choice:
    """What a policy does for one target; places are of shape (2,), NaN where it tells none."""

    target_m: np.ndarray
    action: Action
    predicted_m: np.ndarray
    # standard deviations that the model expects of the endpoint about the predicted one
    spread_m: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))
    # the predicted endpoint nearest to the target of all candidates, be that cast as wild as it may
    nearest_m: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))

    @property
    def miss_m(self) -> float:
        return float(np.linalg.norm(self.predicted_m - self.target_m))

    @property
    def reachable(self) -> bool:
        """Whether the model expects any cast to end at the target or close by."""
        return math.dist(self._reached_m, self.target_m) <= _OUT_OF_REACH_M

    @property
    def _reached_m(self) -> np.ndarray:
        nearer = np.linalg.norm(self.nearest_m - self.target_m) < self.miss_m
        return self.nearest_m if nearer else self.predicted_m

    def out_of_reach(self) -> str:
        """Say that the target cannot be reached, and what can be instead."""
        (x, y), (near_x, near_y) = self.target_m, self._reached_m
        away_m = math.hypot(near_x - x, near_y - y)
        return (
            f"({x:.2f}, {y:.2f}) m is out of reach; the nearest point within reach is "
            f"({near_x:.2f}, {near_y:.2f}) m, {100 * away_m:.0f} cm away"
        )


def choose_actions(
    model: ForwardModel, candidates: np.ndarray, targets_m: np.ndarray, caution: float = 1.0
) -> list[Choice]:
    """Choose the candidate (n, 6) whose cast is expected to miss least, for every target (k, 2).

    The paper's policy is π(s) = argmin |f_forw(a) − s|. Among thousands of candidates many are
    predicted to end at the target, and some of them are whip-like casts that end anywhere. The
    expected mean square miss |f_forw(a) − s|² + |σ(a)|² is least for the chosen one, σ its spread;
    `caution` is the weight of |σ|², 0 for the paper's policy. Candidates come to rest mostly on one
    half of the board: a target on the other gets the mirror image of the cast chosen for its mirror
    image (paper, "Parameterized Actions"), and the candidates are predicted once for all targets.
    """
    if not len(candidates):
        raise ValueError("there is no candidate action to choose from")
    predicted = model.predict(candidates)
    flips = np.ones_like(targets_m)  # to the half where candidates come to rest, and back
    flips[targets_m[:, 1] * rest_side(predicted) < 0, 1] = -1.0
    away = np.square(predicted - (targets_m * flips)[:, None]).sum(axis=2)
    scatter = _scatter(model, candidates, away, caution) if caution else 0.0
    rows, nearest_m = (away + scatter).argmin(axis=1), predicted[away.argmin(axis=1)] * flips
    chosen = [Action.from_array(candidate) for candidate in candidates[rows]]
    chosen = [a.mirrored() if f < 0 else a for a, f in zip(chosen, flips[:, 1], strict=True)]
    ends_m = zip(targets_m, chosen, predicted[rows] * flips, nearest_m, strict=True)
    return [Choice(target, a, end, nearest_m=nearest) for target, a, end, nearest in ends_m]


def _scatter(
    model: ForwardModel, candidates: np.ndarray, away: np.ndarray, caution: float
) -> np.ndarray:
    """Return `caution` times |σ|² of every candidate that a target may want, (n,), else infinity.

    One that is predicted to miss by more than another does with its scatter is never the best, so
    that most need not be asked for theirs; `away` (k, n) are squares of misses.
    """
    scatter = np.full(len(candidates), np.inf)

    def ask(rows: np.ndarray) -> None:
        if len(rows):
            scatter[rows] = caution * np.square(model.spread(candidates[rows])).sum(axis=1)

    nearest = min(_ASKED_FIRST, len(candidates))
    ask(np.unique(away.argpartition(nearest - 1, axis=1)[:, :nearest]))
    best = (away + scatter).min(axis=1, keepdims=True)
    ask(np.flatnonzero((away < best).any(axis=0) & np.isinf(scatter)))
    return scatter


def with_spread(model: ForwardModel, choices: Sequence[Choice]) -> list[Choice]:
    """Say of every choice how sure the model is of its endpoint; mirror images are as sure."""
    spreads = model.spread(_on_candidates_half(choices)[0])
    return [replace(c, spread_m=spread) for c, spread in zip(choices, spreads, strict=True)]


def _on_candidates_half(choices: Sequence[Choice]) -> tuple[np.ndarray, ...]:
    """Return actions (k, 6) with θ₁ > 0, and the signs that mirror actions and endpoints back."""
    actions = np.stack([c.action.as_array() for c in choices])
    mirrored = actions[:, [0]] < 0
    signs = np.where(mirrored, MIRROR, 1.0)
    return actions * signs, signs, np.where(mirrored, [1.0, -1.0], 1.0)


class Neighbourhood:
    """Where an action may move about its candidate: by a `spacing` (6,), within a grid's ends."""

    def __init__(self, grid: ActionGrid, r0_m: float, limits: PlanLimits) -> None:
        self._r0_m, self._limits = r0_m, limits
        self.lower, self.upper, self.spacing = np.full((3, 6), [[-np.inf], [np.inf], [np.inf]])
        for column, (first, last, count) in zip(_GRID, grid.axes(), strict=True):
            self.lower[column], self.upper[column] = min(first, last), max(first, last)
            self.spacing[column] = abs(last - first) / max(count - 1, 1)

    def with_r1(self, actions: np.ndarray) -> np.ndarray:
        """Fill in r₁ of actions (n, 6), which follows from the other coordinates."""
        actions = actions.copy()
        actions[:, _R1] = np.nan
        return plan_curves(actions, self._r0_m, self._limits).actions


def refine_choices(
    model: ForwardModel, choices: Sequence[Choice], about: Neighbourhood, feasible: Feasible
) -> list[Choice]:
    """Move every choice towards its target by damped Gauss–Newton steps of least change.

    A step is taken only where it lowers the predicted miss and the new action is `feasible`.
    """
    actions, mirror, flips = _on_candidates_half(choices)
    targets = np.stack([c.target_m for c in choices]) * flips
    ends = np.stack([c.predicted_m for c in choices]) * flips
    lower = np.maximum(about.lower, actions - about.spacing)
    upper = np.minimum(about.upper, actions + about.spacing)
    for _ in range(_ROUNDS):
        steps, before = _steps(model, actions, targets - ends, about, lower, upper), ends.copy()
        for part in _SHORTENINGS:
            tried = about.with_r1(np.clip(actions + part * steps, lower, upper))
            reached = model.predict(tried)
            miss, now = (np.linalg.norm(e - targets, axis=1) for e in (reached, ends))
            rows = np.flatnonzero(miss < now - 1e-6)
            rows = rows[feasible(tried[rows])] if len(rows) else rows
            actions[rows], ends[rows] = tried[rows], reached[rows]
            steps[rows] = 0.0  # taken; the others are tried shorter
        if np.array_equal(ends, before):
            break
    return [
        replace(c, action=Action.from_array(a), predicted_m=e)
        for c, a, e in zip(choices, actions * mirror, ends * flips, strict=True)
    ]


def _steps(
    model: ForwardModel,
    actions: np.ndarray,
    wanted_m: np.ndarray,
    about: Neighbourhood,
    lower: np.ndarray,
    upper: np.ndarray,
) -> np.ndarray:
    """Return steps (k, 6) that would bring endpoints nearer by `wanted_m` (k, 2).

    A coordinate that stands on a bound and would leave it is held, and the others do its part.
    """
    slopes = model.slopes(actions)
    along = slopes[:, :, _MOVED] + slopes[:, :, [_R1]] * _r1_slopes(actions, about)[:, None]
    along = along * about.spacing[_MOVED]
    here, lowest, highest = actions[:, _MOVED], lower[:, _MOVED], upper[:, _MOVED]
    part = _least_change(along, wanted_m)
    for _ in _MOVED:
        held = ((here >= highest) & (part > 0)) | ((here <= lowest) & (part < 0))
        along = np.where(held[:, None], 0.0, along)
        part = _least_change(along, wanted_m)
    steps = np.zeros_like(actions)
    steps[:, _MOVED] = part * about.spacing[_MOVED]
    return steps


def _least_change(along: np.ndarray, wanted_m: np.ndarray) -> np.ndarray:
    """Return the damped steps (k, 4) of least length with `along` (k, 2, 4) @ step ≈ wanted."""
    turned = along.transpose(0, 2, 1)
    square = along @ turned + _DAMPING_M**2 * np.eye(2)
    return (turned @ np.linalg.solve(square, wanted_m[:, :, None]))[..., 0]


def _r1_slopes(actions: np.ndarray, about: Neighbourhood) -> np.ndarray:
    """Return how r₁ follows the coordinates that move, (k, 4)."""
    sizes = _NUDGE * about.spacing[_MOVED]
    inward = np.where(actions[:, _MOVED] + sizes > about.upper[_MOVED], -sizes, sizes)
    nudged = np.repeat(actions[:, None], len(_MOVED), axis=1)
    nudged[:, range(len(_MOVED)), _MOVED] += inward
    change = nudged[:, range(len(_MOVED)), _MOVED] - actions[:, _MOVED]
    r1 = about.with_r1(nudged.reshape(-1, 6))[:, _R1].reshape(len(actions), -1)
    return (r1 - actions[:, [_R1]]) / change


@dataclass(frozen=True)
class CastAndPull:
    """The analytic baseline (paper, "Baseline Policies"): a turned reset, then a slow pull.

    The reset lays the cable along the ray to the target; the pull draws it in, as far as it may.
    """

    land_r_m: float  # where the swing of the reset sets the held end down
    r_min_m: float  # how near to its base the arm may pull the held end
    pull_m_s: float  # largest speed of the pull
    angle_rad: float  # largest angle of the ray

    def choose(self, cable: Cable, targets_m: np.ndarray) -> list[Choice]:
        """Return the pull that brings the free end as near as it can, for targets (k, 2)."""
        choices = []
        for target in targets_m:
            angle = max(-self.angle_rad, min(self.angle_rad, math.atan2(target[1], target[0])))
            held = max(self.r_min_m, min(self.land_r_m, math.hypot(*target) - cable.length_m))
            ray = np.array([math.cos(angle), math.sin(angle)])
            action = pull_action(angle, self.land_r_m, held, self.pull_m_s)
            choices.append(Choice(target, action, (held + cable.length_m) * ray))
        return choices
