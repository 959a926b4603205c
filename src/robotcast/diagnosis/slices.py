"""Which slices of the samples are worth a look: phases, places, speeds, headings, factors."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, product

import numpy as np

from robotcast.diagnosis.misfit import Misfit, padded, sample_mask
from robotcast.diagnosis.model import Record, Wording
from robotcast.diagnosis.rule import SLICING

QUANTILES = (0.2, 0.25, 1 / 3, 0.4, 0.5, 0.6, 2 / 3, 0.75, 0.8)
FEW_VALUES = 6  # a quantity with no more different values is split between them


@dataclass(frozen=True)
class Range:
    """A range of one quantity: above `low` and not above `high`.

    Of a quantity with few values, all whole numbers, it may hold a `single` one.
    """

    low: float
    high: float
    decimals: int
    single: float | None = None

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Return where values lie inside; nowhere for NaN."""
        return (values > self.low) & (values <= self.high)

    def text(
        self, unit: str, above: str = "above", below: str = "below", between: str = "between"
    ) -> str:
        """Say the range: "above 1.6 rad", "below …", "between … and …"."""
        unit = f" {unit}" if unit not in ("", "1") else ""
        if self.single is not None:
            return f"{self.single:.0f}{unit}".replace("-", "−")
        low, high = (_number(bound, self.decimals) for bound in (self.low, self.high))
        if math.isinf(self.high):
            return f"{above} {low}{unit}"
        if math.isinf(self.low):
            return f"{below} {high}{unit}"
        return f"{between} {low} and {high}{unit}"


def ranges(values: np.ndarray) -> list[Range]:
    """Return the lower and upper parts of values at round numbers, and the middle third last.

    Of a quantity with few values, all whole numbers, also each of them.
    """
    distinct = np.unique(values[np.isfinite(values)])
    if len(distinct) < 2:
        return []
    decimals = max(0, math.ceil(-math.log10((distinct[-1] - distinct[0]) / 40)))
    singles: list[Range] = []
    if len(distinct) <= FEW_VALUES:
        cuts = (distinct[1:] + distinct[:-1]) / 2
        low, high = cuts[[0, -1]]
        if not (distinct % 1).any():  # numbers of things
            ends = zip([-math.inf, *cuts], [*cuts, math.inf], distinct.tolist(), strict=True)
            singles = [Range(float(a), float(b), decimals, one) for a, b, one in ends]
    else:
        quantiles = np.round(np.nanquantile(values, QUANTILES), decimals)
        cuts = np.unique(quantiles)
        low, high = quantiles[[2, 6]]
    below = [Range(-math.inf, float(cut), decimals) for cut in cuts]
    above = [Range(float(cut), math.inf, decimals) for cut in cuts]
    return [*singles, *below, *above, Range(float(low), float(high), decimals)]


def thirds(values: np.ndarray) -> list[Range]:
    """Return the lower, middle and upper third of values at round numbers."""
    found = ranges(values)
    if not found:
        return []
    middle = found[-1]
    return [
        Range(-math.inf, middle.low, middle.decimals),
        middle,
        Range(middle.high, math.inf, middle.decimals),
    ]


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", "−")


@dataclass(frozen=True)
class Slice:
    """Some samples of the trials, and a way to look at their errors."""

    name: str  # what it is in a few words, "in the coast"
    # "phase", "place", "speed", "heading", "signal", "trial" or the name of a factor; slices of one
    # kind say the same thing in different ways
    kind: str
    subject: str  # how a sentence on it begins, "Casts with alpha above 1.6 rad"
    mask: np.ndarray  # bool (n_trials, k_max)
    # unit vectors (n_trials, k_max, d) along which errors are taken; None for their whole length
    directions: np.ndarray | None = None
    whole_trials: bool = False  # it takes a trial with all its samples or not at all

    def signed(self, found: Misfit) -> np.ndarray:
        """Return every sample's error along the directions, else its length, (n_trials, k_max)."""
        if self.directions is None:
            return found.distance
        along = (found.error * self.directions).sum(axis=-1)
        # a diverged run misses by one scale, as far along as across
        return np.where(found.diverged[:, None], found.distance / np.sqrt(2), along)

    def sizes(self, found: Misfit) -> np.ndarray:
        """Return the size of every sample's error as the slice looks at it, (n_trials, k_max)."""
        return np.abs(self.signed(found))

    def percent(self, found: Misfit) -> float:
        """Return the average error inside in % of the scale, to see what a change mends."""
        return float(100 / found.scale * self.sizes(found)[self.mask & found.present].mean())


def candidate_slices(records: Sequence[Record], wording: Wording) -> list[Slice]:
    """Return the slices that hold neither too little nor nearly all of the samples."""
    present = sample_mask(records)
    made: list[Slice] = []
    seen: set[tuple[bytes, str]] = set()
    for family in (_phases, _places, _speeds, _headings, _signals, _factors):
        for whole in family(records, wording):
            found = replace(whole, mask=whole.mask & present)
            key = (found.mask.tobytes(), found.name if found.directions is not None else "")
            if _worth_a_look(found, present) and key not in seen:
                seen.add(key)
                made.append(found)
    return made


def _worth_a_look(found: Slice, present: np.ndarray) -> bool:
    share = found.mask.sum() / present.sum()
    most = SLICING.largest if found.directions is None else 1.0
    touched = found.mask.any(axis=1).sum()
    return SLICING.least <= share <= most and touched >= SLICING.fewest


def _phases(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    """Runs of phases that follow each other, all of them together left out."""
    names = list(dict.fromkeys(name for record in records for name in record.phases))
    number = np.full(sample_mask(records).shape, -1)
    for row, record in zip(number, records, strict=True):
        for at, name in enumerate(names):
            if name in record.phases:
                row[: len(record.times_s)][record.times_s >= record.phases[name]] = at
    for first, last in combinations_with_replacement(range(len(names)), 2):
        text = " and ".join(f"the {name}" for name in names[first : last + 1])
        if last - first > 1:
            text = f"the phases from {names[first]} to {names[last]}"
        subject = f"{wording.samples.capitalize()} in {text}"
        yield Slice(f"in {text}", "phase", subject, (number >= first) & (number <= last))


def _places(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    """Ranges of every component of the measured signal; for a place in a plane also cells."""
    where = padded(records, [r.measured for r in records])
    samples, plane = wording.samples.capitalize(), wording.in_plane(where.shape[-1])
    for i in range(where.shape[-1]):
        axis = wording.axis(i)
        values = where[..., i] * axis.scale
        for part in ranges(values):
            text = f"{axis.name} {part.text(axis.unit)}"
            name, subject = text, f"{samples} ({text})"
            side = axis.above if math.isinf(part.high) else axis.below
            if side and math.inf in (part.high, -part.low):
                name, subject = f"{side} ({text})", f"{samples} {side} ({text})"
            kind = "place" if plane else f"place of {axis.name}"
            yield Slice(name, kind, subject, part.holds(values))
    if plane:
        first, second, x, y = wording.axis(0), wording.axis(1), where[..., 0], where[..., 1]
        for across, up in product(thirds(x), thirds(y)):
            text = f"{first.name} {across.text(first.unit)}, {second.name} {up.text(second.unit)}"
            yield Slice(text, "place", f"{samples} at {text}", across.holds(x) & up.holds(y))


def _speeds(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    """Ranges of the speed; of signals with units of their own, of each and by its direction."""
    velocity = _velocity(records)
    axes = [wording.axis(i) for i in range(velocity.shape[-1])]
    apart = len({(axis.unit, axis.scale) for axis in axes}) > 1 or axes[0].scale != 1
    moving = [(wording.mover, "", axes[0].unit or "units", np.linalg.norm(velocity, axis=-1))]
    if apart:  # the rate of a velocity is none of these
        moving = [
            (axis.name, f" of {axis.name}", axis.unit, velocity[..., i] * axis.scale)
            for i, axis in enumerate(axes)
            if not axis.unit.endswith(("/s", "rpm"))
        ]
    for mover, of, unit, rate in moving:
        speed = np.abs(rate)
        parts = [
            (part.text(f"{unit}/s", "faster than", "slower than", "at between"), part.holds(speed))
            for part in ranges(speed)
        ]
        parts += [("upwards", rate > 0), ("downwards", rate < 0)] if apart else []
        for text, mask in parts:
            name = f"{mover} moving {text}" if of else f"moving {text}"
            subject = f"{wording.samples.capitalize()} where {mover} moves {text}"
            yield Slice(name, f"speed{of}", subject, mask)


def _headings(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    """Errors along and across the measured path, where the signal moves in the plane."""
    velocity = _velocity(records)
    if not wording.in_plane(velocity.shape[-1]):
        return
    speed = np.linalg.norm(velocity, axis=-1)
    fastest = np.nanmax(speed, axis=1)[:, None]
    moving = (speed > SLICING.moving * fastest) & (fastest > 0)
    along = np.divide(
        velocity, speed[..., None], out=np.zeros_like(velocity), where=moving[..., None]
    )
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    for name, directions in (("along", along), ("across", across)):
        yield Slice(f"{name} the path", "heading", f"Errors {name} the path", moving, directions)


def _signals(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    """Errors of every signal beside the others, where they are no place in a plane."""
    d = records[0].measured.shape[1]
    present = sample_mask(records)
    if wording.in_plane(d) or len(wording.axes) < 2:
        return
    for i, way in enumerate(np.eye(d)):
        name, directions = wording.axis(i).name, np.broadcast_to(way, (*present.shape, d))
        yield Slice(f"in {name}", "signal", name[0].upper() + name[1:], present, directions)


def _factors(records: Sequence[Record], wording: Wording) -> Iterator[Slice]:
    k_max = sample_mask(records).shape[1]
    for name, values in shared_factors(records).items():
        for part in ranges(values):
            text = f"{name} {part.text(wording.factor_units.get(name, ''))}"
            mask = np.repeat(part.holds(values)[:, None], k_max, axis=1)
            subject = f"{wording.trials.capitalize()} with {text}"
            yield Slice(text, name, subject, mask, whole_trials=True)


def shared_factors(records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Return the factors that all trials have, (n_trials,) each."""
    shared = set.intersection(*(set(r.factors) for r in records))
    names = [name for name in records[0].factors if name in shared]
    return {name: np.array([r.factors[name] for r in records], dtype=float) for name in names}


def _velocity(records: Sequence[Record]) -> np.ndarray:
    """Return the measured velocity at every sample, (n_trials, k_max, d)."""
    return padded(
        records,
        [
            np.gradient(r.measured, r.times_s, axis=0)
            if len(r.times_s) > 1
            else np.zeros_like(r.measured)
            for r in records
        ],
    )
