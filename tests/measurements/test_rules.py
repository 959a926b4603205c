"""What people's data does that no cast, cable, arm or camera can: found, and said with numbers.

Each case spoils the set of three good casts in one way and states what is right: a set that is
refused, casts that are left out, casts without an endpoint, a warning, or a value put right.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.measurements.errors import noise_floor
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from tests.good_casts import ACTIONS, good_set

Tables = dict[str, pl.DataFrame]
Spoil = Callable[[Tables], None]
C = pl.col
TABLES = ("actions", "tool", "waypoints")
CASTS = good_set([*ACTIONS, ACTIONS[0], ACTIONS[1], ACTIONS[0]])  # trials 0 to 4 of two actions
LAST_S = float(CASTS.trials[3].waypoints_s[-1])
TRIAL = {table: C("trial") == 3 for table in TABLES}


def spoilt(tmp_path: Path, *spoils: Spoil, rig: dict[str, str] | None = None) -> Path:
    """Write the good set, spoil its tables and its rig.yaml, and return its folder."""
    folder = tmp_path / "set"
    write_measurement_set(CASTS, folder)
    tables = {name: pl.read_csv(folder / f"{name}.csv") for name in TABLES}
    both(*spoils)(tables)
    for name, table in tables.items():
        table.write_csv(folder / f"{name}.csv")
    path = folder / "rig.yaml"
    text = path.read_text()
    for old, new in (rig or {}).items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return folder


def change(table: str, **columns: pl.Expr) -> Spoil:
    return lambda tables: tables.update({table: tables[table].with_columns(**columns)})


def keep(table: str, rows: pl.Expr) -> Spoil:
    return lambda tables: tables.update({table: tables[table].filter(rows)})


def both(*spoils: Spoil) -> Spoil:
    def spoil(tables: Tables) -> None:
        for one in spoils:
            one(tables)

    return spoil


def hold(table: str, rows: pl.Expr, *names: str) -> Spoil:
    """Let a trial's first of `rows` stand for all of them, as a tracker or logger that hangs."""
    first = {n: C(n).filter(rows).first().over("trial") for n in names}
    return change(table, **{n: pl.when(rows).then(first[n]).otherwise(n) for n in names})


def updated(name: str, every: int) -> pl.Expr:
    """Let only each `every`th sample of a trial bring a new value."""
    return C(name).gather(pl.int_range(pl.len()) // every * every).over("trial")


def later(table: str, name: str, since: pl.Expr, by: float) -> Spoil:
    """Shift a column of trial 3 by so much in the rows `since`."""
    return change(table, **{name: C(name) + by * (TRIAL[table] & since).cast(pl.Float64)})


def doubled(table: str, later_s: float) -> Spoil:
    def spoil(tables: Tables) -> None:
        again = tables[table].with_columns(t=C("t") + later_s)
        tables[table] = pl.concat([tables[table], again]).sort("trial", "t")

    return spoil


def copied(of: int, to: int, digits: int = 17) -> Spoil:
    """Give one trial the waypoints of another, rounded."""

    def spoil(tables: Tables) -> None:
        copy = tables["waypoints"].filter(C("trial") == of)
        copy = copy.with_columns(C("x", "y").round(digits), trial=pl.lit(to, pl.Int64))
        tables["waypoints"] = pl.concat([tables["waypoints"], copy])

    return spoil


def lost_frames(written: float) -> Spoil:
    """Let every seventh waypoint hold what a program writes for a frame without the end."""
    lost = pl.int_range(pl.len()) % 7 == 3
    xy = {name: pl.when(lost).then(written).otherwise(C(name)) for name in ("x", "y")}
    return change("waypoints", **xy)


def filled(trial: int, first: int, last: int) -> Spoil:
    """Put waypoints of a trial on the line between two others, as trackers fill what they lost."""
    place = pl.int_range(pl.len()).over("trial")
    lost = (C("trial") == trial) & place.is_between(first, last)
    xy = {n: pl.when(lost).then(None).otherwise(C(n)).interpolate() for n in ("x", "y")}
    return change("waypoints", **xy)


REFUSED: dict[str, tuple[Spoil, str]] = {
    "y of the waypoints mirrored": (change("waypoints", y=-C("y")), "with y negated 1.0"),
    "y of the tool mirrored": (change("tool", y=-C("y")), "theta2 .*, with y negated 0.0"),
    "x of the waypoints mirrored": (change("waypoints", x=-C("x")), "with x negated 1.0"),
    "x and y exchanged": (change("waypoints", x=C("y"), y=C("x")), "with x and y exchanged"),
    "all mirrored but the actions": (
        both(change("tool", y=-C("y"), yaw=-C("yaw")), change("waypoints", y=-C("y"))),
        "casts end .* rad from theta2 of their action, with y negated 0.00",
    ),
    "all exchanged but the actions": (
        both(change("tool", x=C("y"), y=C("x")), change("waypoints", x=C("y"), y=C("x"))),
        "rad from theta2 of their action, with x and y exchanged 0.00",
    ),
    "yaw clockwise": (change("tool", yaw=-C("yaw")), "yaw ends .* negated 0.00 rad"),
    "another origin": (change("waypoints", x=C("x") + 0.4, y=C("y") + 1.2), "another unit or"),
    "the board's origin": (
        both(change("tool", y=C("y") + 1.2), change("waypoints", y=C("y") + 1.2)),
        "casts start 1.34 m from the base, and robot.r0_m in rig.yaml is 0.6",
    ),
    "feet": (change("waypoints", x=C("x") * 3.28, y=C("y") * 3.28), "another unit or frame"),
    "an end that never moves": (change("waypoints", x=C("x") / 1e3, y=C("y") / 1e3), "not move"),
    "frame numbers": (change("waypoints", t=(C("t") * 10).round()), "steps of 1 s, and camera.per"),
    "sample numbers": (change("tool", t=C("t") * 25), "times vmax of its action"),
    "the camera half a second late": (change("waypoints", t=C("t") + 0.5), "clocks that do"),
    "the tool two seconds late": (change("tool", t=C("t") + 2.0), "5 of 5 .* before the tool"),
    "a gap in every tool log": (
        keep("tool", ~C("t").is_between(0.3, 0.7)),
        r"5 of 5 casts cannot be used; .*tool.csv: trial 0: no sample from t = 0.29\d to 0.70\d s",
    ),
    "tool logs that stop": (keep("tool", C("t") < 0.6), "5 of 5 .* the log ends at .* it is cut"),
    "tool logs that begin late": (
        both(keep("tool", C("t") > 0.4), change("tool", t=C("t") - 0.4)),
        "of 5 casts cannot be used; .* begins while the tool moves",
    ),
    "a pose that is updated at 10 Hz": (
        change("tool", **{n: updated(n, every=12) for n in ("x", "y", "yaw")}),
        "92 % of the samples repeat the pose before them while the tool moves",
    ),
    "waypoints before the motion alone": (keep("waypoints", C("t") < 0.05), "fewer than 3 lie in"),
    "waypoints of the next trial": (
        change("waypoints", trial=(C("trial") + 1) % 5),
        "trials are numbered otherwise|casts cannot be used|another unit or frame",
    ),
    "nothing found is 0, 0": (lost_frames(0.0), "jumps to x = 0, y = 0 .* lost has no row"),
    "nothing found is -1, -1": (lost_frames(-1.0), "x = -1, y = -1 .* first in trial 0 at t = 0.3"),
    "every tracker hangs": (
        hold("waypoints", C("t").is_between(0.2, 0.6), "x", "y"),
        r"5 of 5 casts cannot be used; \S*waypoints.csv: trial 0: one place is repeated",
    ),
    "the tool taken for the end": (
        lambda tables: tables.update(waypoints=tables["tool"].drop("yaw").gather_every(12)),
        "no more than 0 m lie between the cable's ends",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_set_that_contradicts_itself_is_refused(tmp_path: Path, case: str) -> None:
    spoil, said = REFUSED[case]
    with pytest.raises(ValueError, match=said) as refused:
        read_measurement_set(spoilt(tmp_path, spoil))
    assert "\n" not in str(refused.value)


RIG = {
    "mass in grams": ("mass_kg: 0.008", "mass_kg: 8", "density|kg/m³.*; grams where kilograms"),
    "mass in milligrams": ("mass_kg: 0.008", "mass_kg: 8.0e-6", "makes 0.2 kg/m³"),
    "radius in centimetres": ("radius_m: 0.0045", "radius_m: 0.45", "kg/m³"),
    "length in decimetres": ("length_m: 0.63", "length_m: 6.3", "decimetres where metres"),
    "length in feet": ("length_m: 0.63", "length_m: 2.07", "feet where metres"),
    "weight in grams": ("endpoint_mass_kg: 0.02", "endpoint_mass_kg: 5", "625 times cable.mass_kg"),
    "noise in millimetres": ("noise_m: 0.002", "noise_m: 2", "camera.noise_m 2 is no noise"),
    "r0 in decimetres": ("r0_m: 0.6", "r0_m: 6", "start 0.6 m from the base, and robot.r0_m .* 6"),
    "a period in hertz": ("period_s: 0.1", "period_s: 10", "steps of 0.1 s, and camera.period_s"),
    "a period of nothing": ("period_s: 0.1", "period_s: 1.0e-9", "steps of 0.1 s, and camera.per"),
}


@pytest.mark.parametrize("case", RIG)
def test_values_that_are_impossible_together_are_refused(tmp_path: Path, case: str) -> None:
    old, new, said = RIG[case]
    with pytest.raises(ValueError, match=said):
        read_measurement_set(spoilt(tmp_path, rig={old: new}))


DOUBTFUL = {
    "length_m: 0.63": ("length_m: 0.8", "cable.length_m is 0.8, and .* no more than 0.62"),
    " 0.63": (
        " 0.5",
        "0.62.* m or more from the held point, and cable.length_m in rig.yaml is 0.5",
    ),
    "endpoint_mass_kg: 0.02": ("endpoint_mass_kg: 0.3", "38 times cable.mass_kg 0.008"),
    "r0_m: 0.6": ("r0_m: 0.5", "casts start 0.6 m from the base"),
    "period_s: 0.1": ("period_s: 0.05", "steps of 0.1 s, and camera.period_s in rig.yaml is 0.05"),
}


@pytest.mark.parametrize("old", DOUBTFUL)
def test_what_could_be_true_is_a_warning_with_both_numbers(tmp_path: Path, old: str) -> None:
    new, said = DOUBTFUL[old]
    (notice,) = read_measurement_set(spoilt(tmp_path, rig={old: new})).notices
    with pytest.raises(ValueError, match=said):
        raise ValueError(notice)


def test_clocks_that_differ_by_less_than_a_camera_may_be_early_are_said(tmp_path: Path) -> None:
    later = change("tool", t=C("t") + 0.2)
    (notice,) = read_measurement_set(spoilt(tmp_path, later)).notices
    assert "in half of the casts the free end moves 0." in notice and "before the tool" in notice


def test_a_planned_motion_judges_no_waypoints(tmp_path: Path) -> None:
    """An arm of another planner may be late; what is known of the cable is judged all the same."""
    folder = spoilt(tmp_path, change("waypoints", t=C("t") + 0.5 * (C("t") > 0)))
    (folder / "tool.csv").unlink()
    (notice,) = read_measurement_set(folder).notices
    assert "no tool.csv" in notice
    rig = folder / "rig.yaml"
    rig.write_text(rig.read_text().replace("length_m: 0.63", "length_m: 6.3"))
    with pytest.raises(ValueError, match="decimetres where metres"):
        read_measurement_set(folder)


def test_a_cable_may_have_no_weight_at_its_end(tmp_path: Path) -> None:
    folder = spoilt(tmp_path, rig={"endpoint_mass_kg: 0.02": "endpoint_mass_kg: 0"})
    assert read_measurement_set(folder).notices == ()


UNUSABLE: dict[str, tuple[Spoil, str]] = {
    "a gap": (keep("tool", ~TRIAL["tool"] | ~C("t").is_between(0.3, 0.5)), "no sample from t ="),
    "a log that stops": (keep("tool", ~TRIAL["tool"] | (C("t") < 0.6)), "it is cut"),
    "a log that hangs": (
        hold("tool", TRIAL["tool"] & C("t").is_between(0.3, 0.6), "x", "y", "yaw"),
        "the tool jumps at t = 0.60",
    ),
    "a log of nothing": (hold("tool", TRIAL["tool"], "x", "y", "yaw"), "it is cut, or another"),
    "a spike of yaw": (
        later("tool", "yaw", C("t") == 0.4, 2.0),
        "and 2.0. rad in 0.008 s, as no arm can",
    ),
    "another clock": (
        later("tool", "t", pl.lit(True), 1.5),
        "the free end moves before the tool",
    ),
    "a tracker that hangs": (
        hold("waypoints", TRIAL["waypoints"] & C("t").is_between(0.2, 0.6), "x", "y"),
        "one place is repeated to the last digit 5 times",
    ),
    "a tracker that fills": (filled(3, 4, 6), "goes straight at one speed to the last digit"),
    "waypoints of the motion lost": (
        keep("waypoints", ~TRIAL["waypoints"] | (C("t") < 0.15)), "fewer than 3 lie in the time",
    ),
    "a copy": (
        both(keep("waypoints", ~TRIAL["waypoints"]), copied(of=1, to=3)),
        "those of trial 1 to the last digit that both have, and a copy is no repeat",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", UNUSABLE)
def test_a_cast_that_cannot_be_used_is_left_out_by_number(tmp_path: Path, case: str) -> None:
    spoil, said = UNUSABLE[case]
    measured = read_measurement_set(spoilt(tmp_path, spoil))
    assert [t.trial for t in measured.trials] == [0, 1, 2, 4]
    (notice,) = measured.notices
    assert ".csv: trial 3: " in notice and notice.endswith("; not used")
    with pytest.raises(ValueError, match=said):
        raise ValueError(notice)


UNRESTED: dict[str, tuple[Spoil, str]] = {
    "lost while it moves": (keep("waypoints", ~TRIAL["waypoints"] | (C("t") < 0.75)), "moves"),
    "lost while the tool moves": (
        both(
            keep("waypoints", ~TRIAL["waypoints"] | (C("t") < 0.35)),
            hold("waypoints", TRIAL["waypoints"] & (C("t") > 0.15), "x", "y"),
        ),
        "is seen last at t = 0.30 s, and the tool moves on by 0.76 m",
    ),
    "something else at the end": (
        later("waypoints", "x", C("t") > LAST_S - 0.25, -0.3),
        "long after the tool came to rest",
    ),
    "something else all along": (
        later("waypoints", "x", pl.lit(True), 0.5),
        "from the held point, and cable.length_m is 0.63: something else was followed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", UNRESTED)
def test_an_end_that_was_not_seen_at_rest_is_no_endpoint(tmp_path: Path, case: str) -> None:
    spoil, said = UNRESTED[case]
    measured = read_measurement_set(spoilt(tmp_path, spoil))
    assert [t.trial for t in measured.trials if not t.rested] == [3]
    assert [t.trial for t in measured.rested.trials] == [0, 1, 2, 4]
    (notice,) = measured.notices
    assert "trial 3: " in notice and notice.endswith("; not counted as endpoints")
    with pytest.raises(ValueError, match=said):
        raise ValueError(notice)


def read(tmp_path: Path, *spoils: Spoil) -> MeasurementSet:
    return read_measurement_set(spoilt(tmp_path, *spoils))


@pytest.mark.parametrize("turn", [0.0, np.pi / 2, np.pi, -np.pi / 2])
@pytest.mark.parametrize("wrapped", [False, True])
def test_yaw_is_read_from_where_the_cable_lies_and_does_not_jump(
    tmp_path: Path, turn: float, wrapped: bool
) -> None:
    """The flange may be turned by quarters; yaw may be logged between 0 and 2π."""
    yaw = C("yaw") + turn
    measured = read(tmp_path, change("tool", yaw=yaw % (2 * np.pi) if wrapped else yaw))
    said = " ".join(measured.notices)
    assert ("the cable lies" in said) == bool(turn)
    assert ("jumps by 2π" in said) == (wrapped and turn == 0)
    for trial, good in zip(measured.trials, CASTS.trials, strict=True):
        off = trial.tool.pose[:, 2] - good.tool.pose[:, 2]
        assert np.ptp(off) < 1e-6
        assert np.cos(off[0]) == pytest.approx(1, abs=1e-6)


def test_angles_of_actions_have_their_turn(tmp_path: Path) -> None:
    measured = read(tmp_path, change("actions", theta2=C("theta2") % (2 * np.pi)))
    assert measured.trials[0].action.theta2_rad == pytest.approx(ACTIONS[0].theta2_rad)
    assert "theta2 is beyond π and was turned by 2π" in measured.notices[0]


@pytest.mark.parametrize("table", ["tool", "waypoints"])
@pytest.mark.parametrize("later_s", [0.0, 1e-9])
def test_rows_that_stand_there_twice_are_read_once(
    tmp_path: Path, table: str, later_s: float
) -> None:
    """The cost of reading, and of the noise floor, is that of the rows."""
    measured = read(tmp_path, doubled(table, later_s))
    assert [len(t.waypoints_s) for t in measured.trials] == [
        len(t.waypoints_s) for t in CASTS.trials
    ]
    assert [len(t.tool.t_s) for t in measured.trials] == [len(t.tool.t_s) for t in CASTS.trials]
    assert "line 3: repeats the row before it" in measured.notices[0]
    assert noise_floor(measured).waypoint_percent == noise_floor(CASTS).waypoint_percent


@pytest.mark.parametrize("jitter", [0.0, 2e-5])
def test_equal_actions_are_repeats_whatever_their_numbers(tmp_path: Path, jitter: float) -> None:
    moved = C("theta1") + jitter * pl.int_range(pl.len())
    measured = read(tmp_path, change("actions", action=C("trial"), theta1=moved))
    assert [t.action_id for t in measured.trials] == [0, 1, 0, 1, 0]
    assert "action 2 is action 0 again; 3 casts" in measured.notices[0]
    assert noise_floor(measured).waypoint_percent is not None


@pytest.mark.parametrize("digits", [17, 6, 3, 2])
def test_copies_are_no_repeats_however_they_were_rounded(tmp_path: Path, digits: int) -> None:
    only = keep("waypoints", ~C("trial").is_in([2, 3]))
    copies = copied(of=0, to=2, digits=digits), copied(of=1, to=3, digits=digits)
    measured = read(tmp_path, only, *copies)
    assert [t.trial for t in measured.trials] == [0, 1, 4]
    assert noise_floor(measured) == noise_floor(measured.select([0, 4]))


def test_repeats_are_no_copies_however_their_tracker_rounds(tmp_path: Path) -> None:
    rounded = change("waypoints", x=C("x").round(2), y=C("y").round(2))
    assert len(read(tmp_path, rounded).trials) == 5


def test_frames_that_come_late_are_no_scatter(tmp_path: Path) -> None:
    """A camera without a steady rate: 60 to 140 ms between frames, their times true."""
    late = np.random.default_rng(0)
    trials = []
    for trial in CASTS.trials:
        t_s = np.sort(trial.waypoints_s + late.uniform(-0.02, 0.02, len(trial.waypoints_s)))
        t_s = np.clip(t_s, 0, trial.waypoints_s[-1])
        path = np.stack([np.interp(t_s, trial.waypoints_s, c) for c in trial.waypoints_m.T], axis=1)
        trials.append((t_s, path))
    frame = pl.DataFrame(
        np.vstack([np.column_stack([np.full(len(t), n), t, p]) for n, (t, p) in enumerate(trials)]),
        ["trial", "t", "x", "y"],
    ).cast({"trial": pl.Int64})
    measured = read(tmp_path, lambda tables: tables.update(waypoints=frame))
    before, after = (noise_floor(s).waypoint_percent for s in (CASTS, measured))
    assert before is not None and after == pytest.approx(before, rel=0.15)


def mac(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r"))


def empty_columns(path: Path) -> None:
    path.write_text(path.read_text().replace("\n", ",,\n"))


def empty_cells_in_rows(path: Path) -> None:
    header, rows = path.read_text().split("\n", 1)
    path.write_text(f"{header}\n" + rows.replace("\n", ", ,\n"))


def index_of_pandas(path: Path) -> None:
    frame = pl.read_csv(path)
    frame.insert_column(0, pl.Series("", range(frame.height))).write_csv(path)


def time_stamps(path: Path) -> None:
    for table in TABLES:
        file = path.with_name(f"{table}.csv")
        pl.read_csv(file).with_columns(trial=C("trial") + 1714566123456789012).write_csv(file)


@pytest.mark.parametrize(
    "write", [mac, empty_columns, empty_cells_in_rows, index_of_pandas, time_stamps]
)
@pytest.mark.parametrize("table", ["actions", "waypoints"])
def test_files_as_programs_write_them_are_read(
    tmp_path: Path, write: Callable[[Path], None], table: str
) -> None:
    folder = spoilt(tmp_path)
    write(folder / f"{table}.csv")
    measured = read_measurement_set(folder)
    assert measured.notices == ()
    assert [t.trial % 1714566123456789012 for t in measured.trials] == list(range(5))
    assert set(measured.trials[0].logged) == {"order"}
    for trial, good in zip(measured.trials, CASTS.trials, strict=True):
        np.testing.assert_array_equal(trial.waypoints_m, good.waypoints_m)


@pytest.mark.parametrize(("separator", "said"), [(";", "semicolons"), ("\t", "tabs")])
def test_other_separators_are_named(tmp_path: Path, separator: str, said: str) -> None:
    folder = spoilt(tmp_path)
    path = folder / "tool.csv"
    path.write_text(path.read_text().replace(",", separator))
    with pytest.raises(ValueError, match=f"line 1: .* {said}, .* export with commas"):
        read_measurement_set(folder)
