"""The noise floor is what a perfect model would still show."""

from dataclasses import replace
from pathlib import Path

import pytest

from robotcast.cast_model import noise_floor
from robotcast.measurements.measurement_set import Trial
from robotcast.measurements.reader import read_measurement_set
from tests.good_casts import good_set


def test_repeats_of_a_real_set_scatter_as_its_answer_says(recorded_sets: Path) -> None:
    floor = noise_floor(read_measurement_set(recorded_sets / "a"))
    assert floor is not None and floor.sample_percent == pytest.approx(0.8, abs=0.1)


def test_it_is_unknown_without_repeats_and_from_repeats_that_never_overlap_in_time() -> None:
    def unknown(*trials: Trial) -> bool:
        floor = noise_floor(replace(measured, trials=trials))
        return floor is None or floor.sample_percent is None

    measured = good_set()
    one, other = measured.trials[0], replace(measured.trials[0], trial=99)
    later = replace(other, waypoints_s=other.waypoints_s + 2 * other.waypoints_s[-1] + 1)
    assert unknown() and unknown(one) and unknown(one, later) and not unknown(one, other)
