"""How large errors are, and whether one model's are smaller than another's beyond luck."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robotcast.diagnosis.repeats import RepeatScatter
from robotcast.diagnosis.rule import Rule


def misses(errors: np.ndarray, unit: float) -> np.ndarray:
    """Return errors as a fit judges them, ½ ln(1 + (error / unit)²)."""
    return 0.5 * np.log1p((errors / unit) ** 2)


def typical(missed: np.ndarray, unit: float) -> float:
    """Return the error that misses by as much as the mean of `missed`: a robust mean error."""
    return float(unit * np.sqrt(np.expm1(2 * missed.mean()))) if len(missed) else 0.0


@dataclass(frozen=True)
class Floor:
    """By how much repeats of one trial differ: no model can do better."""

    # of the repeats in the middle, % of the scale; None when nothing is known
    percent: float | None
    unit: float  # errors are judged in units of it: the floor, or the least noise that is believed
    typical: float  # the repeats' typical error (see `typical`), % of the scale; 0 when not known
    # whether repeats may differ by more, and only the sensors' noise is known
    is_least: bool = False
    # what the model errs by because its step is no shorter, % of the scale; an effect that takes
    # away less, in squares, makes up for the step
    numerical: float = 0.0

    @classmethod
    def of(cls, repeats: RepeatScatter, least_percent: float) -> "Floor":
        """Take the floor from repeats; nothing is known of it when there are none."""
        if not repeats.deviations_percent:
            return cls(None, least_percent, 0.0)
        middle = float(np.median([own.mean() for own in repeats.deviations_percent]))
        unit = max(middle, least_percent)
        scatter = np.concatenate(repeats.deviations_percent)
        return cls(middle, unit, typical(misses(scatter, unit), unit))

    @classmethod
    def known(
        cls,
        percent: float,
        least_percent: float,
        is_least: bool = False,
        numerical: float = 0.0,
    ) -> "Floor":
        """Take the floor from elsewhere; less than the least is not believed."""
        unit = max(percent, least_percent)
        return cls(unit, unit, unit, is_least, numerical)

    @property
    def reach(self) -> float:
        """The least typical error that a model can be expected to reach, % of the scale."""
        return max(self.typical, self.unit)

    def is_step(self, worse: float, better: float) -> bool:
        """Tell whether the model's own step may be all that parts two typical errors, squared."""
        return worse**2 - max(better, self.numerical) ** 2 < self.numerical**2

    def above(self, errors: np.ndarray, times: float) -> bool:
        """Tell whether errors (n_trials,) lie so many times above the floor.

        The typical error is asked, beside the repeats', and the trial in the middle.
        """
        if self.percent is None or not len(errors):
            return False
        whole = typical(misses(errors, self.unit), self.unit)
        middle = float(np.median(errors))
        return whole > times * self.reach or middle > times * self.unit


@dataclass(frozen=True)
class Gain:
    """What one model saves over another on held-out trials."""

    share: float  # by how much the typical error falls, of `Scales.base`
    rest: float  # of what the worse model misses beyond the floor; 0 where it stands at the floor
    p_value: float  # one-sided, over groups of trials
    far: bool = False  # the worse model is farther above the floor than honest models differ by
    small: bool = False  # it stands at the floor already, which only the sensors' noise tells

    def matters(self, rule: Rule, part: float = 1.0) -> bool:
        """Tell whether it is large enough, or a part of large enough, to be looked at."""
        return self.share > part * self._least(rule) or self.rest > part * rule.mostly

    def _least(self, rule: Rule) -> float:
        return rule.mostly if self.small else rule.material

    def pays(self, rule: Rule, comparisons: int) -> bool:
        """Tell whether the gain is worth a name and beyond luck, one of so many looked at.

        It must matter beside what was there at first; beside what is left only where that is more
        than honest models differ by.
        """
        worth = self.share > self._least(rule) or (self.far and self.rest > rule.mostly)
        return worth and self.p_value < rule.level / max(comparisons, 1)

    def promises(self, rule: Rule) -> bool:
        """Tell whether it matters and is likely there on further trials too."""
        return self.matters(rule) and self.p_value < rule.equal


@dataclass(frozen=True)
class Scales:
    """What errors are compared by."""

    floor: Floor
    # typical error of the base model, or of none where that predicts better, % of the scale
    base: float
    groups: np.ndarray  # of every trial, numbered from 0; the sampling units
    usual: np.ndarray  # bool (n_trials,), trials that were not measured wrongly
    rule: Rule

    def gain(self, before: np.ndarray, after: np.ndarray) -> Gain:
        """Compare two models' errors (n_trials,)."""
        missed = [misses(errors[self.usual], self.floor.unit) for errors in (before, after)]
        first, second = (typical(one, self.floor.unit) for one in missed)
        second = max(second, self.floor.numerical)  # below, an effect makes up for the step
        groups = np.unique(self.groups[self.usual], return_inverse=True)[1]
        p_value = worse(missed[0] - missed[1], groups, self.rule.far)
        if self.floor.is_step(first, second):
            return Gain(0.0, 0.0, p_value)
        above = self.floor.percent is not None and first > self.rule.at_floor * self.floor.reach
        rest = (first - second) / (first - self.floor.reach) if above else 0.0
        far = above and first > self.rule.beyond * self.floor.reach
        small = self.floor.is_least and not above
        return Gain((first - second) / max(self.base, 1e-12), rest, p_value, far, small)

    def typical(self, errors: np.ndarray) -> float:
        """Return the typical error of usual trials."""
        return typical(misses(errors[self.usual], self.floor.unit), self.floor.unit)


def usual(low: Sequence[np.ndarray], floor: Floor, rule: Rule) -> np.ndarray:
    """Return which trials were not measured wrongly, bool (n_trials,).

    A trial of which every model misses even the best quarter by far was; `low` is what each model
    misses of that, (n_trials,) each.
    """
    best = np.min(low, axis=0)
    return best <= rule.blunder * max(float(np.median(best)), floor.unit)


def worse(extra: np.ndarray, groups: np.ndarray, far: float) -> float:
    """Return the one-sided p-value that what is extra (n_trials,) is not above zero.

    Groups are the sampling unit. What lies far from the bulk of them is drawn in to its edge,
    `far` standard deviations from the middle, before a t-test (Tukey and McLaughlin 1963): one
    diverged run would else drown all others.
    """
    n = int(groups.max(initial=-1)) + 1
    if n < 3:
        return 1.0
    mean = group_means(extra, groups)
    centre = np.median(mean)
    edge = far * 1.4826 * np.median(np.abs(mean - centre))
    mean = np.clip(mean, centre - edge, centre + edge)
    if mean.std() == 0:
        return 1.0
    return float(student.sf(mean.mean() / (mean.std(ddof=1) / np.sqrt(n)), n - 1))


def group_means(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the mean of trials' values (n_trials,) in every group, (n_groups,)."""
    return np.bincount(groups, values) / np.bincount(groups)
