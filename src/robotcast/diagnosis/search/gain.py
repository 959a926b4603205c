"""Whether one revision predicts held-out trials better than another."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.search.floor import Floor
from robotcast.fitting.least_squares import Fit

SIGNIFICANT = 1e-3  # p-value below which a gain on held-out trials is more than luck
FAR = 4.0  # standard deviations, as the median of deviations tells them
LEAST_EXCESS = 0.05  # of what a model misses: a floor is not known better than that
UNDECIDED = 10.0  # times that: what a fit on its way may show
WORTHWHILE = 0.10  # of the excess over the noise floor that an effect must take away
LIKELY = 0.05  # p-value below which a gain is hardly luck, though not beyond doubt
MUCH = 0.25  # of the excess over the noise floor: so much is hardly taken away by accident


@dataclass(frozen=True)
class Gain:
    """What a revision saves on held-out trials.

    Attributes
    ----------
    percent : mean saving of average waypoint error, % of the scale.
    share : of what the earlier one misses more than repeats do (see `Floor`).
    p_value : one-sided, over groups of trials.
    """

    percent: float
    share: float
    p_value: float

    @property
    def pays(self) -> bool:
        """Tell whether the gain is both beyond luck and worth an effect."""
        return self.p_value < SIGNIFICANT and self.share > WORTHWHILE

    @property
    def may_pay(self) -> bool:
        """Tell whether it may yet pay, once the revision has been fitted to the end."""
        return self.p_value < UNDECIDED * SIGNIFICANT and self.share > WORTHWHILE / 2

    @property
    def promises(self) -> bool:
        """Tell whether it takes much away and is likely to do so on further trials too."""
        return self.p_value < LIKELY and self.share > MUCH


def gain(before: np.ndarray, after: np.ndarray, groups: np.ndarray, floor: Floor) -> Gain:
    """Compare two revisions' held-out errors (n_trials,), % of the scale."""
    saved = floor.misses(before) - floor.misses(after)
    least = LEAST_EXCESS * float(floor.misses(before).mean())
    share = float(saved.mean()) / max(floor.excess(before), least, 1e-9)
    return Gain(float((before - after).mean()), share, worse(saved, groups))


def seen_gain(inquiry: Inquiry, before: Fit, after: Fit, floor: Floor) -> Gain:
    """Compare two fits on the very trials that they were fitted to.

    What does not pay there hardly pays on trials held out, which cost as much again to simulate.
    """
    every = inquiry.everything
    errors = [
        inquiry.percent(inquiry.difference_of(fit.residual, every), every)[0]
        for fit in (before, after)
    ]
    return gain(errors[0], errors[1], inquiry.groups, floor)


def worse(extra: np.ndarray, groups: np.ndarray) -> float:
    """Return the one-sided p-value that what is extra (n_trials,) is not above zero.

    Groups are the sampling unit. What lies far from the bulk of them is drawn in to its edge
    before a t-test (Tukey and McLaughlin 1963): one diverged run would else drown all others.
    """
    n = groups.max() + 1
    mean = np.bincount(groups, extra, n) / np.bincount(groups, minlength=n)
    centre = np.median(mean)
    edge = FAR * 1.4826 * np.median(np.abs(mean - centre))
    mean = np.clip(mean, centre - edge, centre + edge)
    if n < 3 or mean.std() == 0:
        return 1.0
    return float(student.sf(mean.mean() / (mean.std(ddof=1) / np.sqrt(n)), n - 1))
