"""Where the casts of policies came to rest, as several sections show it."""

from collections.abc import Iterable

from robotcast.reporting.figures.style import svg
from robotcast.reporting.figures.targets import targets_figure
from robotcast.reporting.names import rig_names
from robotcast.reporting.page import PageFigure
from robotcast.reporting.results import Evaluation, Results

_DATASETS = {"real": 0, "simulated": 1, "mixed": 2}


def in_order(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """Sort evaluations by cable, policy and what was learned from."""
    return sorted(evaluations, key=lambda e: (e.cable, e.policy, _DATASETS.get(e.dataset, 9)))


def targets_of(
    results: Results, evaluations: list[Evaluation], name: str, title: str
) -> PageFigure:
    """Draw targets, and where casts at them came to rest, over the reachable area."""
    rigs = rig_names(tuple(sorted({e.rig for e in evaluations})))
    return PageFigure(
        name,
        f"{title}: targets and endpoints",
        f"Stars are targets, dots of the same colour where the free end came to rest on the "
        f"{rigs}; dashed lines lead from the mean endpoint to the target. Grey, where tuned "
        "simulation brings the free end to rest; yellow, the sector swept by the robot’s hand.",
        svg(targets_figure(evaluations, [results.cable(e.cable) for e in evaluations])),
    )
