"""How measured casts depart from a forward model, learned from few of them.

A Gaussian process of the action, of where the model lets the cast end and of how that end moves
with the action: casts alike in all of these went alike, and the simulator was wrong about them in
the same way. It is exact, with its numbers at the maximum of the marginal likelihood (Rasmussen
and Williams 2006, chapters 2 and 5).

Casts are not equally sure: whip-like ones end anywhere. The process is told so by the model it
corrects, which knows where its own examples scattered and how far the endpoint moves with every
number of the action, and with it whatever chance does to the arm. What the casts themselves say
of that, each seen by the others, makes the few that nothing explains count little.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import minimize

from robotcast.policies.learning.datasets import Examples
from robotcast.policies.learning.forward_model import ForwardModel
from robotcast.policies.learning.gaussian_process import GaussianProcess, Posterior, matern
from robotcast.policies.learning.normalisation import Normalisation
from robotcast.policies.learning.reproducible import reproducible_torch
from robotcast.policies.learning.spread import Spread, held_out_scale, slope_size
from robotcast.policies.learning.training import Epoch

_FREEDOM = 4.0  # degrees of freedom of Student's distribution, by which wild casts lose weight
_ROUNDS = 3  # of fitting and weighing
_EVALUATIONS = 100  # of the likelihood in a round
_LENGTH = 1.0, 1.0  # mean and deviation of the logarithm of a length, in spreads of the input
_LEAST_M = 1e-4  # what is never known of a cast
_BOUNDS = {"lengths": (-2.0, 6.0), "variance": (-8.0, 6.0), "noise": (-24.0, 6.0)}
_FIRST = {"lengths": math.log(2.0), "variance": 0.0, "noise": -2.0}


@dataclass(frozen=True)
class CastNoise:
    """How far casts of one action scatter: √(least² + (of_spread |σ|)² + (of_slope |S|)²).

    σ is the spread that the corrected model expects, S its slope for actions in units of `unit`.

    Attributes
    ----------
    unit : ndarray of shape (6,), in the units of `ACTION_COLUMNS`.
    """

    unit: np.ndarray
    least_m: float
    of_spread: float
    of_slope: float

    def __call__(self, base: ForwardModel, actions: np.ndarray) -> np.ndarray:
        """Return the standard deviation (n,) [m] of one coordinate, up to a common factor."""
        spread_m, slope_m = noise_terms(base, actions, self.unit).T
        parts = (self.least_m, self.of_spread * spread_m, self.of_slope * slope_m)
        return np.sqrt(sum(np.square(part) for part in parts))


@dataclass(frozen=True)
class Departures:
    """What `learn_departures` returns.

    Attributes
    ----------
    process : of the departures [m], (n, 2), of what is `seen_by` a model.
    noise : of casts about it.
    scale : ndarray of shape (2,), standard deviations of x and y in units of what process and
        noise expect together.
    left_out_median_m : median miss of a cast that is predicted from other actions.
    """

    process: GaussianProcess
    noise: CastNoise
    scale: np.ndarray
    left_out_median_m: float


def seen_by(base: ForwardModel, actions: np.ndarray) -> np.ndarray:
    """Return the inputs of the process, (n, 20): actions, the model's endpoints and its slopes."""
    slopes = base.slopes(actions).reshape(len(actions), -1)
    return np.concatenate([actions, base.predict(actions), slopes], axis=1)


def noise_terms(base: ForwardModel, actions: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return |σ| and |S| of `CastNoise`, (n, 2) [m]."""
    spread_m = np.linalg.norm(base.spread(actions), axis=1)
    slope_m = slope_size(base.slopes(actions), unit)
    return np.stack([spread_m, slope_m], axis=1)


def learn_departures(base: ForwardModel, casts: Examples, *, seed: int) -> Departures:
    """Learn how `casts` depart from where `base` lets them end.

    Nothing is held out: every action in turn is predicted from all others, in closed form
    (Rasmussen and Williams 2006, equation 5.12, for one cast of each).
    """
    away_m = casts.endpoints_m - base.predict(casts.actions)
    inputs = Normalisation.of(seen := seen_by(base, casts.actions))
    rms_m = max(float(np.sqrt(away_m.var(axis=0).mean())), _LEAST_M)
    outputs = Normalisation(away_m.mean(axis=0), np.full(2, rms_m))
    terms_m = noise_terms(base, casts.actions, inputs.scale[:6])
    typical_m = np.maximum(np.sqrt(np.square(terms_m).mean(axis=0)), _LEAST_M)
    with reproducible_torch(seed):
        fit = _Fit(
            torch.from_numpy(inputs.apply(seen)),
            torch.from_numpy(outputs.apply(away_m)),
            torch.from_numpy(np.square(terms_m / typical_m)),
            torch.from_numpy(1 / casts.weights),
            _repeats(casts.actions),
            (_LEAST_M / rms_m) ** 2,
        )
        believed, loss = fit.fitted()
    left_out_m = believed.misses.numpy() * rms_m
    expected_m = np.sqrt(believed.variances.numpy()) * rms_m
    of_spread, of_slope = rms_m * np.sqrt(believed.noises.numpy()) / typical_m
    median_m = float(np.median(np.linalg.norm(left_out_m, axis=1)))
    process = GaussianProcess(
        posterior=believed.posterior,
        exact=True,
        actions=inputs,
        endpoints=outputs,
        dataset="departures",
        facts={"real_casts": len(casts)},
        seed=seed,
        history=(Epoch(1, loss, loss, median_m),),
        size=Spread.plain(seen.shape[1]),
    )
    return Departures(
        process=process,
        noise=CastNoise(inputs.scale[:6], _LEAST_M, float(of_spread), float(of_slope)),
        scale=held_out_scale(left_out_m, expected_m, casts.weights),
        left_out_median_m=median_m,
    )


@dataclass(frozen=True)
class _Believed:
    """A fitted process, and what it says of each cast from other actions.

    Attributes
    ----------
    noises : tensor of shape (2,), factors of the noise terms.
    misses : tensor of shape (n, 2); variances : (n,), of one coordinate.
    """

    posterior: Posterior
    noises: torch.Tensor
    misses: torch.Tensor
    variances: torch.Tensor


@dataclass(frozen=True)
class _Numbers:
    """What the likelihood is maximized over, as logarithms of variances and lengths."""

    lengths: torch.Tensor
    variance: torch.Tensor
    noises: torch.Tensor

    @classmethod
    def of(cls, flat: torch.Tensor, inputs: int) -> "_Numbers":
        return cls(flat[:inputs].exp(), flat[inputs].exp(), flat[inputs + 1 :].exp())


@dataclass(frozen=True)
class _Fit:
    """The casts to fit to, in normalised units.

    Attributes
    ----------
    inputs : tensor of shape (n, d); away : (n, 2).
    terms : tensor of shape (n, 2), squares of the noise terms.
    lightness : tensor of shape (n,), by which the noise of a cast is larger than it would be.
    repeats : rows of each action.
    least : variance of the noise at least.
    """

    inputs: torch.Tensor
    away: torch.Tensor
    terms: torch.Tensor
    lightness: torch.Tensor
    repeats: Sequence[torch.Tensor]
    least: float

    def fitted(self) -> tuple[_Believed, float]:
        """Fit and weigh by turns; return what is believed and the loss of a cast."""
        d = self.inputs.shape[1]
        names = ["lengths"] * d + ["variance"] + ["noise"] * 2
        flat = np.array([_FIRST[name] for name in names])
        bounds = [_BOUNDS[name] for name in names]
        wild, loss = torch.ones(len(self.away), dtype=torch.float64), 0.0
        for _ in range(_ROUNDS):
            found = minimize(
                self._loss,
                flat,
                args=(wild,),
                jac=True,
                bounds=bounds,
                options={"maxfun": _EVALUATIONS},
            )
            flat, loss = found.x, float(found.fun)
            believed = self._believed(flat, wild)
            ratio = believed.misses.square().sum(dim=1) / believed.variances
            wild = ((_FREEDOM + ratio) / (_FREEDOM + 2)).clamp_min(1.0)
        return self._believed(flat, wild), loss / len(self.away)

    def _loss(self, flat: np.ndarray, wild: torch.Tensor) -> tuple[float, np.ndarray]:
        """Return the negative logarithm of likelihood times prior, and its gradient."""
        moved = torch.from_numpy(flat).requires_grad_()
        lower = torch.linalg.cholesky(self._covariance(moved, wild))
        told = torch.linalg.solve_triangular(lower, self.away, upper=False)
        mean, deviation = _LENGTH
        prior = ((moved[: self.inputs.shape[1]] - mean) / deviation).square().sum() / 2
        loss = told.square().sum() / 2 + 2 * lower.diagonal().log().sum() + prior
        loss.backward()
        return loss.item(), moved.grad.numpy()  # type: ignore[union-attr]

    def _noise(self, numbers: _Numbers) -> torch.Tensor:
        return (self.terms * numbers.noises).sum(dim=1) + self.least

    def _covariance(self, flat: torch.Tensor, wild: torch.Tensor) -> torch.Tensor:
        numbers = _Numbers.of(flat, self.inputs.shape[1])
        noise = self._noise(numbers) * self.lightness * wild
        kernel = numbers.variance * matern(self.inputs, self.inputs, numbers.lengths)
        return kernel + torch.diag(noise)

    def _believed(self, flat: np.ndarray, wild: torch.Tensor) -> _Believed:
        given = torch.from_numpy(flat)
        numbers = _Numbers.of(given, self.inputs.shape[1])
        lower = torch.linalg.cholesky(self._covariance(given, wild))
        known = torch.cholesky_inverse(lower).contiguous()  # row-major, as a file holds it
        weights = known @ self.away
        posterior = Posterior(
            points=self.inputs.contiguous(),
            lengths=numbers.lengths,
            variance=numbers.variance,
            noise=torch.zeros((), dtype=torch.float64),
            mean_weights=weights.contiguous(),
            known=known,
        )
        misses, variances = torch.empty_like(weights), torch.empty_like(weights[:, 0])
        for rows in self.repeats:
            unseen = torch.linalg.inv(known[rows][:, rows])
            misses[rows], variances[rows] = unseen @ weights[rows], unseen.diagonal()
        extra = self._noise(numbers) * (self.lightness * wild - 1)
        return _Believed(
            posterior, numbers.noises, misses, (variances - extra).clamp_min(self.least)
        )


def _repeats(actions: np.ndarray) -> list[torch.Tensor]:
    """Return the rows of each distinct action of actions (n, 6)."""
    which = np.unique(actions, axis=0, return_inverse=True)[1].ravel()
    return [torch.from_numpy(np.flatnonzero(which == k)) for k in range(which.max() + 1)]
