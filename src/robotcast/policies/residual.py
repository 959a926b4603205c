"""Networks of D_sim, corrected by how measured casts depart from them.

Where a simulator misses, it mostly misses smoothly in the action: a few hundred casts tell by how
much, although they are far too few to learn the casts themselves from. So networks learn D_sim,
and a Gaussian process learns what D_real leaves of it (residual physics: Zeng et al. 2020,
"TossingBot"; Ajay et al. 2018, "Augmenting Physical Simulators with Stochastic Neural Networks").

Its inputs are the action, where the networks let the cast end and how that end moves with the
action; its numbers are at the maximum of the marginal likelihood (Rasmussen and Williams 2006,
chapters 2 and 5). Casts are not equally sure: the networks know where their examples scattered and
how far the endpoint moves with the action; the few casts that nothing explains count little.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize

from robotcast.files import write_yaml
from robotcast.policies import forward_model
from robotcast.policies.datasets import Dataset, Examples, refuse_other_cables
from robotcast.policies.gaussian_process import GaussianProcess, matern
from robotcast.policies.training import Learner
from robotcast.running import Progress, silent

_BASE, _CORRECTION = "base", "correction"
_STEP = 0.02  # of the spread of an action's numbers, to see how the endpoint moves
_FREEDOM = 4.0  # degrees of freedom of Student's distribution, by which wild casts lose weight
_ROUNDS = 3  # of fitting and weighing
_EVALUATIONS = 100  # of the likelihood in a round
_LENGTH = 1.0, 1.0  # mean and deviation of the logarithm of a length, in spreads of the input
_LEAST_M = 1e-4  # what is never known of a cast
_FIRST_LOGS = math.log(2.0), 0.0, -2.0  # of lengths, variance and factors of the noise
_LOG_BOUNDS = (-2.0, 6.0), (-8.0, 6.0), (-24.0, 6.0)

Base = tuple[forward_model.LearnedModel, ...]
"""Members of an ensemble: their mean errs less by chance than each (Hansen and Salamon 1990)."""


@dataclass(frozen=True)
class Residual:
    """A base of several models, taken as their mean, and its correction.

    Casts of one action scatter by √(least² + (of_spread |σ|)² + (of_slope |S|)²), σ the spread that
    the base expects, S its slope for actions in units of their spread.
    """

    base: Base
    process: GaussianProcess  # of departures from the base [m], given what `_features` returns
    of_spread: float
    of_slope: float
    scale: np.ndarray  # (2,), standard deviations of x and y in units of both together
    left_out_median_m: float  # the median miss of a cast predicted from other actions
    facts: Mapping[str, Any]  # of D_sim and D_real

    def predict(self, actions: np.ndarray) -> np.ndarray:
        features, _ = _features(self.base, actions)
        return features[:, 6:8] + self.process.predict(features)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        features, slopes = _features(self.base, actions)
        terms_m = _noise_terms(self.base, actions, slopes, self.process.actions.scale[:6])
        parts = _LEAST_M, self.of_spread * terms_m[:, 0], self.of_slope * terms_m[:, 1]
        noise_m = np.sqrt(sum(np.square(part) for part in parts))
        doubt_m = self.process.doubt(features) * self.process.endpoints.scale[0]
        return np.hypot(doubt_m, noise_m)[:, None] * self.scale

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        # By differences: the process hears of the base's slopes, and networks' move in steps.
        steps = _STEP * self.process.actions.scale[:6]
        there, back = (actions[:, None] + sign * np.diag(steps) for sign in (1, -1))
        change = self.predict(there.reshape(-1, 6)) - self.predict(back.reshape(-1, 6))
        return change.reshape(len(actions), 6, 2).transpose(0, 2, 1) / (2 * steps)

    def save(self, folder: Path) -> None:
        """Write every model into a folder of its own and, last, policy.yaml."""
        for number, member in enumerate(self.base):
            member.save(folder / _BASE / str(number))
        self.process.save(folder / _CORRECTION)
        history = self.base[0].history  # each network keeps its own
        description = {
            "kind": "residual",
            "dataset": "mixed",
            "members": len(self.base),
            "noise": {"of_spread": self.of_spread, "of_slope": self.of_slope},
            "spread": self.scale.tolist(),
            "examples": dict(self.facts),
            "epochs": len(history),
            "best_epoch": forward_model.best_epoch(history).epoch,
            "validation_median_m": round(self.left_out_median_m, 6),
        }
        write_yaml(folder / forward_model.DESCRIPTION_FILE, description)


def _features(base: Base, actions: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the inputs of the process, (n, 20): actions, the base's endpoints and its slopes.

    And the slopes (n, 2, 6) of every member, which its spread rests on too.
    """
    slopes = [member.slopes(actions) for member in base]
    ends_m = np.mean([member.predict(actions) for member in base], axis=0)
    mean = np.mean(slopes, axis=0).reshape(len(actions), -1)
    return np.concatenate([actions, ends_m, mean], axis=1), slopes


def _noise_terms(
    base: Base, actions: np.ndarray, slopes: list[np.ndarray], unit: np.ndarray
) -> np.ndarray:
    """Return |σ| and |S| of `Residual`, (n, 2) [m]."""
    squares = [m.spread(actions, own) ** 2 for m, own in zip(base, slopes, strict=True)]
    spread_m = np.linalg.norm(np.sqrt(np.mean(squares, axis=0)), axis=1)
    return np.stack([spread_m, forward_model.slope_size(np.mean(slopes, axis=0), unit)], axis=1)


@dataclass(frozen=True)
class ResidualLearner:
    """Learns D_sim by the mean of several `members`, and what D_real leaves of it."""

    member: Learner
    members: int

    def __post_init__(self) -> None:
        if self.members < 1:
            raise ValueError(f"policy residual: members must be positive, got {self.members}")

    def fit(
        self,
        real: Dataset,
        simulated: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> Residual:
        """Learn both, the correction from the casts that D_real holds out too.

        The file `unfinished` is of the member in training (see `Learner.fit`); those before it
        are trained anew after a kill.
        """
        refuse_other_cables(real, simulated)
        members = []
        for number in range(self.members):

            def of_all(done: int, total: int, note: str = "", number: int = number) -> None:
                progress(number * total + done, self.members * total, note)

            own = int(np.random.SeedSequence((seed, 6, number)).generate_state(1)[0])
            fit = self.member.fit(simulated, seed=own, unfinished=unfinished, progress=of_all)
            members.append(fit)
        casts = real.training.joined(real.validation)
        return corrected(tuple(members), casts, {**simulated.facts, **real.facts}, seed=seed)

    def load(self, folder: Path) -> Residual:
        """Read back what `Residual.save` wrote."""
        description = forward_model.read_description(folder)
        members = range(description["members"])
        return Residual(
            base=tuple(self.member.load(folder / _BASE / str(k)) for k in members),
            process=GaussianProcess.load(folder / _CORRECTION),
            **description["noise"],
            scale=np.array(description["spread"]),
            left_out_median_m=description["validation_median_m"],
            facts=description["examples"],
        )


def corrected(base: Base, casts: Examples, facts: Mapping[str, Any], *, seed: int) -> Residual:
    """Learn how `casts` depart from where `base` lets them end; none is held out."""
    features, slopes = _features(base, casts.actions)
    departures_m = casts.endpoints_m - features[:, 6:8]
    inputs = forward_model.Normalisation.of(features)
    rms_m = max(float(np.sqrt(departures_m.var(axis=0).mean())), _LEAST_M)
    outputs = forward_model.Normalisation(departures_m.mean(axis=0), np.full(2, rms_m))
    terms_m = _noise_terms(base, casts.actions, slopes, inputs.scale[:6])
    typical_m = np.maximum(np.sqrt(np.square(terms_m).mean(axis=0)), _LEAST_M)
    with forward_model.reproducible_torch(seed):
        likelihood = _Likelihood(
            torch.from_numpy(inputs.apply(features)),
            torch.from_numpy(outputs.apply(departures_m)),
            torch.from_numpy(np.square(terms_m / typical_m)),
            torch.from_numpy(1 / casts.weights),
            casts.action_groups(),
            (_LEAST_M / rms_m) ** 2,
        )
        logs, inflation, loss = likelihood.maximized()
        tensors, misses, variances = likelihood.posterior(logs, inflation)
    left_out_m, expected_m = misses.numpy() * rms_m, np.sqrt(variances.numpy()) * rms_m
    scale = forward_model.held_out_scale(left_out_m, expected_m, casts.weights)
    of_spread, of_slope = (rms_m * np.sqrt(logs[-2:].exp().numpy()) / typical_m).tolist()
    median_m = float(np.median(np.linalg.norm(left_out_m, axis=1)))
    process = GaussianProcess(
        exact=True,
        **tensors,
        actions=inputs,
        endpoints=outputs,
        dataset="departures",
        facts={"real_casts": len(casts)},
        seed=seed,
        history=(forward_model.Epoch(1, loss / len(casts), loss / len(casts), median_m),),
    )
    return Residual(base, process, of_spread, of_slope, scale, median_m, facts)


@dataclass(frozen=True)
class _Likelihood:
    """Of departures at inputs, both normalised.

    Its logarithms (d + 3,) are of lengths and variance of the kernel and of factors of the noise.
    """

    inputs: torch.Tensor  # (n, d)
    departures: torch.Tensor  # (n, 2)
    terms: torch.Tensor  # (n, 2), of the noise: squares of |σ| and |S|
    lightness: torch.Tensor  # (n,), by what the noise of casts of less weight is larger
    groups: np.ndarray  # (n,), casts of one action share a number
    least: float  # variance of the noise

    def maximized(self) -> tuple[torch.Tensor, torch.Tensor, float]:
        """Fit, and weigh casts by how far they miss, by turns.

        Returns the logarithms, by what the noise of wild casts is inflated, (n,), and the loss.
        """
        counts = self.inputs.shape[1], 1, 2
        logs, bounds = np.repeat(_FIRST_LOGS, counts), np.repeat(_LOG_BOUNDS, counts, axis=0)
        inflation, loss = torch.ones(len(self.inputs), dtype=torch.float64), 0.0
        options = {"jac": True, "bounds": bounds, "options": {"maxfun": _EVALUATIONS}}
        for _ in range(_ROUNDS):
            best = minimize(self._loss, logs, args=(inflation,), **options)
            logs, loss = best.x, float(best.fun)
            _, misses, variances = self.posterior(torch.from_numpy(logs), inflation)
            ratio = misses.square().sum(dim=1) / variances
            inflation = ((_FREEDOM + ratio) / (_FREEDOM + 2)).clamp_min(1.0)
        return torch.from_numpy(logs), inflation, loss

    def _loss(self, logs: np.ndarray, inflation: torch.Tensor) -> tuple[float, np.ndarray]:
        """Return the negative logarithm of likelihood times prior, and its gradient."""
        moved = torch.from_numpy(logs).requires_grad_()
        lower = torch.linalg.cholesky(self._covariance(moved, inflation))
        whitened = torch.linalg.solve_triangular(lower, self.departures, upper=False)
        mean, deviation = _LENGTH
        prior = ((moved[:-3] - mean) / deviation).square().sum() / 2
        loss = whitened.square().sum() / 2 + 2 * lower.diagonal().log().sum() + prior
        loss.backward()
        return loss.item(), moved.grad.numpy()  # type: ignore[union-attr]

    def _covariance(self, logs: torch.Tensor, inflation: torch.Tensor) -> torch.Tensor:
        kernel = logs[-3].exp() * matern(self.inputs, self.inputs, logs[:-3].exp())
        return kernel + torch.diag(self._noise(logs) * self.lightness * inflation)

    def _noise(self, logs: torch.Tensor) -> torch.Tensor:
        return (self.terms * logs[-2:].exp()).sum(dim=1) + self.least

    def posterior(
        self, logs: torch.Tensor, inflation: torch.Tensor
    ) -> tuple[dict[str, Any], torch.Tensor, torch.Tensor]:
        """Return the tensors of `GaussianProcess`, and misses (n, 2) and variances (n,) of casts.

        Every action in turn is predicted from all others (Rasmussen and Williams 2006, eq. 5.12).
        """
        lower = torch.linalg.cholesky(self._covariance(logs, inflation))
        known = torch.cholesky_inverse(lower).contiguous()  # row-major, as a file holds it
        weights = (known @ self.departures).contiguous()
        misses, variances = torch.empty_like(weights), torch.empty_like(weights[:, 0])
        for group in range(self.groups.max() + 1):
            rows = torch.from_numpy(np.flatnonzero(self.groups == group))
            unseen = torch.linalg.inv(known[rows][:, rows])
            misses[rows], variances[rows] = unseen @ weights[rows], unseen.diagonal()
        extra = self._noise(logs) * (self.lightness * inflation - 1)
        process = {
            "points": self.inputs.contiguous(),
            "lengths": logs[:-3].exp(),
            "variance": logs[-3].exp(),
            "noise": torch.zeros((), dtype=torch.float64),
            "mean_weights": weights,
            "known": known,
        }
        return process, misses, (variances - extra).clamp_min(self.least)
