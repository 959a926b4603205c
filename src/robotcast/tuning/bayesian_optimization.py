"""Bayesian optimization of a composite function in a trust region, with BoTorch.

The error is known once the residuals are. So Gaussian processes model the residuals, compressed to
principal components, and the error follows from them (Astudillo and Frazier 2019). New vectors lie
in a trust region about the best one, which shrinks where they do no better (TuRBO, Eriksson et al.
2019): one has the least error by the mean of the processes, the others by a sample each (Thompson
sampling). What a cable does late in a cast has many valleys, so that the beginnings of the casts
are fitted first, although whole casts are simulated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from botorch.exceptions.errors import ModelFittingError
from botorch.fit import fit_gpytorch_mll
from botorch.generation.gen import gen_candidates_scipy
from botorch.models import SingleTaskGP
from botorch.models.utils.gpytorch_modules import get_covar_module_with_dim_scaled_prior
from botorch.sampling.pathwise import draw_matheron_paths
from botorch.sampling.pathwise.prior_samplers import draw_kernel_feature_paths
from botorch.utils.sampling import draw_sobol_samples, manual_seed
from gpytorch.mlls import ExactMarginalLogLikelihood
from threadpoolctl import threadpool_limits
from torch import Tensor

from robotcast.fitting.starts import hypercube
from robotcast.tuning.objective import DIVERGED_PERCENT
from robotcast.tuning.search import Objective, Problem, Query, residuals_at

SHARES = (0.5, 0.65, 0.8, 1.0)  # of each cast's waypoints that are fitted, stage by stage
NEAR = 0.5  # of the noise: an error of the beginnings below which the next stage comes
LENGTH = 0.8  # of every range, that a trust region has at first, and at most
LEAST_LENGTHS = (0.15, 0.15, 0.15, 0.02)  # of one that leads no further, stage by stage
TRIES = 3  # regions whose beginnings stay far above the noise before the best of them goes on
LEAST_LENGTH = 1e-4  # of one where the error of whole casts is below the noise
CLEAR = 1e-3  # of the noise: an error with which nothing is left to find
PROGRESS, LEAP = 0.01, 0.3  # of the error that a batch sheds to be a success, and to widen
FAILURES = 2  # batches in turn that halve the length
OUTLIER = 3.0  # times the median error of a cast, or the noise, that one counts for at most
INEXACT = 0.01  # of the size of a vector's residuals, that the processes may miss them by
FEATURES = 256  # of the random Fourier series of a sample
RAW_SAMPLES, RESTARTS = 128, 4  # where a sample is looked at, and from where it is descended
ITERATIONS = 60  # of a fit, and of a descent


@dataclass(frozen=True)
class BayesianOptimization:
    """Tries vectors that Gaussian processes of the residuals call most promising.

    Attributes
    ----------
    initial : vectors of the Latin hypercube with which a trust region begins.
    batch : vectors a query afterwards.
    nearest : vectors that the processes are fitted to, at most.
    components : principal components of the residuals, at most.
    """

    initial: int
    batch: int
    nearest: int
    components: int
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.initial, self.components) < 2 or self.batch < 1:
            raise ValueError(
                "Bayesian optimization needs 2 initial vectors, 2 components and 1 vector a batch, "
                f"got {self.initial}, {self.components} and {self.batch}"
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
        self._done, self._tries = False, 0
        self._begin()

    def run(self) -> None:
        """Try vectors until they would hardly differ from the best."""
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
            errors = self._residuals()[1].sum(axis=1)[self._first :]
            older, newer = np.split(errors, [-len(vectors)])
            self._change(older.min(initial=np.inf), newer.min())

    def _begin(self) -> None:
        self._first, self._stage, self._length, self._failures = len(self._vectors), 0, LENGTH, 0
        self._tries += 1

    def _change(self, before: float, now: float) -> None:
        """Change the region's length, its stage, or the region, after a batch of least error."""
        if now < before * (1 - LEAP):
            self._length = min(2 * self._length, LENGTH)
        self._failures = 0 if now < before * (1 - PROGRESS) else self._failures + 1
        if self._failures == FAILURES:
            self._length, self._failures = self._length / 2, 0
        whole = self._stage == len(SHARES) - 1
        exhausted = self._length < LEAST_LENGTHS[self._stage]
        noises = min(before, now) / self._problem.noise_percent
        near = noises < (1.0 if whole else NEAR)
        self._done = whole and (noises < CLEAR or self._length < LEAST_LENGTH)
        if whole and exhausted and not near:
            self._tries = 0
            self._begin()
        elif not self._stage and exhausted and not near and self._tries < TRIES:
            self._begin()
        elif not whole and (near or exhausted):
            self._first = self._first if near or self._stage else 0
            self._stage, self._failures = self._stage + 1, 0
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
            surrogate = _Surrogate(settings, of, residuals[near], errors[near], noise_percent)
            return surrogate.least_errors(self._length)


class _Surrogate:
    """Gaussian processes of residuals near a vector, the first, and the error they lead to."""

    def __init__(
        self,
        settings: BayesianOptimization,
        vectors: np.ndarray,
        residuals: np.ndarray,
        errors: np.ndarray,
        noise_percent: float,
    ) -> None:
        self._settings = settings
        median = float(np.median(errors[np.isfinite(errors)]))
        self._bound = OUTLIER * max(median, noise_percent / errors.shape[1])
        rows = _bounded(vectors, residuals, errors, self._bound)
        self._shape = rows.shape[1:]
        rows = rows.reshape(len(rows), -1)
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
        spread = rest.std(axis=0) + 1e-12
        self._origin, self._axes = torch.tensor(rows[0] + trend[0] @ axes), torch.tensor(axes)
        self._slopes, self._spread = torch.tensor(trend[1:]), torch.tensor(spread)
        noise = (INEXACT * sizes[:, None] / spread) ** 2 + 1e-6
        self._model = _fitted(*map(torch.tensor, (points, rest / spread, noise)))

    def least_errors(self, length: float) -> np.ndarray:
        """Return vectors (batch, n) of least error in a trust region, by mean and by samples."""
        settings = self._settings
        ends = np.clip(self._best + length * np.array([[-0.5], [0.5]]), 0.0, 1.0)
        box, best = (torch.tensor((v - self._low) / self._width) for v in (ends, self._best))
        paths = draw_matheron_paths(
            self._model,
            torch.Size([settings.batch]),
            prior_sampler=partial(draw_kernel_feature_paths, num_features=FEATURES),
        )

        def sampled(points: Tensor) -> Tensor:
            return self._gain(points, paths(points.unsqueeze(-3)).transpose(-1, -2))

        def expected(points: Tensor) -> Tensor:
            return self._gain(points, self._model.posterior(points).mean)

        raw = draw_sobol_samples(box, RAW_SAMPLES, 1, seed=0).squeeze(1)
        raw[::2] = best + 0.1 * (raw[::2] - best)  # about the best one half of them
        raw[0] = best
        with torch.no_grad():
            top = sampled(raw.expand(settings.batch, -1, -1)).topk(RESTARTS).indices
        found = _climbed(sampled, raw[top], box)
        found[:1] = _climbed(expected, torch.cat([found, best[None]])[None], box)
        return np.clip(found.numpy() * self._width + self._low, 0.0, 1.0)

    def _gain(self, points: Tensor, rest: Tensor) -> Tensor:
        """Return −log error (...) at points (..., n), the processes being (..., q) there."""
        scores = points @ self._slopes + rest * self._spread
        rows = (scores @ self._axes + self._origin).unflatten(-1, self._shape)
        bounded = torch.linalg.vector_norm(rows, dim=-1).sum(dim=-1) / self._bound
        errors = bounded / (1 - bounded.clamp(max=0.97))
        return -torch.log(errors.sum(dim=-1) + 1e-12)


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


def _fitted(points: Tensor, scores: Tensor, variances: Tensor) -> SingleTaskGP:
    """Return a process for each column of scores; its lengths have Hvarfner's priors (2024)."""
    batch, n = torch.Size([scores.shape[1]]), points.shape[1]
    kernel = get_covar_module_with_dim_scaled_prior(ard_num_dims=n, batch_shape=batch)
    model = SingleTaskGP(points, scores, variances, covar_module=kernel, outcome_transform=None)
    likelihood = ExactMarginalLogLikelihood(model.likelihood, model)
    try:
        fit_gpytorch_mll(likelihood, optimizer_kwargs={"options": {"maxiter": ITERATIONS}})
    except ModelFittingError:
        model.eval()  # the priors' modes are a usable model
    return model


def _climbed(gain: Callable[[Tensor], Tensor], starts: Tensor, box: Tensor) -> Tensor:
    """Return the point (m, n) of most gain that is reached from starts (m, n_starts, n)."""
    climb: Any = gen_candidates_scipy  # any function serves, which its annotation does not say
    options = {"maxiter": ITERATIONS}
    points, gains = climb(starts, gain, box[0], box[1], options=options, use_parallel_mode=False)
    return points[torch.arange(len(points)), gains.argmax(dim=-1)].detach()
