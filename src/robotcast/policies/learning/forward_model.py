"""What every forward model answers, whatever it is made of (paper, "Policies")."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from robotcast.policies.learning.datasets import Dataset
from robotcast.policies.learning.training import Epoch
from robotcast.progress import Progress, silent


class Predictor(Protocol):
    """f_forw: where the free end comes to rest after an action."""

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Predict endpoints.

        Parameters
        ----------
        actions : ndarray of shape (n, 6), in the order and units of `ACTION_COLUMNS`.

        Returns
        -------
        ndarray of shape (n, 2): endpoints in the robot base's frame [m].
        """
        ...


class SmoothPredictor(Predictor, Protocol):
    """A predictor that knows its own gradient."""

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Return the endpoint's derivatives (n, 2, 6) by the numbers of actions (n, 6)."""
        ...


class UncertainPredictor(Predictor, Protocol):
    """A predictor that says how sure it is."""

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Return standard deviations (n, 2) [m] of a cast's endpoint about the prediction."""
        ...


class ForwardModel(SmoothPredictor, UncertainPredictor, Protocol):
    """A predictor that was learned, and can be kept."""

    @property
    def facts(self) -> Mapping[str, object]:
        """What is told of the examples; `cable` names the cable they are of, where known."""
        ...

    @property
    def history(self) -> tuple[Epoch, ...]:
        """One entry a pass over the training examples."""
        ...

    def save(self, folder: Path) -> None:
        """Write the model into `folder`; `policy.yaml` is written last."""
        ...


class Learner(Protocol):
    """One way to make a forward model: what conf/policy/*.yaml configures."""

    def fit(
        self,
        dataset: Dataset,
        *,
        seed: int,
        unfinished: Path | None = None,
        progress: Progress = silent,
    ) -> ForwardModel:
        """Learn a forward model; the same dataset and seed give the same bytes.

        Parameters
        ----------
        unfinished : file that keeps the state of the training, so that one that was killed goes
            on where it was; None keeps none.
        """
        ...

    def shortened(self, passes: int) -> "Learner":
        """Return a learner of at most so many passes over the examples, to try settings with."""
        ...

    def load(self, folder: Path) -> ForwardModel:
        """Read back what `ForwardModel.save` wrote."""
        ...
