"""How far a prediction is from measured trials, where, and which part effects take away."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from robotcast.diagnosis.found import Found
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.localise import Finding, any_of, localise, outstanding_trials
from robotcast.diagnosis.misfit import Misfit, known_median, misfit
from robotcast.diagnosis.model import PLAIN, Model, Record, Wording
from robotcast.diagnosis.repeats import RepeatScatter, TimeGrid, repeat_scatter
from robotcast.diagnosis.rule import RULE, Rule
from robotcast.diagnosis.slices import Slice, shared_factors
from robotcast.files import plain

LEAST_PART = 0.5  # of the trials that must still be seen at a time
FEWEST_FOR_A_TREND = 8
WINDOW_PART = 0.3  # of the trials that a running median looks at


def error_over_time(found: Misfit, grid: TimeGrid, noise: RepeatScatter) -> dict[str, np.ndarray]:
    """Return the error of all trials at the times of the grid, each (n_times,).

    The mean and the quartiles are in % of scale, as is the `noise`, the repeats' average deviation,
    NaN where unknown. Times at which less than half of the trials were seen are left out: they
    would show which trials are long, not how the error grows.
    """
    percent = 100 / found.scale * grid.place(found.distance)
    count = np.isfinite(percent).sum(axis=0)
    seen = count >= max(1, LEAST_PART * len(percent))
    percent = percent[:, seen]
    lower, median, upper = np.nanquantile(percent, (0.25, 0.5, 0.75), axis=0)
    return {
        "times_s": grid.times_s[seen],
        "mean": np.nanmean(percent, axis=0),
        "lower": lower,
        "median": median,
        "upper": upper,
        "noise": noise.over_time_percent[seen],
        "trials": count[seen],
    }


def median_phases(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return the median start [s] of every phase, over the trials that have it."""
    names = dict.fromkeys(name for record in records for name in record.phases)
    return [
        {"name": n, "start_s": float(np.median([r.phases[n] for r in records if n in r.phases]))}
        for n in names
    ]


def trends(records: Sequence[Record], found: Misfit) -> dict[str, dict[str, np.ndarray]]:
    """Return the error [% of scale] against every factor that all trials have and that varies.

    With it comes its running median: the middle of the errors of neighbouring trials along the
    factor, empty for fewer than eight trials. Medians that fall on one place are averaged.
    """
    errors = found.sample_percent
    factors = shared_factors(records).items()
    return {name: _trend(values, errors) for name, values in factors if np.ptp(values) > 0}


def _trend(values: np.ndarray, errors: np.ndarray) -> dict[str, np.ndarray]:
    order, window = np.argsort(values, kind="stable"), max(5, round(WINDOW_PART * len(values)))
    running = [np.empty(0), np.empty(0)]
    if len(values) >= FEWEST_FOR_A_TREND:
        along = (sliding_window_view(some[order], window) for some in (values, errors))
        places, medians = (np.median(windows, axis=-1) for windows in along)
        at, place = np.unique(places, return_inverse=True)
        running = [at, np.bincount(place, medians) / np.bincount(place)]
    return {
        "values": values,
        "errors": errors,
        "running_values": running[0],
        "running_median": running[1],
    }


@dataclass(frozen=True)
class Comparison:
    """One prediction beside the measured trials."""

    records: tuple[Record, ...]
    predicted: np.ndarray  # (n_trials, k_max, d)
    found: Misfit  # predicted minus measured
    error_unit: str
    wording: Wording
    # average error over a trial's samples, then over trials, in % of scale; a diverged trial
    # counts as one scale
    waypoint_error_percent: float
    final_error_percent: float  # median over the trials that ended of the error at the last sample
    repeats: RepeatScatter  # the noise floor
    findings: tuple[Finding, ...]  # the slices that hold most of the error
    course: Mapping[str, np.ndarray]

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data for JSON: no arrays, and null where nothing is known."""
        found, repeats = self.found, self.repeats
        return plain(
            {
                "error_unit": self.error_unit,
                "scale": found.scale,
                "words": self.wording.as_dict(found.error.shape[-1]),
                "waypoint_error_percent": self.waypoint_error_percent,
                "final_error_percent": self.final_error_percent,
                "noise_floor_percent": repeats.sample_percent,
                "noise_floor_final_percent": repeats.final_percent,
                "repeats": {"groups": repeats.groups, "trials": repeats.trials},
                "groups": len({r.together for r in self.records}),
                "diverged": [
                    r.trial for r, lost in zip(self.records, found.diverged, strict=True) if lost
                ],
                "slices": [_finding(f) for f in self.findings],
                "over_time": self.course,
                "phases": median_phases(self.records),
                "factors": trends(self.records, found),
                "trials": [self._trial(row) for row in range(len(self.records))],
            }
        )

    def _trial(self, row: int) -> dict[str, Any]:
        record, found = self.records[row], self.found
        k = len(record.times_s)
        return {
            "trial": record.trial,
            "group": record.group,
            "waypoint_percent": found.sample_percent[row],
            "final_percent": found.final_percent[row],
            "diverged": found.diverged[row],
            "factors": dict(record.factors),
            "phases": dict(record.phases),
            "times_s": record.times_s,
            "measured": record.measured,
            "predicted": self.predicted[row, :k],
            "errors_percent": 100 / found.scale * found.distance[row, :k],
        }


def compare(
    model: Model,
    records: Sequence[Record],
    predicted: np.ndarray,
    wording: Wording = PLAIN,
    rule: Rule = RULE,
) -> Comparison:
    """Compare a model's prediction (n_trials, k_max, d) with the measured trials.

    It is as `Model.predict` gives it for one parameter vector; NaN in any of a trial's samples
    marks a run that diverged. The `rule` says what counts as a repeat, and as noise.
    """
    found = misfit(records, predicted, model.scale)
    grid = TimeGrid.of(records)
    repeats = repeat_scatter(records, grid, model.scale, rule)
    exceptions = outstanding_trials(records, found, wording)
    noise = grid.at_samples(repeats.square_over_time, found.distance.shape[1])
    return Comparison(
        records=tuple(records),
        predicted=predicted,
        found=found,
        error_unit=model.error_unit,
        wording=wording,
        waypoint_error_percent=float(found.sample_percent.mean()),
        final_error_percent=known_median(found.final_percent),
        repeats=repeats,
        findings=tuple(localise(records, found, noise, exceptions, wording)),
        course=error_over_time(found, grid, repeats),
    )


def _finding(finding: Finding) -> dict[str, Any]:
    said = {key: value for key, value in vars(finding).items() if key != "slice"}
    return {"name": finding.slice.name, "kind": finding.slice.kind, **said}


class Explained:
    """Predictions of fitted revisions beside the trials; each revision is simulated once."""

    def __init__(self, inquiry: Inquiry, wording: Wording, rule: Rule) -> None:
        self._inquiry, self._wording, self._rule = inquiry, wording, rule
        self._predicted: dict[tuple[tuple[str, ...], bytes], np.ndarray] = {}
        self._compared: dict[tuple[tuple[str, ...], bytes], Comparison] = {}

    def comparison(self, revision: Revision) -> Comparison:
        """Compare a revision with all trials; diverged runs stay diverged."""
        key = (revision.effects, revision.fit.vector.tobytes())
        if key not in self._compared:
            inquiry, predicted = self._inquiry, self._prediction(revision)
            self._compared[key] = compare(
                inquiry.model, inquiry.records, predicted, self._wording, self._rule
            )
        return self._compared[key]

    def slices(self, found: Found) -> dict[str, list[dict[str, Any]]]:
        """Return for every refitted effect the base model's slices before and after it."""
        pairs = {n: map(self._misfit, pair) for n, pair in _before_and_after(found).items()}
        if not pairs:
            return {}
        slices = _usual_slices(self.comparison(found.base.revision))
        return {
            name: [
                {
                    "slice": some.name,
                    "before_percent": some.percent(before),
                    "after_percent": some.percent(after),
                }
                for some in slices
            ]
            for name, (before, after) in pairs.items()
        }

    def _misfit(self, revision: Revision) -> Misfit:
        inquiry = self._inquiry
        return misfit(inquiry.records, self._prediction(revision), inquiry.model.scale)

    def _prediction(self, revision: Revision) -> np.ndarray:
        """Return what a revision predicts, (n_trials, k_max, d)."""
        key = (revision.effects, revision.fit.vector.tobytes())
        if key not in self._predicted:
            inquiry, vector = self._inquiry, revision.fit.vector[None]
            difference = inquiry.differences(revision.effects, vector, inquiry.everything)[0]
            self._predicted[key] = inquiry.measured + difference
        return self._predicted[key]


def _usual_slices(base: Comparison) -> list[Slice]:
    """Return the slices that hold most of the error, without trials named for their size."""
    single = [f for f in base.findings if f.slice.kind == "trial"]
    usual = ~any_of(base.found, single)
    return [
        replace(f.slice, mask=f.slice.mask & usual)
        for f in base.findings
        if f.slice.kind != "trial"
    ]


def _before_and_after(found: Found) -> dict[str, tuple[Revision, Revision]]:
    """Return every judged effect's revisions without it and with it.

    Effects that are judged together only share the pair.
    """
    pairs: dict[str, tuple[Revision, Revision]] = {}
    if not found.judged:
        return pairs
    models = {frozenset(e): rung.revision for e, rung in found.judged.items()}
    base = found.base.revision
    for effects, rung in sorted(found.judged.items(), key=lambda item: item[0] == found.chosen):
        for name in effects[len(base.effects) :]:
            without = models.get(frozenset(effects) - {name}, base)
            pairs[name] = (without, rung.revision)
    return pairs
