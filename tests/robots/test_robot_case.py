"""What a robot's folder is read as: windows, start states, noise, effects at their null."""

from pathlib import Path

import mujoco
import numpy as np
import polars as pl
import pytest

from robotcast.diagnosis.diagnose import diagnose
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots import rollout
from robotcast.robots.robot_case import RobotCase, read_case
from robotcast.robots.rollout import Start
from tests.robots.made_up_robot import ARM, PERIOD_S, QUANTUM, SLIDER, dry, write_folder


@pytest.fixture(scope="module")
def slider(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    return read_case(write_folder(tmp_path_factory.mktemp("slider"), change=dry(0.8)))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    folder = tmp_path_factory.mktemp("arm")
    return read_case(write_folder(folder, ARM, logs=3, windows={"length_s": 0.3, "most": 6}))


def all_by_steps(tune: object, effects: object, vectors: np.ndarray) -> np.ndarray:
    return np.ones(len(vectors), bool)


def test_all_steps_in_one_call_are_the_same_steps(
    arm: RobotCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, records, probed = arm.model, arm.model.records[:3], np.array([[0.1], [0.0]])
    at_once = model.predict(records, ["dry_friction_elbow"], probed)
    monkeypatch.setattr(rollout, "stepwise", all_by_steps)
    assert model.predict(records, ["dry_friction_elbow"], probed).tobytes() == at_once.tobytes()


def test_a_window_is_simulated_as_mujoco_alone_would(slider: RobotCase) -> None:
    simulator, record = slider.model.rollout, slider.model.records[1]
    window = simulator.windows[record.trial]
    model = mujoco.MjModel.from_xml_path(str(slider.robot.model_path))
    data, log = mujoco.MjData(model), simulator.logs[window.log]
    data.qpos[:], data.qvel[:] = window.qpos, window.qvel
    path = []
    for k in range(window.first, window.end):
        path.append(data.qpos[0])
        data.ctrl[:] = log.drive[k]
        mujoco.mj_step(model, data, round(PERIOD_S / model.opt.timestep))
    start = Start(record.trial, np.zeros((2, 1)))
    found = simulator.simulate([start], [record.times_s], (), np.zeros((1, 0)))
    np.testing.assert_allclose(found[0, 0, :, 0], path, atol=1e-12)


def test_every_effect_does_nothing_at_its_null_and_something_at_its_probes(
    arm: RobotCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rollout, "stepwise", all_by_steps)
    model, records = arm.model, arm.model.records[:3]
    bare = model.predict(records, (), np.zeros((1, 0)))[0]
    for name, effect in model.effects.items():
        null = np.array([p.nominal for p in effect.parameters])
        probed = np.array([p.probes[-1] if p.probes else p.nominal for p in effect.parameters])
        found = model.predict(records, [name], np.array([null, probed]))
        assert found[0].tobytes() == bare.tobytes(), name
        assert np.isfinite(found[1]).all() and (found[1] != bare).any(), name


def test_predictions_do_not_depend_on_what_they_are_batched_with(arm: RobotCase) -> None:
    model, records = arm.model, arm.model.records
    name = "load_friction_elbow"
    vectors = np.linspace(0.0, 0.3, 5)[:, None]
    whole = model.predict(records, [name], vectors)
    one = model.predict(records[2:3], [name], vectors[3:4])
    assert whole[3, 2, : one.shape[2]].tobytes() == one[0, 0].tobytes()


def test_a_start_state_lies_as_far_from_the_truth_as_its_deviation_says(tmp_path: Path) -> None:
    case = read_case(write_folder(tmp_path, logs=20, noise=5e-4))
    rollout = case.model.rollout
    clean = read_case(write_folder(tmp_path / "clean", logs=20, noise=0.0)).model.rollout
    off = [
        [(w.qpos[0] - c.qpos[0]) / w.start_sd[0, 0], (w.qvel[0] - c.qvel[0]) / w.start_sd[1, 0]]
        for w, c in zip(rollout.windows, clean.windows, strict=False)
        if (w.log, w.first) == (c.log, c.first)
    ]
    assert len(off) > 15
    assert 0.5 < np.std(off) < 1.6


def test_noise_is_read_from_the_logs(tmp_path: Path) -> None:
    given = read_case(write_folder(tmp_path, noise=3e-3))
    noise = given.model.units.noise * given.model.units.si
    assert noise[0] == pytest.approx(3e-3, rel=0.3)


def test_a_perfect_model_stands_at_its_floor(tmp_path: Path) -> None:
    case = read_case(write_folder(tmp_path, noise=2e-3))
    model, records = case.model, case.model.records
    found = model.predict(records, (), np.zeros((1, 0)))[0]
    missed = [
        np.linalg.norm(path[: len(r.times_s)] - r.measured, axis=1).mean()
        for path, r in zip(found, records, strict=True)
    ]
    assert 100 * np.median(missed) / model.scale == pytest.approx(case.floor_percent, rel=0.3)


def test_a_start_state_hides_no_more_than_its_deviation_allows(slider: RobotCase) -> None:
    model = slider.model
    record = model.records[0]
    slopes, _ = model._gain(record)
    wrong = model.predict([record], ["constant_torque_axis"], np.array([[0.0], [50.0]]))[:, 0]
    rollout, still = model.rollout, Start(record.trial, np.zeros((2, 1)))
    effect = [model.effects["constant_torque_axis"]]
    raw = rollout.simulate([still], [record.times_s], effect, np.array([[50.0]]))[0, 0]
    moved = np.abs(wrong[1] - raw / model.units.si)
    assert (moved <= 3.0 * np.abs(slopes).sum(axis=1).reshape(moved.shape) + 1e-9).all()


def test_windows_of_one_log_are_held_out_together(slider: RobotCase, tmp_path: Path) -> None:
    many = read_case(write_folder(tmp_path, logs=13))
    by_log = {(w.log, w.part) for w in many.model.rollout.windows}
    assert len(by_log) == len({log for log, _ in by_log}) == 13
    few = {(w.log, w.part) for w in slider.model.rollout.windows}
    assert len({part for _, part in few}) == len(few) >= 12  # logs are cut, never joined
    assert any("too few to hold out" in note for note in slider.notes)


def test_repeats_tell_the_floor(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, logs=6, repeats=[["log0.csv", "log1.csv"]])
    rng = np.random.default_rng(1)
    lines = (folder / "log0.csv").read_text().splitlines()
    again = [lines[0]]
    for line in lines[1:]:
        *others, q = map(float, line.split(","))
        again.append(",".join(map(str, [*others, q + QUANTUM * rng.normal()])))
    (folder / "log1.csv").write_text("\n".join(again) + "\n")
    case = read_case(folder)
    assert case.repeated
    parts = {w.log: w.part for w in case.model.rollout.windows if w.log < 2 and w.first < 20}
    assert parts[0] == parts[1]


FEW = ("dry_friction_axis", "viscous_friction_axis", "drive_gain_axis", "mass_table")


def named(case: RobotCase, *more: str) -> tuple[list[str], dict[str, float]]:
    """Return what a diagnosis with a few candidates names, and the sizes of it."""
    effects = case.model.effects
    others = [n for n, e in effects.items() if e.depends_on is None and n not in (*FEW, *more)]
    effort = Effort(some=12, tried=3, finalists=1)
    said = diagnose(case.question(others, (), Rule(), effort), lambda known: None)
    return said["verdict"], {n: p["value"] for n, p in said["model"]["parameters"].items()}


def test_hidden_dry_friction_is_named(slider: RobotCase) -> None:
    verdict, sizes = named(slider)
    assert verdict == ["dry_friction_axis"]
    assert sizes["dry_friction_axis.torque"] == pytest.approx(0.8, rel=0.05)


def test_a_joint_that_resonates_is_named_elastic(tmp_path: Path) -> None:
    xml = SLIDER.replace('damping="2"', 'damping="2" armature="0.6"')
    case = read_case(write_folder(tmp_path, xml, spring=600.0))
    verdict, sizes = named(case, "elastic_joint_axis", "dead_time_axis", "lag_axis")
    assert verdict == ["elastic_joint_axis"]
    assert sizes["elastic_joint_axis.c"] == pytest.approx(1 / 600, rel=0.1)


def test_commands_that_come_late_are_named_dead_time(tmp_path: Path) -> None:
    folder = write_folder(tmp_path)
    for path in folder.glob("log*.csv"):  # commands are logged three rows before they act
        table = pl.read_csv(path)
        earlier = pl.col("u_motor").shift(-3).fill_null(strategy="forward")
        table.with_columns(earlier).write_csv(path)
    verdict, sizes = named(read_case(folder), "elastic_joint_axis", "dead_time_axis", "lag_axis")
    assert verdict == ["dead_time_axis"]
    assert sizes["dead_time_axis.tau"] == pytest.approx(3 * PERIOD_S, rel=0.1)  # the step is 5 ms
