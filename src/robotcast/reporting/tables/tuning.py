"""Table "tuning" (paper, tab:tuning): how well each tuned simulator does on held-out casts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from robotcast.reporting.names import (
    cable_name,
    method_name,
    rig_names,
    thousands,
)
from robotcast.reporting.paper import CABLES, PAPER_RIG, TUNING
from robotcast.reporting.results import Results, Tuning
from robotcast.reporting.table import Cell, Group, Row, Table
from robotcast.reporting.tables.cells import marked
from robotcast.reporting.tables.setting import PAPER_NOTE, cables_of, numbers
from robotcast.tuning.revisions import Revision

_METRICS = ("waypoint_percent", "final_percent")


def tuning_table(results: Results) -> Table:
    """Error of each tuned simulator on held-out casts, per cable, with the noise floor.

    Every simulator of the paper has a row for every optimizer that was run, whether or not that
    cell was. Below stand the models with effects that do better than without on some cable.
    """
    cables = cables_of(results)
    rows_of = _methods(results)
    ours = [[_tuned(results, cable, row) for cable in cables] for row in rows_of]
    paper = [[_papers(row, cable) for cable in CABLES] for row in rows_of]
    own, reference = marked(_flat(ours), digits=1), marked(_flat(paper), digits=0)
    rows = [Row((row.label,), (*a, *b)) for row, a, b in zip(rows_of, own, reference, strict=True)]
    rig = rig_names(results.rigs)
    floors = [results.cable(c) for c in cables]
    floor_cells = [
        Cell(getattr(c.floor, metric) if c and c.floor else None)
        for c in floors
        for metric in _METRICS
    ]
    blanks = [Cell(None)] * (2 * len(CABLES))
    rows.append(Row(("Noise floor (repeats)",), (*floor_cells, *blanks)))
    n_test = sorted(
        {t.facts["errors"]["test"]["n_casts"] for t in results.tunings if _judged(t, "test")}
    )
    return Table(
        name="tuning",
        caption=(
            f"Error of the tuned simulators on {numbers(n_test)} held-out casts for each cable, "
            f"in % of cable length, on the {rig}: average waypoint error "
            "(Wayp.) and median final distance (Last). The noise floor is how far repeats of one "
            f"action lie from their mean: no model does better. {_efforts(results)}{PAPER_NOTE}"
        ),
        label_columns=("Sim. model",),
        groups=(
            *(Group(f"{rig}, {cable_name(c)}", ("Wayp.", "Last")) for c in cables),
            *(Group(f"{PAPER_RIG}, {cable_name(c)}", ("Wayp.", "Last")) for c in CABLES),
        ),
        rows=tuple(rows),
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


def _methods(results: Results) -> list[_Method]:
    """Return the rows: without effects first, then those with effects that help."""
    pairs = {(t.simulator, t.optimizer) for t in results.tunings}
    simulators = [*TUNING, *sorted({s for s, _ in pairs} - set(TUNING))]
    optimizers = ["de", *sorted({o for _, o in pairs} - {"de"})]
    base = [_Method(s, o) for s in simulators for o in optimizers]
    found = {_method(t) for t in results.tunings}
    for cable in results.cables:
        found |= {_method(r) for r in cable.revisions}
    richer = sorted(
        (m for m in found if m.effects), key=lambda m: (m.simulator, m.optimizer, m.effects)
    )
    return [*base, *(method for method in richer if _helps(results, method))]


def _helps(results: Results, method: _Method) -> bool:
    """Tell whether the effects lower the waypoint error on some cable."""
    plain = replace(method, effects=())
    for cable in cables_of(results):
        richer, base = _tuned(results, cable, method)[0], _tuned(results, cable, plain)[0]
        if richer is not None and (base is None or richer < base):
            return True
    return False


def _tuned(results: Results, cable: str, method: _Method) -> tuple[float | None, float | None]:
    """Return both errors of a row on one cable, None where it was not run there.

    What lies tuned now is asked first, then the revisions that a later tuning has replaced.
    """
    for tuning in results.tunings:
        if tuning.cable == cable and _method(tuning) == method:
            waypoint, final = (tuning.error("test", metric) for metric in _METRICS)
            return waypoint, final
    known = results.cable(cable)
    for r in known.revisions if known else ():
        if _method(r) == method:
            return r.heldout_waypoint_error_percent, r.heldout_final_error_percent
    return None, None


def _method(tuned: Tuning | Revision) -> _Method:
    return _Method(tuned.simulator, tuned.optimizer, tuned.effects)


def _judged(tuning: Tuning, split: str) -> bool:
    return split in tuning.facts.get("errors", {})


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
        efforts.setdefault(tuning.method, set()).add(
            (casts, tuning.facts.get("simulated_casts", 0))
        )
    if len(set().union(*efforts.values())) < 2:
        return ""
    said = [
        f"{label} {numbers(sorted({n for n, _ in both}))} casts, "
        f"{thousands(max(n for _, n in both))} simulated"
        for label, both in sorted(efforts.items())
    ]
    return f"Tuned to: {'; '.join(said)}. "


def _flat(rows: Sequence[Sequence[Sequence]]) -> list[list]:
    return [[value for pair in row for value in pair] for row in rows]
