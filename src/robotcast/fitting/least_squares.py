"""Robust nonlinear least squares over trials, with every evaluation batched.

Levenberg–Marquardt on finite-difference Jacobians (Nocedal and Wright 2006, ch. 10), for models
that are chaotic on some trials. Two things make it work there. A trial counts by the logarithm
of its mean square (a Cauchy loss over whole trials), because a few whip-like trials jump by ten
times the rest where the whip tips over. Differences are central at first; later they are taken
downhill along the axes of the last curvature, each as long as the trials tell parameters apart
along it: an axis along which the model is stiff is probed where it is linear, a soft one beyond
the noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robotcast.fitting.parameter import Parameter

DAMPINGS = (1e-5, 1e-2, 0.3, 8.0)  # tried side by side, in units of the curvature
DIFFERENCE = 0.02  # of a parameter's range; of an effect's strength, from its probes
REACH = 0.15  # of a parameter's range: no difference is taken over more
LEAST = 1e-3  # of the noise, that a difference moves the residuals by
NUDGE = 1e-9  # of a range, by which a smooth model moves nothing
CLEAR_OF = 3.0  # jitters, that a difference moves the residuals by
PAYS = 0.02  # of the loss, that a step must shed for another one by the same Jacobian
ENOUGH = 1e-3  # two steps that lower the loss by less than this share end the fit
LOST = 1e5  # noises, by which a run that diverged misses in a fit

Residuals = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(unit vectors (n_vectors, n), numbers of trials (m,)) → (n_vectors, m, D) residuals.

Residuals are in units of the noise and divided by the root of the number of samples, so that
the sum of squares of a trial is its mean square; 0 past its samples. All are finite: a run that
diverged misses by `LOST` in one sample.
"""


@dataclass(frozen=True)
class Fit:
    """Where a fit ended."""

    vector: np.ndarray  # (n,), in [0, 1]
    residual: np.ndarray  # (n_trials, D)
    jacobian: np.ndarray  # (n_trials, D, n), of the residuals, near the vector
    # root mean square by which trials move where parameters move by nothing, 0 where not looked at
    jitter: float = 0.0

    @cached_property
    def loss(self) -> float:
        """Mean over trials of ½ ln(1 + mean square)."""
        return float(trial_losses(self.residual).mean())

    @property
    def weights(self) -> np.ndarray:
        """How much each trial counts, (n_trials,)."""
        return trial_weights(self.residual)

    def slope(self, weights: np.ndarray) -> np.ndarray:
        """Return the slope (n,) of the loss whose trials have these weights (n_trials,)."""
        return np.einsum("idn,id->n", self.jacobian * weights[:, None, None], self.residual)


@dataclass(frozen=True)
class Stepping:
    """How a fit goes; by default as suits trials with noise.

    Trials without it, made up by the model itself, lead along narrow curved valleys. Shorter
    differences and several steps for each Jacobian follow those.
    """

    least_unit: float = 1.0  # noises, see `miss_unit`
    nearer: float = 2.0  # median misses: below the noise, differences are no longer than that
    most: int = 1  # steps for one Jacobian, which those after the first correct (Broyden 1965)
    central: bool = True  # whether the first differences are taken on both sides of the start
    # whether to look how a simulation jitters whatever changes, as a solver may that does not
    # converge: a difference that moves it by no more tells no slope
    may_jitter: bool = False


@dataclass(frozen=True)
class Prior:
    """What is expected of the parameters (n,) before any trial, in units of their ranges.

    It holds what the trials do not tell.
    """

    mean: np.ndarray
    sd: np.ndarray


def trial_losses(residual: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """Return ½ ln(1 + mean square) of every trial, (..., n_trials), `scale` being the unit."""
    return 0.5 * np.log1p((residual**2).sum(axis=-1) / scale**2)


def trial_weights(residual: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """Return the weights of the equivalent weighted least squares, (n_trials,)."""
    return 1 / (scale**2 + (residual**2).sum(axis=-1))


def difference_steps(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the finite-difference step of every parameter, in units of its range."""
    steps = np.full(len(parameters), DIFFERENCE)
    for k, p in enumerate(parameters):
        if p.null is not None and p.probes:
            null, probes = p.to_unit(np.asarray(p.null)), p.to_unit(np.asarray(p.probes))
            steps[k] = 0.25 * np.abs(probes - null).max()
    return steps


def fit_robustly(
    residuals: Residuals,
    start: np.ndarray,
    steps: np.ndarray,
    trials: np.ndarray,
    *,
    iterations: int,
    known: Fit | None = None,
    like: Fit | None = None,
    free: np.ndarray | None = None,
    prior: Prior | None = None,
    stepping: Stepping = Stepping(),
) -> Fit:
    """Minimise the loss over the numbered trials (m,) from `start` (n,), inside [0, 1].

    The `steps` (n,) are the differences of the first Jacobian, unless a fit of these trials that
    ended at the start is `known`, or another fit is `like` it: its curvature tells how far to take
    them. All parameters are `free` (n,) by default, the prior is about the start, as
    wide as the ranges. No iterations only take the slopes at the start, and return the best
    of the vectors that tell them.
    """
    free = np.ones(len(start), bool) if free is None else free
    prior = prior or Prior(start, np.ones(len(start)))
    if like is not None:
        rows = _downhill(like, free, stepping.nearer)
    else:
        axes = np.diag(steps)[free]
        one_sided = np.where(start + axes > 1, start - axes, start + axes)
        others = [start + axes, start - axes] if stepping.central else [one_sided]
        rows = np.vstack([start, *others])
    best = known or _differentiated(residuals, rows, trials, prior, stepping)
    small = 0
    for iteration in range(iterations if free.any() else 0):
        if iteration:
            rows = _downhill(best, free, stepping.nearer)
            best = _differentiated(residuals, rows, trials, prior, stepping)
        unit = miss_unit(best.residual, stepping.least_unit)
        first = before = _whole_loss(best.residual[None], best.vector[None], prior, unit)[0]
        behind = best
        for step in range(stepping.most):
            if step:
                behind, best = best, _corrected(behind, best)
            tried = _proposals(best, prior, free, unit)
            values = residuals(tried, trials)
            losses = _whole_loss(values, tried, prior, unit)
            chosen = int(np.argmin(losses))
            if losses[chosen] < before:
                best = replace(best, vector=tried[chosen], residual=values[chosen])
            if losses[chosen] > before * (1 - PAYS):
                break
            before = losses[chosen]
        small = small + 1 if before > first * (1 - ENOUGH) else 0
        if small == 2:
            break
    return best


def _corrected(behind: Fit, fit: Fit) -> Fit:
    """Return a fit whose Jacobian agrees with the step that led to it (Broyden 1965).

    A step that moved trials by no more than their jitter tells nothing of it.
    """
    if _moved(behind.residual, fit.residual) < CLEAR_OF * fit.jitter:
        return fit
    step = fit.vector - behind.vector
    missing = fit.residual - behind.residual - behind.jacobian @ step
    return replace(fit, jacobian=behind.jacobian + missing[..., None] * step / (step @ step))


def _differentiated(
    residuals: Residuals, rows: np.ndarray, trials: np.ndarray, prior: Prior, stepping: Stepping
) -> Fit:
    """Return a fit with the slopes about the first of `rows` (m, n), at the best of them."""
    rows = np.clip(rows, 0.0, 1.0)
    nudged = rows[:0]
    if stepping.may_jitter:
        moves = (rows != rows[0]).any(axis=0)
        nudged = rows[:1] + np.where(moves, np.where(rows[0] < 0.5, NUDGE, -NUDGE), 0.0)
    values = residuals(np.vstack([rows, nudged]), trials)
    values, again = values[: len(rows)], values[len(rows) :]
    wild = _lost(values).mean(axis=1) > 0.5  # where most runs are lost, a tenth as far
    if wild.any():
        rows[wild] = rows[0] + (rows[wild] - rows[0]) / 10
        values[wild] = residuals(rows[wild], trials)
    losses = _whole_loss(values, rows, prior, miss_unit(values[0], stepping.least_unit))
    chosen = int(np.argmin(losses))
    jitter = _moved(values[0], again[0]) if stepping.may_jitter else 0.0
    jacobian = steady_slopes(rows, values, max(1.0, CLEAR_OF * jitter))
    return Fit(rows[chosen], values[chosen], jacobian, jitter)


def _moved(before: np.ndarray, after: np.ndarray) -> float:
    """Return by how much residuals (n_trials, D) moved, the root mean square over trials.

    Of one that tipped over, or was lost, before or after, little or nothing counts.
    """
    squares = np.array([(some**2).sum(axis=-1) for some in (before, after)]).max(axis=0)
    weights = (squares < LOST**2) / (1 + squares)
    moved = ((after - before) ** 2).sum(axis=-1)
    return float(np.sqrt(moved @ weights / max(weights.sum(), 1e-30)))


def _downhill(last: Fit, free: np.ndarray, nearer: float) -> np.ndarray:
    """Return a fit's vector, and others (1 + n_free, n) one axis of the curvature away from it.

    On the side where the loss falls, unless that lies out of the range.
    """
    axes = noise_axes(last, free, nearer)
    axes[axes @ last.slope(last.weights) > 0] *= -1
    beyond = last.vector + axes
    axes[((beyond < 0) | (beyond > 1)).any(axis=1)] *= -1
    return np.vstack([last.vector, last.vector + axes])


def slopes(vectors: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the slopes (n_trials, D, n) at the first of some vectors (n_vectors, n) close by.

    Their residuals are the `values` (n_vectors, n_trials, D).
    """
    apart = vectors[1:] - vectors[0]
    moved = (values[1:] - values[0]).reshape(len(apart), values[0].size)
    found = np.linalg.lstsq(apart, moved, rcond=None)[0].T
    return found.reshape(*values[0].shape, vectors.shape[1])


def steady_slopes(vectors: np.ndarray, values: np.ndarray, unit: float = 1.0) -> np.ndarray:
    """Return the slopes, each trial's as far as it can be trusted.

    The vectors are meant to move trials by a `unit`, in noises.

    A trial that tips over at one of the vectors has no slope that a fit could follow: it weighs
    by its mean square over all of them, not at the first. One whose run is lost at one of them,
    not at the first, says nothing there, and of the others what it would say without.
    """
    mean_square, lost = (values**2).sum(axis=-1), _lost(values)
    found = slopes(vectors, values)
    for trial in np.flatnonzero(lost.any(axis=0)):
        kept = ~lost[:, trial]
        found[trial] = slopes(vectors[kept], values[kept, trial : trial + 1])[0]
    mean = np.where(lost, 0.0, mean_square).sum(axis=0) / (~lost).sum(axis=0)
    trust = np.minimum(np.sqrt((unit**2 + mean_square[0]) / (unit**2 + mean)), 1.0)
    return found * trust[:, None, None]


def _lost(values: np.ndarray) -> np.ndarray:
    """Return which runs of `values` (n_vectors, n_trials, D) are lost that the first is not."""
    lost = (values**2).sum(axis=-1) >= LOST**2
    return lost & ~lost[0]


def noise_axes(fit: Fit, free: np.ndarray, nearer: float = Stepping.nearer) -> np.ndarray:
    """Return the curvature's axes (n_free, n), each moving the residuals by about the noise.

    Where a fit misses much less than the noise, as it may a made-up truth, they are shorter; where
    the simulation jitters, so long that the jitter adds a tenth to the curvature.
    """
    values, vectors = np.linalg.eigh(curvature(fit)[np.ix_(free, free)])
    moved = np.clip(nearer * median_miss(fit.residual), LEAST, 1.0)
    moved = max(moved, CLEAR_OF * fit.jitter)
    lengths = moved * np.sqrt(fit.weights.sum() / np.maximum(values, 1e-9))
    axes = np.zeros((len(values), len(fit.vector)))
    axes[:, free] = (vectors * np.minimum(lengths, REACH)).T
    return axes


def miss_unit(residual: np.ndarray, least: float = 1.0) -> float:
    """Return the unit in which a step judges misses: the noise, or the median miss far away.

    Judged by the noise alone, all trials would be outliers far from the answer, and none would
    pull (graduated non-convexity, Blake and Zisserman 1987). Without noise, `least` is smaller:
    else the last trial to tip over outweighs all that come nearer.
    """
    return max(least, median_miss(residual))


def median_miss(residual: np.ndarray) -> float:
    """Return the root mean square of the median trial, residuals being (..., n_trials, D)."""
    return float(np.sqrt(np.median((residual**2).sum(axis=-1))))


def curvature(fit: Fit, weights: np.ndarray | None = None) -> np.ndarray:
    """Return the curvature of the loss (n, n), in units of the noise over the ranges."""
    weights = fit.weights if weights is None else weights
    return np.einsum("idn,idm->nm", fit.jacobian * weights[:, None, None], fit.jacobian)


def _whole_loss(residual: np.ndarray, vectors: np.ndarray, prior: Prior, unit: float) -> np.ndarray:
    away = (((vectors - prior.mean) / prior.sd) ** 2).sum(axis=-1)
    return trial_losses(residual, unit).sum(axis=-1) + 0.5 * away


def _proposals(fit: Fit, prior: Prior, free: np.ndarray, unit: float) -> np.ndarray:
    """Return where one step for every damping leads, (n_dampings, n), clipped to the range."""
    weights = trial_weights(fit.residual, unit)
    slope = fit.slope(weights) + (fit.vector - prior.mean) / prior.sd**2
    bend = curvature(fit, weights) + np.diag(1 / prior.sd**2)
    bend, slope = bend[np.ix_(free, free)], slope[free]
    proposals = np.tile(fit.vector, (len(DAMPINGS), 1))
    for row, damping in zip(proposals, DAMPINGS, strict=True):
        row[free] -= np.linalg.solve(bend + damping * np.diag(np.diag(bend)), slope)
    return np.clip(proposals, 0.0, 1.0)


def bread(fit: Fit, sd: np.ndarray) -> np.ndarray:
    """Return the inverse curvature (n, n), `sd` (n,) being what is expected before any trial."""
    return np.linalg.inv(curvature(fit) + np.diag(1 / sd**2))


def sandwich(fit: Fit, inverse: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return standard errors (n,) with groups of trials as clusters (Liang and Zeger 1986).

    The `inverse` (n, n) is that of `bread`; `groups` (n_trials,) are numbered from 0.
    """
    by_group = _scores(fit, groups)
    n, p = by_group.shape
    meat = by_group.T @ by_group * n / max(n - p, 1)
    return np.sqrt(np.diag(inverse @ meat @ inverse))


def optimism(fit: Fit, inverse: np.ndarray, groups: np.ndarray) -> float:
    """Return by how much the loss, summed over trials, is too small for having been fitted.

    What further trials of the same kind will miss more than those fitted to, for a model that is
    a little wrong (Takeuchi 1976; Akaike's number of parameters where it is not).
    """
    by_group = _scores(fit, groups)
    return float(np.trace(inverse @ by_group.T @ by_group))


def _scores(fit: Fit, groups: np.ndarray) -> np.ndarray:
    """Return the slopes of every group's loss (n_groups, n)."""
    scores = np.einsum("idn,id->in", fit.jacobian * fit.weights[:, None, None], fit.residual)
    by_group = np.zeros((groups.max() + 1, scores.shape[1]))
    np.add.at(by_group, groups, scores)
    return by_group
