"""Real diagnoses of a puck, small ones, one for every state of the page."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.next_trials import Further
from tests.diagnosis.sliding_puck import (
    DEAD,
    FAINT,
    LATE,
    SHEAR,
    SHIFT,
    TILT,
    TURN,
    WORDS,
    Mechanism,
    Puck,
    pushes,
)

TILTED, LATE_S = (0.06, -0.04), (0.1,)
LIVE = (TILT, LATE, SHIFT, TURN)
TOLD = {"pipeline": True, "rig": "virtual", "measurements": "b"}  # by the stage that diagnoses


def told(records: Sequence[Record], *effects: Mechanism, ignored: bool = False) -> list[dict]:
    """Return what a diagnosis tells, step by step; the last is the whole of it."""
    model, said = Puck(*effects, ignored=ignored), list[dict]()
    names = [effect.name for effect in effects if effect.depends_on is None]
    further = Further(Puck(*effects), pushes(5, groups=60, repeats=1))
    case = Case(model, records, names, wording=WORDS, further=lambda: further)
    diagnose(case, lambda known: said.append({**json.loads(json.dumps(known)), **TOLD}))
    return said


@cache
def tilted() -> list[dict[str, Any]]:
    return told(pushes(tilt=TILTED), *LIVE)


def effect() -> dict[str, Any]:
    return tilted()[-1]


def just_started() -> dict[str, Any]:
    return tilted()[0]


def running() -> dict[str, Any]:
    return next(one for one in tilted() if one["doing"].startswith("refitting"))


@cache
def none() -> dict[str, Any]:
    return told(pushes(), *LIVE)[-1]


@cache
def several() -> dict[str, Any]:
    return told(pushes(tilt=TILTED, late_clock=LATE_S), *LIVE)[-1]


@cache
def untestable() -> dict[str, Any]:
    """One effect is there; of two others nothing can be said."""
    return told(pushes(tilt=TILTED), TILT, DEAD, FAINT, ignored=True)[-1]


@cache
def confused() -> dict[str, Any]:
    few = pushes(0, groups=9, heading=(-0.08, 0.08), turn=(0.02,))
    return told(few, TILT, SHIFT, TURN, SHEAR)[-1]


@cache
def without_repeats() -> dict[str, Any]:
    return told(pushes(groups=30, repeats=1), *LIVE)[-1]


@cache
def too_few() -> dict[str, Any]:
    return told(pushes(groups=3, repeats=1, tilt=TILTED), *LIVE)[-1]


@cache
def unknown() -> dict[str, Any]:
    """A field explains what is missing; it is drawn as arrows on the board."""
    field = replace(SHEAR, text="a shear of the board", depends_on="place")
    said = told(pushes(shift=(0.15, 0.1)), TURN, field)[-1]
    return {**said, "unexplained": {**said["unexplained"], "explains": True, "field": pull_field()}}


def unknown_speed() -> dict[str, Any]:
    speeds = [0.1 * i for i in range(21)]
    field = {
        "acts_on": "every piece of the cable", "axes": ["speed [m/s]"], "unit": "m/s²",
        "points": [[v] for v in speeds], "values": [[-0.4 * v - 0.3 * v**2] for v in speeds],
    }  # fmt: skip
    left = {**unknown()["unexplained"], "depends_on": "speed", "field": field}
    return {**unknown(), "unexplained": left}


def pull_field() -> dict[str, Any]:
    points = [
        [0.35 + 0.15 * i, -0.6 + 0.2 * j]
        for i in range(7)
        for j in range(7)
        if (i - 3) ** 2 + (j - 3) ** 2 < 14
    ]
    values = [[1.2 * (1.05 - x), 1.2 * (-0.25 - y)] for x, y in points]
    return {
        "acts_on": "the free end", "endpoint": True, "axes": ["x [m]", "y [m]"], "unit": "m/s²",
        "points": points, "values": values,
    }  # fmt: skip


def near() -> dict[str, Any]:
    """Nothing is confirmed, but two effects came near."""
    alike = confused()
    pair = [[name] for name in alike["confusion_set"][0]]
    rows = [{**r, "status": r["status"].replace("confirmed", "refitted")} for r in alike["ranking"]]
    given = {"verdict": ["none"], "code": "none", "nearest": pair, "ranking": rows}
    sentence = "No effect of the library is confirmed. It may be one of two."
    return {**alike, **given, "ladder": alike["ladder"][:1], "sentence": sentence}


def with_gaps() -> dict[str, Any]:
    """A finished diagnosis in which everything that may be missing is."""
    first, *_ = effect()["ranking"]
    gaps = dict.fromkeys(("p_value", "power", "slices", "parameters"))
    unknown = dict.fromkeys(("noise_floor_percent", "casts", "simulated_casts", "base"))
    row = {**first, **gaps, "realised_typical_error_percent": None}
    return {**effect(), **unknown, "ranking": [row]}


STATES = {
    state.__name__: state
    for state in (
        none, near, effect, several, untestable, unknown, unknown_speed, confused, running,
        just_started, without_repeats, too_few, with_gaps,
    )
}  # fmt: skip
