"""The diagnosis page: one HTML file, made from the dict of `diagnosis.json` alone."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from robotcast.diagnosis.limits import counted
from robotcast.diagnosis.wording import parameter_name
from robotcast.reporting.comparison import blocks
from robotcast.reporting.comparison.labels import factor_name
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
_UNTESTED = ("touches nothing", "ignored by the model", "held at its null")

STATUS_HINTS = {
    "confirmed": "refitted in full, and it lowers the error on held-out {trials}",
    "refitted": "refitted in full; the held-out error did not fall enough to keep it",
    "tried": "fitted to the beginnings of some {trials}: others explain them clearly better",
    "screened": "judged by a quick look only: too little promised to refit it",
    "touches nothing": "simulating it changes no prediction of this set, so it cannot be judged",
    "ignored by the model": "the model does not react to it at all",
    "held at its null": "it is configured so that it can never act",
    "your casts cannot tell": "its trace in these {trials} is too faint to say present or absent",
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
        status=lambda status: status.replace("casts", read.words["trials"]),
    )
    return made.from_string(template(_ROOM, "page.html")).render(
        css=style(template(_ROOM, "diagnosis.css"), blocks.blocks_style()),
        d=read,
        words=read.words,
        pairs=_pairs,
        parameter_name=parameter_name,
        state=state,
        kicker=kicker(read, state),
        headline=headline(read),
        source=_source(read),
        tiles=tiles(read),
        steps=next_steps(read, state),
        ladder=_ladder(read),
        judged=tuple(r for r in read.ranking if r.status not in _UNTESTED),
        untested=tuple(r for r in read.ranking if r.status in _UNTESTED),
        status_hints={n: h.format(**read.words) for n, h in STATUS_HINTS.items()},
        named=set(read.found) | set(rivals(read)),
        explained=tuple((r, slices_figure(r.slices, read.unit)) for r in read.ranking if r.slices),
        missing=_missing(read),
        drafts=drafts(read.unexplained) if read.unexplained and read.pipeline else (),
        next_table=next_table(read),
        collect=_collect(read),
        where=_where(read),
        casts=_casts(read),
        script=blocks.blocks_script(),
        run=_run(read),
    )


def _source(read: Diagnosis) -> str:
    """Say which data were diagnosed."""
    words = read.words
    parts = [f"set {read.measurements}" if read.measurements else ""]
    if read.casts is not None:
        of = f" of {counted(read.actions, words['group'], words['groups'])}" if read.actions else ""
        parts.append(f"{counted(read.casts, words['trial'], words['trials'])}{of}")
    parts.append(f"measured on the {rig_name(read.rig)}" if read.rig else "")
    return " · ".join(part for part in parts if part)


def _ladder(read: Diagnosis) -> Markup | None:
    trials = read.words["trials"]
    axis = f"typical error on held-out {trials} [{read.unit} {read.error_name}".rstrip() + "]"
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
    caption = f"What {field.acts_on or 'the model'} is missing: {strongest(field)}."
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


def next_table(read: Diagnosis) -> NextTable:
    """Lay out the next trials; columns are the numbers of their actions."""
    trials, units = read.next_trials, read.words["factor_units"]
    names = tuple(dict.fromkeys(name for t in trials for name in t.action))
    rows = tuple((tuple(number(t.action.get(n)) for n in names), t) for t in trials)
    return NextTable(tuple((factor_name(n), units.get(n, "")) for n in names), rows)


def _pairs(trial: NextTrial) -> str:
    """Say what a trial decides between."""
    named = [effect_name(e) for e in trial.separates]
    return " / ".join(named) if len(named) != 1 else f"{named[0]} / without"


def _collect(read: Diagnosis) -> str:
    """Return the command that runs the next trials on the configured rig."""
    if not (read.pipeline and read.output):
        return ""
    return f"python stages/collect.py collect.actions={shlex.quote(f'{read.output}/actions.csv')}"


def _where(read: Diagnosis) -> tuple[tuple[str, Markup], ...]:
    """Return what the comparison shows of the base model's error, as (heading, block)."""
    if read.comparison is None:
        return ()
    shown = (
        ("The parts that hold most of the error", blocks.slices_block(read.comparison)),
        ("Error over time", blocks.time_block(read.comparison)),
        ("Error on the board", blocks.map_block(read.comparison)),
        (
            f"Error against every number of the {read.words['group']}",
            blocks.factors_block(read.comparison),
        ),
    )
    return tuple((heading, block) for heading, block in shown if block)


def _casts(read: Diagnosis) -> Markup | None:
    """Return every cast, measured and predicted; a page that reloads itself cannot play them."""
    return blocks.casts_block(read.comparison) if read.comparison and read.finished else None


def _run(read: Diagnosis) -> tuple[tuple[str, str], ...]:
    """Return facts about the run as (name, text)."""
    facts = [("Data", _source(read))]
    if read.simulated_casts is not None:
        facts.append((f"Simulated {read.words['trials']}", thousands(read.simulated_casts)))
    if read.seconds is not None:
        minutes = f" ({read.seconds / 60:.1f} min)" if read.seconds >= 90 else ""
        facts.append(("Time", f"{read.seconds:.0f} s{minutes}"))
    if read.ranking:
        facts.append(("Effects tested", str(len(read.ranking))))
    return tuple(facts)
