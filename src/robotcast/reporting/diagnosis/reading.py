"""What a diagnosis says, read from the dict of `diagnosis.json`; what is not known yet is empty."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from robotcast.diagnosis.wording import PLAIN
from robotcast.reporting.ladder import Rung
from robotcast.reporting.names import effect_name
from robotcast.reporting.numbers import error

_NOT_ACTIONS = ("separates", "difference_percent", "why")


@dataclass(frozen=True)
class Size:
    """One parameter with its interval; `null` is the value at which the effect does nothing."""

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None
    null: float | None


@dataclass(frozen=True)
class Slice:
    """A part of the trials and the error in it, without and with an effect."""

    name: str
    before: float
    after: float


@dataclass(frozen=True)
class Ranked:
    """One effect of the ranking; errors in the diagnosis' unit, None where not computed."""

    effect: str
    text: str
    status: str
    p_value: float | None
    power: float | None
    predicted: float | None
    realised: float | None
    first_in_resamples: float | None
    sizes: tuple[Size, ...]
    confusable_with: tuple[str, ...]
    slices: tuple[Slice, ...]


@dataclass(frozen=True)
class Field:
    """The missing force as values over points.

    Attributes
    ----------
    axes : label of every coordinate, with its unit.
    points : rows of as many coordinates as there are axes.
    values : one row of components a point.
    """

    acts_on: str
    axes: tuple[str, ...]
    unit: str
    points: tuple[tuple[float, ...], ...]
    values: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Unexplained:
    """What no named effect explains; `explains` tells whether the field does, or comes nearest."""

    depends_on: str
    text: str
    heldout: float | None
    field: Field | None
    explains: bool = True


@dataclass(frozen=True)
class NextTrial:
    """A trial that would tell effects apart; `action` maps a name to its number."""

    action: Mapping[str, float]
    separates: tuple[str, ...]
    difference: float | None
    why: str


@dataclass(frozen=True)
class Diagnosis:
    """A diagnosis, whole or while it runs.

    Attributes
    ----------
    verdict : effect ids, or ("none",), or ("unknown",); empty while it is not known.
    code : "none", "named", "unknown" or "cannot tell"; empty while it is not known.
    output : the folder of the diagnosis, empty when not known.
    overrides : what was overridden of the simulator, for commands that go on with it.
    nearest : effects that came near to the verdict, where it names none.
    model : every effect of the last model of the ladder, those fixed in advance included.
    words : what trials and their groups are called (`Wording.as_dict`).
    conclusive : False when the trials are too few to confirm anything.
    pipeline : whether the stages know the model, so that their commands help.
    unit, error_name : "%" and "of cable length".
    doing : what the run is at, empty once it has finished.
    """

    words: Mapping[str, Any]
    conclusive: bool
    pipeline: bool
    verdict: tuple[str, ...]
    code: str
    sentence: str
    model: tuple[str, ...]
    confusion_sets: tuple[tuple[str, ...], ...]
    nearest: tuple[str, ...]
    unexplained: Unexplained | None
    rig: str
    measurements: str
    output: str
    overrides: tuple[str, ...]
    casts: int | None
    actions: int | None
    unit: str
    error_name: str
    notes: tuple[str, ...]
    noise_floor: float | None
    ladder: tuple[Rung, ...]
    ranking: tuple[Ranked, ...]
    next_trials: tuple[NextTrial, ...]
    base: tuple[Size, ...]
    comparison: Mapping[str, Any] | None
    simulated_casts: float | None
    seconds: float | None
    finished: bool
    doing: str

    @property
    def found(self) -> tuple[str, ...]:
        """The effects that the verdict names."""
        return tuple(v for v in self.verdict if v not in ("none", "unknown"))

    def ranked(self, effect: str) -> Ranked | None:
        """Return an effect of the ranking."""
        return next((r for r in self.ranking if r.effect == effect), None)


def read_diagnosis(plain: Mapping[str, Any]) -> Diagnosis:
    """Read the dict of `diagnosis.json`; keys that it lacks count as not known."""
    unit, _, rest = str(plain.get("error_unit") or "%").partition(" ")
    finished = bool(plain.get("finished", True))
    return Diagnosis(
        words=plain.get("words") or PLAIN.as_dict(0),
        conclusive=bool(plain.get("conclusive", True)),
        pipeline=bool(plain.get("pipeline")),
        verdict=tuple(plain.get("verdict") or ()),
        code=str(plain.get("code") or ""),
        sentence=str(plain.get("sentence") or ""),
        model=_model(plain),
        confusion_sets=tuple(tuple(s) for s in plain.get("confusion_set") or ()),
        nearest=tuple(plain.get("nearest") or ()),
        unexplained=_unexplained(plain.get("unexplained")),
        rig=str(plain.get("rig") or ""),
        measurements=str(plain.get("measurements") or ""),
        output=str(plain.get("output") or ""),
        overrides=tuple(plain.get("overrides") or ()),
        casts=plain.get("casts"),
        actions=plain.get("actions"),
        unit=unit,
        error_name=rest,
        notes=tuple(str(n) for n in plain.get("notes") or ()),
        noise_floor=_finite(plain.get("noise_floor_percent")),
        ladder=_rungs(plain.get("ladder") or (), _field_rung(plain), unit),
        ranking=tuple(_ranked(r) for r in plain.get("ranking") or ()),
        next_trials=tuple(_next_trial(a) for a in plain.get("next_actions") or ()),
        base=_sizes((plain.get("base") or {}).get("parameters")),
        comparison=plain.get("comparison") or None,
        simulated_casts=_finite(plain.get("simulated_casts")),
        seconds=_finite(plain.get("seconds")),
        finished=finished,
        doing="" if finished else str(plain.get("doing") or "starting"),
    )


def _model(plain: Mapping[str, Any]) -> tuple[str, ...]:
    rungs = plain.get("ladder") or ()
    named = (v for v in plain.get("verdict") or () if v not in ("none", "unknown"))
    return tuple(dict.fromkeys([*(rungs[-1].get("effects") or () if rungs else ()), *named]))


def _field_rung(plain: Mapping[str, Any]) -> Rung | None:
    """Return the rung of the fitted field, which no model has climbed yet."""
    unexplained = plain.get("unexplained") or {}
    reached = _typical(unexplained)
    if reached is None:
        return None
    depends_on = unexplained.get("depends_on") or "anything"
    return Rung("fitted field", reached, detail=f"any force by {depends_on}", kind="open")


def _rungs(plain: Sequence[Mapping[str, Any]], further: Rung | None, unit: str) -> tuple[Rung, ...]:
    rungs: list[Rung] = []
    before: frozenset[str] | None = None
    for entry in plain:
        effects = frozenset(entry.get("effects") or ())
        rungs.append(
            Rung(
                label=_label(effects, before),
                realised=_typical(entry),
                standard_error=_finite(entry.get("standard_error_percent")),
                detail=_detail(entry, unit),
                kind="base" if before is None else "model",
                compared_to=rungs[-1].realised if rungs else None,
            )
        )
        before = effects
    if further and rungs:
        rungs.append(replace(further, compared_to=rungs[-1].realised))
    return tuple(rungs)


def _typical(entry: Mapping[str, Any]) -> float | None:
    """Return the held-out error of the trial in the middle."""
    return _finite(entry.get("heldout_typical_error_percent"))


def _detail(entry: Mapping[str, Any], unit: str) -> str:
    means = (("mean", "heldout_waypoint_error_percent"), ("final", "heldout_final_error_percent"))
    known = ((name, _finite(entry.get(key))) for name, key in means)
    return ", ".join(f"{name} {error(value, unit)}" for name, value in known if value is not None)


def _label(effects: frozenset[str], before: frozenset[str] | None) -> str:
    """Say what a rung adds to the one before: "+ board tilt"."""
    if before is not None and before < effects:
        return " ".join(f"+ {effect_name(e)}" for e in sorted(effects - before))
    names = " + ".join(effect_name(e) for e in sorted(effects))
    return f"with {names}" if names else "base model"


def _ranked(plain: Mapping[str, Any]) -> Ranked:
    return Ranked(
        effect=str(plain["effect"]),
        text=str(plain.get("text") or ""),
        status=str(plain.get("status") or ""),
        p_value=_finite(plain.get("p_value")),
        power=_finite(plain.get("power")),
        predicted=_finite(plain.get("predicted_typical_error_percent")),
        realised=_finite(plain.get("realised_typical_error_percent")),
        first_in_resamples=_finite(plain.get("first_in_resamples")),
        sizes=_sizes(plain.get("parameters")),
        confusable_with=tuple(plain.get("confusable_with") or ()),
        slices=tuple(
            Slice(str(s["slice"]), float(s["before_percent"]), float(s["after_percent"]))
            for s in plain.get("slices") or ()
            if _finite(s.get("before_percent")) is not None
            and _finite(s.get("after_percent")) is not None
        ),
    )


def _sizes(plain: Mapping[str, Mapping[str, Any]] | None) -> tuple[Size, ...]:
    return tuple(
        Size(
            name=name,
            unit=str(given.get("unit") or "1"),
            value=float(given["value"]),
            low=_finite(given.get("low")),
            high=_finite(given.get("high")),
            null=_finite(given.get("null")),
        )
        for name, given in (plain or {}).items()
        if _finite(given.get("value")) is not None
    )


def _unexplained(plain: Mapping[str, Any] | None) -> Unexplained | None:
    if not plain:
        return None
    return Unexplained(
        depends_on=str(plain.get("depends_on") or ""),
        text=str(plain.get("text") or ""),
        heldout=_typical(plain),
        field=_field(plain.get("field")),
        explains=bool(plain.get("explains", True)),
    )


def _field(plain: Mapping[str, Any] | None) -> Field | None:
    if not plain or not plain.get("points"):
        return None
    pairs = [
        (_row(point), _row(value))
        for point, value in zip(plain["points"], plain["values"], strict=True)
    ]
    drawn = [pair for pair in pairs if all(math.isfinite(v) for row in pair for v in row)]
    return Field(
        acts_on=str(plain.get("acts_on") or ""),
        axes=tuple(str(a) for a in plain.get("axes") or ()),
        unit=str(plain.get("unit") or ""),
        points=tuple(point for point, _ in drawn),
        values=tuple(value for _, value in drawn),
    )


def _row(given: Any) -> tuple[float, ...]:
    cells = given if isinstance(given, Sequence) else (given,)
    return tuple(math.nan if cell is None else float(cell) for cell in cells)


def _next_trial(plain: Mapping[str, Any]) -> NextTrial:
    return NextTrial(
        action={
            k: float(v)
            for k, v in plain.items()
            if k not in _NOT_ACTIONS and isinstance(v, int | float)
        },
        separates=tuple(plain.get("separates") or ()),
        difference=_finite(plain.get("difference_percent")),
        why=str(plain.get("why") or ""),
    )


def _finite(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None
