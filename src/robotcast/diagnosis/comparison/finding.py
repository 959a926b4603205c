"""One slice that holds more of the error than its size explains."""

from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.slice_sentence import heading_sentence, share_sentence
from robotcast.diagnosis.comparison.slices import Slice
from robotcast.diagnosis.rule import Slicing
from robotcast.diagnosis.wording import Wording


@dataclass(frozen=True)
class Finding:
    """One slice that holds more of the error than its size explains.

    Attributes
    ----------
    slice : the samples, to look at other predictions of them.
    sentence : one plain sentence.
    share_of_error : part of the squared error, 0 to 1.
    share_of_samples : 0 to 1; of errors along or across the path, their part of the directions.
    error_percent, elsewhere_percent : average error inside and outside in % of scale.
    p_value : that any slice stands out as much when the error depends on nothing; None for
        single trials, which are named for their size.
    """

    slice: Slice
    sentence: str
    share_of_error: float
    share_of_samples: float
    error_percent: float
    elsewhere_percent: float
    p_value: float | None


def find(
    some: Slice,
    shares: tuple[float, float],
    found: Misfit,
    used: np.ndarray,
    p_value: float | None,
    wording: Wording,
    slicing: Slicing,
) -> Finding:
    """Describe what a slice holds.

    Parameters
    ----------
    shares : of the squared error and of the samples.
    used : bool ndarray of shape (n_trials, k_max), the samples that take part.
    """
    inside = some.mask & used
    if some.directions is None:
        text = share_sentence(some, *shares, wording)
        elsewhere = found.distance[used & ~inside]
    else:
        text = heading_sentence(some, shares[0], found, inside, wording, slicing.steady)
        other = found.distance**2 - some.sizes(found) ** 2
        elsewhere = np.sqrt(np.maximum(other[inside], 0))
    to_percent = 100 / found.scale
    return Finding(
        slice=some,
        sentence=text,
        share_of_error=shares[0],
        share_of_samples=shares[1],
        error_percent=float(to_percent * some.sizes(found)[inside].mean()),
        elsewhere_percent=float(to_percent * elsewhere.mean()),
        p_value=p_value,
    )


def well_beyond(share_of_error: float, share_of_samples: float, slicing: Slicing) -> bool:
    """Tell whether a share of the error is worth a sentence."""
    surplus = share_of_error - share_of_samples
    return surplus >= slicing.beyond and share_of_error >= slicing.times * share_of_samples
