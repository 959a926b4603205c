"""A whole diagnosis of any model, told step by step as the dict of `diagnosis.json`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from robotcast.diagnosis import limits, report
from robotcast.diagnosis.compare import Explained
from robotcast.diagnosis.decision import Code, Unexplained, Verdict, decide, look_for_the_unknown
from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.found import Found, Outlook, Step
from robotcast.diagnosis.inquiry import Inquiry, Revision, fit_base
from robotcast.diagnosis.library import fit_library
from robotcast.diagnosis.model import PLAIN, Model, Record, Wording
from robotcast.diagnosis.next_trials import Further, NextTrial, next_trials, open_contests
from robotcast.diagnosis.repeats import RepeatScatter, TimeGrid, repeat_scatter
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.diagnosis.screen import Screened, screen
from robotcast.diagnosis.selection import Selection
from robotcast.files import plain
from robotcast.running import Progress, silent

Tell = Callable[[dict[str, Any]], object]
Draw = Callable[[Inquiry, Unexplained], Mapping[str, Any] | None]


@dataclass(frozen=True)
class Case:
    """What is diagnosed."""

    model: Model
    records: Sequence[Record]  # in the order of the session; samples that are NaN were not measured
    # names of the effects to try, fields left out: they come when nothing else pays
    candidates: Sequence[str]
    fixed: Sequence[str] = ()  # effects that act from the start
    comparisons: int = 0  # effects that share the level, where the candidates were chosen from more
    wording: Wording = PLAIN
    # noise floor in % of the scale where it is known from elsewhere than from repeats
    floor: float | None = None
    floor_is_least: bool = False  # whether that is only the least: repeats may differ by more
    # what the model errs by because its step is no shorter, % of the scale
    numerical_error: float = 0.0
    # predicts records, (n_trials, k, d), where nothing acts; None where nobody can tell
    idle: Callable[[Sequence[Record]], np.ndarray] | None = None
    # makes the trials that could be run next; None when nobody can run any
    further: Callable[[], Further] | None = None
    # draws the fitted field, as `unexplained.field` of diagnosis.json
    draw: Draw = lambda inquiry, left: None
    rule: Rule = field(default_factory=Rule)
    effort: Effort = field(default_factory=Effort)

    def __post_init__(self) -> None:
        """Raise ValueError for effects that the model does not hold, and for empty records."""
        unknown = [n for n in (*self.candidates, *self.fixed) if n not in self.model.effects]
        if unknown:
            known = ", ".join(self.model.effects)
            raise ValueError(f"the model has no effect {', '.join(unknown)}; it has {known}")
        object.__setattr__(self, "records", measured(self.records))


def measured(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records without samples that were not measured, and without empty ones."""
    kept = []
    for record in records:
        if len(record.times_s) != len(record.measured):
            raise ValueError(
                f"trial {record.trial}: {len(record.times_s)} times and "
                f"{len(record.measured)} samples; expected as many"
            )
        seen = np.isfinite(record.measured).all(axis=1)
        if not seen.all():
            record = replace(record, times_s=record.times_s[seen], measured=record.measured[seen])
        kept += [record] if len(record.times_s) else []
    if not kept:
        raise ValueError("no trial holds a sample that was measured")
    return tuple(kept)


def diagnose(case: Case, tell: Tell, progress: Progress = silent) -> dict[str, Any]:
    """Find the effects that the model lacks.

    `tell` is called after each step with what is known, and at the end; the dict holds the keys of
    `diagnosis.json` that do not depend on where the trials come from. `progress` is told the runs
    so far, how many there will be about, and what is being done.
    """
    run = _Run(case, tell, progress)
    run.search() if not limits.too_few(run.inquiry, case.rule) else run.look_only()
    if case.further is not None:
        run.choose_next(case.further)
    return run.finish()


def floor_and_noise(case: Case, repeats: RepeatScatter | None = None) -> tuple[Floor, float]:
    """Return the noise floor of a case, and what residuals are weighed against."""
    moved = [np.linalg.norm(r.measured - r.measured.mean(axis=0), axis=1) for r in case.records]
    travel = float(np.median([np.sqrt((one**2).mean()) for one in moved]))
    least = 100 * case.rule.least_noise * travel / case.model.scale
    floor = (
        Floor.of(repeats or _repeats(case), least)
        if case.floor is None
        else Floor.known(case.floor, least, case.floor_is_least, case.numerical_error)
    )
    return floor, floor.unit / 100 * case.model.scale


def _repeats(case: Case) -> RepeatScatter:
    return repeat_scatter(case.records, TimeGrid.of(case.records), case.model.scale, case.rule)


class _Run:
    """A diagnosis on its way: what is known so far, and how it is told."""

    def __init__(self, case: Case, tell: Tell, progress: Progress) -> None:
        self._case, self._tell, self._bar = case, tell, progress
        self._repeats = _repeats(case)
        self._floor, noise = floor_and_noise(case, self._repeats)
        self.inquiry = Inquiry(case.model, case.records, noise, self._simulated)
        self._explained = Explained(self.inquiry, case.wording, case.rule)
        effects = case.model.effects
        self._fields = [name for name, e in effects.items() if e.depends_on is not None]
        held = [n for n in (*case.candidates, *case.fixed) if limits.held_at_null(effects[n])]
        self._held = [n for n in held if n in case.candidates]
        self._idle = [n for n in held if n in case.fixed]
        self._candidates = [n for n in case.candidates if n not in self._held]
        self._outlook = Outlook(len(case.records))
        self._doing = ""
        self._found = Found()
        self._base: Revision | None = None
        self._screens: dict[str, Screened] = {}
        self._verdict = Verdict()
        self._next: Sequence[NextTrial] = ()

    def search(self) -> None:
        """Choose the effects that are missing, and decide what may be said."""
        case = self._case
        selection = Selection(
            self.inquiry,
            self._candidates,
            case.fixed,
            self._floor,
            case.rule,
            case.effort,
            self._step,
            case.comparisons,
            self._without_forces(),
        )
        self._found = selection.run()
        self._base = self._found.base.revision
        self._verdict = decide(self._found, self._look, selection.refit_singles)
        self._found = selection.choose((*case.fixed, *self._verdict.named))
        self._screen(self._found.chosen)

    def _without_forces(self) -> np.ndarray | None:
        """Return what is missed where nothing acts, (n_trials,), % of the scale."""
        inquiry, predict = self.inquiry, self._case.idle
        if predict is None:
            return None
        missed = inquiry.against(predict(inquiry.records)[None], inquiry.everything)[0]
        return inquiry.percent(missed, inquiry.everything)[0]

    def look_only(self) -> None:
        """Fit the model and look at every effect, where nothing can be held back for a test."""
        case, effort = self._case, self._case.effort
        self._step(self._found, Step.BASE)
        self._base = fit_base(self.inquiry, case.fixed, effort)
        if self._candidates:
            self._step(self._found, Step.LIBRARY)
            early = self.inquiry.beginnings(effort.early, effort.some)
            begun = early.fit(case.fixed, self._base.fit.vector, 1)
            library = fit_library(early, case.fixed, self._candidates, begun, effort.library)
            self._found = replace(self._found, library=library)
            self._screen(case.fixed)
        self._verdict = Verdict(Code.CANNOT_TELL)

    def _screen(self, acting: Sequence[str]) -> None:
        library, rule = self._found.library, self._case.rule
        if library is not None:
            self._screens = {n: screen(library, acting, n, rule) for n in self._candidates}

    def _look(self) -> Unexplained:
        tell, effort = partial(self._step, self._found, Step.FIELDS), self._case.effort
        return look_for_the_unknown(self.inquiry, self._found, self._fields, effort, tell)

    def choose_next(self, further: Callable[[], Further]) -> None:
        """Look for the trials that would decide what is still open."""
        self._step(self._found, Step.NEXT, self._case.wording.trials)
        assert self._base is not None
        contests = open_contests(
            self.inquiry, self._found, self._base, self._verdict, self._screens, self._case.rule
        )
        for some in contests:
            if some and not self._next:
                self._next = next_trials(self.inquiry, some, further(), self._case.rule.decides)

    def finish(self) -> dict[str, Any]:
        """Return everything, once nothing is left to do."""
        self._findings()  # simulates what is still to be compared
        self._doing = ""
        self._bar(self.inquiry.simulated, self.inquiry.simulated)
        return self._say()

    def _simulated(self, done: int, total: int, note: str = "") -> None:
        self._bar(done, self._outlook.total(done), self._doing)

    def _step(self, found: Found, step: Step, what: str = "") -> None:
        self._found, self._doing = found, step.says(what)
        if found.judged:
            self._base = found.base.revision
        self._outlook.step(step, self.inquiry.simulated)
        self._simulated(self.inquiry.simulated, 0)
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
            "conclusive": not limits.too_few(inquiry, case.rule),
            "simulated_casts": inquiry.simulated,
            "finished": not self._doing,
            "doing": self._doing,
        }

    def _findings(self) -> dict[str, Any]:
        case, inquiry, found = self._case, self.inquiry, self._found
        verdict, base = self._verdict, self._base
        decided = verdict.code is not Code.OPEN
        known = (*case.fixed, *verdict.named)
        slices = self._explained.slices(found) if decided else {}
        ranked = report.ranking(inquiry, found, self._screens, verdict, case.rule, slices)
        held = [report.unjudged(inquiry, name, "held at its null") for name in self._held]
        top = found.top if decided and found.judged else None
        folds = found.base.errors.vectors if found.judged else None
        return {
            "verdict": verdict.words,
            "code": verdict.code.value,
            "sentence": self._sentence() if decided else "",
            "confusion_set": report.confusion_set(found, verdict),
            "nearest": [[n for n in rung.effects if n not in known] for rung in verdict.near],
            "unexplained": report.unexplained(inquiry, verdict.left, case.draw),
            "notes": self._notes(base),
            "ladder": report.ladder(found),
            "ranking": [*ranked, *held],
            "next_actions": report.next_rows(inquiry, self._next, case.wording),
            "base": report.base_parameters(inquiry, base, folds, case.rule) if base else {},
            "model": report.fitted(inquiry, top.revision, top.errors.vectors, case.rule)
            if top
            else {},
            "comparison": self._explained.comparison(base).as_dict() if base else None,
        }

    def _sentence(self) -> str:
        found, words, rule = self._found, self._case.wording, self._case.rule
        if limits.too_few(self.inquiry, rule):
            return report.sentence_on_too_few(self.inquiry, words, rule)
        top = self._explained.comparison(found.top.revision)
        where = top.findings[0].slice.name if top.findings else ""
        return report.sentence(self.inquiry, found, self._verdict, words, where)

    def _notes(self, base: Revision | None) -> list[str]:
        inquiry, found, words = self.inquiry, self._found, self._case.wording
        rule, percent = self._case.rule, self._floor.percent
        notes = limits.notes_on_trials(inquiry, self._repeats, percent, words, rule)
        if base is None:
            return notes
        top = base
        if found.judged and self._verdict.code is not Code.OPEN:
            notes += limits.notes_on_outliers(inquiry, found, words)
            top = found.top.revision
        notes += limits.notes_on_parameters(inquiry, base, top, words, rule)
        return notes + limits.notes_on_effects(self._held, self._idle)
