"""Which tuned simulator and which policy do best."""

from robotcast.reporting.results import Evaluation, Results, Tuning


def best_tuning(results: Results, cable: str) -> Tuning | None:
    """Return the tuned simulator that does best on held-out casts of a cable."""
    tunings = [t for t in results.tunings if t.cable == cable and test_error(t) is not None]
    return min(tunings, key=test_error, default=None)  # type: ignore[arg-type]


def test_error(tuning: Tuning) -> float | None:
    """Return the average waypoint error on held-out casts [% of cable length]."""
    return tuning.error("test", "waypoint_percent")


def best_policy(results: Results, cable: str) -> Evaluation | None:
    """Return the policy whose casts on a rig ended nearest to the targets, by the median."""
    cast = [e for e in results.evaluations if e.cable == cable and e.kind == "executed"]
    ended = [e for e in cast if e.median_percent is not None]
    return min(ended, key=lambda e: e.median_percent, default=None)  # type: ignore[arg-type, return-value]
