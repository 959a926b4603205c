"""How an endpoint moves with each number of the action, through a model's own gradient."""

from collections.abc import Callable

import torch

from robotcast.policies.learning.reproducible import in_parts


def row_slopes(
    function: Callable[[torch.Tensor], torch.Tensor], rows: torch.Tensor
) -> torch.Tensor:
    """Differentiate a function of rows, (n, 6) → (n, 2), row by row.

    Returns
    -------
    tensor of shape (n, 2, 6): the change of each output per unit of each input.
    """

    def of_part(part: torch.Tensor) -> torch.Tensor:
        with torch.inference_mode(False), torch.enable_grad():
            inputs = part.detach().requires_grad_()
            ends = function(inputs)
            slopes = [
                torch.autograd.grad(ends[:, c].sum(), inputs, retain_graph=True)[0] for c in (0, 1)
            ]
        return torch.stack(slopes, dim=1)

    return in_parts(of_part, rows)
