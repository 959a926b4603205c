"""The paper's three tables, filled with this run's results (tab:tuning, tab:error, tab:results)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.reporting.names import (
    cable_name,
    dataset_name,
    effect_name,
    optimizer_name,
    policy_name,
    rig_names,
    simulator_name,
    thousands,
)
from robotcast.reporting.paper import CABLES, PAPER_RIG, POLICIES, QUARTILES, TUNING
from robotcast.reporting.results import Evaluation, Results, Tuning
from robotcast.reporting.table import Cell, Group, Row, Table
from robotcast.tuning.revisions import Revision

_PAPER_NOTE = f"Columns “{PAPER_RIG}”: the paper’s values, a UR5 and real cables, for reference."
_TUNING_METRICS = ("waypoint_percent", "final_percent")


def all_tables(results: Results) -> tuple[Table, ...]:
    """Return the tables "tuning", "policies", "cables" and "parts"."""
    return (
        tuning_table(results),
        policies_table(results),
        cables_table(results),
        parts_table(results),
    )


def tuning_table(results: Results) -> Table:
    """Error of each tuned simulator on held-out casts, per cable, with the noise floor.

    Every simulator of the paper has a row for every optimizer that was run, whether or not that
    cell was. Below stand the models with effects that do better than without on some cable.
    """
    cables = _cables(results)
    rows_of = _methods(results)
    ours = [[_tuned(results, cable, row) for cable in cables] for row in rows_of]
    paper = [[_papers(row, cable) for cable in CABLES] for row in rows_of]
    own, reference = _marked(_flat(ours), digits=1), _marked(_flat(paper), digits=0)
    rows = [Row((row.label,), (*a, *b)) for row, a, b in zip(rows_of, own, reference, strict=True)]
    rig = rig_names(results.rigs)
    floors = [results.cable(c) for c in cables]
    floor_cells = [
        Cell(getattr(c.floor, metric) if c and c.floor else None)
        for c in floors
        for metric in _TUNING_METRICS
    ]
    blanks = [Cell(None)] * (2 * len(CABLES))
    rows.append(Row(("Noise floor (repeats)",), (*floor_cells, *blanks)))
    n_test = sorted(
        {t.facts["errors"]["test"]["n_casts"] for t in results.tunings if _judged(t, "test")}
    )
    return Table(
        name="tuning",
        caption=(
            f"Error of the tuned simulators on {_numbers(n_test)} held-out casts for each cable, "
            f"in % of cable length, on the {rig}: average waypoint error "
            "(Wayp.) and median final distance (Last). The noise floor is how far repeats of one "
            f"action lie from their mean: no model does better. {_efforts(results)}{_PAPER_NOTE}"
        ),
        label_columns=("Sim. model",),
        groups=(
            *(Group(f"{rig}, {cable_name(c)}", ("Wayp.", "Last")) for c in cables),
            *(Group(f"{PAPER_RIG}, {cable_name(c)}", ("Wayp.", "Last")) for c in CABLES),
        ),
        rows=tuple(rows),
        reference=len(cables),
    )


def policies_table(results: Results) -> Table:
    """Errors of every policy on one cable; further cables where more than one policy was run."""
    blocks = [c for c in _cables(results) if len(_of_cable(results, c)) > 1]
    blocks = blocks or [e.cable for e in results.evaluations[:1]] or ["cable1"]
    rows: list[Row] = []
    for cable in blocks:
        evaluations = _of_cable(results, cable)
        pairs = list(POLICIES)
        pairs += sorted({(e.policy, e.dataset) for e in evaluations} - set(pairs))
        own = _marked([_quartiles(results.evaluation(cable, *p)) for p in pairs], digits=1)
        paper = [POLICIES.get(p) if cable == "cable1" else None for p in pairs]
        reference = _marked([p or (None,) * 5 for p in paper], digits=0)
        rows += [
            Row((cable_name(cable), policy_name(*pair), dataset_name(pair[1])), (*a, *b))
            for pair, a, b in zip(pairs, own, reference, strict=True)
        ]
    shown = [e for c in blocks for e in _of_cable(results, c)]
    return Table(
        name="policies",
        caption=(
            f"Final distance to the target for each policy, {_setting(shown)}. "
            f"All errors in % of cable length; best in bold. {_PAPER_NOTE}"
        ),
        label_columns=("Cable", "Model", "Dataset"),
        groups=(
            Group(_own_title(shown), QUARTILES),
            Group(f"{PAPER_RIG}, Cable 1", QUARTILES),
        ),
        rows=tuple(rows),
        reference=1,
    )


def cables_table(results: Results) -> Table:
    """Errors of π_R2S2R, one row a cable."""
    cables = _cables(results)
    evaluations = [results.evaluation(c, "nn", "mixed") for c in cables]
    own = _cells([_quartiles(e) for e in evaluations], digits=1)
    reference = _cells([CABLES.get(c, (None,) * 5) for c in cables], digits=0)
    return Table(
        name="cables",
        caption=(
            "Final distance to the target of π_R2S2R, trained for each cable by itself, "
            f"{_setting([e for e in evaluations if e])}. "
            f"All errors in % of cable length. {_PAPER_NOTE}"
        ),
        label_columns=("Cable",),
        groups=(
            Group(_own_title([e for e in evaluations if e]), QUARTILES),
            Group(PAPER_RIG, QUARTILES),
        ),
        rows=tuple(
            Row((cable_name(c),), (*a, *b)) for c, a, b in zip(cables, own, reference, strict=True)
        ),
        reference=1,
    )


def parts_table(results: Results) -> Table:
    """What every policy's error is made of, how sure its median is, what its model expects."""
    shown = [e for e in _ordered(results) if len(e.errors_percent)]
    rows = []
    for evaluation in shown:
        parts, interval = evaluation.parts, evaluation.median_interval
        low, high = interval or (None, None)
        numbers = (
            float(np.median(evaluation.errors_percent)),
            low,
            high,
            evaluation.scatter_percent,
            parts.repeatability if parts else None,
            parts.model if parts else None,
            100 * parts.repeatability_share if parts else None,
            evaluation.expected_percent,
            _hundred(evaluation.within_expected),
        )
        labels = (
            cable_name(evaluation.cable),
            policy_name(evaluation.policy, evaluation.dataset),
            dataset_name(evaluation.dataset),
        )
        rows.append(Row(labels, tuple(Cell(v) for v in numbers)))
    return Table(
        name="parts",
        caption=(
            f"What the error of each policy is made of, {_setting(shown)}. The 95 % interval of "
            "the median is a bootstrap over targets; the scatter is the median distance of "
            "repeats from their mean. Root mean squares: repeatability (aleatoric) is the scatter "
            "of repeats, model (epistemic) the distance of their mean from the target; the share "
            "is repeatability’s part of the mean square error. Expected is how far from its "
            "prediction the model expects a cast to end (root mean square), covered the share of "
            "casts that ended where it expects 95 %. In % of cable length but the shares."
        ),
        label_columns=("Cable", "Model", "Dataset"),
        groups=(
            Group("Median", ("Median", "from", "to")),
            Group("Repeats", ("Scatter",)),
            Group("Root mean square", ("Repeatability", "Model", "Share")),
            Group("Model’s spread", ("Expected", "Covered")),
        ),
        rows=tuple(rows),
        reference=3,
    )


def _hundred(share: float | None) -> float | None:
    return None if share is None else 100 * share


def _ordered(results: Results) -> list[Evaluation]:
    """Evaluations by cable, then as the paper lists policies."""
    paper = [*POLICIES]

    def place(evaluation: Evaluation) -> tuple:
        pair = (evaluation.policy, evaluation.dataset)
        return (evaluation.cable, paper.index(pair) if pair in paper else len(paper), pair)

    return sorted(results.evaluations, key=place)


def _cables(results: Results) -> list[str]:
    """The paper's cables, run or not, then any other."""
    return [*CABLES, *(c.name for c in results.cables if c.name not in CABLES)]


def _of_cable(results: Results, cable: str) -> list[Evaluation]:
    return [e for e in results.evaluations if e.cable == cable]


def _judged(tuning: Tuning, split: str) -> bool:
    return split in tuning.facts.get("errors", {})


@dataclass(frozen=True)
class _Method:
    """A row of table "tuning": what was tuned by what, with which effects, by name."""

    simulator: str
    optimizer: str
    effects: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        added = "".join(f" + {effect_name(effect)}" for effect in self.effects)
        return f"{simulator_name(self.simulator)}, {optimizer_name(self.optimizer)}{added}"


def _methods(results: Results) -> list[_Method]:
    """Return the rows: without effects first, then those with effects that help."""
    pairs = {(t.simulator, t.optimizer) for t in results.tunings}
    simulators = [*TUNING, *sorted({s for s, _ in pairs} - set(TUNING))]
    optimizers = ["de", *sorted({o for _, o in pairs} - {"de"})]
    base = [_Method(s, o) for s in simulators for o in optimizers]
    found = {_Method(t.simulator, t.optimizer, _effects(t)) for t in results.tunings}
    for cable in results.cables:
        found |= {_Method(r.simulator, r.optimizer, r.effects) for r in cable.revisions}
    richer = sorted(
        (m for m in found if m.effects), key=lambda m: (m.simulator, m.optimizer, m.effects)
    )
    return [*base, *(method for method in richer if _helps(results, method))]


def _helps(results: Results, method: _Method) -> bool:
    """Tell whether the effects lower the waypoint error on some cable."""
    plain = replace(method, effects=())
    for cable in _cables(results):
        richer, base = _tuned(results, cable, method)[0], _tuned(results, cable, plain)[0]
        if richer is not None and (base is None or richer < base):
            return True
    return False


def _tuned(results: Results, cable: str, method: _Method) -> tuple[float | None, float | None]:
    """Return both errors of a row on one cable, None where it was not run there.

    What lies tuned now is asked first, then the revisions that a later tuning has replaced.
    """
    for tuning in results.tunings:
        if tuning.cable == cable and _Method(*_pair(tuning), _effects(tuning)) == method:
            waypoint, final = (tuning.error("test", metric) for metric in _TUNING_METRICS)
            return waypoint, final
    known = results.cable(cable)
    for r in known.revisions if known else ():
        if _Method(*_pair(r), r.effects) == method:
            return r.heldout_waypoint_error_percent, r.heldout_final_error_percent
    return None, None


def _pair(tuned: Tuning | Revision) -> tuple[str, str]:
    return tuned.simulator, tuned.optimizer


def _effects(tuning: Tuning) -> tuple[str, ...]:
    return tuple(sorted(tuning.facts.get("effects", ())))


def _papers(method: _Method, cable: str) -> tuple[float | None, float | None]:
    """Return the paper's errors, which are of differential evolution and no effects."""
    if method.optimizer != "de" or method.effects:
        return None, None
    return TUNING.get(method.simulator, {}).get(cable, (None, None))


def _efforts(results: Results) -> str:
    """Say what each tuning was given, where it was not the same for all."""
    efforts: dict[str, set[tuple[int, int]]] = {}
    for tuning in results.tunings:
        casts = tuning.facts["errors"]["tune"]["n_casts"] if _judged(tuning, "tune") else 0
        label = _Method(*_pair(tuning), _effects(tuning)).label
        efforts.setdefault(label, set()).add((casts, tuning.facts.get("simulated_casts", 0)))
    if len(set().union(*efforts.values())) < 2:
        return ""
    said = [
        f"{label} {_numbers(sorted({n for n, _ in both}))} casts, "
        f"{thousands(max(n for _, n in both))} simulated"
        for label, both in sorted(efforts.items())
    ]
    return f"Tuned to: {'; '.join(said)}. "


def _quartiles(evaluation: Evaluation | None) -> tuple[float | None, ...]:
    if evaluation is None or len(evaluation.errors_percent) == 0:
        return (None,) * 5
    return tuple(np.percentile(evaluation.errors_percent, [50, 25, 75, 0, 100]).tolist())


def _flat(rows: Sequence[Sequence[Sequence]]) -> list[list]:
    return [[value for pair in row for value in pair] for row in rows]


def _cells(rows: Sequence[Sequence[float | None]], digits: int) -> list[tuple[Cell, ...]]:
    return [tuple(Cell(v, digits) for v in row) for row in rows]


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


def _own_title(evaluations: Sequence[Evaluation]) -> str:
    return rig_names(tuple(sorted({e.rig for e in evaluations})))


def _setting(evaluations: Sequence[Evaluation]) -> str:
    """Say on what and how often the policies were tested."""
    if not evaluations:
        return "not run yet"
    where = f"on the {_own_title(evaluations)}"
    if all(e.kind == "predicted" for e in evaluations):
        casts = _numbers(sorted({len(e.casts) for e in evaluations}))
        return (
            f"{where}, where nothing can be executed: the distance of the predicted from the "
            f"measured endpoint of {casts} held-out recorded casts"
        )
    targets = sorted({e.targets for e in evaluations})
    repeats = sorted({e.repeats for e in evaluations})
    lost = sum(e.lost for e in evaluations)
    lost_note = f", {lost} lost in tracking" if lost else ""
    return f"{where}, {_numbers(targets)} targets × {_numbers(repeats)} casts each{lost_note}"


def _numbers(found: Sequence[int]) -> str:
    """[30] → "30"; [20, 30] → "20 to 30"."""
    if not found:
        return "no"
    return str(found[0]) if len(found) == 1 else f"{found[0]} to {found[-1]}"
