"""The tables of the report, most of them the paper's, and the paper's own results beside ours.

Those (tables "tuning", "error" and "results": a UR5 and real cables) are a reference for form and
order of magnitude. A virtual rig is another world than the paper's laboratory, so neither being
below nor above them proves anything. A table is written as Markdown, CSV, LaTeX and page cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
import polars as pl

from robotcast.reporting.names import (
    cable_name,
    method_name,
    name_of,
    policy_name,
    rig_names,
)
from robotcast.reporting.page import caption, markdown, render
from robotcast.reporting.results import Evaluation, Results, Tuning
from robotcast.tuning.tuned import ModelRevision

MISSING = "–"


def percent(value: float | None) -> str:
    """Return a number in % as tables show it: whole ones as they are, others with one decimal."""
    if value is None:
        return MISSING
    return f"{value}%" if isinstance(value, int) else f"{value:.1f}%"


class Cell(NamedTuple):
    """A number as it is shown; the best is bold. `kind` : its CSS classes."""

    text: str
    best: bool
    kind: str


@dataclass(frozen=True)
class Group:
    """Neighbouring columns under one heading; of a `contest`, the least of each is the best."""

    title: str
    columns: tuple[str, ...]
    contest: bool = False


@dataclass(frozen=True)
class Table:
    """A table with a caption, ready to be written."""

    name: str  # stem of its files and its LaTeX label
    caption: str
    label_columns: tuple[str, ...]  # headings of the labels that a row begins with
    groups: tuple[Group, ...]
    rows: tuple[tuple, ...]  # labels, then % of cable length for every column; None: not run
    reference: int  # index of the first group that is not this run's own, for shading
    contests: tuple[str | None, ...] = ()  # row → with which others it contends for the best

    @property
    def written(self) -> list[tuple[tuple[str, ...], list[Cell]]]:
        """Labels and cells, row by row."""
        labels = len(self.label_columns)
        written: list[tuple[tuple[str, ...], list[Cell]]] = [(r[:labels], []) for r in self.rows]
        columns = ((i, g, c) for i, g in enumerate(self.groups) for c in g.columns)
        for at, (index, group, column) in enumerate(columns, start=labels):
            first = column == group.columns[0]
            kind = " ".join(["paper"] * (index >= self.reference) + ["first"] * first)
            best = self._best(at) if group.contest else [False] * len(written)
            for (_, cells), row, wins in zip(written, self.rows, best, strict=True):
                cells.append(Cell(percent(row[at]), wins, kind))
        return written

    def _best(self, at: int) -> list[bool]:
        """Tell of each number of a column whether none is lower, as shown, among its rivals."""
        shown = [None if row[at] is None else round(row[at], 1) for row in self.rows]
        rivals: dict[str | None, list[float]] = {}
        for value, contest in zip(shown, self.contests, strict=True):
            rivals.setdefault(contest, []).extend([] if value is None else [value])
        return [
            contest is not None and len(rivals[contest]) > 1 and value == min(rivals[contest])
            for value, contest in zip(shown, self.contests, strict=True)
        ]

    @property
    def _columns(self) -> list[str]:
        return [f"{g.title}: {c}" for g in self.groups for c in g.columns]

    def markdown(self) -> str:
        """Write as a Markdown table; a column's heading names its group."""
        rows = [
            (*labels, *(f"**{c.text}**" if c.best else c.text for c in cells))
            for labels, cells in self.written
        ]
        n = len(self.label_columns)
        return f"{markdown((*self.label_columns, *self._columns), rows, n)}\n{self.caption}\n"

    def csv(self) -> str:
        """Write plain numbers in % of cable length, empty where nothing was run."""
        names = [f"{column} [% of cable length]" for column in self._columns]
        frame = pl.DataFrame(
            self.rows, [*self.label_columns, *names], orient="row", infer_schema_length=None
        )
        return frame.write_csv(float_precision=3)

    def latex(self) -> str:
        """Write a table environment that shrinks to the text's width where it is wider.

        It needs \\usepackage{booktabs,graphicx}.
        """
        ends = [*accumulate((len(g.columns) for g in self.groups), initial=len(self.label_columns))]
        return render(
            "table.tex",
            name=self.name,
            caption=self.caption,
            labels=self.label_columns,
            groups=self.groups,
            columns=tuple(c for g in self.groups for c in g.columns),
            spans=[(low + 1, high) for low, high in pairwise(ends)],
            rows=self.written,
        )


PAPER_RIG = "paper’s robot"

QUARTILES = ("Median", "Q1", "Q3", "Min", "Max")
_NO_QUARTILES = (None,) * len(QUARTILES)

# simulator → cable → (average waypoint error, median final error), % of cable length
TUNING = {
    "bullet": {"cable1": (29, 28), "cable2": (28, 28), "cable3": (23, 17)},
    "hybrid": {"cable1": (14, 23), "cable2": (11, 14), "cable3": (11, 13)},
    "segmented": {"cable1": (9, 13), "cable2": (8, 9), "cable3": (11, 13)},
}

# (policy, dataset) → QUARTILES, % of cable length, Cable 1
POLICIES = {
    ("cast_and_pull", "none"): (61, 38, 86, 6, 124),
    ("gp", "real"): (27, 9, 51, 4, 97),
    ("nn", "real"): (15, 11, 21, 8, 36),
    ("nn", "simulated"): (14, 10, 17, 6, 115),
    ("nn", "mixed"): (8, 5, 12, 2, 105),
}

# cable → QUARTILES of π_R2S2R, % of cable length
CABLES = {
    "cable1": (8, 5, 12, 2, 105),
    "cable2": (12, 8, 16, 4, 28),
    "cable3": (14, 9, 23, 6, 38),
}

# simulator → optimizer → (least, largest) error of the tuned parameters in % ("Comparing
# Real2Sim Tuning Methods"), Bayesian optimization over its acquisitions with 5 casts
SIM2SIM = {
    "hybrid": {"bo": (3.39, 17.98), "de": (None, 1.0)},
    "segmented": {"bo": (1.09, 9.25), "de": (None, 1.0)},
}
SIM2SIM_CASTS = 5

_Method = tuple[str, str, tuple[str, ...]]  # simulator, optimizer, effects
_Errors = tuple[float | None, float | None]  # average waypoint error, median final error
_Found = dict[tuple[_Method, str], _Errors]  # with the cable
_NOT_RUN: _Errors = (None, None)


def tuning_table(results: Results) -> Table:
    """Error of each tuned simulator on held-out casts (paper, tab:tuning), with the noise floor.

    Every simulator of the paper has a row for every optimizer that was run, whether or not that
    cell was. Below stand the models with effects that do better than without on some cable.
    """
    cables, rig, found = _cables(results), rig_names(results.rigs), _tuned(results)
    methods = _methods(results, found)
    paper: _Found = {((s, "de", ()), c): pair for s, of in TUNING.items() for c, pair in of.items()}
    floors = [c.floor if c else None for c in map(results.cable, cables)]
    known = [getattr(f, of, None) for f in floors for of in ("waypoint_percent", "final_percent")]
    rows = [
        (
            method_name(*method),
            *(v for c in cables for v in found.get((method, c), _NOT_RUN)),
            *(v for c in CABLES for v in paper.get((method, c), _NOT_RUN)),
        )
        for method in methods
    ]
    rows.append(("Noise floor (repeats)", *known, *[None] * (2 * len(CABLES))))
    efforts: dict[str, list[tuple[int, int]]] = {}
    for t in results.tunings:
        given = (int(t.error("tune", "n_casts") or 0), t.facts.get("simulated_casts", 0))
        efforts.setdefault(t.method, []).append(given)
    n_test = [n for t in results.tunings if (n := t.error("test", "n_casts")) is not None]
    return Table(
        name="tuning",
        caption=caption("tuning", rig, n_test, efforts),
        label_columns=("Sim. model",),
        groups=(
            *(Group(f"{rig}, {cable_name(c)}", ("Wayp.", "Last"), True) for c in cables),
            *(Group(f"{PAPER_RIG}, {cable_name(c)}", ("Wayp.", "Last"), True) for c in CABLES),
        ),
        rows=tuple(rows),
        reference=len(cables),
        contests=(*["all"] * len(methods), None),
    )


def _method(tuned: Tuning | ModelRevision) -> _Method:
    return tuned.simulator, tuned.optimizer, tuned.effects


def _tuned(results: Results) -> _Found:
    """Return both errors of every row and cable that was run.

    What lies tuned now goes before the revisions that a later tuning has replaced.
    """
    found: _Found = {}
    for t in results.tunings:
        errors = t.error("test", "waypoint_percent"), t.error("test", "final_percent")
        found.setdefault((_method(t), t.cable), errors)
    for cable in results.cables:
        for r in cable.revisions:
            errors = r.heldout_waypoint_error_percent, r.heldout_final_error_percent
            found.setdefault((_method(r), cable.name), errors)
    return found


def _methods(results: Results, found: _Found) -> list[_Method]:
    """Return the rows: without effects first, then those whose effects help on some cable."""
    simulators = [*TUNING, *sorted({t.simulator for t in results.tunings} - set(TUNING))]
    optimizers = ["de", *sorted({t.optimizer for t in results.tunings} - {"de"})]

    def helps(of: _Method, cable: str, error: float | None) -> bool:
        base, _ = found.get(((*of[:2], ()), cable), _NOT_RUN)
        return bool(of[2]) and error is not None and (base is None or error < base)

    richer = {of for (of, cable), (error, _) in found.items() if helps(of, cable, error)}
    return [*((s, o, ()) for s in simulators for o in optimizers), *sorted(richer)]


def policies_table(results: Results) -> Table:
    """Errors of every policy on one cable (paper, tab:error), on others where several were run.

    Cable 1 has a row for every policy of the paper, whether it was run or not.
    """
    of = {c: [e for e in results.evaluations if e.cable == c] for c in _cables(results)}
    blocks = [cable for cable, evaluations in of.items() if len(evaluations) > 1]
    blocks = blocks or [e.cable for e in results.evaluations[:1]] or ["cable1"]
    rows: list[tuple] = []
    for cable in blocks:
        evaluated = {(e.policy, e.dataset) for e in of[cable]}
        pairs = [p for p in POLICIES if cable == "cable1" or p in evaluated]
        for pair in [*pairs, *sorted(evaluated - set(pairs))]:
            paper = POLICIES.get(pair, _NO_QUARTILES) if cable == "cable1" else _NO_QUARTILES
            labels = (cable_name(cable), policy_name(*pair), name_of(pair[1]))
            rows.append((*labels, *_numbers(results.evaluation(cable, *pair)), *paper))
    shown = [e for cable in blocks for e in of[cable]]
    contests = tuple(row[0] for row in rows)
    labels = ("Cable", "Model", "Dataset")
    return _beside_the_paper("policies", labels, shown, f"{PAPER_RIG}, Cable 1", rows, contests)


def cables_table(results: Results) -> Table:
    """Errors of π_R2S2R (paper, tab:results), one row a cable."""
    cast = {c: results.evaluation(c, "nn", "mixed") for c in _cables(results)}
    rows = [(cable_name(c), *_numbers(e), *CABLES.get(c, _NO_QUARTILES)) for c, e in cast.items()]
    shown = [e for e in cast.values() if e]
    return _beside_the_paper("cables", ("Cable",), shown, PAPER_RIG, rows)


def _beside_the_paper(
    name: str,
    labels: tuple[str, ...],
    shown: Sequence[Evaluation],
    paper: str,
    rows: Sequence[tuple],
    contests: tuple[str | None, ...] = (),
) -> Table:
    """Return quartiles with their interval and repeats, beside the paper's quartiles."""
    groups = (
        Group(rig_names(e.rig for e in shown), QUARTILES, bool(contests)),
        Group("Median", ("from", "to")),
        Group("Repeats", ("Scatter",)),
        Group(paper, QUARTILES, bool(contests)),
    )
    return Table(name, caption(name, shown), labels, groups, tuple(rows), 3, contests)


def parts_table(results: Results) -> Table:
    """What every policy's error is made of, how sure its median is, what its model expects."""
    paper = [*POLICIES]

    def place(e: Evaluation) -> tuple:
        pair = (e.policy, e.dataset)
        return (e.cable, paper.index(pair) if pair in paper else len(paper), pair)

    shown = [e for e in sorted(results.evaluations, key=place) if len(e.errors_percent)]
    rows = []
    for e in shown:
        parts, told = e.parts, (None,) * 4
        if parts:
            share = 100 * parts.repeatability_share
            told = (parts.repeatability, parts.model, share, 100 - share)
        covered = e.within_expected and 100 * e.within_expected
        rows.append(
            (*e.named, e.median_percent, *_numbers(e)[5:], *told, e.expected_percent, covered)
        )
    return Table(
        name="parts",
        caption=caption("parts", shown),
        label_columns=("Cable", "Model", "Dataset"),
        groups=(
            Group("Median", ("Median", "from", "to")),
            Group("Repeats", ("Scatter",)),
            Group("Root mean square", ("Repeatability", "Model")),
            Group("Share", ("Aleatoric", "Epistemic")),
            Group("Model’s spread", ("Expected", "Covered")),
        ),
        rows=tuple(rows),
        reference=4,
    )


def _numbers(evaluation: Evaluation | None) -> tuple[float | None, ...]:
    """Return `QUARTILES`, the median's 95 % interval, and what repeats of one cast differ by."""
    if evaluation is None or evaluation.casts.is_empty():
        return (None,) * 8
    quartiles = np.percentile(evaluation.errors_percent, [50, 25, 75, 0, 100]).tolist()
    return *quartiles, *(evaluation.median_interval or _NOT_RUN), evaluation.scatter_percent


def _cables(results: Results) -> list[str]:
    """The paper's cables, run or not, then any other."""
    return [*CABLES, *(c.name for c in results.cables if c.name not in CABLES)]
