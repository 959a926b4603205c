"""A correct set is read as it stands; a bad one is refused with file, row and rule."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.writer import write_measurement_set


def test_a_set_is_read_as_it_stands(set_folder: Path) -> None:
    measured = read_measurement_set(set_folder)
    assert measured.cable.name == "cable1"
    assert (measured.r0_m, measured.period_s, measured.noise_m) == (0.6, 0.1, 0.002)
    assert measured.rig == "recorded"
    assert measured.notice is None
    assert [(t.trial, t.action_id) for t in measured.trials] == [(0, 0), (1, 1), (2, 0)]
    assert measured.trials[1].action == Action(0.5, 0.6, -0.8, 0.7, 0.4, 1.5)
    np.testing.assert_array_equal(measured.trials[1].tool.t_s, [0, 0.008])
    np.testing.assert_array_equal(measured.trials[1].tool.pose[1], [0.59, 0.02, 0.2])


def test_further_numbers_of_a_cast_are_its_factors(set_folder: Path) -> None:
    """Names and half-filled columns are none; the order in the session comes by itself."""
    path = set_folder / "actions.csv"
    frame = pl.read_csv(path)
    n = frame.height
    frame.with_columns(
        pl.Series("board_celsius", [20.0 + k for k in range(n)]),
        pl.Series("operator", ["ada"] * n),
        pl.Series("half", [None, *range(n - 1)]),
    ).write_csv(path)
    trials = read_measurement_set(set_folder).trials
    assert [t.factors["board_celsius"] for t in trials] == [20.0 + k for k in range(n)]
    assert [t.factors["order"] for t in trials] == [k / max(n - 1, 1) for k in range(n)]
    assert not {"operator", "half"} & set(trials[0].factors)
    write_measurement_set(read_measurement_set(set_folder), set_folder.parent / "copy")
    copied = read_measurement_set(set_folder.parent / "copy").trials
    assert [t.logged for t in copied] == [t.logged for t in trials]
    assert trials[0].factors["vmax"] == trials[0].action.vmax_m_s


def test_gaps_are_kept(set_folder: Path) -> None:
    trial = read_measurement_set(set_folder).trials[0]
    np.testing.assert_array_equal(trial.waypoints_s, [0, 0.1, 0.3])
    np.testing.assert_array_equal(trial.endpoint_m, [1.2, 0.03])


def test_a_set_may_name_its_rig_and_leave_out_its_noise(set_folder: Path) -> None:
    edit(set_folder / "rig.yaml", ", noise_m: 0.002}", "}\nrig: virtual")
    measured = read_measurement_set(set_folder)
    assert measured.rig == "virtual"
    assert measured.noise_m is None


@pytest.mark.parametrize("name", ["a", "b", "c", "d", "e", "f"])
def test_recorded_sets_are_read(recorded_sets: Path, name: str) -> None:
    measured = read_measurement_set(recorded_sets / name)
    assert len(measured.trials) == 52
    assert len({t.action_id for t in measured.trials}) == 40


def test_rows_of_a_trial_need_not_stand_together(set_folder: Path) -> None:
    before = read_measurement_set(set_folder)
    header, *rows = (set_folder / "tool.csv").read_text().splitlines()
    shuffled = [rows[i] for i in (0, 2, 4, 1, 3, 5)]
    (set_folder / "tool.csv").write_text("\n".join([header, *shuffled]) + "\n")
    after = read_measurement_set(set_folder)
    for old, new in zip(before.trials, after.trials, strict=True):
        np.testing.assert_array_equal(old.tool.pose, new.tool.pose)


def test_blank_lines_spaces_and_windows_files_are_read(set_folder: Path) -> None:
    path = set_folder / "waypoints.csv"
    text = path.read_text().replace("0,0.1,1.22,0.01\n", "\n0, 0.1 ,1.22,0.01\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    trial = read_measurement_set(set_folder).trials[0]
    np.testing.assert_array_equal(trial.waypoints_s, [0, 0.1, 0.3])


def test_without_tool_csv_the_planned_motion_stands_in_and_is_announced(set_folder: Path) -> None:
    (set_folder / "tool.csv").unlink()
    measured = read_measurement_set(set_folder)
    trial = measured.trials[1]
    planned = plan_action(trial.action, r0_m=0.6, limits=PlanLimits())
    np.testing.assert_array_equal(trial.tool.pose, planned.tool.pose)
    assert measured.notice is not None
    assert "no tool.csv" in measured.notice
    assert measured.select([1]).notice == measured.notice


def test_a_cast_that_cannot_be_planned_is_refused_without_tool_csv(set_folder: Path) -> None:
    (set_folder / "tool.csv").unlink()
    edit(set_folder / "actions.csv", "1,1,0.5,0.6,-0.8", "1,1,0.5,0.6,0.8")
    with pytest.raises(ValueError, match=r"actions\.csv line 3: without tool\.csv .* turn back"):
        read_measurement_set(set_folder)


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


BAD = {
    "missing column": ("actions.csv", "alpha,", "", "actions.csv", "column alpha is missing"),
    "column twice": ("waypoints.csv", "t,x,y", "t,x,x", "line 1", "column x stands there twice"),
    "other separator": (
        "tool.csv",
        "trial,t,x,y,yaw",
        "trial;t;x;y;yaw",
        "tool.csv",
        "found trial;t;x;y;yaw",
    ),
    "NaN": ("waypoints.csv", "1.22,0.01", "nan,0.01", "waypoints.csv line 3", "finite number"),
    "infinity": ("tool.csv", "0.59,0.02", "inf,0.02", "tool.csv line 5", "finite number"),
    "a word": ("tool.csv", "0.59,0.02", "lost,0.02", "tool.csv line 5", "got 'lost'"),
    "an empty cell": ("tool.csv", "0.59,0.02", ",0.02", "tool.csv line 5", "got an empty cell"),
    "a cell missing": ("tool.csv", ",0.02,0.2", ",0.02", "tool.csv line 5", "got an empty cell"),
    "a cell too many": ("tool.csv", ",0.02,0.2", ",0.02,0.2,9", "tool.csv line 5", "got 6"),
    "half a trial": ("actions.csv", "1,1,0.5", "1.5,1,0.5", "actions.csv line 3", "whole number"),
    "time stands": ("tool.csv", "1,0.008", "1,0", "tool.csv line 5", "time must increase"),
    "time falls": ("waypoints.csv", "0,0.3", "0,0.05", "waypoints.csv line 4", "must increase"),
    "time before 0": ("tool.csv", "1,0,", "1,-0.1,", "tool.csv line 4", "before the start"),
    "milliseconds": ("waypoints.csv", "0,0.3", "0,300", "waypoints.csv line 4", "milliseconds"),
    "no waypoints": ("waypoints.csv", "1,0,1.23,0\n", "", "actions.csv line 3", "no waypoints"),
    "no tool": ("tool.csv", "1,0,", "0,9,", "actions.csv line 3", "1 samples in tool.csv"),
    "unknown trial": ("waypoints.csv", "1,0,", "7,0,", "waypoints.csv line 5", "unknown"),
    "trial twice": ("actions.csv", "2,0,0.7", "1,0,0.7", "actions.csv line 4", "twice"),
    "mixed repeat": ("actions.csv", "2,0,0.7", "2,0,0.9", "actions.csv line 4", "action 0"),
    "degrees": ("actions.csv", "0.5,0.6,-0.8", "0.5,0.6,-80", "actions.csv line 3", "degrees"),
    "yaw degrees": ("tool.csv", "0.01,0.1", "0.01,10", "tool.csv line 3", "degrees"),
    "millimetres": ("waypoints.csv", "1.22,0.01", "1220,10", "waypoints.csv line 3", "millimetres"),
    "radius in mm": ("actions.csv", "-0.8,0.7", "-0.8,700", "actions.csv line 3", "millimetres"),
    "backwards": ("actions.csv", "1.25", "-1.25", "actions.csv line 2", "vmax must be above"),
    "speed in mm": ("actions.csv", "0.4,1.5", "0.4,1500", "actions.csv line 3", "per second"),
    "length zero": ("rig.yaml", "length_m: 0.63", "length_m: 0", "rig.yaml", "length_m"),
    "length in mm": ("rig.yaml", "length_m: 0.63", "length_m: 630", "rig.yaml", "millimetres"),
    "radius too": ("rig.yaml", "radius_m: 0.0045", "radius_m: 4.5", "rig.yaml", "radius_m"),
    "negative mass": ("rig.yaml", "mass_kg: 0.008", "mass_kg: -1", "rig.yaml", "negative"),
    "grams": ("rig.yaml", "mass_kg: 0.02", "mass_kg: 20", "rig.yaml", "grams"),
    "mass missing": ("rig.yaml", "mass_kg: 0.008, ", "", "rig.yaml", "got nothing"),
    "mass a word": ("rig.yaml", "mass_kg: 0.008", "mass_kg: light", "rig.yaml", "'light'"),
    "no name": ("rig.yaml", "name: cable1", "name:", "rig.yaml", "cable.name"),
    "period zero": ("rig.yaml", "period_s: 0.1", "period_s: 0", "rig.yaml", "above zero"),
    "period in ms": ("rig.yaml", "period_s: 0.1", "period_s: 100", "rig.yaml", "milliseconds"),
    "noise NaN": ("rig.yaml", "noise_m: 0.002", "noise_m: .nan", "rig.yaml", "finite"),
    "bad YAML": ("rig.yaml", "robot: {", "robot: }", "rig.yaml line 2", "not YAML"),
    "no mapping": ("rig.yaml", "robot: {r0_m: 0.6}", "robot: 3", "rig.yaml", "robot.r0_m"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_by_file_row_and_rule(set_folder: Path, case: str) -> None:
    name, old, new, place, rule = BAD[case]
    edit(set_folder / name, old, new)
    with pytest.raises(ValueError) as refusal:
        read_measurement_set(set_folder)
    message = str(refusal.value)
    assert place in message
    assert rule in message
    assert "\n" not in message


@pytest.mark.parametrize("name", ["rig.yaml", "actions.csv", "waypoints.csv"])
def test_a_missing_file_is_refused(set_folder: Path, name: str) -> None:
    (set_folder / name).unlink()
    with pytest.raises(ValueError, match=f"{name}.* is missing"):
        read_measurement_set(set_folder)


@pytest.mark.parametrize("name", ["rig.yaml", "actions.csv", "tool.csv", "waypoints.csv"])
@pytest.mark.parametrize("content", [b"", b"\n", b"\xff\xfe\x00", b"\x89PNG\r\n"])
def test_a_file_of_something_else_is_refused(set_folder: Path, name: str, content: bytes) -> None:
    (set_folder / name).write_bytes(content)
    with pytest.raises(ValueError, match=name):
        read_measurement_set(set_folder)


def test_a_set_without_casts_is_refused(set_folder: Path) -> None:
    header = (set_folder / "actions.csv").read_text().splitlines()[0]
    (set_folder / "actions.csv").write_text(header + "\n")
    with pytest.raises(ValueError, match=r"actions\.csv: holds no casts"):
        read_measurement_set(set_folder)


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such folder"):
        read_measurement_set(tmp_path / "nowhere")


def test_two_files_of_one_table_are_refused(set_folder: Path) -> None:
    pl.read_csv(set_folder / "actions.csv").write_parquet(set_folder / "actions.parquet")
    with pytest.raises(ValueError, match=r"both actions\.csv and actions\.parquet"):
        read_measurement_set(set_folder)


def test_a_parquet_table_is_refused_by_its_row(set_folder: Path) -> None:
    frame = pl.read_csv(set_folder / "waypoints.csv").with_columns(
        x=pl.when(pl.col("t") == 0.3).then(float("nan")).otherwise("x")
    )
    (set_folder / "waypoints.csv").unlink()
    frame.write_parquet(set_folder / "waypoints.parquet")
    with pytest.raises(ValueError, match=r"waypoints\.parquet row 3: x must be a finite number"):
        read_measurement_set(set_folder)


def test_a_broken_parquet_file_is_refused(set_folder: Path) -> None:
    (set_folder / "tool.csv").unlink()
    (set_folder / "tool.parquet").write_bytes(b"trial,t,x,y,yaw\n")
    with pytest.raises(ValueError, match=r"tool\.parquet: is not readable as Parquet"):
        read_measurement_set(set_folder)
