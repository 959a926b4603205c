"""A whole diagnosis of any model, told step by step as the dict of `diagnosis.json`."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from robotcast.diagnosis.answer import limits, report
from robotcast.diagnosis.answer.explained import Explained
from robotcast.diagnosis.comparison.repeats import RepeatScatter, repeat_scatter
from robotcast.diagnosis.further.contests import open_contests
from robotcast.diagnosis.further.next_trials import Further, NextTrial, next_trials
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Model, Record
from robotcast.diagnosis.outlook import Outlook
from robotcast.diagnosis.plain import plain
from robotcast.diagnosis.revision import Revision, fit_base
from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.found import Effort, Found, Rung
from robotcast.diagnosis.search.nearest import came_near
from robotcast.diagnosis.search.rounds import search
from robotcast.diagnosis.search.screen import Screened, looks
from robotcast.diagnosis.search.stability import first_in_resamples
from robotcast.diagnosis.search.unexplained import Unexplained, look_for_the_unknown
from robotcast.diagnosis.time_grid import TimeGrid
from robotcast.diagnosis.wording import PLAIN, Wording
from robotcast.progress import Progress, silent

Tell = Callable[[dict[str, Any]], object]
Draw = Callable[[Inquiry, Unexplained], Mapping[str, Any] | None]


@dataclass(frozen=True)
class Case:
    """What is diagnosed.

    Attributes
    ----------
    candidates : names of the effects to try, fields left out: they come when nothing else pays.
    fixed : effects that act from the start.
    floor : noise floor in % of the scale where it is known from elsewhere than from repeats.
    further : makes the trials that could be run next; None when nobody can run any.
    draw : draws the fitted field, as `unexplained.field` of diagnosis.json.
    """

    model: Model
    records: Sequence[Record]
    candidates: Sequence[str]
    fixed: Sequence[str] = ()
    wording: Wording = PLAIN
    floor: float | None = None
    further: Callable[[], Further] | None = None
    draw: Draw = lambda inquiry, left: None
    effort: Effort = field(default_factory=Effort)


def diagnose(case: Case, tell: Tell, progress: Progress = silent) -> dict[str, Any]:
    """Find the effects that the model lacks.

    Parameters
    ----------
    tell : called after each step with what is known, and at the end; the dict holds the keys of
        `diagnosis.json` that do not depend on where the trials come from.
    progress : told the runs so far, how many there will be about, and what is being done.
    """
    run = _Run(case, tell, progress)
    base = run.search() if not limits.too_few(run.inquiry) else run.look_only()
    if case.further is not None:
        run.choose_next(base, case.further)
    return run.finish()


def floor_and_noise(case: Case) -> tuple[Floor, float | None]:
    """Return the noise floor of a case, and by how much repeats differ, None when unknown."""
    floor = Floor.of(_repeats(case)) if case.floor is None else Floor.known(case.floor)
    percent = floor.percent
    return floor, None if percent is None else percent / 100 * case.model.scale


def _repeats(case: Case) -> RepeatScatter:
    return repeat_scatter(case.records, TimeGrid.of(case.records), case.model.scale)


class _Run:
    """A diagnosis on its way: what is known so far, and how it is told."""

    def __init__(self, case: Case, tell: Tell, progress: Progress) -> None:
        self._case, self._tell, self._bar = case, tell, progress
        records = case.records
        self._repeats = _repeats(case)
        self._floor, noise = floor_and_noise(case)
        self.inquiry = Inquiry(case.model, records, noise, self._simulated)
        self._explained = Explained(self.inquiry, case.wording)
        effects = case.model.effects
        self._fields = [name for name, e in effects.items() if e.depends_on is not None]
        held = [n for n in (*case.candidates, *case.fixed) if limits.held_at_null(effects[n])]
        self._held = [n for n in held if n in case.candidates]
        self._idle = [n for n in held if n in case.fixed]
        self._candidates = [n for n in case.candidates if n not in self._held]
        self._outlook = Outlook(len(records), len(self._candidates), len(self._fields))
        self._started = time.monotonic()
        self._doing = ""
        self._found = Found()
        self._base: Revision | None = None
        self._further_runs = 0
        self._refitted: dict[tuple[str, ...], Rung] = {}
        self._left: Unexplained | None = None
        self._next: Sequence[NextTrial] = ()

    def search(self) -> Revision:
        """Add effects until none pays; then, if none did, look what is left depends on."""
        case = self._case
        self._found = search(
            self.inquiry, self._candidates, case.fixed, self._floor, case.effort, self._step
        )
        self._found, self._left = look_for_the_unknown(
            self.inquiry,
            self._found,
            self._fields,
            self._floor,
            case.effort,
            lambda note: self._step(self._found, note),
        )
        top = self._found.ladder[-1].revision
        if not self._found.screens:  # the model is as good as noise: say what would have shown
            self._look(top)
        return top

    def look_only(self) -> Revision:
        """Fit the model and look at every effect, where nothing can be held back for a test."""
        inquiry, effort = self.inquiry, self._case.effort
        self._step(self._found, "fitting the model as it is")
        self._base = fit_base(inquiry, self._case.fixed, effort.seed, effort.base)
        self._look(self._base)
        return self._base

    def _look(self, revision: Revision) -> None:
        """Screen every effect and leave it at that."""
        screens: dict[str, Screened] = {}
        looked = looks(self.inquiry, revision, self._candidates)
        for name in self._candidates:
            self._step(replace(self._found, screens=(dict(screens),)), f"looking at {name}")
            screens[name] = next(looked)
        self._found = replace(self._found, screens=(screens,))

    def choose_next(self, top: Revision, further: Callable[[], Further]) -> None:
        """Look for the trials that would decide what is still open."""
        self._step(self._found, f"choosing the next {self._case.wording.trials}")
        named = report.verdict(self._found, self._fixed, self._left)
        near, left = self._near, self._left
        for contests in open_contests(
            self.inquiry, self._found, top, named, left, near, self._floor
        ):
            if contests and not self._next:
                looked = partial(self._looked_further, self._further_runs)
                self._next = next_trials(self.inquiry, contests, further(), looked)

    def finish(self) -> dict[str, Any]:
        """Return everything, once nothing is left to do."""
        self._findings()  # simulates what is still to be compared
        self._doing = ""
        self._bar(self._runs, self._runs)
        return self._say()

    @property
    def _fixed(self) -> int:
        return len(self._case.fixed)

    @property
    def _near(self) -> tuple[Rung, ...]:
        """Effects that came near to being named, where nothing explains what is left."""
        explained = self._left is not None and self._left.enough
        if explained or len(self._found.ladder) > 1:
            return ()
        return came_near(self._found, self.inquiry.groups, self._floor)

    @property
    def _runs(self) -> int:
        """How many trials were simulated so far."""
        return self.inquiry.simulated + self._further_runs

    def _simulated(self, done: int, total: int, note: str = "") -> None:
        self._show_bar()

    def _looked_further(self, before: int, done: int, total: int, note: str = "") -> None:
        self._further_runs = before + done
        self._show_bar()

    def _show_bar(self) -> None:
        self._bar(self._runs, self._outlook.total(self._runs), self._doing)

    def _step(self, found: Found, note: str) -> None:
        self._found, self._doing = found, note
        self._outlook.step(note, self._runs)
        self._show_bar()
        self._say()

    def _say(self) -> dict[str, Any]:
        said = plain(self._facts() | self._findings())
        self._tell(said)
        return said

    def _facts(self) -> dict[str, Any]:
        case, inquiry = self._case, self.inquiry
        return {
            "words": case.wording.as_dict(case.records[0].measured.shape[1]),
            "error_unit": case.model.error_unit,
            "casts": len(case.records),
            "actions": int(inquiry.groups.max()) + 1,
            "noise_floor_percent": self._floor.percent,
            "conclusive": not limits.too_few(inquiry),
            "simulated_casts": self._runs,
            "seconds": round(time.monotonic() - self._started, 1),
            "finished": not self._doing,
            "doing": self._doing,
        }

    def _findings(self) -> dict[str, Any]:
        case, inquiry, found = self._case, self.inquiry, self._found
        named = report.verdict(found, self._fixed, self._left)
        base = found.ladder[0].revision if found.ladder else self._base
        return {
            "verdict": named if base else [],
            "sentence": self._sentence(named) if base else "",
            "confusion_set": report.confusion_set(found, self._near),
            "nearest": report.added(self._near),
            "unexplained": report.unexplained(inquiry, self._left, case.draw),
            "notes": self._notes(base),
            "ladder": report.ladder(found),
            "ranking": [
                *report.ranking(
                    inquiry,
                    found,
                    self._near,
                    self._explained.slices(found),
                    self._stability(),
                ),
                *(report.held(inquiry, name) for name in self._held),
            ],
            "next_actions": report.next_rows(inquiry, self._next, case.wording),
            "base": self._base_parameters(base),
            "comparison": self._explained.comparison(base).as_dict() if base else None,
        }

    def _stability(self) -> dict[str, float]:
        """Tell how often every refitted effect comes first; later rounds overwrite refits."""
        found, inquiry = self._found, self.inquiry
        self._refitted |= {rung.revision.effects: rung for rung in found.refits.values()}
        rungs, seed = self._refitted.values(), self._case.effort.seed
        return first_in_resamples(found, rungs, inquiry.groups, seed)

    def _sentence(self, named: list[str]) -> str:
        if limits.too_few(self.inquiry):
            return report.sentence_on_too_few(self.inquiry, self._case.wording)
        floor, words = self._floor, self._case.wording
        found, left, near = self._found, self._left, self._near
        return report.sentence(self.inquiry, found, named, left, near, floor, words)

    def _base_parameters(self, base: Revision | None) -> dict[str, Any]:
        if base is None:
            return {}
        ladder = self._found.ladder
        vectors = ladder[0].errors.vectors if ladder else None
        return report.base_parameters(self.inquiry, base, vectors)

    def _notes(self, base: Revision | None) -> list[str]:
        inquiry, wording = self.inquiry, self._case.wording
        notes = limits.notes_on_trials(inquiry, self._repeats, self._floor.percent, wording)
        if base is None:
            return notes
        top = self._found.ladder[-1].revision if self._found.ladder else base
        seen = self._explained.comparison(top)
        unit = inquiry.model.error_unit
        notes += limits.notes_on_outliers(seen.findings, seen.found, unit, wording)
        notes += limits.notes_on_parameters(inquiry, base, wording)
        return notes + limits.notes_on_effects(self._held, self._idle)
