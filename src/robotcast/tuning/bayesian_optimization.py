"""Bayesian optimization of a composite function in trust regions, with BoTorch.

The error is known once the residuals are. So Gaussian processes model the residuals, compressed to
principal components, about a linear trend, and least squares of what they predict lead on
(Astudillo and Frazier 2019). New vectors lie in a trust region about the best one, which shrinks
where they do no better; one that leads no further makes way for another, which begins all over the
ranges and knows every vector nearby (TuRBO, Eriksson et al. 2019). What a cable does late in a cast
has many valleys, so that the beginnings of the casts are fitted first, although whole casts are
simulated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from botorch.exceptions.errors import ModelFittingError
from botorch.fit import fit_gpytorch_mll
from botorch.models import SingleTaskGP
from botorch.models.utils.gpytorch_modules import get_covar_module_with_dim_scaled_prior
from botorch.sampling.pathwise import draw_matheron_paths
from botorch.sampling.pathwise.prior_samplers import draw_kernel_feature_paths
from botorch.utils.sampling import manual_seed
from gpytorch.mlls import ExactMarginalLogLikelihood
from threadpoolctl import threadpool_limits
from torch import Tensor

from robotcast.fitting.starts import hypercube
from robotcast.tuning.objective import DIVERGED_PERCENT
from robotcast.tuning.search import Objective, Problem, Query, residuals_at

SHARES = (0.5, 0.65, 0.8, 1.0)  # of each cast's waypoints that are fitted, stage by stage
NEAR = 0.5  # of the noise: an error of the beginnings below which the next stage comes
LENGTH = 0.8  # of every range, that a trust region has at first, and at most
LEAST_LENGTHS = (0.1, 0.1, 0.1, 0.01)  # of one that leads no further, stage by stage
TRIES = 3  # regions whose beginnings stay far above the noise before the best of them goes on
LEAST_LENGTH = 1e-3  # of one where the error of whole casts is below the noise
CLEAR = 2e-3  # of the noise: an error with which nothing is left to find
PROGRESS = 0.01  # of the error that a batch must shed, or the region shrinks
FACTOR = 2.0  # by which a region's length changes
SPANS = (1.0, 0.25, 4.0)  # lengths that least squares of the mean are sought in, side by side
SAME = 0.1  # of the way from the best vector, by which two of a batch must differ
OUTLIER = 3.0  # times the median error of a cast, or the noise, that one counts for at most
INEXACT = 0.01  # of the size of a vector's residuals, that the processes may miss them by
FEATURES = 256  # of the random Fourier series of a sample
ITERATIONS, STEPS = 12, 15  # of a fit of the processes, and of least squares
DAMPINGS = np.array([1e-9, 1e-3, 0.1, 10.0])  # of these, tried side by side
DIFFERENCE = 1e-6  # of the width of the vectors, for slopes of what the processes predict


@dataclass(frozen=True)
class BayesianOptimization:
    """Tries vectors that Gaussian processes of the residuals call most promising."""

    initial: int  # vectors of the Latin hypercube with which a trust region begins
    batch: int  # vectors a query afterwards
    nearest: int  # vectors that the processes are fitted to, at most
    components: int  # principal components of the residuals, at most
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.initial, self.batch, self.components) < 2:
            raise ValueError(
                "Bayesian optimization needs 2 initial vectors, vectors a batch and components, "
                f"got {self.initial}, {self.batch} and {self.components}"
            )

    def minimise(self, problem: Problem, objective: Objective, budget_casts: int) -> None:
        """Search from a Latin hypercube with the problem's start as one of its vectors."""
        _TrustRegions(self, problem, objective).run()


class _TrustRegions:
    """One trust region after the other, each in stages."""

    def __init__(
        self, settings: BayesianOptimization, problem: Problem, objective: Objective
    ) -> None:
        self._settings, self._problem, self._objective = settings, problem, objective
        self._vectors = np.empty((0, len(problem.start)))
        self._batches: list[np.ndarray] = []  # residuals of the vectors
        self._like: SingleTaskGP | None = None
        self._done, self._tries = False, 0
        self._begin()

    def run(self) -> None:
        """Try vectors until nothing is left to find, or the budget ends it."""
        settings, start = self._settings, self._problem.start
        while not self._done:
            if len(self._vectors) > self._first:
                vectors = self._promising()
            else:
                seed, middle = settings.seed + self._first, np.full(len(start), 0.5)
                vectors = hypercube(middle, 1.0, settings.initial, seed)
                vectors[:1] = vectors[:1] if self._first else start
            self._batches.append(residuals_at(self._objective, Query(vectors)))
            self._vectors = np.vstack([self._vectors, vectors])
            self._change(len(self._vectors) - len(vectors))

    def _begin(self) -> None:
        self._first, self._stage, self._length = len(self._vectors), 0, LENGTH
        self._tries += 1

    def _change(self, newer: int) -> None:
        """Change the region's length, its stage, or the region, after a batch from `newer` on."""
        errors = self._residuals()[1].sum(axis=1)
        now = newer + int(np.argmin(errors[newer:]))
        error = errors[now]
        if newer > self._first:
            before = self._first + int(np.argmin(errors[self._first : newer]))
            moved = np.abs(self._vectors[now] - self._vectors[before]).max()
            if error > (1 - PROGRESS) * errors[before]:
                self._length /= FACTOR
            else:  # four times the way is as far as a step of this length should lead
                grown = np.clip(4 * moved, self._length / FACTOR, self._length * FACTOR)
                self._length = min(float(grown), LENGTH)
            error = min(error, errors[before])
        whole = self._stage == len(SHARES) - 1
        noises = error / self._problem.noise_percent
        near = noises < (1.0 if whole else NEAR)
        exhausted = self._length < (LEAST_LENGTH if whole and near else LEAST_LENGTHS[self._stage])
        self._done = whole and noises < CLEAR
        if whole:
            if exhausted:
                self._tries = 0
                self._begin()
        elif not self._stage and exhausted and not near and self._tries < TRIES:
            self._begin()
        elif near or exhausted:
            self._first = self._first if near or self._stage else 0
            self._stage += 1
            self._length = min(4 * self._length, LENGTH)

    def _residuals(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what this stage fits: residuals and the casts' errors that their lengths sum to.

        Both are in % and divided by the number of casts, of shapes (n_vectors, n_casts, k_max, 2)
        and (n_vectors, n_casts). An error is infinite where the run diverged.
        """
        told = np.concatenate(self._batches)
        diverged = told[..., 0] == DIVERGED_PERCENT
        residuals = told.reshape(*told.shape[:2], -1, 2)
        seen = (np.where(diverged[..., None, None], 0.0, residuals) != 0).any(axis=(0, 3))
        waypoints = seen.shape[1] - np.argmax(seen[:, ::-1], axis=1)
        counted = np.maximum(np.round(SHARES[self._stage] * waypoints), 2)[:, None]
        weights = np.sqrt(waypoints)[:, None] / counted / len(waypoints)
        weights = np.where(np.arange(seen.shape[1]) < counted, weights, 0.0)
        residuals = residuals * weights[..., None]
        errors = np.linalg.norm(residuals, axis=-1).sum(axis=-1)
        return residuals, np.where(diverged, np.inf, errors)

    def _promising(self) -> np.ndarray:
        settings, (residuals, errors) = self._settings, self._residuals()
        best = self._first + int(np.argmin(errors.sum(axis=1)[self._first :]))
        away = np.abs(self._vectors - self._vectors[best]).max(axis=1)
        away[best] = -1.0
        inside = int((away <= self._length).sum())
        wanted = min(max(inside, 3 * self._vectors.shape[1]), settings.nearest)
        near = np.argsort(away, kind="stable")[:wanted]
        with threadpool_limits(1), manual_seed(settings.seed + len(self._vectors)):
            of, noise_percent = self._vectors[near], self._problem.noise_percent
            data = of, residuals[near], errors[near], noise_percent
            surrogate = _Surrogate(settings, *data, like=self._like)
            self._like = surrogate.model
            return surrogate.least_errors(self._length)


class _Surrogate:
    """Gaussian processes of residuals near a vector, the first, and where they lead to."""

    def __init__(
        self,
        settings: BayesianOptimization,
        vectors: np.ndarray,
        residuals: np.ndarray,
        errors: np.ndarray,
        noise_percent: float,
        like: SingleTaskGP | None,
    ) -> None:
        self._settings = settings
        median = float(np.median(errors[np.isfinite(errors)]))
        bound = OUTLIER * max(median, noise_percent / errors.shape[1])
        rows = _bounded(vectors, residuals, errors, bound).reshape(len(vectors), -1)
        sizes = np.linalg.norm(rows, axis=1) + 1e-12
        weights = (sizes.min() / sizes)[:, None]
        away = rows - rows[0]
        axes = np.linalg.svd(away * weights, full_matrices=False)[2][: settings.components]
        scores = away @ axes.T
        self._best, self._low = vectors[0], vectors.min(axis=0)
        self._width = np.ptp(vectors, axis=0) + 1e-12
        points = (vectors - self._low) / self._width
        design = np.column_stack([np.ones(len(points)), points])
        trend = np.linalg.lstsq(design * weights, scores * weights, rcond=None)[0]
        rest = scores - design @ trend
        self._origin, self._slopes = trend[0] + rows[0] @ axes.T, trend[1:]
        self._spread = rest.std(axis=0) + 1e-12
        noise = (INEXACT * sizes[:, None] / self._spread) ** 2 + 1e-6
        data = tuple(map(torch.tensor, (points, rest / self._spread, noise)))
        self.model = _fitted(*data, like=like)
        with torch.no_grad():
            self._mean = _mean(self.model, *data)

    def least_errors(self, length: float) -> np.ndarray:
        """Return vectors (batch, n) in a trust region that least squares lead to.

        Of the mean of the processes in boxes of several lengths, where these differ; of a sample
        of the processes each (Thompson sampling).
        """
        drawn = self._settings.batch - 1
        best = (self._best - self._low) / self._width
        lengths = length * np.append(SPANS, np.ones(drawn))
        ends = np.clip(self._best + np.multiply.outer([-0.5, 0.5], lengths)[..., None], 0.0, 1.0)
        low, high = (ends - self._low) / self._width
        n_spans = len(SPANS)
        paths = draw_matheron_paths(
            self.model,
            torch.Size([drawn]),
            prior_sampler=partial(draw_kernel_feature_paths, num_features=FEATURES),
        )
        with torch.no_grad():
            starts = np.tile(best, (n_spans, 1))
            found = _least(partial(self._scores, self._mean), starts, low[:n_spans], high[:n_spans])
            starts = np.tile(found[0], (drawn, 1))
            sampled = _least(partial(self._scores, paths), starts, low[n_spans:], high[n_spans:])
        chosen: list[np.ndarray] = []
        for vector in np.vstack([found, sampled]) * self._width + self._low:
            ways = (np.abs([vector - one, one - self._best]).max(axis=1) for one in chosen)
            if all(apart > SAME * way for apart, way in ways):
                chosen.append(vector)
        return np.clip(chosen[: self._settings.batch], 0.0, 1.0)

    def _scores(self, rest: Callable[[Tensor], Tensor], points: np.ndarray) -> np.ndarray:
        """Return scores (m, k, q) at points (m, k, n), the rest about the trend as given."""
        values = rest(torch.from_numpy(points).unsqueeze(-3)).transpose(-1, -2).numpy()
        return self._origin + points @ self._slopes + values * self._spread


def _bounded(
    vectors: np.ndarray, residuals: np.ndarray, errors: np.ndarray, bound: float
) -> np.ndarray:
    """Return residuals of casts whose errors are bounded: e becomes e / (1 + e / bound).

    A run that diverged goes on from the nearest one that did not, in the same direction.
    """
    finite = np.isfinite(errors)
    rows = residuals / (1 + np.where(finite, errors, 0.0) / bound)[..., None, None]
    for vector, cast in zip(*np.nonzero(~finite), strict=True):
        others = np.flatnonzero(finite[:, cast])
        rows[vector, cast] = 0.0
        if len(others):
            away = np.abs(vectors[others] - vectors[vector]).max(axis=1)
            like = others[np.argmin(away)]
            rows[vector, cast] = residuals[like, cast] * bound / max(errors[like, cast], 1e-12)
    return rows


def _fitted(
    points: Tensor, scores: Tensor, variances: Tensor, like: SingleTaskGP | None
) -> SingleTaskGP:
    """Return a process for each column of scores; its lengths have Hvarfner's priors (2024).

    The fit begins at the lengths of those `like` it.
    """
    batch, n = torch.Size([scores.shape[1]]), points.shape[1]
    kernel = get_covar_module_with_dim_scaled_prior(ard_num_dims=n, batch_shape=batch)
    if like is not None and like.covar_module.batch_shape == batch:
        kernel.load_state_dict(like.covar_module.state_dict())
    model = SingleTaskGP(points, scores, variances, covar_module=kernel, outcome_transform=None)
    likelihood = ExactMarginalLogLikelihood(model.likelihood, model)
    try:
        fit_gpytorch_mll(likelihood, optimizer_kwargs={"options": {"maxiter": ITERATIONS}})
    except ModelFittingError:
        model.eval()  # the priors' modes are a usable model
    return model


def _mean(
    model: SingleTaskGP, points: Tensor, scores: Tensor, variances: Tensor
) -> Callable[[Tensor], Tensor]:
    """Return the mean (..., q, k) of processes at points (..., 1, k, n), in few operations."""
    kernel: Any
    mean: Any
    kernel, mean = model.covar_module, model.mean_module
    constant = mean.constant.unsqueeze(-1)
    covariance = kernel.forward(points, points) + torch.diag_embed(variances.T)
    pulls = torch.linalg.solve(covariance, (scores.T - constant).unsqueeze(-1))
    return lambda at: constant + (kernel.forward(at, points) @ pulls).squeeze(-1)


def _least(
    scores: Callable[[np.ndarray], np.ndarray],
    starts: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """Return points (m, n) in boxes of least squares of `scores`, m functions at once."""
    points, eye = starts, np.eye(starts.shape[1])
    rows, probes = np.arange(len(starts)), DIFFERENCE * np.vstack([0 * eye[:1], eye])
    for _ in range(STEPS):
        values = scores(points[:, None] + probes)
        slopes = (values[:, 1:] - values[:, :1]) / DIFFERENCE
        rises = np.einsum("mnq,mq->mn", slopes, values[:, 0])
        held = ((points <= low) & (rises > 0)) | ((points >= high) & (rises < 0))
        slopes[held], rises[held] = 0.0, 0.0
        bend = slopes @ slopes.transpose(0, 2, 1)
        damped = np.einsum("mnn->mn", bend)[:, None] * DAMPINGS[:, None] + held[:, None] + 1e-12
        steps = np.linalg.solve(bend[:, None] + damped[..., None] * eye, rises[:, None, :, None])
        tried = np.clip(points[:, None] - steps[..., 0], low[:, None], high[:, None])
        squares = (scores(tried) ** 2).sum(axis=-1)
        chosen, before = squares.argmin(axis=1), (values[:, 0] ** 2).sum(axis=-1)
        shed = before - squares[rows, chosen]
        points = np.where(shed[:, None] > 0, tried[rows, chosen], points)
        if (shed < PROGRESS**2 * before).all():
            break
    return points
