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
from robotcast.policies.learning.datasets import Dataset, refuse_other_cables
from robotcast.policies.learning.departures import (
    CastNoise,
    Departures,
    learn_departures,
    seen_by,
)
from robotcast.policies.learning.forward_model import ForwardModel, Learner
from robotcast.policies.learning.gaussian_process import GaussianProcess
from robotcast.policies.learning.storage import DESCRIPTION_FILE, read_description
from robotcast.policies.learning.training import Epoch, best_epoch
from robotcast.progress import Progress, silent

_BASE, _CORRECTION = "base", "correction"
_STEP = 0.02  # of the spread of an action's numbers, to see how the endpoint moves


@dataclass(frozen=True)
class Residual:
    """A base model and its correction.

    Attributes
    ----------
    facts : what is told of D_sim and D_real together.
    """

    base: ForwardModel
    correction: Departures
    facts: Mapping[str, Any]

    @property
    def history(self) -> tuple[Epoch, ...]:
        """The passes of the base."""
        return self.base.history

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        seen = seen_by(self.base, actions)
        return seen[:, 6:8] + self.correction.process.predict(seen)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        process = self.correction.process
        unsure_m = process.doubt(seen_by(self.base, actions)) * process.endpoints.scale[0]
        noise_m = self.correction.noise(self.base, actions)
        return np.hypot(unsure_m, noise_m)[:, None] * self.correction.scale

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6).

        By central differences: the correction hears of the base's slopes, and those of networks
        move in steps.
        """
        steps = _STEP * self.correction.noise.unit
        there, back = (actions[:, None] + sign * np.diag(steps) for sign in (1, -1))
        change = self.predict(there.reshape(-1, 6)) - self.predict(back.reshape(-1, 6))
        return change.reshape(len(actions), 6, 2).transpose(0, 2, 1) / (2 * steps)

    def save(self, folder: Path) -> None:
        """Write base and correction into folders of their own and, last, policy.yaml."""
        self.base.save(folder / _BASE)
        self.correction.process.save(folder / _CORRECTION)
        noise = self.correction.noise
        told = {
            "kind": "residual",
            "dataset": "mixed",
            "noise": {**vars(noise), "unit": noise.unit.tolist()},
            "spread": self.correction.scale.tolist(),
            "examples": dict(self.facts),
            "epochs": len(self.history),
            "best_epoch": best_epoch(self.history).epoch,
            "validation_median_m": round(self.correction.left_out_median_m, 6),
        }
        write_text(folder / DESCRIPTION_FILE, yaml.safe_dump(told, sort_keys=False))


@dataclass(frozen=True)
class ResidualLearner:
    """Learns D_sim by another learner, and what D_real leaves of it.

    Attributes
    ----------
    base : how D_sim is learned.
    """

    base: Learner

    def fit(
        self,
        real: Dataset,
        simulated: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> Residual:
        """Learn both. The correction learns from the casts that D_real holds out too.

        Parameters
        ----------
        unfinished : file for the state of the base's training (see `Learner.fit`).
        """
        refuse_other_cables(real, simulated)
        base = self.base.fit(simulated, seed=seed, unfinished=unfinished, progress=progress)
        casts = real.training.joined(real.validation)
        correction = learn_departures(base, casts, seed=seed)
        return Residual(base, correction, {**simulated.facts, **real.facts})

    def load(self, folder: Path) -> Residual:
        """Read back what `Residual.save` wrote."""
        told = read_description(folder)
        noise = {**told["noise"], "unit": np.array(told["noise"]["unit"])}
        correction = Departures(
            GaussianProcess.load(folder / _CORRECTION),
            CastNoise(**noise),
            np.array(told["spread"]),
            told["validation_median_m"],
        )
        return Residual(self.base.load(folder / _BASE), correction, told["examples"])
