"""The head of the page: the verdict, and the three or four numbers that carry it."""

import re
from dataclasses import dataclass
from typing import Literal

from robotcast.reporting.diagnosis.reading import Diagnosis, Ranked
from robotcast.reporting.names import effect_name
from robotcast.reporting.numbers import error, odds, share

State = Literal["running", "too few", "unknown", "none", "near", "open", "confused", "found"]

ENOUGH_POWER = 0.8

KICKERS: dict[State, str] = {
    "running": "Still running",
    "too few": "Too few data",
    "unknown": "Something is missing that has no name here",
    "none": "Nothing is missing that these {trials} could show",
    "near": "Not confirmed",
    "open": "No effect confirmed, and more than noise is left",
    "confused": "Missing effect found, hardly told from another",
    "found": "Missing effect found",
}


@dataclass(frozen=True)
class Tile:
    """One number in large type, what it is below, and a longer explanation on hover."""

    number: str
    label: str
    hint: str = ""


def state_of(diagnosis: Diagnosis) -> State:
    """Return which of the page's states the diagnosis is in."""
    if not diagnosis.finished:
        return "running"
    if diagnosis.code == "unknown" or (diagnosis.found and diagnosis.unexplained):
        return "unknown"
    if not diagnosis.conclusive or not diagnosis.ladder:
        return "too few"
    if diagnosis.found:
        return "confused" if rivals(diagnosis) else "found"
    if diagnosis.nearest:
        return "near"
    return "open" if diagnosis.unexplained or diagnosis.code == "cannot tell" else "none"


def kicker(diagnosis: Diagnosis, state: State) -> str:
    """Return the few words above the verdict."""
    if state == "confused":
        alike = " or ".join(effect_name(e) for e in rivals(diagnosis))
        return f"Missing effect found, hardly told from {alike}"
    if state == "found" and len(diagnosis.found) > 1:
        return f"{len(diagnosis.found)} missing effects found"
    if state == "near":
        return f"Not confirmed: {' or '.join(effect_name(e) for e in diagnosis.nearest)}"
    if state == "open" and diagnosis.noise_floor is None:
        return "No effect confirmed, and the noise is unknown"
    if state == "unknown" and diagnosis.found:
        return "An effect found, and more that has no name here"
    return KICKERS[state].format(trials=diagnosis.words["trials"])


def rivals(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the effects that the trials cannot tell from those that the verdict names."""
    named = set(diagnosis.found)
    others = [e for s in diagnosis.confusion_sets if named & set(s) for e in s]
    return tuple(dict.fromkeys(e for e in others if e not in named))


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence, with effects under readable names."""
    sentence = readable(diagnosis, diagnosis.sentence or _headline(diagnosis))
    so_far = "So far: " if diagnosis.sentence and not diagnosis.finished else ""
    return f"{so_far}{sentence}".replace(" %", "\u00a0%").replace("held-out", "held\u2011out")


def readable(diagnosis: Diagnosis, sentence: str) -> str:
    """Write the ids of effects in a sentence as names."""
    known = {r.effect for r in diagnosis.ranking} | set(diagnosis.found)
    ids = sorted((e for e in known if "_" in e), key=len, reverse=True)
    if not ids:
        return sentence
    pattern = rf"\b(?:{'|'.join(map(re.escape, ids))})\b"
    return re.sub(pattern, lambda found: effect_name(found[0]), sentence)


def _headline(diagnosis: Diagnosis) -> str:
    state = state_of(diagnosis)
    if state == "running":
        return f"No verdict yet: {diagnosis.doing}."
    if diagnosis.found:
        return f"The model lacks {' and '.join(effect_name(e) for e in diagnosis.found)}."
    return f"{kicker(diagnosis, state)}."


def tiles(diagnosis: Diagnosis) -> tuple[Tile, ...]:
    """Return the numbers that carry the verdict, the most telling first."""
    shown = [_fall(diagnosis) or _fitted(diagnosis), _floor(diagnosis)]
    ranked = [r for r in (diagnosis.ranked(e) for e in diagnosis.found) if r]
    if ranked:
        shown += [_chance(ranked), _stability(ranked[0], diagnosis.words["trials"])]
    elif diagnosis.conclusive:
        shown.append(_noticed(diagnosis))
    return tuple(tile for tile in shown if tile)


def _fall(diagnosis: Diagnosis) -> Tile | None:
    known = [r.realised for r in diagnosis.ladder if r.realised is not None and r.kind != "open"]
    if not known:
        return None
    unit = diagnosis.unit
    label = f"typical held-out error, {diagnosis.error_name}".rstrip(", ")
    held = "of the trial in the middle, of those that no model was fitted to"
    if len(known) == 1:
        return Tile(error(known[0], unit), label, f"Error {held}.")
    fall = f"{error(known[0], unit)} → {error(known[-1], unit)}"
    return Tile(fall, label, f"Error {held}: first and last model.")


def _fitted(diagnosis: Diagnosis) -> Tile | None:
    if diagnosis.comparison is None:
        return None
    percent = diagnosis.comparison["waypoint_error_percent"]
    label = f"error on the {diagnosis.words['trials']} it was fitted to"
    why = "A model always fits these better than others: no measure of how well it predicts."
    return Tile(error(percent, diagnosis.unit), label, why)


def _floor(diagnosis: Diagnosis) -> Tile | None:
    floor = diagnosis.noise_floor
    if floor is None and not diagnosis.finished:
        return None
    if floor is None:
        why = f"No {diagnosis.words['trial']} was repeated, so noise cannot be measured."
        return Tile("unknown", "noise floor", why)
    why = f"How far repeats of one {diagnosis.words['trial']} lie apart. No model can do better."
    return Tile(error(floor, diagnosis.unit), "noise floor from repeats", why)


def _chance(ranked: list[Ranked]) -> Tile | None:
    known = [r.p_value for r in ranked if r.p_value is not None]
    if not known:
        return None
    why = "How often chance alone would lower the error on held-out trials by as much."
    return Tile(odds(max(known)), "by chance alone", why)


def _stability(first: Ranked, trials: str) -> Tile | None:
    if first.first_in_resamples is None:
        return None
    why = f"The {trials} were drawn anew many times; so often the effect came out first."
    return Tile(share(first.first_in_resamples), "of resamples rank it first", why)


def _noticed(diagnosis: Diagnosis) -> Tile | None:
    powers = [r.power for r in diagnosis.ranking if r.power is not None]
    if not powers:
        return None
    seen = sum(p >= ENOUGH_POWER for p in powers)
    why = (
        "For these effects the power is at least 80 %: had one of them mattered, these "
        f"{diagnosis.words['trials']} would most likely have shown it. Of the others nothing is "
        "known."
    )
    return Tile(f"{seen} of {len(powers)}", "effects would have been noticed", why)
