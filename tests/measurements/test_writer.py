"""What is written is read back exactly, once, and as the same bytes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set, write_measurement_set


def with_awkward_numbers(measured: MeasurementSet) -> MeasurementSet:
    rng = np.random.default_rng(3)
    trials = tuple(
        replace(t, waypoints_m=t.waypoints_m + rng.normal(size=t.waypoints_m.shape) * 1e-4 / 3)
        for t in measured.trials
    )
    cable = replace(measured.cable, mass_kg=np.nextafter(0.01, 1), radius_m=1 / 300)
    return replace(measured, trials=trials, cable=cable, noise_m=0.01 / 3, rig="virtual")


def assert_same(one: MeasurementSet, other: MeasurementSet) -> None:
    assert replace(one, trials=()) == replace(other, trials=())
    assert len(one.trials) == len(other.trials)
    for a, b in zip(one.trials, other.trials, strict=True):
        assert (a.trial, a.action_id, a.action) == (b.trial, b.action_id, b.action)
        np.testing.assert_array_equal(a.tool.t_s, b.tool.t_s)
        np.testing.assert_array_equal(a.tool.pose, b.tool.pose)
        np.testing.assert_array_equal(a.waypoints_s, b.waypoints_s)
        np.testing.assert_array_equal(a.waypoints_m, b.waypoints_m)


def as_parquet(folder: Path) -> None:
    for path in folder.glob("*.csv"):
        pl.read_csv(path).write_parquet(path.with_suffix(".parquet"))
        path.unlink()


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def test_a_set_comes_back_to_the_last_digit_and_gives_the_same_bytes(
    set_folder: Path, tmp_path: Path
) -> None:
    measured = with_awkward_numbers(read_measurement_set(set_folder))
    write_measurement_set(measured, tmp_path / "new")
    again = read_measurement_set(tmp_path / "new")
    assert_same(again, measured)
    write_measurement_set(again, tmp_path / "copy")
    assert contents(tmp_path / "copy") == contents(tmp_path / "new")


@pytest.mark.parametrize("parquet", [False, True])
def test_what_was_not_at_rest_and_long_numbers_come_back(
    set_folder: Path, tmp_path: Path, parquet: bool
) -> None:
    """Trials may be numbered by time stamps in ns, which are no exact floats."""
    measured = read_measurement_set(set_folder)
    trials = tuple(
        replace(t, trial=1714566123456789012 + t.trial, rested=t.trial != 1)
        for t in measured.trials
    )
    write_measurement_set(replace(measured, trials=trials), tmp_path / "new")
    if parquet:
        as_parquet(tmp_path / "new")
    again = read_measurement_set(tmp_path / "new")
    assert_same(again, replace(again, trials=trials))
    assert [(t.trial, t.rested, t.logged) for t in again.trials] == [
        (t.trial, t.rested, t.logged) for t in trials
    ]
    assert "not seen at rest" in again.notices[0]


def test_a_set_on_disk_is_never_changed_and_none_written_without_casts(set_folder: Path) -> None:
    before = contents(set_folder)
    measured = read_measurement_set(set_folder)
    with pytest.raises(ValueError, match="never changed in place"):
        write_measurement_set(measured, set_folder)
    assert contents(set_folder) == before
    with pytest.raises(ValueError, match="without casts"):
        write_measurement_set(measured.select([]), set_folder.with_name("new"))


def test_a_failed_write_leaves_nothing(set_folder: Path, tmp_path: Path) -> None:
    measured = read_measurement_set(set_folder)
    broken = replace(measured.trials[0], waypoints_m=np.zeros((1, 5)))
    with pytest.raises(ValueError):
        write_measurement_set(replace(measured, trials=(broken,)), tmp_path / "new")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["set"]


def test_a_planned_motion_is_not_written_as_if_it_was_measured(
    set_folder: Path, tmp_path: Path
) -> None:
    measured = replace(read_measurement_set(set_folder), tool_planned=True)
    write_measurement_set(measured, tmp_path / "new")
    assert not (tmp_path / "new" / "tool.csv").exists()
