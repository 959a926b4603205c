"""The numbers of every cable at a glance."""

from robotcast.reporting.best import best_policy, best_tuning, test_error
from robotcast.reporting.names import cable_name, policy_label, thousands
from robotcast.reporting.page import Glance
from robotcast.reporting.results import CableData, Results


def glance_of(results: Results) -> Glance:
    """Return a row a cable: lengths, counts, the floor, and how near model and policy come."""
    rows = tuple(_row(results, cable) for cable in results.cables)
    return Glance(
        columns=(
            "Cable",
            "Length",
            "Casts tracked",
            "Lost in tracking",
            "Noise floor: waypoint / last",
            "Best tuned: waypoint / last",
            "D_sim casts",
            "Diverged",
            "π_R2S2R median",
            "Best policy median",
            "Its repeats scatter",
        ),
        rows=rows,
        caption=(
            "Percentages are of cable length; “last” is the final rest position. The noise floor "
            "and the scatter are what repeats of one action show, and bound what any model or "
            "policy can reach. – was not run or is not known."
        ),
    )


def _row(results: Results, cable: CableData) -> tuple[str, ...]:
    measured, floor = cable.measured, cable.floor
    best = best_tuning(results, cable.name)
    mixed = results.evaluation(cable.name, "nn", "mixed")
    policy = best_policy(results, cable.name)
    return (
        cable_name(cable.name),
        f"{measured.cable.length_m:.2f} m" if measured else "–",
        str(len(measured.trials)) if measured else "–",
        str(len(cable.tracking["lost"])) if "lost" in cable.tracking else "–",
        _pair(floor.waypoint_percent, floor.final_percent) if floor else "–",
        _pair(test_error(best), best.error("test", "final_percent")) if best else "–",
        thousands(len(cable.simulated)) if cable.simulated else "–",
        str(cable.generation.get("diverged", "–")),
        _percent(mixed.median_percent) if mixed else "–",
        f"{policy_label(policy.policy, policy.dataset)} {_percent(policy.median_percent)}"
        if policy
        else "–",
        _percent(policy.scatter_percent) if policy else "–",
    )


def _pair(first: float | None, second: float | None) -> str:
    return f"{_percent(first)} / {_percent(second)}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}%"
