"""Naming the effect to which the model's predictions are most sensitive.

No residual is asked, nothing is projected out, nothing is tested: this is what a sensitivity
ranking alone can say.
"""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.hidden_effects.rivals.places import least_strengths, unit_rows


def raw_sensitivities(
    inquiry: Inquiry, base: Revision, candidates: Sequence[str]
) -> dict[str, float]:
    """Return how far each effect at its smallest probe moves the predictions.

    The root mean square over trials in units of the noise; of an effect with several strengths
    or places to try, the largest.
    """
    return {name: _largest_move(inquiry, base, name) for name in candidates}


def _largest_move(inquiry: Inquiry, base: Revision, name: str) -> float:
    places = least_strengths(inquiry.model.effects[name])
    rows = unit_rows(inquiry, base.fit.vector, [name], places)
    moved = inquiry.residuals((*base.effects, name))(rows, inquiry.everything) - base.fit.residual
    return float(np.sqrt((moved**2).sum(axis=2).mean(axis=1)).max())
