"""What the data and the model do not allow to say, one plain sentence each."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.comparison.finding import Finding
from robotcast.diagnosis.comparison.misfit import Misfit
from robotcast.diagnosis.comparison.repeats import RepeatScatter
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Candidate
from robotcast.diagnosis.revision import Revision
from robotcast.diagnosis.wording import Wording, parameter_name

FEWEST_GROUPS = 8  # of different trials: with fewer, none can be held back for a fair test
NEAR_A_BOUND = 0.005  # of a parameter's range
BLUNDER = 5.0  # times what nine in ten of the other trials miss by: hardly the model's fault
IGNORED = 1e-4  # of the noise: a parameter whose whole range moves no trial by more is ignored


def too_few(inquiry: Inquiry) -> bool:
    """Tell whether the trials are too few to confirm anything."""
    return int(inquiry.groups.max()) + 1 < FEWEST_GROUPS


def held_at_null(candidate: Candidate) -> bool:
    """Tell whether an effect is configured so that it can never act."""
    return all(
        p.nominal == p.null if p.frozen else all(probe == p.null for probe in p.probes)
        for p in candidate.parameters
        if p.null is not None
    )


def notes_on_trials(
    inquiry: Inquiry, repeats: RepeatScatter, floor: float | None, wording: Wording
) -> list[str]:
    """Say what the trials lack before any model is asked; `floor` is None when unknown."""
    n, groups = len(inquiry.records), int(inquiry.groups.max()) + 1
    notes = []
    if too_few(inquiry):
        notes.append(
            f"The set has {counted(n, wording.trial, wording.trials)} of "
            f"{counted(groups, wording.group, wording.groups)}. At least {FEWEST_GROUPS} "
            f"different {wording.groups} are needed to hold some back and test an effect on them."
        )
    if repeats.strays:
        notes.append(
            f"{_numbered(repeats.strays, wording)} far from the repeats of the same "
            f"{wording.group} and were left out of the noise floor."
        )
    if floor is None:
        notes.append(
            f"No {wording.group} was repeated, so the noise floor is unknown and nobody can say "
            f"how much of the error is noise. To know it, repeat five {wording.groups} three "
            "times each."
        )
    return notes


def _numbered(trials: Sequence[int], wording: Wording) -> str:
    if len(trials) == 1:
        return f"{wording.trial.capitalize()} {trials[0]} lies"
    *first, last = map(str, trials)
    return f"{wording.trials.capitalize()} {', '.join(first)} and {last} lie"


def counted(n: int, one: str, many: str) -> str:
    """Return "1 cast" or "3 casts"."""
    return f"{n} {one if n == 1 else many}"


def notes_on_outliers(
    findings: Sequence[Finding], found: Misfit, error_unit: str, wording: Wording
) -> list[str]:
    """Name the trials that the model misses by so much that something else went wrong.

    Parameters
    ----------
    findings, found : of the best model.
    """
    slices = [f.slice for f in findings if f.slice.kind == "trial"]
    rows = [row for s in slices for row in np.flatnonzero(s.mask.any(axis=1)).tolist()]
    if not rows:
        return []
    usual = float(np.quantile(np.delete(found.sample_percent, rows), 0.9))
    numbers, percent = slices[0].trials, found.sample_percent
    return [
        _outlier(numbers[row], row, found, usual, error_unit, wording)
        for row in rows
        if percent[row] > BLUNDER * usual
    ]


def _outlier(
    trial: int, row: int, found: Misfit, usual: float, error_unit: str, wording: Wording
) -> str:
    percent, unit = found.sample_percent, wording.axis(0).unit
    distance = np.nanmean(found.distance[row])
    length = f" ({distance:.2g} {unit})" if unit else ""
    part = percent[row] / len(percent)
    return (
        f"{wording.trial.capitalize()} {trial} is off by {percent[row]:.1f} {error_unit}{length} "
        f"on average, where nine in ten of the others stay below {usual:.1f}. Check how it was "
        f"measured. It weighs little in the fits and does not decide; of the average error of "
        f"{percent.mean():.2f} it alone makes {part:.2f}."
    )


def is_ignored(base: Revision, k: int) -> bool:
    """Tell whether parameter `k` of a fitted revision changes no prediction."""
    return bool(np.abs(base.fit.jacobian[..., k]).max() < IGNORED)


def notes_on_parameters(inquiry: Inquiry, base: Revision, wording: Wording) -> list[str]:
    """Say which parameters of the base model cannot have been fitted."""
    notes = []
    for k, parameter in enumerate(inquiry.parameters(base.effects)):
        at = base.fit.vector[k]
        name = parameter_name(parameter.name, parameter.unit)
        if parameter.frozen:
            continue
        if is_ignored(base, k):
            notes.append(
                f"The model ignores {name}: changing it changes no prediction of these "
                f"{wording.trials}."
            )
        elif min(at, 1 - at) < NEAR_A_BOUND:
            end = parameter.upper if at > 0.5 else parameter.lower
            unit = "" if parameter.unit in ("", "1") else f" {parameter.unit}"
            notes.append(
                f"The fit pushed {name} to the end of its range, {end:g}{unit}: a wider range "
                "may change what is found."
            )
    return notes


def notes_on_effects(not_tried: Sequence[str], idle: Sequence[str]) -> list[str]:
    """Say which effects are held at their null: candidates, and effects that act from the start."""
    plain = {name: name.replace("_", " ").capitalize() for name in (*not_tried, *idle)}
    return [
        *(f"{plain[n]} is held where it does nothing, so it was not tried." for n in not_tried),
        *(f"{plain[n]} acts from the start, but is held where it does nothing." for n in idle),
    ]
