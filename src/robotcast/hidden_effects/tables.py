"""The benchmark's results in words and numbers: Markdown for people, CSV for programs."""

import csv
import io
from collections.abc import Sequence

from robotcast.hidden_effects.outcome import Outcome
from robotcast.hidden_effects.score import (
    METHODS,
    Criterion,
    Share,
    both,
    coverage,
    covered,
    covered_when_told,
    criteria,
    false_alarms,
    named_by,
    top_one,
)

MISSING = "–"
Rows = list[list[str]]

CASE_COLUMNS = (
    "case",
    "cable",
    "hidden",
    "size",
    "strength",
    "shift [%]",
    "verdict",
    "right",
    "confusable",
    "interval",
    "base [%]",
    "final [%]",
    "oracle [%]",
    "oracle p",
    "noise floor [%]",
    "random",
    "largest sensitivity",
    "brute force",
    "simulated casts",
    "brute force casts",
    "seconds",
)


def criteria_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return the benchmark's criteria: name, asked, came, met, not run."""
    head = ["", "asked", "came", "met", "cases not run"]
    return [head, *(_criterion_row(one) for one in criteria(outcomes))]


def method_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return the diagnosis beside the other methods, one row a method."""
    shown = [o for o in outcomes if o.truth.kind == "single" and o.shows]
    single = [o for o in outcomes if o.truth.kind == "single"]
    head = [
        "method",
        "named first, where the oracle's gain is significant",
        "named first, all",
        "false alarms on controls",
        "both of two named",
        "simulated casts a case",
    ]
    rows = [
        [
            method.replace("_", " "),
            *(
                _share(share)
                for share in (
                    top_one(shown, method),
                    top_one(single, method),
                    false_alarms(outcomes, method),
                    both(outcomes, method),
                )
            ),
            _casts(outcomes, method),
        ]
        for method in METHODS
    ]
    return [head, *rows]


def size_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return how many intervals hold the true size, one row an effect.

    Effects whose law on the rig is not the library's have no size to compare, and no row.
    """
    head = ["effect", "hidden alone", "diagnosis: interval holds", "oracle: interval holds"]
    of = [o for o in outcomes if o.truth.kind == "single" and o.truth.comparable_sizes]
    effects = sorted({next(iter(o.truth.effects)) for o in of})
    rows = []
    for effect in effects:
        alone = [o for o in of if effect in o.truth.effects]
        held = [_share(coverage(alone, how)) for how in (covered, covered_when_told)]
        rows.append([effect, str(len(alone)), *held])
    return [head, *rows]


def case_rows(outcomes: Sequence[Outcome]) -> Rows:
    """Return every case: what was hidden, what was said, and by how much errors fell."""
    return [list(CASE_COLUMNS), *(_case_row(outcome) for outcome in outcomes)]


def markdown(rows: Rows) -> str:
    """Write rows, the first of them the head, as a Markdown table."""
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return "\n".join("| " + " | ".join(cell for cell in line) + " |" for line in lines) + "\n"


def csv_text(rows: Rows) -> str:
    """Write rows as CSV, empty where nothing was run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([["" if cell == MISSING else cell for cell in row] for row in rows])
    return text.getvalue()


def _criterion_row(one: Criterion) -> list[str]:
    asked = MISSING
    if one.bound is not None:
        asked = f"{'≥' if one.rule == 'least' else '≤'} {100 * one.bound:.0f} %"
    came = _share(one.share) if one.counted else _percent(one.share.value)
    met = {None: MISSING, True: "yes", False: "no"}[one.met]
    return [one.name, asked, came, met, str(one.share.missing)]


def _share(share: Share) -> str:
    if share.value is None:
        return MISSING
    return f"{share.part:.0f} of {share.whole:.0f} ({100 * share.value:.0f} %)"


def _percent(value: float | None) -> str:
    return MISSING if value is None else f"{100 * value:.0f} %"


def _casts(outcomes: Sequence[Outcome], method: str) -> str:
    """Return the casts a method simulated on average; a guess and a sensitivity count none."""
    if method not in ("diagnosis", "brute_force", "oracle"):
        return MISSING
    run = [getattr(o, method) for o in outcomes if getattr(o, method)]
    return f"{sum(one.simulated_casts for one in run) / len(run):.0f}" if run else MISSING


def _case_row(o: Outcome) -> list[str]:
    said, oracle, brute = o.diagnosis, o.oracle, o.brute_force
    return [
        o.case,
        o.truth.cable,
        _names(tuple(o.truth.effects)) if o.truth.effects else "none",
        _sizes(o),
        o.truth.strength or MISSING,
        _number(o.truth.shift_percent),
        _names(said.verdict) if said else MISSING,
        _right(o),
        _names(tuple(sorted(said.confusable))) if said else MISSING,
        _held(o),
        _number(said.base_percent if said else None),
        _number(said.final_percent if said else None),
        _number(oracle.final_percent if oracle else None),
        f"{oracle.p_value:.1e}" if oracle else MISSING,
        _number(said.noise_floor_percent if said else None),
        o.random or MISSING,
        o.largest_sensitivity or MISSING,
        _names(brute.effects) if brute else MISSING,
        str(said.simulated_casts) if said else MISSING,
        str(brute.simulated_casts) if brute else MISSING,
        f"{said.seconds:.0f}" if said else MISSING,
    ]


def _right(outcome: Outcome) -> str:
    said = named_by(outcome, "diagnosis")
    if said is None:
        return MISSING
    expected = {"control": {"none"}, "outside": {"unknown"}}
    return (
        "yes" if set(said) == expected.get(outcome.truth.kind, set(outcome.truth.effects)) else "no"
    )


def _sizes(outcome: Outcome) -> str:
    sizes = [f"{name} {value:.3g}" for (_, name), value in outcome.truth.sizes.items()]
    return ", ".join(sizes) or MISSING


def _held(outcome: Outcome) -> str:
    """Say whether the intervals hold the true sizes, for effects that were named."""
    held = covered(outcome)
    return f"holds {sum(held)} of {len(held)}" if held else MISSING


def _names(names: tuple[str, ...]) -> str:
    return " + ".join(names) or MISSING


def _number(value: float | None) -> str:
    return MISSING if value is None else f"{value:.2f}"
