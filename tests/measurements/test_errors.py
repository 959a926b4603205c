"""The two metrics are the paper's, in metres and in % of cable length."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotcast.measurements.errors import prediction_errors
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set


@pytest.fixture
def measured(set_folder: Path) -> MeasurementSet:
    whole = read_measurement_set(set_folder)
    trials = tuple(
        replace(t, waypoints_s=t.waypoints_s[:k], waypoints_m=t.waypoints_m[:k])
        for t, k in zip(whole.trials, (3, 1, 2), strict=True)
    )
    return replace(whole, trials=trials)


def padded(measured: MeasurementSet, offsets_m: list[list[float]]) -> np.ndarray:
    """Return the measured waypoints shifted in y by `offsets_m`, NaN-padded to 4 waypoints."""
    predicted = np.full((len(measured.trials), 4, 2), np.nan)
    for row, trial, offset in zip(predicted, measured.trials, offsets_m, strict=True):
        row[: len(trial.waypoints_m)] = trial.waypoints_m + np.array([[0, o] for o in offset])
    return predicted


OFFSETS = [[0.0, 0.03, 0.06], [0.01], [0.02, 0.04]]


def test_every_cast_weighs_the_same(measured: MeasurementSet) -> None:
    errors = prediction_errors(padded(measured, OFFSETS), measured.trials, 0.5)
    assert errors.waypoint_m == pytest.approx((0.03 + 0.01 + 0.03) / 3)
    assert errors.final_m == pytest.approx(0.04)
    assert errors.waypoint_percent == pytest.approx(100 * errors.waypoint_m / 0.5)
    assert errors.final_percent == pytest.approx(8)
    assert (errors.n_casts, errors.n_diverged) == (3, 0)


def test_the_final_error_is_of_casts_that_rested(measured: MeasurementSet) -> None:
    trials = [replace(t, rested=t.trial == 2) for t in measured.trials]
    errors = prediction_errors(padded(measured, [[0, 0, 0.5], [0.5], [0, 0.1]]), trials, 0.5)
    assert errors.final_m == pytest.approx(0.1)


def test_a_diverged_run_costs_a_cable_length_and_is_counted(measured: MeasurementSet) -> None:
    predicted = padded(measured, OFFSETS)
    predicted[0, 2] = np.nan
    errors = prediction_errors(predicted, measured.trials, 0.5)
    assert errors.n_diverged == 1
    assert errors.waypoint_m == pytest.approx((0.5 + 0.01 + 0.03) / 3)


def test_predictions_of_another_shape_are_refused(measured: MeasurementSet) -> None:
    with pytest.raises(ValueError, match=r"3 casts with up to 3 waypoints"):
        prediction_errors(np.zeros((3, 2, 2)), measured.trials, 0.5)
