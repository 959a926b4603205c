"""A first look at every effect: what it would explain if it acted a little.

Each effect is simulated at its probes. What the tuned parameters could do instead is projected
out; a score test over groups of trials (Cox and Hinkley 1974, ch. 9, with the groups' own
scatter in place of a model of it) says whether the rest of it points along the residuals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import ncf

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Candidate
from robotcast.diagnosis.revision import Revision
from robotcast.diagnosis.side_by_side import side_by_side
from robotcast.fitting.least_squares import trial_losses
from robotcast.fitting.parameter import Parameter

TOUCHES = 0.02  # of the noise: an effect that moves every trial by less touches nothing
LEFT = 0.05  # share of a sensitivity that must be left after projection to be told apart
STEP_SHARES = (0.25, 0.5, 1.0)  # of the linear step, tried by simulating it
RIDGE = 1.0  # of a parameter's range, as the fit's prior


@dataclass(frozen=True)
class Screened:
    """What the first look says of one effect.

    Attributes
    ----------
    p_value : of the score test, corrected for the places tried.
    start : unit vector where a refit starts: the best of the simulated linear steps.
    loss : the fit's loss there.
    predicted : average error of the linear prediction, % of the scale.
    left : share of the sensitivity that the tuned parameters cannot imitate.
    power : chance that the test at 0.001 finds the effect at its smallest probe.
    moved : the largest root mean square by which the probes move a trial, in noise units.
    """

    effect: str
    p_value: float
    start: np.ndarray
    loss: float
    predicted: float
    left: float
    power: float
    moved: float

    @property
    def status(self) -> str | None:
        """Why the effect cannot be judged, None when it can."""
        if self.moved == 0:
            return "ignored by the model"
        if self.moved < TOUCHES:
            return "touches nothing"
        return "your casts cannot tell" if self.left < LEFT else None


def looks(inquiry: Inquiry, revision: Revision, effects: Sequence[str]) -> Iterator[Screened]:
    """Yield the first look at every effect, in their order."""
    return side_by_side(lambda effect: screen(inquiry, revision, effect), effects)


def screen(inquiry: Inquiry, revision: Revision, effect: str) -> Screened:
    """Probe one effect on top of a fitted revision."""
    active = (*revision.effects, effect)
    places = [
        _Place.of(inquiry, revision, active, place)
        for place in _places(inquiry.model.effects[effect])
    ]
    rows = np.vstack([place.rows for place in places])
    moves = inquiry.residuals(active)(rows, inquiry.everything) - revision.fit.residual
    ends = np.cumsum([len(place.rows) for place in places])[:-1]
    tries = [
        _try(inquiry, revision, active, place, seen)
        for place, seen in zip(places, np.split(moves, ends), strict=True)
    ]
    best = min(tries, key=lambda one: one.p_value)
    start, loss = _step(inquiry, revision, active, best)
    return Screened(
        effect=effect,
        p_value=min(1.0, best.p_value * len(tries)),
        start=start,
        loss=loss,
        predicted=best.predicted,
        left=best.left,
        power=best.power,
        moved=max(one.moved for one in tries),
    )


@dataclass(frozen=True)
class _Place:
    """One place of an effect, and its probes there.

    Attributes
    ----------
    vector : unit vector (n,) with every strength at its null.
    own : the effect's parameters, at that place.
    strengths : which of them are strengths.
    rows : unit vectors (n_probes, n).
    columns, by : of each row, which strength was moved, and by how much; (n_probes,).
    """

    vector: np.ndarray
    own: Sequence[Parameter]
    strengths: list[int]
    rows: np.ndarray
    columns: np.ndarray
    by: np.ndarray

    @classmethod
    def of(
        cls,
        inquiry: Inquiry,
        revision: Revision,
        active: tuple[str, ...],
        place: dict[str, float],
    ) -> "_Place":
        parameters = inquiry.model.effects[active[-1]].parameters
        own = [p.at(place.get(p.name, p.nominal)) for p in parameters]
        units = np.array([float(p.to_unit(np.asarray(p.nominal))) for p in own])
        vector = np.concatenate([revision.fit.vector, units])
        first = len(revision.fit.vector)
        strengths = [k for k, p in enumerate(own) if p.null is not None]
        rows, columns = [], []
        for column, k in enumerate(strengths):
            for probe in own[k].probes:
                row = vector.copy()
                row[first + k] = float(own[k].to_unit(np.asarray(probe)))
                rows.append(row)
                columns.append(column)
        moved = first + np.array([strengths[c] for c in columns])
        by = np.array([row[k] - vector[k] for row, k in zip(rows, moved, strict=True)])
        return cls(vector, own, strengths, np.array(rows), np.array(columns), by)

    def slopes(self, moves: np.ndarray) -> np.ndarray:
        """Return slopes (n_trials, D, n_strengths) through null and the probes' moves."""
        slopes = np.zeros((*moves.shape[1:], len(self.strengths)))
        for column in range(len(self.strengths)):
            mine = self.columns == column
            rise = np.tensordot(self.by[mine], moves[mine], axes=1)
            slopes[..., column] = rise / (self.by[mine] ** 2).sum()
        return slopes


@dataclass(frozen=True)
class _Try:
    vector: np.ndarray
    step: np.ndarray
    p_value: float
    predicted: float
    left: float
    power: float
    moved: float


def _places(candidate: Candidate) -> list[dict[str, float]]:
    """Return values of the parameters that are no strengths, every combination of probes."""
    others = [p for p in candidate.parameters if p.null is None and not p.frozen]
    values = [p.probes or (p.nominal,) for p in others]
    return [dict(zip((p.name for p in others), place, strict=True)) for place in product(*values)]


def _try(
    inquiry: Inquiry,
    revision: Revision,
    active: tuple[str, ...],
    at: _Place,
    moves: np.ndarray,
) -> _Try:
    vector, own, strengths = at.vector, at.own, at.strengths
    fit, first = revision.fit, len(revision.fit.vector)
    slopes, moved = at.slopes(moves), float(np.sqrt((moves**2).sum(axis=-1)).max())
    root = np.sqrt(fit.weights)[:, None]
    free = inquiry.free(revision.effects)
    base = (fit.jacobian[:, :, free] * root[..., None]).reshape(-1, free.sum())
    sensitivity = (slopes * root[..., None]).reshape(-1, len(strengths))
    residual = (fit.residual * root).ravel()
    rest = _without(base, sensitivity)
    projected = rest.reshape(*fit.residual.shape, len(strengths))
    scores = np.einsum("idn,id->in", projected, residual.reshape(fit.residual.shape))
    p_value, power = _score_test(scores, projected, sensitivity, inquiry, own, strengths)
    sd = np.array([own[k].prior_sd for k in strengths])
    step = _linear_step(base, sensitivity, residual, sd)
    whole = np.zeros(len(vector))
    whole[np.flatnonzero(free)] = step[: free.sum()]
    whole[first + np.array(strengths)] = step[free.sum() :]
    after = fit.residual - (fit.jacobian[:, :, free] @ step[: free.sum()])
    after = after - slopes @ step[free.sum() :]
    percent = inquiry.percent(inquiry.difference_of(after, inquiry.everything), inquiry.everything)
    size = np.linalg.norm(sensitivity, axis=0).max()
    left = float(np.linalg.norm(rest, axis=0).max() / size) if size else 0.0
    return _Try(vector, -whole, p_value, float(percent[0].mean()), left, power, moved)


def _without(base: np.ndarray, sensitivity: np.ndarray) -> np.ndarray:
    """Return what of the sensitivities no change of the tuned parameters gives."""
    ridge = np.vstack([base, np.eye(base.shape[1]) / RIDGE])
    target = np.vstack([sensitivity, np.zeros((base.shape[1], sensitivity.shape[1]))])
    return sensitivity - base @ np.linalg.lstsq(ridge, target, rcond=None)[0]


def _linear_step(
    base: np.ndarray, sensitivity: np.ndarray, residual: np.ndarray, sd: np.ndarray
) -> np.ndarray:
    columns = np.hstack([base, sensitivity])
    expected = np.concatenate([np.full(base.shape[1], RIDGE), sd])
    ridge = np.vstack([columns, np.diag(1 / expected)])
    target = np.concatenate([residual, np.zeros(columns.shape[1])])
    return np.linalg.lstsq(ridge, target, rcond=None)[0]


def _score_test(
    scores: np.ndarray,
    projected: np.ndarray,
    sensitivity: np.ndarray,
    inquiry: Inquiry,
    own: Sequence,
    strengths: Sequence[int],
) -> tuple[float, float]:
    """Return the p-value of the scores (n_trials, q) by group, and the power at a probe."""
    groups = inquiry.groups
    n, q = groups.max() + 1, scores.shape[1]
    by_group = np.zeros((n, q))
    np.add.at(by_group, groups, scores)
    scatter = by_group.T @ by_group
    if n <= q + 1 or not np.all(np.diag(scatter) > 0):
        return 1.0, 0.0
    total = by_group.sum(axis=0)
    inverse = np.linalg.pinv(scatter)
    square = float(total @ inverse @ total)
    # Hotelling: scores scatter about their mean, not about 0
    hotelling = square / max(1 - square / n, 1e-9) * (n - 1) / n
    factor = (n - q) / (q * (n - 1))
    p_value = float(f_distribution.sf(hotelling * factor, q, n - q))
    information = np.einsum("idn,idm->nm", projected, projected)
    probe = [
        min(
            abs(own[k].to_unit(np.asarray(x)) - own[k].to_unit(np.asarray(own[k].null)))
            for x in own[k].probes
        )
        for k in strengths
    ]
    centred = scatter - np.outer(total, total) / n
    shift = information @ np.asarray(probe, float)
    away = float(shift @ np.linalg.pinv(centred + 1e-12 * np.eye(q)) @ shift)
    critical = f_distribution.isf(1e-3, q, n - q)
    power = float(ncf.sf(critical, q, n - q, min(away, 1e4)))
    return p_value, power


def _step(
    inquiry: Inquiry, revision: Revision, active: tuple[str, ...], best: _Try
) -> tuple[np.ndarray, float]:
    rows = np.clip(
        np.array([best.vector + share * best.step for share in STEP_SHARES]), 0.001, 0.999
    )
    losses = trial_losses(inquiry.residuals(active)(rows, inquiry.everything)).mean(axis=1)
    chosen = int(np.argmin(losses))
    return rows[chosen], float(losses[chosen])
