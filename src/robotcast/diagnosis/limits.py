"""What the data and the model do not allow to say, one plain sentence each."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.found import Found
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.model import Candidate, Wording, parameter_name
from robotcast.diagnosis.repeats import RepeatScatter
from robotcast.diagnosis.rule import Rule
from robotcast.fitting.parameter import Parameter


def too_few(inquiry: Inquiry, rule: Rule) -> bool:
    """Tell whether the trials are too few to confirm anything."""
    return int(inquiry.groups.max()) + 1 < rule.fewest_groups


def held_at_null(candidate: Candidate) -> bool:
    """Tell whether an effect is configured so that it can never act."""
    return all(
        p.nominal == p.null if p.frozen else all(probe == p.null for probe in p.probes)
        for p in candidate.parameters
        if p.null is not None
    )


def notes_on_trials(
    inquiry: Inquiry,
    repeats: RepeatScatter,
    floor: float | None,
    wording: Wording,
    rule: Rule,
) -> list[str]:
    """Say what the trials lack before any model is asked; `floor` is None when unknown."""
    n, groups = len(inquiry.records), int(inquiry.groups.max()) + 1
    notes = []
    if too_few(inquiry, rule):
        notes.append(
            f"The set has {counted(n, wording.trial, wording.trials)} of "
            f"{counted(groups, wording.group, wording.groups)}. At least {rule.fewest_groups} "
            f"different {wording.groups} are needed to hold some back and test an effect on them."
        )
    if repeats.strays:
        strays = wording.numbered(repeats.strays).capitalize()
        notes.append(
            f"{strays} {'lies' if len(repeats.strays) == 1 else 'lie'} far from the repeats of the "
            f"same {wording.group}: left out of the noise floor."
        )
    if repeats.drift is not None:
        notes.append(
            f"Repeats that lie far apart in the session differ {repeats.drift:.1f} times as much "
            "as those that follow each other: something drifts over the session. The noise floor "
            f"is taken from {wording.trials} that follow each other."
        )
    elif floor is not None and repeats.groups and not repeats.far_apart:
        notes.append(
            f"No {wording.group} was repeated both soon and late in the session, so drift would "
            "not show: spread the repeats over the session."
        )
    if floor is None:
        notes.append(
            f"No {wording.group} was repeated, so the noise floor is unknown and nobody can say "
            f"how much of the error is noise. To know it, repeat five {wording.groups} three "
            "times each."
        )
    return notes


def counted(n: int, one: str, many: str) -> str:
    """Return "1 cast" or "3 casts"."""
    return f"{n} {one if n == 1 else many}"


def notes_on_outliers(inquiry: Inquiry, found: Found, wording: Wording) -> list[str]:
    """Name the trials that were measured wrongly, of which no model explains even a quarter."""
    kept, percent = found.known_scales.usual, found.top.errors.waypoint
    rows = np.flatnonzero(~kept)
    if not len(rows):
        return []
    off, one = [f"{percent[row]:.1f}" for row in rows], len(rows) == 1
    said = " and ".join(filter(None, [", ".join(off[:-1]), off[-1]]))
    which = wording.numbered([inquiry.records[row].trial for row in rows]).capitalize()
    return [
        f"{which} {'is' if one else 'are'} off by {said} {inquiry.model.error_unit} on average, "
        f"where the others are by {np.median(percent[kept]):.2g}, from the first {wording.samples} "
        f"on. Check how {'it was' if one else 'they were'} measured: "
        f"{'it decides' if one else 'they decide'} nothing and "
        f"{'is' if one else 'are'} left out of the typical error."
    ]


def is_ignored(base: Revision, k: int, rule: Rule) -> bool:
    """Tell whether parameter `k` of a fitted revision changes no prediction."""
    return bool(np.abs(base.fit.jacobian[..., k]).max() < rule.ignored)


def notes_on_parameters(
    inquiry: Inquiry, base: Revision, top: Revision, wording: Wording, rule: Rule
) -> list[str]:
    """Say which parameters of the base model cannot have been fitted, and which sizes ended early.

    `top` is the chosen model: a size at the end of its range that does something stands for more.
    """
    notes = []
    for k, parameter in enumerate(inquiry.parameters(base.effects)):
        name = parameter_name(parameter.name, parameter.unit)
        if not parameter.frozen and is_ignored(base, k, rule):
            notes.append(
                f"The model ignores {name}: changing it changes no prediction of these "
                f"{wording.trials}."
            )
        elif not parameter.frozen:
            notes += _note_on_end(parameter, base.fit.vector[k], name, rule)
    for effect in top.effects[len(base.effects) :]:
        of = inquiry.model.effects[effect]
        sizes = top.fit.vector[inquiry.entries(top.effects, effect)]
        for parameter, at in zip(of.parameters, sizes, strict=True):
            if parameter.null is not None:
                name = f"{parameter.name} of {effect.replace('_', ' ')}"
                notes += _note_on_end(parameter, at, name, rule)
    return notes


def _note_on_end(parameter: Parameter, at: float, name: str, rule: Rule) -> list[str]:
    """Say that a fit ended, `at` in units of the range, at an end where the parameter acts."""
    end = parameter.upper if at > 0.5 else parameter.lower
    if min(at, 1 - at) >= rule.at_bound or end == parameter.null:
        return []
    unit = "" if parameter.unit in ("", "1") else f" {parameter.unit}"
    return [
        f"The fit pushed {name} to the end of its range, {end:g}{unit}: a wider range may change "
        "what is found."
    ]


def notes_on_effects(not_tried: Sequence[str], idle: Sequence[str]) -> list[str]:
    """Say which effects are held at their null: candidates, and effects that act from the start."""
    plain = {name: name.replace("_", " ").capitalize() for name in (*not_tried, *idle)}
    return [
        *(f"{plain[n]} is held where it does nothing, so it was not tried." for n in not_tried),
        *(f"{plain[n]} acts from the start, but is held where it does nothing." for n in idle),
    ]
