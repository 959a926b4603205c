"""What tables say of where their numbers come from."""

from collections.abc import Sequence

from robotcast.reporting.names import cable_name, policy_label, rig_names
from robotcast.reporting.paper import CABLES, PAPER_RIG
from robotcast.reporting.results import Evaluation, Results

BESIDE_NOTE = (
    "From and to: the 95 % interval of the median, a bootstrap over targets. Scatter: median "
    "distance of the repeats of a cast from their mean, the rig’s own repeatability."
)
PAPER_NOTE = f"Columns “{PAPER_RIG}”: the paper’s values, a UR5 and real cables, for reference."


def cables_of(results: Results) -> list[str]:
    """The paper's cables, run or not, then any other."""
    return [*CABLES, *(c.name for c in results.cables if c.name not in CABLES)]


def of_cable(results: Results, cable: str) -> list[Evaluation]:
    return [e for e in results.evaluations if e.cable == cable]


def rigs_of(evaluations: Sequence[Evaluation]) -> str:
    return rig_names(tuple(sorted({e.rig for e in evaluations})))


def setting(evaluations: Sequence[Evaluation]) -> str:
    """Say on what and how often the policies were tested."""
    if not evaluations:
        return "not run yet"
    where = f"on the {rigs_of(evaluations)}"
    if all(e.kind == "predicted" for e in evaluations):
        casts = numbers(sorted({len(e.casts) for e in evaluations}))
        return (
            f"{where}, where nothing can be executed: the distance of the predicted from the "
            f"measured endpoint of {casts} held-out recorded casts"
        )
    targets = sorted({e.targets for e in evaluations})
    repeats = sorted({e.repeats for e in evaluations})
    return (
        f"{where}, {numbers(targets)} targets × {numbers(repeats)} casts each{_lost(evaluations)}"
    )


def _lost(evaluations: Sequence[Evaluation]) -> str:
    """Say whose casts were lost: what remains of them counts."""
    lost = [
        f"{e.lost} of {cable_name(e.cable)}, {policy_label(e.policy, e.dataset)}"
        for e in evaluations
        if e.lost
    ]
    return f" (lost in tracking: {'; '.join(lost)})" if lost else ""


def numbers(found: Sequence[int]) -> str:
    """[30] → "30"; [20, 30] → "20 to 30"."""
    if not found:
        return "no"
    return str(found[0]) if len(found) == 1 else f"{found[0]} to {found[-1]}"
