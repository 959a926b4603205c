"""What a run was: its scale, its sizes, what was tuned and trained."""

from dataclasses import dataclass

from robotcast.reporting.names import (
    cable_name,
    policy_label,
    rig_names,
    thousands,
)
from robotcast.reporting.results import CableData, Results


@dataclass(frozen=True)
class RunFacts:
    """What the caller knows of the run that the results do not tell.

    Attributes
    ----------
    sizes : (name, text) pairs of the scale's sizes.
    """

    scale: str
    seed: int
    sizes: tuple[tuple[str, str], ...]


def run_rows(results: Results, facts: RunFacts) -> tuple[tuple[str, str], ...]:
    """Return what a run was as rows (what, text)."""
    rows = [
        ("Rig", rig_names(results.rigs)),
        ("Scale", facts.scale),
        ("Seed", str(facts.seed)),
        *facts.sizes,
    ]
    for cable in results.cables:
        if cable.measured is not None:
            rows.append((f"Measured, {cable_name(cable.name)}", _measured(cable)))
    for tuning in results.tunings:
        casts = tuning.facts.get("simulated_casts", 0)
        rows.append(
            (
                f"Tuned, {cable_name(tuning.cable)}",
                f"{tuning.method}: {thousands(casts)} simulated casts, "
                f"seed {tuning.facts.get('seed', '–')}{_doubts(tuning.facts)}",
            )
        )
    for (cable, folder), policy in results.policies.items():
        name = policy_label(*folder.rsplit("-", 1))
        told = {k: v for k, v in policy["examples"].items() if k not in ("cable", "mixtures")}
        examples = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in told.items())
        rows.append(
            (
                f"Trained, {cable_name(cable)}",
                f"{name}: {examples}; best after {policy['best_epoch']} of {policy['epochs']} "
                f"passes, median error on validation {1000 * policy['validation_median_m']:.0f} mm",
            )
        )
    return tuple(rows)


def _measured(cable: CableData) -> str:
    """Return how much was cast and what of it is missing."""
    trials = cable.measured.trials if cable.measured else ()
    actions = len({trial.action_id for trial in trials})
    lost = len(cable.tracking.get("lost", ()))
    return f"{thousands(len(trials))} casts of {thousands(actions)} actions" + (
        f"; {thousands(lost)} more lost in tracking" if lost else ""
    )


def _doubts(facts: dict) -> str:
    """Return what to know before trusting tuned parameters, empty when there is nothing."""
    bounds = [name for name, p in facts.get("parameters", {}).items() if p.get("at_bound")]
    vague, lost = facts.get("certainty", {}).get("vague"), facts.get("diverged_casts")
    said = [
        f"{thousands(lost)} diverged" if lost else "",
        f"at a bound: {', '.join(bounds)}" if bounds else "",
        f"hardly told by the casts: {', '.join(vague)}" if vague else "",
        "" if "certainty" in facts else "too few casts to say how well these tell the parameters",
    ]
    return "".join(f"; {words}" for words in said if words)
