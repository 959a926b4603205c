"""The noise floor is what a perfect model would still show."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotcast.casts.action import Action, ToolMotion
from robotcast.measurements.errors import NoiseFloor, noise_floor
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from robotcast.measurements.reader import read_measurement_set

SCATTER_M = 0.005
TIMES_S = np.arange(30) * 0.1


def scattered_set(n_actions: int, n_repeats: int) -> MeasurementSet:
    """Repeats around one path with normal scatter of SCATTER_M in x and y."""
    rng = np.random.default_rng(0)
    still = ToolMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
    trials = tuple(
        Trial(
            trial=action * n_repeats + repeat,
            action_id=action,
            action=Action(0.5, 0.6, -0.5, 0.6, 0.0, 1.0),
            tool=still,
            waypoints_s=TIMES_S,
            waypoints_m=np.stack([TIMES_S, 0 * TIMES_S], axis=1)
            + SCATTER_M * rng.normal(size=(len(TIMES_S), 2)),
        )
        for action in range(n_actions)
        for repeat in range(n_repeats)
    )
    return MeasurementSet(Cable("c", 0.5, 0.01, 0.005, 0.02), 0.6, 0.1, None, trials)


@pytest.mark.parametrize("n_repeats", [2, 3, 8])
def test_few_repeats_do_not_make_the_floor_look_lower(n_repeats: int) -> None:
    floor = noise_floor(scattered_set(1200 // n_repeats, n_repeats))
    mean_m, median_m = SCATTER_M * np.sqrt(np.pi / 2), SCATTER_M * np.sqrt(2 * np.log(2))
    assert floor.waypoint_percent == pytest.approx(100 * mean_m / 0.5, rel=0.02)
    assert floor.final_percent == pytest.approx(100 * median_m / 0.5, rel=0.08)


def test_repeats_of_a_real_set_scatter_as_its_answer_says(recorded_sets: Path) -> None:
    floor = noise_floor(read_measurement_set(recorded_sets / "a"))
    assert floor.waypoint_percent == pytest.approx(0.8, abs=0.1)


def test_gaps_match_by_time() -> None:
    full = scattered_set(40, 3)
    gappy = replace(
        full,
        trials=tuple(
            replace(t, waypoints_s=t.waypoints_s[kept], waypoints_m=t.waypoints_m[kept])
            for t in full.trials
            for kept in [np.arange(len(TIMES_S)) % 3 != t.trial % 3]
        ),
    )
    before, after = noise_floor(full), noise_floor(gappy)
    assert after.waypoint_percent == pytest.approx(before.waypoint_percent, rel=0.1)


def test_it_is_unknown_without_repeats_and_from_repeats_that_never_overlap_in_time() -> None:
    assert noise_floor(scattered_set(5, 1)) == NoiseFloor(None, None)
    pair = scattered_set(1, 2)
    apart = tuple(
        replace(t, waypoints_s=TIMES_S[i::2], waypoints_m=t.waypoints_m[i::2])
        for i, t in enumerate(pair.trials)
    )
    assert noise_floor(replace(pair, trials=apart)).waypoint_percent is None
