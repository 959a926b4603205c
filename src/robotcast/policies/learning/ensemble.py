"""Several networks that differ in their random numbers, and what they say on average.

What one training gets wrong by chance, the mean of several hardly does (Hansen and Salamon 1990,
"Neural Network Ensembles").
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from robotcast.files import write_text
from robotcast.policies.learning.datasets import Dataset
from robotcast.policies.learning.forward_model import ForwardModel, Learner
from robotcast.policies.learning.storage import DESCRIPTION_FILE, read_description
from robotcast.policies.learning.training import Epoch
from robotcast.progress import Progress, silent


@dataclass(frozen=True)
class Ensemble:
    """The mean of several forward models of one dataset."""

    members: tuple[ForwardModel, ...]

    @property
    def facts(self) -> Mapping[str, object]:
        """What is told of the examples, which all members share."""
        return self.members[0].facts

    @property
    def history(self) -> tuple[Epoch, ...]:
        """The passes of the first member; each keeps its own."""
        return self.members[0].history

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints (n, 2) [m] of actions (n, 6)."""
        return np.mean([m.predict(actions) for m in self.members], axis=0)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m]: the members' in the mean square."""
        return np.sqrt(np.mean([m.spread(actions) ** 2 for m in self.members], axis=0))

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        return np.mean([m.slopes(actions) for m in self.members], axis=0)

    def save(self, folder: Path) -> None:
        """Write every member into a folder of its own and, last, policy.yaml."""
        for number, member in enumerate(self.members):
            member.save(folder / str(number))
        told: dict[str, Any] = {"kind": "ensemble", "members": len(self.members)}
        write_text(folder / DESCRIPTION_FILE, yaml.safe_dump(told, sort_keys=False))


@dataclass(frozen=True)
class EnsembleLearner:
    """Trains several models, one after another.

    Attributes
    ----------
    member : how each is trained; each has a seed of its own.
    members : how many.
    """

    member: Learner
    members: int

    def __post_init__(self) -> None:
        if self.members < 1:
            raise ValueError(f"an ensemble needs a member, got members={self.members}")

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> Ensemble:
        """Train every member on `dataset`.

        Parameters
        ----------
        unfinished : file for the state of the member in training (see `Learner.fit`); of those
            before it a training that was killed knows nothing and makes them anew.
        """
        members = []
        for number in range(self.members):

            def tell(done: int, total: int, note: str = "", before: int = number) -> None:
                progress(before * total + done, self.members * total, note)

            own = int(np.random.SeedSequence((seed, 6, number)).generate_state(1)[0])
            members.append(self.member.fit(dataset, seed=own, unfinished=unfinished, progress=tell))
        return Ensemble(tuple(members))

    def shortened(self, passes: int) -> "EnsembleLearner":
        """Return a learner of fewer passes for each member, to try settings with."""
        return replace(self, member=self.member.shortened(passes))

    def load(self, folder: Path) -> Ensemble:
        """Read back what `Ensemble.save` wrote."""
        count = read_description(folder)["members"]
        return Ensemble(tuple(self.member.load(folder / str(k)) for k in range(count)))
