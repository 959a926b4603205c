"""Which slices of the samples are worth a look: phases, places, speeds, headings, factors."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robotcast.diagnosis.comparison.misfit import padded, sample_mask
from robotcast.diagnosis.comparison.ranges import ranges, thirds
from robotcast.diagnosis.comparison.slices import Slice
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import RULE, Slicing
from robotcast.diagnosis.wording import Wording


def candidate_slices(
    records: Sequence[Record], wording: Wording, slicing: Slicing = RULE.slicing
) -> list[Slice]:
    """Return the slices that hold neither too little nor nearly all of the samples."""
    present = sample_mask(records)
    made: list[Slice] = []
    seen: set[tuple[bytes, str]] = set()
    for family in (_phases, _places, _speeds, _headings, _factors):
        for whole in family(records, wording, slicing):
            found = replace(whole, mask=whole.mask & present)
            key = (found.mask.tobytes(), found.name if found.directions is not None else "")
            if _worth_a_look(found, present, slicing) and key not in seen:
                seen.add(key)
                made.append(found)
    return made


def _worth_a_look(found: Slice, present: np.ndarray, slicing: Slicing) -> bool:
    share = found.mask.sum() / present.sum()
    most = slicing.largest if found.directions is None else 1.0
    touched = found.mask.any(axis=1).sum()
    return slicing.least <= share <= most and touched >= slicing.fewest


def _phases(records: Sequence[Record], wording: Wording, slicing: Slicing) -> Iterator[Slice]:
    """Runs of phases that follow each other, all of them together left out."""
    names = list(dict.fromkeys(name for record in records for name in record.phases))
    number = np.full(sample_mask(records).shape, -1)
    for row, record in zip(number, records, strict=True):
        for at, name in enumerate(names):
            if name in record.phases:
                row[: len(record.times_s)][record.times_s >= record.phases[name]] = at
    for first in range(len(names)):
        for last in range(first, len(names)):
            text = _run(names[first : last + 1])
            yield Slice(
                name=f"in {text}",
                kind="phase",
                subject=f"{wording.samples.capitalize()} in {text}",
                trials=_numbers(records),
                mask=(number >= first) & (number <= last),
            )


def _run(names: Sequence[str]) -> str:
    if len(names) > 2:
        return f"the phases from {names[0]} to {names[-1]}"
    return " and ".join(f"the {name}" for name in names)


def _places(records: Sequence[Record], wording: Wording, slicing: Slicing) -> Iterator[Slice]:
    """Ranges of every component of the measured signal; for two components also cells."""
    where = padded(records, [r.measured for r in records])
    for i in range(where.shape[-1]):
        axis = wording.axis(i)
        for part in ranges(where[..., i]):
            side = axis.above if math.isinf(part.high) else axis.below
            side = f" {side}" if side and not np.isfinite([part.low, part.high]).all() else ""
            text = f"{axis.name} {part.text(axis.unit)}"
            yield Slice(
                name=f"{side.strip()} ({text})" if side else text,
                kind="place",
                subject=f"{wording.samples.capitalize()}{side} ({text})",
                trials=_numbers(records),
                mask=part.holds(where[..., i]),
            )
    if where.shape[-1] == 2:
        first, second = wording.axis(0), wording.axis(1)
        for row in thirds(where[..., 0]):
            for column in thirds(where[..., 1]):
                text = (
                    f"{first.name} {row.text(first.unit)}, {second.name} {column.text(second.unit)}"
                )
                yield Slice(
                    name=text,
                    kind="place",
                    subject=f"{wording.samples.capitalize()} at {text}",
                    trials=_numbers(records),
                    mask=row.holds(where[..., 0]) & column.holds(where[..., 1]),
                )


def _speeds(records: Sequence[Record], wording: Wording, slicing: Slicing) -> Iterator[Slice]:
    speed = np.linalg.norm(_velocity(records), axis=-1)
    unit = f"{wording.axis(0).unit or 'units'}/s"
    for part in ranges(speed):
        text = part.text(unit, "faster than", "slower than", "at between")
        yield Slice(
            name=f"moving {text}",
            kind="speed",
            subject=f"{wording.samples.capitalize()} where {wording.mover} moves {text}",
            trials=_numbers(records),
            mask=part.holds(speed),
        )


def _headings(records: Sequence[Record], wording: Wording, slicing: Slicing) -> Iterator[Slice]:
    """Errors along and across the measured path, where the signal moves in the plane."""
    velocity = _velocity(records)
    if velocity.shape[-1] != 2:
        return
    speed = np.linalg.norm(velocity, axis=-1)
    fastest = np.nanmax(speed, axis=1)[:, None]
    moving = (speed > slicing.moving * fastest) & (fastest > 0)
    along = np.divide(
        velocity, speed[..., None], out=np.zeros_like(velocity), where=moving[..., None]
    )
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    for name, directions in (("along", along), ("across", across)):
        yield Slice(
            name=f"{name} the path",
            kind="heading",
            subject=f"Errors {name} the path",
            trials=_numbers(records),
            mask=moving,
            directions=directions,
        )


def _factors(records: Sequence[Record], wording: Wording, slicing: Slicing) -> Iterator[Slice]:
    k_max = sample_mask(records).shape[1]
    names = set.intersection(*(set(r.factors) for r in records))
    for name in (n for n in records[0].factors if n in names):
        values = np.array([r.factors[name] for r in records])
        for part in ranges(values):
            text = f"{name} {part.text(wording.factor_units.get(name, ''))}"
            yield Slice(
                name=text,
                kind=name,
                subject=f"{wording.trials.capitalize()} with {text}",
                trials=_numbers(records),
                mask=np.repeat(part.holds(values)[:, None], k_max, axis=1),
                whole_trials=True,
            )


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


def _numbers(records: Sequence[Record]) -> tuple[int, ...]:
    return tuple(r.trial for r in records)
