"""The page of model revisions: it reloads itself while a tuning runs, and stays afterwards."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from robotcast.reporting.html import environment, style, template
from robotcast.reporting.names import cable_name, method_name, rig_name, thousands
from robotcast.reporting.numbers import error, quantity
from robotcast.reporting.revisions.rungs import (
    Comparable,
    comparable,
    revision_name,
)
from robotcast.reporting.revisions.search_figure import search_figure
from robotcast.tuning.revisions import Revision
from robotcast.tuning.search import Batch

_ROOM = "robotcast.reporting.revisions"


@dataclass(frozen=True)
class Tuning:
    """A tuning that runs, or the last that ran.

    Attributes
    ----------
    split : which casts it is tuned to and judged on, as in its revision.
    trace : the batches so far.
    """

    cable: str
    rig: str
    split: str
    simulator: str
    optimizer: str
    effects: tuple[str, ...]
    noise_floor_percent: float | None
    trace: Sequence[Batch] = ()
    finished: bool = False


def revisions_page(revisions: Sequence[Revision], tuning: Tuning) -> str:
    """Return the page of all revisions beside the tuning that adds one to them."""
    groups = comparable(revisions)
    here = next((g for g in groups if g.split == tuning.split), None)
    made = environment()
    made.filters.update(error=error, quantity=quantity, thousands=thousands)
    made.filters.update(revision_name=revision_name, tuned_by=_tuned_by)
    return made.from_string(template(_ROOM, "page.html")).render(
        css=style(template(_ROOM, "revisions.css")),
        tuning=tuning,
        source=_source(tuning),
        kicker=_kicker(tuning),
        headline=_headline(tuning, here),
        here=here,
        ladder=here.figure() if here else None,
        search=_search(tuning, here),
        others=[g for g in groups if g is not here],
    )


def _tuned_by(revision: Revision) -> str:
    return method_name(revision.simulator, revision.optimizer)


def _source(tuning: Tuning) -> str:
    return f"Model revisions · {cable_name(tuning.cable)} · measured on the {rig_name(tuning.rig)}"


def _kicker(tuning: Tuning) -> str:
    method = method_name(tuning.simulator, tuning.optimizer)
    now = "Tuned" if tuning.finished else "Tuning now"
    return f"{now}: {revision_name(tuning.effects)}, {method}"


def _headline(tuning: Tuning, here: Comparable | None) -> str:
    own = _own(tuning, here) if tuning.finished else None
    if own is not None and here is not None:
        return _fallen(own, here.base_of(own))
    if not tuning.trace:
        return "The first batch is being simulated."
    best = error(tuning.trace[-1].best_percent)
    batches = len(tuning.trace)
    counted = f"{batches} batch{'es' if batches > 1 else ''}"
    return f"Best so far: {best} of cable length on the tuning casts, after {counted}."


def _own(tuning: Tuning, here: Comparable | None) -> Revision | None:
    """Return the revision that the tuning ended with."""
    wanted = (tuning.simulator, tuning.optimizer, tuple(sorted(tuning.effects)))
    found = here.revisions if here else ()
    return next((r for r in found if (r.simulator, r.optimizer, r.effects) == wanted), None)


def _fallen(own: Revision, base: Revision | None) -> str:
    reached = error(own.heldout_waypoint_error_percent)
    if base is None or base is own:
        return f"The error on held\u2011out casts is {reached} of cable length."
    before = base.heldout_waypoint_error_percent
    way = "fell" if own.heldout_waypoint_error_percent < before else "rose"
    added = revision_name(own.effects).removeprefix("+ ")
    return (
        f"With {added}, the error on held\u2011out casts {way} "
        f"from {error(before)} to {reached} of cable length."
    )


def _search(tuning: Tuning, here: Comparable | None) -> Markup | None:
    if not tuning.trace:
        return None
    marks: dict[str, float] = {}
    method: Any = (tuning.simulator, tuning.optimizer)
    for revision in here.revisions if here else ():
        if (revision.simulator, revision.optimizer) == method and not revision.effects:
            marks["base model"] = revision.tuning_waypoint_error_percent
    if tuning.finished and not tuning.effects:
        marks = {}
    return search_figure(tuning.trace, marks, tuning.noise_floor_percent)
