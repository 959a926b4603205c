"""Examples as the tensors that learning works on."""

from dataclasses import dataclass

import numpy as np
import torch

from robotcast.policies.learning.datasets import Examples
from robotcast.policies.learning.normalisation import Normalisation


@dataclass(frozen=True)
class Rows:
    """Normalised examples.

    Attributes
    ----------
    actions, endpoints : tensors of shape (n, 6) and (n, 2).
    weights : tensor of shape (n,).
    """

    actions: torch.Tensor
    endpoints: torch.Tensor
    weights: torch.Tensor

    @classmethod
    def of(
        cls,
        examples: Examples,
        actions: Normalisation,
        endpoints: Normalisation,
        dtype: torch.dtype,
    ) -> "Rows":
        """Normalise `examples`; their weights stay as they are."""
        columns = (
            actions.apply(examples.actions),
            endpoints.apply(examples.endpoints_m),
            examples.weights,
        )
        return cls(*(torch.from_numpy(np.ascontiguousarray(c)).to(dtype) for c in columns))
