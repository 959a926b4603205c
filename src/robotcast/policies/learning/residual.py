"""A forward model of D_sim, corrected by how measured casts depart from it.

Where a simulator misses, it mostly misses smoothly in the action: a few hundred casts tell by how
much, although they are far too few to learn the casts themselves from. So one model learns
D_sim, and a Gaussian process learns what D_real leaves of it (residual physics: Zeng et al. 2020,
"TossingBot"; Ajay et al. 2018, "Augmenting Physical Simulators with Stochastic Neural Networks").
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from robotcast.files import write_text
from robotcast.policies.learning.datasets import Dataset, Examples, refuse_other_cables
from robotcast.policies.learning.forward_model import ForwardModel, Learner
from robotcast.policies.learning.gaussian_process import GaussianProcess
from robotcast.policies.learning.gaussian_process_learner import GaussianProcessLearner
from robotcast.policies.learning.spread import held_out_scale
from robotcast.policies.learning.storage import DESCRIPTION_FILE
from robotcast.policies.learning.training import Epoch, best_epoch
from robotcast.progress import Progress, silent

_BASE, _CORRECTION = "base", "correction"
_WILD = 2.0  # median departures: a cast that departs by so much has half its weight


@dataclass(frozen=True)
class Residual:
    """A base model and its correction.

    Attributes
    ----------
    scale : ndarray of shape (2,), standard deviations of x and y in units of what both expect.
    held_out_median_m : median miss of the measured casts held out from the correction.
    facts : what is told of D_sim and D_real together.
    """

    base: ForwardModel
    correction: GaussianProcess
    scale: np.ndarray
    held_out_median_m: float
    facts: Mapping[str, Any]

    @property
    def history(self) -> tuple[Epoch, ...]:
        """The passes of the base; the correction keeps its own."""
        return self.base.history

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        return self.base.predict(actions) + self.correction.predict(actions)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        return _relative(self.base, self.correction, actions)[:, None] * self.scale

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        return self.base.slopes(actions) + self.correction.slopes(actions)

    def save(self, folder: Path) -> None:
        """Write base and correction into folders of their own and, last, policy.yaml."""
        self.base.save(folder / _BASE)
        self.correction.save(folder / _CORRECTION)
        told = {
            "kind": "residual",
            "dataset": "mixed",
            "spread": self.scale.tolist(),
            "examples": dict(self.facts),
            "epochs": len(self.history),
            "best_epoch": best_epoch(self.history).epoch,
            "validation_median_m": round(self.held_out_median_m, 6),
        }
        write_text(folder / DESCRIPTION_FILE, yaml.safe_dump(told, sort_keys=False))


@dataclass(frozen=True)
class ResidualLearner:
    """Learns D_sim by one learner, and by another what D_real leaves of it.

    Attributes
    ----------
    base : of D_sim; correction : of the departures, which are few.
    """

    base: Learner
    correction: GaussianProcessLearner

    def fit(
        self,
        real: Dataset,
        simulated: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> Residual:
        """Learn both; the casts that D_real holds out set the size of the spread.

        Parameters
        ----------
        unfinished : file for the state of the base's training (see `Learner.fit`).
        """
        refuse_other_cables(real, simulated)
        base = self.base.fit(simulated, seed=seed, unfinished=unfinished, progress=progress)
        departures = Dataset(
            "departures of D_real",
            _departures(base, real.training),
            _departures(base, real.validation),
            _departures(base, real.calibration),
            real.facts,
        )
        correction = self.correction.fit(departures, seed=seed)
        out = real.calibration
        missed_m = out.endpoints_m - base.predict(out.actions) - correction.predict(out.actions)
        scale = held_out_scale(missed_m, _relative(base, correction, out.actions), out.weights)
        median_m = float(np.median(np.linalg.norm(missed_m, axis=1)))
        return Residual(base, correction, scale, median_m, {**simulated.facts, **real.facts})

    def load(self, folder: Path) -> Residual:
        """Read back what `Residual.save` wrote."""
        description = folder / DESCRIPTION_FILE
        if not description.exists():
            raise FileNotFoundError(f"{description} is missing: run the train stage first")
        told = yaml.safe_load(description.read_text(encoding="utf-8"))
        return Residual(
            self.base.load(folder / _BASE),
            self.correction.load(folder / _CORRECTION),
            np.array(told["spread"]),
            told["validation_median_m"],
            told["examples"],
        )


def _departures(base: ForwardModel, casts: Examples) -> Examples:
    """Return by how much casts depart from the base; wild ones weigh little."""
    away_m = casts.endpoints_m - base.predict(casts.actions)
    far = np.linalg.norm(away_m, axis=1)
    weights = 1 / (1 + (far / max(_WILD * np.median(far), 1e-3)) ** 2)
    return Examples(casts.actions, away_m, casts.weights * weights)


def _relative(base: ForwardModel, correction: GaussianProcess, actions: np.ndarray) -> np.ndarray:
    """Return the spread (n,) [m] that base and correction expect together."""
    both = base.spread(actions) ** 2 + correction.spread(actions) ** 2
    return np.sqrt(both.sum(axis=1))
