"""A first look at every effect: what the slopes of the whole library say of it.

What the parameters of the model with the effects that act could do instead is projected out of an
effect's slopes; a score test over groups of trials (Cox and Hinkley 1974, ch. 9, with the groups'
own scatter in place of a model of it) says whether the rest of it points along the residuals.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import ncf

from robotcast.diagnosis.library import Library, without
from robotcast.diagnosis.rule import Rule

NOTHING = 1e-9  # of the noise: what rounding leaves


@dataclass(frozen=True)
class Screened:
    """What the first look says of one effect."""

    effect: str
    p_value: float  # of the score test
    predicted: float  # average error that the slopes promise with the effect, % of the scale
    power: float  # chance that the test finds the effect at its smallest probe
    moved: float  # the largest root mean square by which its probes move a trial, in noise units
    status: str | None  # why it cannot be judged, None when it can


def screen(library: Library, acting: Sequence[str], effect: str, rule: Rule) -> Screened:
    """Look at one effect on top of the model in which others act."""
    early, others = library.early, [name for name in acting if name != effect]
    parameters = early.parameters(library.effects)
    strengths = [k for k in library.columns[effect] if parameters[k].null is not None]
    residual, slopes = library.weighted
    used = [*library.free, *(k for name in others for k in library.columns[name])]
    beside = residual + slopes[..., used] @ library.step(others)
    reach = np.array([_probe(parameters[k], max) for k in strengths])
    least = np.array([_probe(parameters[k], min) for k in strengths])
    moved = library.fit.jacobian[..., strengths] * reach
    most = float(np.sqrt((moved**2).sum(axis=1)).max()) if moved.size else 0.0
    sensitivity = slopes[..., strengths].reshape(-1, len(strengths))
    rest = without(slopes[..., used].reshape(len(sensitivity), -1), sensitivity)
    size, kept = (np.linalg.norm(one, axis=0).max() for one in (sensitivity, rest))
    left = kept / size if size else 0.0
    rest = rest.reshape(*residual.shape, len(strengths))
    scores = np.einsum("idn,id->in", rest, beside)
    p_value, power = _score_test(scores, rest, early.groups, least, rule.level)
    predicted = library.predicted([*others, effect])
    return Screened(effect, p_value, predicted, power, most, _status(most, left, rule))


def _status(moved: float, left: float, rule: Rule) -> str | None:
    if moved < NOTHING:
        return "ignored by the model"
    if moved < rule.faint:
        return "touches nothing"
    return "your casts cannot tell" if left < rule.distinct else None


def _probe(parameter, pick) -> float:
    null = float(parameter.to_unit(np.asarray(parameter.null)))
    probes = parameter.probes or (parameter.upper,)
    return pick(abs(float(parameter.to_unit(np.asarray(x))) - null) for x in probes)


def _score_test(
    scores: np.ndarray, projected: np.ndarray, groups: np.ndarray, probe: np.ndarray, level: float
) -> tuple[float, float]:
    """Return the p-value of the scores (n_trials, q) by group, and the power at a probe."""
    n, q = int(groups.max()) + 1, scores.shape[1]
    by_group = np.zeros((n, q))
    np.add.at(by_group, groups, scores)
    scatter = by_group.T @ by_group
    if n <= q + 1 or not np.all(np.diag(scatter) > 0):
        return 1.0, 0.0
    total = by_group.sum(axis=0)
    square = float(total @ np.linalg.pinv(scatter) @ total)
    # Hotelling: scores scatter about their mean, not about 0
    hotelling = square / max(1 - square / n, 1e-9) * (n - 1) / n
    factor = (n - q) / (q * (n - 1))
    p_value = float(f_distribution.sf(hotelling * factor, q, n - q))
    information = np.einsum("idn,idm->nm", projected, projected)
    centred = scatter - np.outer(total, total) / n
    shift = information @ probe
    away = float(shift @ np.linalg.pinv(centred + 1e-12 * np.eye(q)) @ shift)
    critical = f_distribution.isf(level, q, n - q)
    return p_value, float(ncf.sf(critical, q, n - q, min(away, 1e4)))
