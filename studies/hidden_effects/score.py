"""Open the sealed answers of the hidden-effect benchmark and score the diagnoses."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import polars as pl
from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.page import markdown
from robotcast.reporting.style import style, svg
from robotcast.stage import output_folder, stage, tell
from studies.hidden_effects.figures import confusion_figure, power_figure
from studies.hidden_effects.outcomes import Outcome, Said, read_outcomes

NONE, UNKNOWN = ("none",), ("unknown",)
METHODS = ("diagnosis", "random", "largest_sensitivity", "brute_force", "oracle")
MISSING = "–"
OPENING = """# Hidden effects

{cases} sets of casts were measured on the virtual rig, a 3-D cable with contacts that shares no \
code with the simulators; each hides an effect, two, something that no diagnosis has a name for, \
or nothing. {run} of them were diagnosed. Errors are average waypoint errors on held-out casts in \
% of cable length; a shift is how far the hidden effect moves the paths.
"""
FIGURES = """![Which effect was named where which was hidden](confusion.svg)

![How often an effect is named against how far it moves the paths](power.svg)
"""

Rows = list[list[str]]


@dataclass(frozen=True)
class Share:
    """So much of so many, both counts or both sums; cases that belong here and were not run."""

    part: float
    whole: float
    missing: int = 0

    @property
    def value(self) -> float | None:
        """The share, None of nothing."""
        return self.part / self.whole if self.whole else None

    def __str__(self) -> str:
        if self.value is None:
            return MISSING
        return f"{self.part:.0f} of {self.whole:.0f} ({100 * self.value:.0f} %)"


@dataclass(frozen=True)
class Criterion:
    """One line of the benchmark's result: what is asked, and what came."""

    name: str
    share: Share
    rule: Literal["≥", "≤"] = "≥"  # whether the share shall be at least or at most `bound`
    bound: float | None = None  # None: shown only
    counted: bool = True  # the share is of cases or parameters, not of an amount

    @property
    def met(self) -> bool | None:
        """Whether it is met; None when nothing is asked or nothing was run."""
        value = self.share.value
        if value is None or self.bound is None:
            return None
        return value >= self.bound if self.rule == "≥" else value <= self.bound


def criteria(outcomes: Sequence[Outcome]) -> list[Criterion]:
    """Return what is asked of the diagnosis, with what came."""
    own = "diagnosis"
    single, outside = _of_kind(outcomes, "single"), _of_kind(outcomes, "outside")
    shown = [o for o in single if o.shows]
    named = [o for o in outcomes if o.kind in ("single", "pair")]
    top = top_one(shown, own)
    top = Share(top.part, top.whole, top.missing + sum("oracle" not in o.said for o in single))
    unknown = _count(outside, own, lambda _, said: said.names == UNKNOWN)
    clean = _count(
        outside, own, lambda _, said: said.names not in (NONE, UNKNOWN) and not said.unexplained
    )
    among = _count(shown, own, lambda o, said: set(o.effects) <= said.confusable | {*said.names})
    drop, whole, first = _drop(named), _casts(outcomes), _casts(outcomes, first_round=True)
    brute = "simulated casts relative to brute force"
    return [
        Criterion("named first, where the oracle's gain is significant", top, bound=0.9),
        Criterion("named first, all cases with one effect", top_one(single, own)),
        Criterion("false alarms on controls", false_alarms(outcomes, own), "≤", 0.0),
        Criterion("outside the library: unknown", unknown, bound=0.75),
        Criterion("outside the library: a wrong name with a clean bill", clean, "≤", 0.0),
        Criterion("two effects: both named", both(outcomes, own), bound=0.75),
        Criterion("truth among the confusable", among, bound=0.95),
        Criterion("held-out drop relative to the oracle's", drop, bound=0.9, counted=False),
        Criterion("intervals that cover the true size", coverage(named, own), bound=0.85),
        Criterion("intervals that cover the true size, of the oracle", coverage(named, "oracle")),
        Criterion(brute, whole, "≤", 0.25, counted=False),
        Criterion(f"{brute} that looks for one effect only", first, "≤", counted=False),
    ]


def top_one(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return how many of the cases with one effect a method names first."""
    return _count(outcomes, method, lambda o, said: said.names[0] in o.effects)


def false_alarms(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return how many controls a method says something is hidden in."""
    return _count(_of_kind(outcomes, "control"), method, lambda _, said: said.names != NONE)


def both(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return in how many cases with two effects a method names both."""
    pairs = _of_kind(outcomes, "pair")
    return _count(pairs, method, lambda o, said: set(o.effects) <= set(said.names))


def coverage(outcomes: Iterable[Outcome], method: str) -> Share:
    """Return how many of a method's intervals hold the true size."""
    held = [one for outcome in outcomes for one in outcome.held(method)]
    return Share(sum(held), len(held))


def _drop(outcomes: Sequence[Outcome]) -> Share:
    """Return by how much the diagnosis lowers the held-out errors, of what the oracle does."""
    outcomes = [o for o in outcomes if o.shows]
    drops = [
        [
            said.base_percent - said.final_percent
            for said in (o.diagnosis, o.said.get("oracle"))
            if said and said.base_percent is not None and said.final_percent is not None
        ]
        for o in outcomes
    ]
    own = [pair for pair in drops if len(pair) == 2]
    return Share(sum(d for d, _ in own), sum(d for _, d in own), len(outcomes) - len(own))


def _casts(outcomes: Sequence[Outcome], first_round: bool = False) -> Share:
    """Return what a diagnosis simulates, of what brute force does, where both were run."""
    pairs = [
        (o.diagnosis.casts or 0, (brute.casts or 0) - first_round * brute.later_casts)
        for o in outcomes
        if o.diagnosis and (brute := o.said.get("brute_force"))
    ]
    own, brute = (sum(pair[k] for pair in pairs) for k in (0, 1))
    return Share(own, brute, len(outcomes) - len(pairs))


def _of_kind(outcomes: Iterable[Outcome], kind: str) -> list[Outcome]:
    return [o for o in outcomes if o.kind == kind]


def _count(
    outcomes: Iterable[Outcome], method: str, good: Callable[[Outcome, Said], bool]
) -> Share:
    outcomes = list(outcomes)
    run = [(o, o.said[method]) for o in outcomes if method in o.said]
    return Share(sum(good(o, said) for o, said in run), len(run), len(outcomes) - len(run))


def criteria_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return the benchmark's criteria: name, asked, came, met, not run."""
    rows = [["", "asked", "came", "met", "cases not run"]]
    for one in criteria(outcomes):
        asked = MISSING if one.bound is None else f"{one.rule} {100 * one.bound:.0f} %"
        value = one.share.value
        amount = MISSING if value is None else f"{100 * value:.0f} %"
        met = {None: MISSING, True: "yes", False: "no"}[one.met]
        came = str(one.share) if one.counted else amount
        rows.append([one.name, asked, came, met, str(one.share.missing)])
    return rows


def method_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return the diagnosis beside the other methods, one row a method."""
    single = _of_kind(outcomes, "single")
    shown = [o for o in single if o.shows]
    head = ["method", "named first, where the oracle's gain is significant", "named first, all"]
    rows = [[*head, "false alarms on controls", "both of two named", "simulated casts a case"]]
    for method in METHODS:
        shares = (top_one(shown, method), top_one(single, method))
        shares += (false_alarms(outcomes, method), both(outcomes, method))
        casts = [s.casts for o in outcomes if (s := o.said.get(method)) and s.casts is not None]
        mean = f"{sum(casts) / len(casts):.0f}" if casts else MISSING
        rows.append([method.replace("_", " "), *map(str, shares), mean])
    return rows


def size_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return how many intervals hold the true size, one row an effect.

    Effects whose law on the rig is not the library's have no size to compare, and no row.
    """
    of = [o for o in _of_kind(outcomes, "single") if o.sizes(comparable=True)]
    rows = [["effect", "hidden alone", "diagnosis: interval holds", "oracle: interval holds"]]
    for effect in sorted({name for o in of for name in o.effects}):
        alone = [o for o in of if effect in o.effects]
        held = [str(coverage(alone, method)) for method in ("diagnosis", "oracle")]
        rows.append([effect, str(len(alone)), *held])
    return rows


def case_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return every case: what was hidden, what was said, and by how much errors fell."""
    rows = [_case_row(outcome) for outcome in outcomes]
    return [list(rows[0]), *(list(row.values()) for row in rows)]


def _case_row(o: Outcome) -> dict[str, str]:
    found, random, largest, brute, oracle = (o.said.get(m, Said(())) for m in METHODS)
    expected = {"control": {"none"}, "outside": {"unknown"}}.get(o.kind, set(o.effects))
    held = o.held("diagnosis")
    row = {
        "case": o.case,
        "cable": o.cable,
        "hidden": " + ".join(o.effects) or "none",
        "size": ", ".join(f"{name} {value:.3g}" for (_, name), value in o.sizes().items()),
        "strength": o.strength,
        "shift [%]": f"{o.shift_percent:.2f}",
        "verdict": " + ".join(found.names),
        "right": found.names and ("yes" if set(found.names) == expected else "no"),
        "confusable": " + ".join(sorted(found.confusable)),
        "interval": held and f"holds {sum(held)} of {len(held)}",
        "base [%]": _number(found.base_percent),
        "final [%]": _number(found.final_percent),
        "oracle [%]": _number(oracle.final_percent),
        "oracle p": oracle.names and f"{oracle.p_value:.1e}",
        "noise floor [%]": _number(found.noise_floor_percent),
        "random": " + ".join(random.names),
        "largest sensitivity": " + ".join(largest.names),
        "brute force": " + ".join(brute.names),
        "simulated casts": found.names and str(found.casts),
        "brute force casts": brute.names and str(brute.casts),
        "seconds": found.names and f"{found.seconds:.0f}",
    }
    return {name: str(cell or MISSING) for name, cell in row.items()}


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def write_results(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Write README.md with all tables, each as CSV, and the two figures; return the paths."""
    tables = {
        "criteria": ("What is asked of the diagnosis", criteria_rows(outcomes)),
        "methods": ("Beside other methods", method_rows(outcomes)),
        "sizes": ("Sizes of effects", size_rows(outcomes)),
        "cases": ("Every case", case_rows(outcomes)),
    }
    files = {f"{name}.csv": _csv(rows) for name, (_, rows) in tables.items()}
    with style():
        files["confusion.svg"] = svg(confusion_figure(outcomes))
        files["power.svg"] = svg(power_figure(outcomes))
    run = sum(o.diagnosis is not None for o in outcomes)
    parts = [f"## {title}\n\n{markdown(rows[0], rows[1:])}" for title, rows in tables.values()]
    parts = [OPENING.format(cases=len(outcomes), run=run), *parts[:2], FIGURES, *parts[2:]]
    files["README.md"] = "\n".join(parts)
    for name, text in files.items():
        write_text(folder / name, text)
    return [folder / name for name in files]


def _csv(rows: Rows) -> str:
    """Write rows, the first of them the head, as CSV, empty where nothing was run."""
    cells = [[None if cell == MISSING else cell for cell in row] for row in rows[1:]]
    schema = dict.fromkeys(rows[0], pl.String)
    return pl.DataFrame(cells, schema, orient="row").write_csv().removeprefix('""')


def score(config: DictConfig) -> None:
    reports = Path(config.hidden_effects.reports)
    outcomes = read_outcomes(reports)
    written = write_results(outcomes, output_folder(str(reports / "results")))
    for name, *cells in criteria_rows(outcomes)[1:]:
        tell(f"{name}: {', '.join(cells)}")
    missed = [one.name for one in criteria(outcomes) if one.met is False]
    tell(f"{written[0].parent}: {len(written)} files, {len(missed)} criteria not met")


if __name__ == "__main__":
    stage(score)()
