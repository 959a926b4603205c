"""Table "cables" (paper, tab:results): π_R2S2R on every cable."""

from robotcast.reporting.names import cable_name
from robotcast.reporting.paper import CABLES, PAPER_RIG, QUARTILES
from robotcast.reporting.results import Results
from robotcast.reporting.table import Group, Row, Table
from robotcast.reporting.tables.cells import median_and_repeats, plain_cells, quartiles
from robotcast.reporting.tables.setting import (
    BESIDE_NOTE,
    PAPER_NOTE,
    cables_of,
    rigs_of,
    setting,
)


def cables_table(results: Results) -> Table:
    """Errors of π_R2S2R, one row a cable."""
    cables = cables_of(results)
    evaluations = [results.evaluation(c, "nn", "mixed") for c in cables]
    own = plain_cells([quartiles(e) for e in evaluations], digits=1)
    beside = [median_and_repeats(e) for e in evaluations]
    reference = plain_cells([CABLES.get(c, (None,) * 5) for c in cables], digits=0)
    return Table(
        name="cables",
        caption=(
            "Final distance to the target of π_R2S2R, trained for each cable by itself, "
            f"{setting([e for e in evaluations if e])}. "
            f"All errors in % of cable length. {BESIDE_NOTE} {PAPER_NOTE}"
        ),
        label_columns=("Cable",),
        groups=(
            Group(rigs_of([e for e in evaluations if e]), QUARTILES),
            Group("Median", ("from", "to")),
            Group("Repeats", ("Scatter",)),
            Group(PAPER_RIG, QUARTILES),
        ),
        rows=tuple(
            Row((cable_name(name),), (*a, *b, *c))
            for name, a, b, c in zip(cables, own, beside, reference, strict=True)
        ),
        reference=3,
    )
