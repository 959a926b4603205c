"""How well a model in training predicts casts held out from it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotcast.policies.learning.datasets import Examples
from robotcast.policies.learning.normalisation import Normalisation


@dataclass(frozen=True)
class Held:
    """Casts held out from training, as a model sees them.

    Attributes
    ----------
    actions, endpoints : how the model's inputs and outputs are normalised.
    outlier_m : misses far below it count as their square, those far above hardly more as they grow.
    """

    examples: Examples
    actions: Normalisation
    endpoints: Normalisation
    outlier_m: float

    def judge(self, predict: Callable[[np.ndarray], np.ndarray]) -> tuple[float, float]:
        """Return the loss by which passes are compared, and the median miss [m].

        The loss is the weighted mean of Cauchy's function log(1 + (miss / outlier)²): the few
        whip-like casts, which no smooth function explains, must not decide which pass is the best.

        Parameters
        ----------
        predict : normalised actions (n, 6) → normalised endpoints (n, 2).
        """
        predicted_m = self.endpoints.undo(predict(self.actions.apply(self.examples.actions)))
        misses_m = np.linalg.norm(predicted_m - self.examples.endpoints_m, axis=1)
        costs = np.log1p((misses_m / self.outlier_m) ** 2)
        loss = float(np.average(costs, weights=self.examples.weights))
        return loss, float(np.median(misses_m))
