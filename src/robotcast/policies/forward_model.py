"""What every forward model answers, whatever it is made of (paper, "Policies")."""

from pathlib import Path
from typing import Protocol

import numpy as np

from robotcast.policies.datasets import Dataset
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


class ForwardModel(Predictor, Protocol):
    """A predictor that can be kept."""

    def save(self, folder: Path) -> None:
        """Write the model into `folder`; `policy.yaml` is written last."""
        ...


class Learner(Protocol):
    """One way to make a forward model: what conf/policy/*.yaml configures."""

    def fit(self, dataset: Dataset, *, seed: int, progress: Progress = silent) -> ForwardModel:
        """Learn a forward model; the same dataset and seed give the same bytes."""
        ...

    def load(self, folder: Path) -> ForwardModel:
        """Read back what `ForwardModel.save` wrote."""
        ...
