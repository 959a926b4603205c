"""Where the error sits: the few slices that hold most of it, none of them by chance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotcast.diagnosis.misfit import Misfit
from robotcast.diagnosis.model import Record, Wording
from robotcast.diagnosis.rule import SLICING
from robotcast.diagnosis.slices import Slice, candidate_slices


def sentence(
    some: Slice,
    shares: tuple[float, float],
    found: Misfit,
    inside: np.ndarray,
    wording: Wording,
    alone: bool,
) -> str:
    """Say which part of the error lies in a slice, and which part of the data that is.

    Of errors along or across the path also on which side they lie, if on one.

    Parameters
    ----------
    shares : of the squared error and of the samples.
    inside : bool ndarray of shape (n_trials, k_max), the samples of the slice that take part.
    alone : whether it holds single trials, named for their size.
    """
    error, data = (f"{100 * share:.0f} %" for share in shares)
    if some.directions is not None and some.kind == "heading":
        signed = some.signed(found)[inside & ~found.diverged[:, None]]
        steady = abs(signed.mean()) > SLICING.steady * np.sqrt((signed**2).mean())
        way, other, *sides = ("along", "across", "runs ahead", "lags behind")
        if some.name.startswith("across"):
            way, other, *sides = ("across", "along", "passes on the left", "passes on the right")
        remark = f": the prediction {sides[0 if signed.mean() > 0 else 1]}" if steady else ""
        return (
            f"While {wording.mover} moves, {error} of the squared error lies "
            f"{way} its path, not {other} it{remark}."
        )
    if some.directions is not None:
        return (
            f"{some.subject} holds {error} of the squared error, each signal in units of "
            f"its own; it is one of {round(1 / shares[1])}."
        )
    if alone:
        holds, them = ("holds", "it") if some.mask.any(axis=1).sum() == 1 else ("hold", "them")
        return (
            f"{some.subject} alone {holds} {error} of the squared error; there are "
            f"{len(some.mask)} {wording.trials}. What else is found leaves {them} out."
        )
    unit = wording.trials if some.whole_trials else wording.samples
    return f"{some.subject} hold {error} of the squared error; they are {data} of the {unit}."


@dataclass(frozen=True)
class Finding:
    """One slice that holds more of the error than its size explains."""

    slice: Slice  # the samples, to look at other predictions of them
    sentence: str  # one plain sentence
    share_of_error: float  # part of the squared error, 0 to 1
    # 0 to 1; of errors along or across the path, their part of the directions
    share_of_samples: float
    error_percent: float  # average error inside in % of scale
    elsewhere_percent: float  # average error outside in % of scale
    # that any slice stands out as much when the error depends on nothing; None for single trials,
    # which are named for their size
    p_value: float | None


def find(
    some: Slice,
    shares: tuple[float, float],
    found: Misfit,
    used: np.ndarray,
    p_value: float | None,
    wording: Wording,
) -> Finding:
    """Describe what a slice holds.

    `shares` are of the squared error and of the samples; `used` are the samples that take part,
    bool (n_trials, k_max).
    """
    inside = some.mask & used
    if some.directions is None:
        elsewhere = found.distance[used & ~inside]
    else:
        other = found.distance**2 - some.sizes(found) ** 2
        elsewhere = np.sqrt(np.maximum(other[inside], 0))
    to_percent = 100 / found.scale
    return Finding(
        slice=some,
        sentence=sentence(some, shares, found, inside, wording, p_value is None),
        share_of_error=shares[0],
        share_of_samples=shares[1],
        error_percent=float(to_percent * some.sizes(found)[inside].mean()),
        elsewhere_percent=float(to_percent * elsewhere.mean()),
        p_value=p_value,
    )


def well_beyond(share_of_error: float, share_of_samples: float) -> bool:
    """Tell whether a share of the error is worth a sentence."""
    surplus = share_of_error - share_of_samples
    return surplus >= SLICING.beyond and share_of_error >= SLICING.times * share_of_samples


def outstanding_trials(
    records: Sequence[Record],
    found: Misfit,
    wording: Wording,
) -> list[Finding]:
    """Return one finding on the few trials that hold much of the error alone, or none."""
    square = np.where(found.present, found.distance**2, 0)
    size = np.sqrt(square.sum(axis=1) / found.present.sum(axis=1))
    usual = np.quantile(size, 0.9, method="lower")
    rows = np.flatnonzero(size > SLICING.outstanding * usual)
    if len(records) <= SLICING.fewest or not len(rows):
        return []
    rows = rows[np.argsort(-size[rows], kind="stable")]
    shares = (
        float(square[rows].sum() / square.sum()),
        float(found.present[rows].sum() / found.present.sum()),
    )
    if not well_beyond(*shares):
        return []
    mask = np.zeros_like(found.present)
    mask[rows] = found.present[rows]
    name = wording.numbered([records[row].trial for row in rows])
    made = Slice(name, "trial", name[0].upper() + name[1:], mask, whole_trials=True)
    return [find(made, shares, found, found.present, None, wording)]


PERMUTATIONS, SEED = 2000, 0


class Contrast:
    """The squared error inside slices against what their share of the samples would hold.

    The weight of a slice is the sum over samples of (m − f) s: m is 1 inside and 0 outside, f
    the slice's share of the samples, s the squared error. It is the sum of two parts over
    trials: how inside and outside differ within each trial, and how the trial's mean goes with
    the part of the trial that lies inside. When the error does not depend on the slice, the
    first may as well have the other sign in any trial, and the second may as well belong to any
    other trial. So whole trials are permuted, however the errors inside a trial hang together.
    For a slice with directions, the weight is the squared error along them less an equal part
    of the whole, and only its signs are permuted. The samples that take part are `used`, bool
    (n_trials, k_max).
    """

    def __init__(
        self, slices: Sequence[Slice], found: Misfit, used: np.ndarray, rng: np.random.Generator
    ) -> None:
        self._slices, self._found = slices, found
        self._rows = np.flatnonzero(used.any(axis=1))
        self._used = used[self._rows]
        self._masks = [some.mask[self._rows] & self._used for some in slices]
        self._size = self._used.sum(axis=1)
        self._part = np.array([mask.sum(axis=1) for mask in self._masks]) / self._size
        n = len(self._rows)
        self._signs = rng.choice([-1.0, 1.0], size=(PERMUTATIONS, n))
        self._orders = rng.permuted(np.tile(np.arange(n), (PERMUTATIONS, 1)), axis=1)

    def test(self, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return every slice's weight and p-value, each (n_slices,).

        They are of `square`, squared errors (n_trials, k_max). The p-value is the chance that any
        slice would stand out as much, every weight taken in its own standard deviations.
        """
        mean = np.where(self._used, square[self._rows], 0).sum(axis=1) / self._size
        within, lean = self._within(square, mean), self._lean()
        weight = within.sum(axis=1) + lean @ mean
        drawn = self._signs @ within.T + mean[self._orders] @ lean.T
        spread = np.maximum(drawn.std(axis=0), 1e-12 * (mean @ self._size))
        largest = (drawn / spread).max(axis=1)
        as_large = (largest[:, None] >= weight / spread).sum(axis=0)
        return weight, (1 + as_large) / (1 + PERMUTATIONS)

    def shares(self, at: int, square: np.ndarray) -> tuple[float, float]:
        """Return slice `at`'s share of `square` and of the samples.

        For a slice with directions, the share of the squared error that lies along them, and
        an equal part for every direction.
        """
        inside, own = self._masks[at], square[self._rows]
        if self._slices[at].directions is not None:
            along = self._slices[at].sizes(self._found)[self._rows] ** 2
            return float(along[inside].sum() / own[inside].sum()), 1 / self._found.error.shape[-1]
        return (
            float(own[inside].sum() / own[self._used].sum()),
            float(inside.sum() / self._used.sum()),
        )

    def without(self, at: int, square: np.ndarray) -> np.ndarray:
        """Return `square` with slice `at` brought to the level of the other samples."""
        if self._slices[at].directions is not None:
            return square
        own, inside = square[self._rows], self._masks[at]
        surplus = own[inside].mean() - own[self._used & ~inside].mean()
        level = square.copy()
        level[self._rows] -= np.where(inside, surplus, 0)
        return level

    def _within(self, square: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """Return how much more every slice holds of each trial than its part, (n_slices, n)."""
        own = square[self._rows]
        # along a direction it is the error itself: levels taken out of `square` have none
        whole = self._found.distance[self._rows] ** 2 / self._found.error.shape[-1]
        within = []
        for some, mask, part in zip(self._slices, self._masks, self._part, strict=True):
            if some.directions is None:
                held = np.where(mask, own, 0).sum(axis=1)
                within.append(held - part * self._size * mean)
            else:
                along = some.sizes(self._found)[self._rows] ** 2
                within.append(np.where(mask, along - whole, 0).sum(axis=1))
        return np.array(within)

    def _lean(self) -> np.ndarray:
        """Return how many more samples than its share every slice has of each trial."""
        share = (self._part * self._size).sum(axis=1) / self._size.sum()
        lean = (self._part - share[:, None]) * self._size
        lean[[some.directions is not None for some in self._slices]] = 0
        return lean


def any_of(found: Misfit, findings: Sequence[Finding]) -> np.ndarray:
    """Return which samples any of the findings holds, bool (n_trials, k_max)."""
    return np.any([np.zeros_like(found.present), *(f.slice.mask for f in findings)], axis=0)


def localise(
    records: Sequence[Record],
    found: Misfit,
    noise: np.ndarray,
    exceptions: Sequence[Finding],
    wording: Wording,
) -> list[Finding]:
    """Find the slices that hold most of the squared error, the weightiest first.

    Slices are taken one after another. Each must hold well more of the error than of the
    samples, also of that part of it which exceeds noise, and stand out when whole trials are
    permuted (see `Contrast`). What a chosen slice explains is taken out before the next is
    looked for, so that no two say the same. `noise` (n_trials, k_max) is the squared error that
    noise alone makes at every sample, 0 where it is not known. The `exceptions` are findings on
    single trials, which come first; their trials are left out here.
    """
    findings = list(exceptions)
    used = found.present & ~any_of(found, findings)
    square = found.distance**2
    excess = square - noise
    if excess[used].sum() < SLICING.excess * square[used].sum():
        return findings
    candidates = candidate_slices(records, wording)
    if not candidates:
        return findings
    contrast = Contrast(candidates, found, used, np.random.default_rng(SEED))
    remaining = square
    while len(findings) < SLICING.most:
        weight, p_value = contrast.test(remaining)
        eligible = [
            at
            for at in np.flatnonzero(p_value <= SLICING.level).tolist()
            if candidates[at].kind not in {f.slice.kind for f in findings}
            and well_beyond(*contrast.shares(at, square))
            and well_beyond(*contrast.shares(at, excess))
        ]
        if not eligible:
            break
        best = max(eligible, key=lambda at: weight[at])
        shares = contrast.shares(best, square)
        p = float(p_value[best])
        findings.append(find(candidates[best], shares, found, used, p, wording))
        remaining = contrast.without(best, remaining)
    return findings
