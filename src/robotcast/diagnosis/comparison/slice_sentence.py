"""A slice and its share of the error in one plain sentence."""

import numpy as np

from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.slices import Slice
from robotcast.diagnosis.wording import Wording


def share_sentence(
    some: Slice, share_of_error: float, share_of_samples: float, wording: Wording
) -> str:
    """Say which part of the error lies in a slice, and which part of the data that is."""
    unit = wording.trials if some.whole_trials else wording.samples
    return (
        f"{some.subject} hold {_percent(share_of_error)} of the squared error; "
        f"they are {_percent(share_of_samples)} of the {unit}."
    )


def heading_sentence(
    some: Slice,
    share_of_error: float,
    found: Misfit,
    used: np.ndarray,
    wording: Wording,
    part: float,
) -> str:
    """Say whether the error lies along or across the path, and on which side if on one.

    A mean error beyond `part` of its root mean square has a side.
    """
    signed = some.signed(found)[used & ~found.diverged[:, None]]
    steady = abs(signed.mean()) > part * np.sqrt((signed**2).mean())
    along = some.name.startswith("along")
    sides = (
        ("runs ahead", "lags behind") if along else ("passes on the left", "passes on the right")
    )
    remark = f": the prediction {sides[0 if signed.mean() > 0 else 1]}" if steady else ""
    way, other = ("along", "across") if along else ("across", "along")
    return (
        f"While {wording.mover} moves, {_percent(share_of_error)} of the squared error lies "
        f"{way} its path, not {other} it{remark}."
    )


def outstanding_sentence(
    name: str, count: int, share_of_error: float, n_trials: int, wording: Wording
) -> str:
    """Say that `count` single trials, called `name`, hold much of the error."""
    name = name[0].upper() + name[1:]
    holds = "holds" if count == 1 else "hold"
    return (
        f"{name} alone {holds} {_percent(share_of_error)} of the squared error; "
        f"there are {n_trials} {wording.trials}. What else is found leaves "
        f"{'it' if count == 1 else 'them'} out."
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
