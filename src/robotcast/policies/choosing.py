"""From a target to an action: a forward model's, refined along its gradient, or a plain pull."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

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
_PARTS = (1.0, 0.5, 0.25, 0.1)  # of the way that least squares lead
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

    def moved(self, action: np.ndarray, to: np.ndarray) -> np.ndarray:
        """Return an action (6,) moved to (k, 4) values of `_MOVED`, (k, 6); r₁ follows."""
        actions = np.tile(action, (len(to), 1))
        actions[:, _MOVED], actions[:, _R1] = to, np.nan
        return plan_curves(actions, self._r0_m, self._limits).actions


def refine_choices(
    model: ForwardModel, choices: Sequence[Choice], about: Neighbourhood, feasible: Feasible
) -> list[Choice]:
    """Move every choice towards its target by least squares of what is missed.

    As far along the way as the predicted miss falls and the action stays `feasible`.
    """
    actions, mirror, flips = _on_candidates_half(choices)
    return [
        _refined(model, choice, action, sides, about, feasible)
        for choice, action, *sides in zip(choices, actions, mirror, flips, strict=True)
    ]


def _refined(
    model: ForwardModel,
    choice: Choice,
    action: np.ndarray,
    sides: Sequence[np.ndarray],
    about: Neighbourhood,
    feasible: Feasible,
) -> Choice:
    mirror, flip = sides  # of the action (6,) and of places (2,), to the candidates' half
    target, start, reach = choice.target_m * flip, action[_MOVED], about.spacing[_MOVED]
    bounds = (
        np.maximum(about.lower[_MOVED], start - reach),
        np.minimum(about.upper[_MOVED], start + reach),
    )

    def missed(to: np.ndarray) -> np.ndarray:
        return model.predict(about.moved(action, to[None]))[0] - target

    edge = 1e-6 * reach  # a start on a bound cannot be moved
    inside = np.clip(start, bounds[0] + edge, bounds[1] - edge)
    found = least_squares(missed, inside, bounds=bounds, x_scale=reach, max_nfev=_ROUNDS)
    tried = about.moved(action, start + np.outer(_PARTS, found.x - start))
    ends = model.predict(tried)
    misses = np.linalg.norm(ends - target, axis=1)
    kept = np.flatnonzero(feasible(tried) & (misses < choice.miss_m))
    if not len(kept):
        return choice
    best = kept[misses[kept].argmin()]
    return replace(
        choice, action=Action.from_array(tried[best] * mirror), predicted_m=ends[best] * flip
    )


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
