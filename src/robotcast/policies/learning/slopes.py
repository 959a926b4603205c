"""How an endpoint moves with each number of the action, through a model's own gradient."""

from collections.abc import Callable

import numpy as np
import torch

from robotcast.policies.learning.reproducible import reproducible_torch


def row_slopes(function: Callable[[torch.Tensor], torch.Tensor], actions: np.ndarray) -> np.ndarray:
    """Differentiate a function of rows, (n, 6) → (n, 2), row by row.

    Returns
    -------
    ndarray of shape (n, 2, 6): the change of x and y [m] per unit of each action coordinate.
    """
    rows = torch.from_numpy(np.ascontiguousarray(actions, dtype=float)).requires_grad_()
    with reproducible_torch(0), torch.enable_grad():
        ends = function(rows)
        slopes = [torch.autograd.grad(ends[:, c].sum(), rows, retain_graph=True)[0] for c in (0, 1)]
    return torch.stack(slopes, dim=1).numpy()
