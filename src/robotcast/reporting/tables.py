"""The tables of the report, most of them the paper's."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.reporting.names import (
    cable_name,
    dataset_name,
    method_name,
    policy_label,
    policy_name,
    rig_names,
    thousands,
)
from robotcast.reporting.paper import CABLES, PAPER_RIG, POLICIES, QUARTILES, TUNING
from robotcast.reporting.results import Evaluation, Results, Tuning
from robotcast.reporting.table import Cell, Group, Row, Table
from robotcast.tuning.revisions import ModelRevision

_METRICS = ("waypoint_percent", "final_percent")
_BESIDE_NOTE = (
    "From and to: the 95 % interval of the median, a bootstrap over targets. Scatter: median "
    "distance of the repeats of a cast from their mean, the rig’s own repeatability."
)
_PAPER_NOTE = f"Columns “{PAPER_RIG}”: the paper’s values, a UR5 and real cables, for reference."


def tuning_table(results: Results) -> Table:
    """Error of each tuned simulator on held-out casts (paper, tab:tuning), with the noise floor.

    Every simulator of the paper has a row for every optimizer that was run, whether or not that
    cell was. Below stand the models with effects that do better than without on some cable.
    """
    cables, rig = _cables(results), rig_names(results.rigs)
    methods = _methods(results)
    ours = [[v for c in cables for v in _tuned(results, c, method)] for method in methods]
    paper = [[v for c in CABLES for v in _papers(method, c)] for method in methods]
    marked = zip(methods, _marked(ours, 1), _marked(paper, 0), strict=True)
    rows = [Row((method.label,), (*own, *reference)) for method, own, reference in marked]
    floors = [c.floor if c else None for c in map(results.cable, cables)]
    known = [Cell(getattr(floor, metric, None)) for floor in floors for metric in _METRICS]
    blanks = [Cell(None)] * (2 * len(CABLES))
    errors = [t.facts.get("errors", {}) for t in results.tunings]
    n_test = _numbers({e["test"]["n_casts"] for e in errors if "test" in e})
    return Table(
        name="tuning",
        caption=(
            f"Error of the tuned simulators on {n_test} held-out casts for each cable, "
            f"in % of cable length, on the {rig}: average waypoint error "
            "(Wayp.) and median final distance (Last). The noise floor is how far repeats of one "
            f"action lie from their mean: no model does better. {_efforts(results)}{_PAPER_NOTE}"
        ),
        label_columns=("Sim. model",),
        groups=(
            *(Group(f"{rig}, {cable_name(c)}", ("Wayp.", "Last")) for c in cables),
            *(Group(f"{PAPER_RIG}, {cable_name(c)}", ("Wayp.", "Last")) for c in CABLES),
        ),
        rows=(*rows, Row(("Noise floor (repeats)",), (*known, *blanks))),
        reference=len(cables),
    )


@dataclass(frozen=True)
class _Method:
    """A row of table "tuning": what was tuned by what, with which effects, by name."""

    simulator: str
    optimizer: str
    effects: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        return method_name(self.simulator, self.optimizer, self.effects)


def _method(tuned: Tuning | ModelRevision) -> _Method:
    return _Method(tuned.simulator, tuned.optimizer, tuned.effects)


def _methods(results: Results) -> list[_Method]:
    """Return the rows: without effects first, then those with effects that help."""
    simulators = [*TUNING, *sorted({t.simulator for t in results.tunings} - set(TUNING))]
    optimizers = ["de", *sorted({t.optimizer for t in results.tunings} - {"de"})]
    tuned = [*results.tunings, *(r for cable in results.cables for r in cable.revisions)]
    richer = sorted(
        {_method(t) for t in tuned if t.effects},
        key=lambda m: (m.simulator, m.optimizer, m.effects),
    )
    return [
        *(_Method(s, o) for s in simulators for o in optimizers),
        *(method for method in richer if _helps(results, method)),
    ]


def _helps(results: Results, method: _Method) -> bool:
    """Tell whether the effects lower the waypoint error on some cable."""
    plain = replace(method, effects=())
    pairs = [
        (_tuned(results, cable, method)[0], _tuned(results, cable, plain)[0])
        for cable in _cables(results)
    ]
    return any(r is not None and (base is None or r < base) for r, base in pairs)


def _tuned(results: Results, cable: str, method: _Method) -> tuple[float | None, float | None]:
    """Return both errors of a row on one cable, None where it was not run there.

    What lies tuned now is asked first, then the revisions that a later tuning has replaced.
    """
    for tuning in results.tunings:
        if tuning.cable == cable and _method(tuning) == method:
            return tuning.error("test", _METRICS[0]), tuning.error("test", _METRICS[1])
    known = results.cable(cable)
    for r in known.revisions if known else ():
        if _method(r) == method:
            return r.heldout_waypoint_error_percent, r.heldout_final_error_percent
    return None, None


def _papers(method: _Method, cable: str) -> tuple[float | None, float | None]:
    """Return the paper's errors, which are of differential evolution and no effects."""
    if method.optimizer != "de" or method.effects:
        return None, None
    return TUNING.get(method.simulator, {}).get(cable, (None, None))


def _efforts(results: Results) -> str:
    """Say what each tuning was given, where it was not the same for all."""
    efforts: dict[str, set[tuple[int, int]]] = {}
    for tuning in results.tunings:
        casts = tuning.facts.get("errors", {}).get("tune", {}).get("n_casts", 0)
        given = (casts, tuning.facts.get("simulated_casts", 0))
        efforts.setdefault(tuning.method, set()).add(given)
    if len(set().union(*efforts.values())) < 2:
        return ""
    said = [
        f"{label} {_numbers({n for n, _ in both})} casts, "
        f"{thousands(max(n for _, n in both))} simulated"
        for label, both in sorted(efforts.items())
    ]
    return f"Tuned to: {'; '.join(said)}. "


def policies_table(results: Results) -> Table:
    """Errors of every policy on one cable (paper, tab:error), on others where several were run.

    Cable 1 has a row for every policy of the paper, whether it was run or not.
    """
    of = {c: [e for e in results.evaluations if e.cable == c] for c in _cables(results)}
    blocks = [cable for cable, evaluations in of.items() if len(evaluations) > 1]
    blocks = blocks or [e.cable for e in results.evaluations[:1]] or ["cable1"]
    rows: list[Row] = []
    for cable in blocks:
        evaluated = {(e.policy, e.dataset) for e in of[cable]}
        pairs = [p for p in POLICIES if cable == "cable1" or p in evaluated]
        pairs += sorted(evaluated - set(pairs))
        cast = [results.evaluation(cable, *p) for p in pairs]
        paper = [POLICIES.get(p) if cable == "cable1" else None for p in pairs]
        own = _marked([_quartiles(e) for e in cast], 1)
        reference = _marked([p or (None,) * 5 for p in paper], 0)
        rows += [
            Row(
                (cable_name(cable), policy_name(*pair), dataset_name(pair[1])),
                (*a, *_median_and_repeats(e), *b),
            )
            for pair, a, e, b in zip(pairs, own, cast, reference, strict=True)
        ]
    shown = [e for cable in blocks for e in of[cable]]
    return _beside_the_paper(
        "policies",
        f"Final distance to the target for each policy, {_setting(shown)}. "
        f"All errors in % of cable length; best in bold. {_BESIDE_NOTE} {_PAPER_NOTE}",
        ("Cable", "Model", "Dataset"),
        (shown, f"{PAPER_RIG}, Cable 1"),
        rows,
    )


def cables_table(results: Results) -> Table:
    """Errors of π_R2S2R (paper, tab:results), one row a cable."""
    cast = {c: results.evaluation(c, "nn", "mixed") for c in _cables(results)}
    rows = [
        Row(
            (cable_name(cable),),
            (
                *map(Cell, _quartiles(e)),
                *_median_and_repeats(e),
                *(Cell(v, 0) for v in CABLES.get(cable, (None,) * 5)),
            ),
        )
        for cable, e in cast.items()
    ]
    shown = [e for e in cast.values() if e]
    return _beside_the_paper(
        "cables",
        "Final distance to the target of π_R2S2R, trained for each cable by itself, "
        f"{_setting(shown)}. All errors in % of cable length. {_BESIDE_NOTE} {_PAPER_NOTE}",
        ("Cable",),
        (shown, PAPER_RIG),
        rows,
    )


def _beside_the_paper(
    name: str,
    caption: str,
    labels: tuple[str, ...],
    both: tuple[Sequence[Evaluation], str],
    rows: Sequence[Row],
) -> Table:
    """Return quartiles with their interval and repeats, beside the paper's quartiles."""
    groups = (
        Group(_rigs(both[0]), QUARTILES),
        Group("Median", ("from", "to")),
        Group("Repeats", ("Scatter",)),
        Group(both[1], QUARTILES),
    )
    return Table(name, caption, labels, groups, tuple(rows), reference=3)


def parts_table(results: Results) -> Table:
    """What every policy's error is made of, how sure its median is, what its model expects."""
    paper = [*POLICIES]

    def place(e: Evaluation) -> tuple:
        pair = (e.policy, e.dataset)
        return (e.cable, paper.index(pair) if pair in paper else len(paper), pair)

    shown = [e for e in sorted(results.evaluations, key=place) if len(e.errors_percent)]
    rows = []
    for e in shown:
        parts = e.parts
        share = 100 * parts.repeatability_share if parts else None
        cells = (
            Cell(float(np.median(e.errors_percent))),
            *_median_and_repeats(e),
            Cell(parts.repeatability if parts else None),
            Cell(parts.model if parts else None),
            Cell(share),
            Cell(None if share is None else 100 - share),
            Cell(e.expected_percent),
            Cell(None if e.within_expected is None else 100 * e.within_expected),
        )
        labels = (cable_name(e.cable), policy_name(e.policy, e.dataset), dataset_name(e.dataset))
        rows.append(Row(labels, cells))
    return Table(
        name="parts",
        caption=(
            f"What the error of each policy is made of, {_setting(shown)}. The 95 % interval of "
            "the median is a bootstrap over targets; the scatter is the median distance of "
            "repeats from their mean. Root mean squares: repeatability (aleatoric) is the scatter "
            "of repeats, model (epistemic) the distance of their mean from the target; the shares "
            "are their parts of the mean square error. Expected is how far from its "
            "prediction the model expects a cast to end (root mean square), covered the share of "
            "casts that ended where it expects 95 %. In % of cable length but the shares."
        ),
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


def _quartiles(evaluation: Evaluation | None) -> tuple[float | None, ...]:
    if evaluation is None or len(evaluation.errors_percent) == 0:
        return (None,) * 5
    return tuple(np.percentile(evaluation.errors_percent, [50, 25, 75, 0, 100]).tolist())


def _median_and_repeats(evaluation: Evaluation | None) -> tuple[Cell, ...]:
    """Return the median's 95 % interval, then what repeats of one cast differ by."""
    if evaluation is None or len(evaluation.errors_percent) == 0:
        return (Cell(None),) * 3
    low, high = evaluation.median_interval or (None, None)
    return Cell(low), Cell(high), Cell(evaluation.scatter_percent)


def _marked(rows: Sequence[Sequence[float | None]], digits: int) -> list[tuple[Cell, ...]]:
    """Turn numbers into cells, the lowest of each column marked if there is more than one."""
    best = []
    for column in zip(*rows, strict=True):
        shown = [round(v, digits) for v in column if v is not None]
        best.append(min(shown) if len(shown) > 1 else None)
    return [
        tuple(
            Cell(v, digits, v is not None and b is not None and round(v, digits) == b)
            for v, b in zip(row, best, strict=True)
        )
        for row in rows
    ]


def _cables(results: Results) -> list[str]:
    """The paper's cables, run or not, then any other."""
    return [*CABLES, *(c.name for c in results.cables if c.name not in CABLES)]


def _rigs(evaluations: Sequence[Evaluation]) -> str:
    return rig_names(tuple(sorted({e.rig for e in evaluations})))


def _setting(evaluations: Sequence[Evaluation]) -> str:
    """Say on what and how often the policies were tested, and whose casts were lost."""
    if not evaluations:
        return "not run yet"
    where = f"on the {_rigs(evaluations)}"
    if all(e.kind == "predicted" for e in evaluations):
        return (
            f"{where}, where nothing can be executed: the distance of the predicted from the "
            f"measured endpoint of {_numbers({len(e.casts) for e in evaluations})} held-out "
            "recorded casts"
        )
    lost = [
        f"{e.lost} of {cable_name(e.cable)}, {policy_label(e.policy, e.dataset)}"
        for e in evaluations
        if e.lost
    ]
    targets, repeats = ({getattr(e, of) for e in evaluations} for of in ("targets", "repeats"))
    said = f" (lost in tracking: {'; '.join(lost)})" if lost else ""
    return f"{where}, {_numbers(targets)} targets × {_numbers(repeats)} casts each{said}"


def _numbers(found: set[int]) -> str:
    """{30} → "30"; {20, 30} → "20 to 30"."""
    if not found:
        return "no"
    return str(min(found)) if len(found) == 1 else f"{min(found)} to {max(found)}"
