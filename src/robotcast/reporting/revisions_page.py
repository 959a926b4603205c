"""The page of model revisions: it reloads itself while a tuning runs, and stays afterwards."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from robotcast.reporting import names
from robotcast.reporting.page import render
from robotcast.reporting.style import (
    BLUE,
    GREEN,
    GREY,
    Bar,
    Row,
    bars,
    beside,
    canvas,
    fall,
    inline,
    log_marks,
    spread,
    style,
)
from robotcast.tuning.search import Batch
from robotcast.tuning.tuned import ModelRevision

_AXIS = "average waypoint error on held-out casts [% of cable length]"


@dataclass(frozen=True)
class Comparable:
    """Revisions that were tuned to the same casts and judged on the same others."""

    revisions: tuple[ModelRevision, ...]

    @property
    def best(self) -> ModelRevision:
        """The revision with the smallest held-out error; of equals, the one with fewer effects."""
        return min(self.revisions, key=lambda r: (r.heldout_waypoint_error_percent, len(r.effects)))

    def find(self, method: tuple[str, str], effects: Sequence[str]) -> ModelRevision | None:
        """Return the revision of a method, simulator and optimizer, with these effects."""
        wanted = (method, tuple(sorted(effects)))
        return next((r for r in self.revisions if (_method(r), r.effects) == wanted), None)

    def figure(self) -> Figure:
        """Draw the ladder."""
        return bars([*map(self._row, self.revisions)], _AXIS, self.revisions[0].noise_floor_percent)

    def _row(self, revision: ModelRevision) -> Row:
        method, reached = _method(revision), revision.heldout_waypoint_error_percent
        base = self.find(method, ()) if revision.effects else None
        above = base.heldout_waypoint_error_percent if base else None
        bar = Bar(
            reached,
            "model" if revision.effects else "before",
            fall(above, reached),
            spread(reached, revision.standard_error_percent),
            revision.predicted_waypoint_error_percent,
        )
        several = len(set(map(_method, self.revisions))) > 1
        final = f"final error {names.error(revision.heldout_final_error_percent)}"
        detail = names.method_name(*method) if several else final
        return Row(revision_name(revision.effects), (bar,), detail)


def comparable(revisions: Sequence[ModelRevision]) -> tuple[Comparable, ...]:
    """Sort revisions by the casts they were judged on, most revisions first."""
    groups: dict[tuple[str, str], list[ModelRevision]] = {}
    for revision in revisions:
        groups.setdefault((revision.cable, revision.split), []).append(revision)
    ordered = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    return tuple(Comparable(tuple(group)) for _, group in ordered)


def revision_name(effects: Sequence[str]) -> str:
    """("air_drag", "board_tilt") → + air drag + board tilt."""
    return " ".join(f"+ {names.effect_name(e)}" for e in effects) or "base model"


def _method(of: "ModelRevision | TuningProgress") -> tuple[str, str]:
    return of.simulator, of.optimizer


@dataclass(frozen=True)
class TuningProgress:
    """A tuning that runs, or the last that ran; `split` names its casts as in its revision."""

    cable: str
    rig: str
    split: str
    simulator: str
    optimizer: str
    effects: tuple[str, ...]
    noise_floor_percent: float | None
    trace: Sequence[Batch] = ()
    finished: bool = False


def revisions_page(revisions: Sequence[ModelRevision], tuning: TuningProgress) -> str:
    """Return the page of all revisions beside the tuning that adds one to them."""
    groups = comparable(revisions)
    here = next((g for g in groups if g.revisions[0].split == tuning.split), None)
    own = here.find(_method(tuning), tuning.effects) if here and tuning.finished else None
    base = here.find(_method(tuning), ()) if here else None
    apart = base if tuning.effects or not tuning.finished else None
    level = apart.tuning_waypoint_error_percent if apart else None
    return render(
        "revisions.html",
        tuning=tuning,
        cable=names.cable_name(tuning.cable),
        rig=names.rig_name(tuning.rig),
        method=names.method_name,
        name=revision_name,
        own=own,
        base=base if own else None,
        here=here,
        drawn=lambda group: inline(group.figure(), "Error ladder"),
        search=tuning.trace and inline(_search_figure(tuning, level), "The best error so far"),
        others=[g for g in groups if g is not here],
    )


@style(on_page=True)
def _search_figure(tuning: TuningProgress, base: float | None) -> Figure:
    """Draw the best error so far against the casts simulated for it, beside the base model's."""
    best = [batch.best_percent for batch in tuning.trace]
    casts = np.cumsum([batch.casts for batch in tuning.trace])
    figure, axes = canvas(480, 260, 52, 62, 14, 46)
    axes.step(casts, best, where="post", color=BLUE, lw=2.2)
    axes.plot(casts[-1], best[-1], "o", color=BLUE, ms=8, clip_on=False)
    beside(axes, names.error(best[-1]), casts[-1], best[-1], 8, -4, color=BLUE, weight="bold")
    floor = tuning.noise_floor_percent
    marks = ((base, f"base model {names.error(base)}", GREY, 4), (floor, "noise floor", GREEN, -13))
    for level, words, color, up in marks:
        if level:
            axes.axhline(level, color=color, lw=1, ls=(0, (3, 4)))
            beside(axes, words, casts[-1], level, -4, up, ha="right", size=11, color=color)
    known = [v for v in (*best, base, floor) if v]
    axes.set(xlim=(0, casts[-1]), yscale="log", ylim=(min(known) / 1.25, max(known) * 1.15))
    axes.grid(axis="x", visible=False)
    log_marks(axes.yaxis)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.xaxis.set_major_formatter(lambda value, _: names.thousands(value))
    axes.set(xlabel="simulated casts", ylabel="best error on tuning casts [%]")
    return figure
