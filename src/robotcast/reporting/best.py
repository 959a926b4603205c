"""Which tuned simulator does best."""

from robotcast.reporting.results import Results, Tuning


def best_tuning(results: Results, cable: str) -> Tuning | None:
    """Return the tuned simulator that does best on held-out casts of a cable."""
    tunings = [t for t in results.tunings if t.cable == cable and test_error(t) is not None]
    return min(tunings, key=test_error, default=None)  # type: ignore[arg-type]


def test_error(tuning: Tuning) -> float | None:
    """Return the average waypoint error on held-out casts [% of cable length]."""
    return tuning.error("test", "waypoint_percent")
