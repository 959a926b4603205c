"""The diagnosis page: one HTML file, made from the dict of `diagnosis.json` alone."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from robotcast.reporting.comparison import blocks
from robotcast.reporting.diagnosis.evidence import headline, kicker, rivals, state_of, tiles
from robotcast.reporting.diagnosis.field import field_figure, focus, strongest
from robotcast.reporting.diagnosis.reading import Diagnosis, NextTrial, read_diagnosis
from robotcast.reporting.diagnosis.slices import slices_figure
from robotcast.reporting.diagnosis.steps import next_steps
from robotcast.reporting.diagnosis.whiskers import in_words, shortly, whisker
from robotcast.reporting.diagnosis.writing import drafts
from robotcast.reporting.html import environment, style, template
from robotcast.reporting.ladder import ladder
from robotcast.reporting.names import effect_name, rig_name, thousands
from robotcast.reporting.numbers import error, number, p_value, share

_ROOM = "robotcast.reporting.diagnosis"
_UNTESTED = ("touches nothing", "ignored by the model")
_ACTIONS = {
    "theta1": ("θ₁", "rad"),
    "r1": ("r₁", "m"),
    "theta2": ("θ₂", "rad"),
    "r2": ("r₂", "m"),
    "alpha": ("α", "rad"),
    "vmax": ("v max", "m/s"),
}

STATUS_HINTS = {
    "confirmed": "refitted in full, and it lowers the error on held-out casts",
    "refitted": "refitted in full; the held-out error did not fall enough to keep it",
    "screened": "judged by a quick look only: too little promised to refit it",
    "touches nothing": "simulating it changes no prediction of this set, so it cannot be judged",
    "ignored by the model": "the simulator does not react to it at all",
    "your casts cannot tell": "its trace in these casts is too faint to say present or absent",
}


def diagnosis_page(diagnosis: Mapping[str, Any]) -> str:
    """Return the page of a diagnosis, whole or while it runs."""
    read = read_diagnosis(diagnosis)
    state = state_of(read)
    made = environment()
    made.filters.update(
        error=lambda value: error(value, read.unit),
        p_value=p_value,
        share=share,
        effect_name=effect_name,
        whisker=whisker,
        in_words=in_words,
        shortly=shortly,
    )
    return made.from_string(template(_ROOM, "page.html")).render(
        css=style(template(_ROOM, "diagnosis.css"), blocks.blocks_style()),
        d=read,
        state=state,
        kicker=kicker(read, state),
        headline=headline(read),
        source=_source(read),
        tiles=tiles(read),
        steps=next_steps(read, state),
        ladder=_ladder(read),
        judged=tuple(r for r in read.ranking if r.status not in _UNTESTED),
        untested=tuple(r for r in read.ranking if r.status in _UNTESTED),
        status_hints=STATUS_HINTS,
        named=set(read.found) | set(rivals(read)),
        explained=tuple((r, slices_figure(r.slices, read.unit)) for r in read.ranking if r.slices),
        missing=_missing(read),
        drafts=drafts(read.unexplained) if read.unexplained else (),
        next_table=next_table(read.next_trials),
        where=_where(read),
        casts=_casts(read),
        script=blocks.blocks_script(),
        run=_run(read),
    )


def _source(read: Diagnosis) -> str:
    """Say which data were diagnosed."""
    parts = [f"set {read.measurements}" if read.measurements else ""]
    if read.casts is not None:
        actions = f" of {read.actions} actions" if read.actions is not None else ""
        parts.append(f"{read.casts} casts{actions}")
    parts.append(f"measured on the {rig_name(read.rig)}" if read.rig else "")
    return " · ".join(part for part in parts if part)


def _ladder(read: Diagnosis) -> Markup | None:
    axis = f"average error on held-out casts [{read.unit} {read.error_name}".rstrip() + "]"
    return ladder(read.ladder, read.noise_floor, read.unit, axis) if read.ladder else None


@dataclass(frozen=True)
class _Missing:
    figure: Markup
    caption: str


def _missing(read: Diagnosis) -> _Missing | None:
    """Draw the missing force, if it was fitted as a field."""
    field = read.unexplained.field if read.unexplained else None
    if field is None or not field.points:
        return None
    caption = f"What {field.acts_on or 'the cable'} is missing: {strongest(field)}."
    aimed = focus(field)
    if aimed is not None:
        (x, y), towards = aimed
        way = "towards" if towards else "away from"
        caption += (
            f" The arrows point {way} one place, about "
            f"({number(float(x))}, {number(float(y))}), marked by the circle."
        )
    return _Missing(field_figure(field), caption)


@dataclass(frozen=True)
class NextTable:
    """The next trials as rows of text under columns of (name, unit)."""

    columns: tuple[tuple[str, str], ...]
    rows: tuple[tuple[tuple[str, ...], NextTrial], ...]


def next_table(trials: tuple[NextTrial, ...]) -> NextTable:
    """Lay out the next trials; columns are the numbers of their actions."""
    names = tuple(dict.fromkeys(name for t in trials for name in t.action))
    rows = tuple((tuple(number(t.action.get(n)) for n in names), t) for t in trials)
    return NextTable(tuple(_ACTIONS.get(n, (n, "")) for n in names), rows)


def _where(read: Diagnosis) -> tuple[tuple[str, Markup], ...]:
    """Return what the comparison shows of the base model's error, as (heading, block)."""
    if read.comparison is None:
        return ()
    shown = (
        ("The parts that hold most of the error", blocks.slices_block(read.comparison)),
        ("Error over time", blocks.time_block(read.comparison)),
        ("Error on the board", blocks.map_block(read.comparison)),
        ("Error against every number of the action", blocks.factors_block(read.comparison)),
    )
    return tuple((heading, block) for heading, block in shown if block)


def _casts(read: Diagnosis) -> Markup | None:
    """Return every cast, measured and predicted; a page that reloads itself cannot play them."""
    return blocks.casts_block(read.comparison) if read.comparison and read.finished else None


def _run(read: Diagnosis) -> tuple[tuple[str, str], ...]:
    """Return facts about the run as (name, text)."""
    facts = [("Data", _source(read))]
    if read.simulated_casts is not None:
        facts.append(("Simulated casts", thousands(read.simulated_casts)))
    if read.seconds is not None:
        minutes = f" ({read.seconds / 60:.1f} min)" if read.seconds >= 90 else ""
        facts.append(("Time", f"{read.seconds:.0f} s{minutes}"))
    if read.ranking:
        facts.append(("Effects tested", str(len(read.ranking))))
    return tuple(facts)
