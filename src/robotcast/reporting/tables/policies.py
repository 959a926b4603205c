"""Table "policies" (paper, tab:error): how far from the target each policy ends."""

from robotcast.reporting.names import cable_name, dataset_name, policy_name
from robotcast.reporting.paper import PAPER_RIG, POLICIES, QUARTILES
from robotcast.reporting.results import Results
from robotcast.reporting.table import Group, Row, Table
from robotcast.reporting.tables.cells import marked, median_and_repeats, quartiles
from robotcast.reporting.tables.setting import (
    BESIDE_NOTE,
    PAPER_NOTE,
    cables_of,
    of_cable,
    rigs_of,
    setting,
)


def policies_table(results: Results) -> Table:
    """Errors of every policy on one cable; further cables where more than one policy was run.

    Cable 1 has a row for every policy of the paper, whether it was run or not.
    """
    blocks = [c for c in cables_of(results) if len(of_cable(results, c)) > 1]
    blocks = blocks or [e.cable for e in results.evaluations[:1]] or ["cable1"]
    rows: list[Row] = []
    for cable in blocks:
        evaluations = of_cable(results, cable)
        evaluated = {(e.policy, e.dataset) for e in evaluations}
        pairs = [p for p in POLICIES if cable == "cable1" or p in evaluated]
        pairs += sorted(evaluated - set(pairs))
        cast = [results.evaluation(cable, *p) for p in pairs]
        own = marked([quartiles(e) for e in cast], digits=1)
        beside = [median_and_repeats(e) for e in cast]
        paper = [POLICIES.get(p) if cable == "cable1" else None for p in pairs]
        reference = marked([p or (None,) * 5 for p in paper], digits=0)
        rows += [
            Row((cable_name(cable), policy_name(*pair), dataset_name(pair[1])), (*a, *b, *c))
            for pair, a, b, c in zip(pairs, own, beside, reference, strict=True)
        ]
    shown = [e for c in blocks for e in of_cable(results, c)]
    return Table(
        name="policies",
        caption=(
            f"Final distance to the target for each policy, {setting(shown)}. "
            f"All errors in % of cable length; best in bold. {BESIDE_NOTE} {PAPER_NOTE}"
        ),
        label_columns=("Cable", "Model", "Dataset"),
        groups=(
            Group(rigs_of(shown), QUARTILES),
            Group("Median", ("from", "to")),
            Group("Repeats", ("Scatter",)),
            Group(f"{PAPER_RIG}, Cable 1", QUARTILES),
        ),
        rows=tuple(rows),
        reference=3,
    )
