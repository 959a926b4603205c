"""What a comparison says of predictions whose errors are known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from robotcast.casts.action import Action, ToolMotion
from robotcast.diagnosis.compare import compare, trends
from robotcast.diagnosis.misfit import misfit
from robotcast.diagnosis.model import Record
from robotcast.measurements.errors import noise_floor, prediction_errors
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from tests.diagnosis.made_up_trials import MODEL, NOISE, SCALE, TIMES_S, MadeUp, compared, made_up


@pytest.mark.parametrize("repeats", [2, 3, 8])
def test_few_repeats_do_not_make_the_noise_floor_look_lower(repeats: int) -> None:
    found = compared(made_up(groups=400 // repeats, repeats=repeats))
    mean_m, median_m = NOISE * np.sqrt(np.pi / 2), NOISE * np.sqrt(2 * np.log(2))
    assert found.repeats.sample_percent == pytest.approx(100 * mean_m / SCALE, rel=0.03)
    assert found.repeats.final_percent == pytest.approx(100 * median_m / SCALE, rel=0.15)
    assert found.waypoint_error_percent == pytest.approx(100 * mean_m / SCALE, rel=0.03)


def test_a_trial_that_was_not_seen_to_end_has_no_final_error() -> None:
    made = made_up(groups=8, repeats=3)
    whole = compared(made).as_dict()["trials"]
    for cut in ([4], range(len(whole))):
        records = [replace(r, ended=r.trial not in cut) for r in made.records]
        found = compared(MadeUp(records, made.predicted)).as_dict()
        finals = [None if t["trial"] in cut else t["final_percent"] for t in whole]
        assert [t["final_percent"] for t in found["trials"]] == finals
        known = [final for final in finals if final is not None]
        typical = pytest.approx(np.median(known), rel=1e-4) if known else None
        assert found["final_error_percent"] == typical
        assert known or found["noise_floor_final_percent"] is None


def test_errors_and_noise_floor_are_those_of_measurement_sets() -> None:
    made = made_up(groups=8, repeats=3)
    made.predicted[4] = np.nan
    gappy = with_gaps(made.records, 7)
    found = compared(MadeUp(gappy, made.predicted))
    measured = as_measurement_set(gappy)
    errors = prediction_errors(made.predicted, measured.trials, SCALE)
    assert found.waypoint_error_percent == pytest.approx(errors.waypoint_percent)
    assert found.final_error_percent == pytest.approx(errors.final_percent)
    floor = noise_floor(measured)
    assert found.repeats.sample_percent == pytest.approx(floor.waypoint_percent)
    assert found.repeats.final_percent == pytest.approx(floor.final_percent)


def with_gaps(records: list[Record], every: int) -> list[Record]:
    """Return the records without one sample in so many."""
    kept = [np.arange(len(TIMES_S)) % every != r.trial % every for r in records]
    return [
        replace(r, times_s=r.times_s[some], measured=r.measured[some])
        for r, some in zip(records, kept, strict=True)
    ]


def as_measurement_set(records: list[Record]) -> MeasurementSet:
    action = Action(0.5, 0.6, -0.5, 0.6, 0.0, 1.0)
    still = ToolMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
    trials = tuple(Trial(r.trial, r.group, action, still, r.times_s, r.measured) for r in records)
    return MeasurementSet(Cable("c", SCALE, 0.01, 0.005, 0.02), 0.6, 0.1, None, trials)


def test_repeats_are_matched_by_time() -> None:
    """Frames of another moment, and lost ones, are no scatter of the paths."""
    full = made_up()
    late = []
    for record, path in zip(full.records, full.predicted, strict=True):
        times_s = TIMES_S + 0.03 * (record.trial % 2)
        moved = CubicSpline(TIMES_S, path)(times_s) - path
        late.append(replace(record, times_s=times_s, measured=record.measured + moved))
    gappy = with_gaps(late, 4)
    before = compared(full).repeats.sample_percent
    after = compared(MadeUp(gappy, full.predicted)).repeats.sample_percent
    assert after == pytest.approx(before, rel=0.1)


def test_a_diverged_trial_is_marked_and_counts_as_one_scale() -> None:
    made = made_up(groups=1, repeats=2)
    made.predicted[1, 7] = np.nan
    found = compared(made)
    plain = found.as_dict()
    assert plain["diverged"] == [1]
    assert plain["trials"][1]["diverged"] is True
    assert plain["trials"][1]["predicted"][7] == [None, None]
    assert plain["trials"][1]["waypoint_percent"] == 100
    assert found.waypoint_error_percent > 50


def test_the_same_input_gives_the_same_bytes_without_nan() -> None:
    made = made_up(wrong=wrong_above)
    made.predicted[3] = np.nan
    first, second = (json.dumps(compared(made).as_dict(), allow_nan=False) for _ in range(2))
    assert first == second


def wrong_above(record: Record) -> np.ndarray:
    return np.full(record.measured.shape, 0.02 * (record.factors["alpha"] > 1.5))


def test_one_trial_with_one_sample_can_be_compared() -> None:
    record = Record(0, 0, np.array([0.0]), np.array([[1.0, 1.0]]))
    found = compare(MODEL, [record], np.array([[[1.0, 1.5]]]))
    assert found.waypoint_error_percent == pytest.approx(100)
    assert found.findings == ()


def test_signals_of_one_component_can_be_compared() -> None:
    made = made_up(wrong=wrong_above)
    records = [replace(r, measured=r.measured[:, :1]) for r in made.records]
    found = compare(MODEL, records, made.predicted[..., :1])
    assert [f.slice.kind for f in found.findings] == ["alpha"]


def test_a_prediction_of_another_shape_is_refused() -> None:
    made = made_up(groups=2)
    with pytest.raises(ValueError, match=r"expected a prediction of shape \(4, 25, 2\)"):
        compared(MadeUp(made.records, made.predicted[:, :20]))


def test_the_error_over_time_ends_where_few_trials_are_left() -> None:
    made = made_up(groups=10, repeats=1)
    short = [replace(r, times_s=r.times_s[:10], measured=r.measured[:10]) for r in made.records[1:]]
    course = compared(MadeUp([made.records[0], *short], made.predicted)).course
    assert len(course["times_s"]) == 10
    assert np.all(course["lower"] <= course["upper"])


def test_a_running_median_has_one_value_where_trials_share_a_place() -> None:
    made = made_up(groups=12, repeats=1)
    records = [replace(r, factors={"speed": float(k % 2)}) for k, r in enumerate(made.records)]
    predicted = np.stack([r.measured + 0.01 * r.factors["speed"] for r in records])
    trend = trends(records, misfit(records, predicted, SCALE))["speed"]
    places, medians = trend["running_values"], trend["running_median"]
    assert list(places) == sorted(set(places)) and medians[0] < 0.1 < medians[-1]
