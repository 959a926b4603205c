"""What a robot's folder is read as: windows, start states, noise, effects at their null."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import polars as pl
import pytest
import yaml

from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.files import plain
from robotcast.reporting.diagnosis_page import diagnosis_page
from robotcast.robots import by_joint, rollout
from robotcast.robots.by_joint import diagnose_by_joint, diagnose_robot
from robotcast.robots.outcome import shown, write_patched
from robotcast.robots.robot_case import RobotCase, read_case
from robotcast.robots.robot_file import load_spec, write_parameters
from tests.robots.made_up_robot import (
    ARM,
    FEW,
    PERIOD_S,
    QUANTUM,
    SLIDER,
    diagnosed,
    rewrite,
    write_folder,
)

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def slider(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    def stick(model: mujoco.MjModel) -> None:
        model.dof_frictionloss[0] = 0.8

    return read_case(write_folder(tmp_path_factory.mktemp("slider"), change=stick))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> RobotCase:
    folder = tmp_path_factory.mktemp("arm")
    return read_case(write_folder(folder, ARM, logs=3, windows={"length_s": 0.3, "most": 6}))


STANDING = """<mujoco><worldbody><geom type="box" pos="0.3 0 1" size="0.1 0.1 0.1"/>
<body name="base" pos="0 0 1"><freejoint/><geom type="box" size="0.2 0.1 0.05"/>
  <body pos="0 0.12 0"><joint name="hip" axis="1 0 0"/><geom name="leg" size="0.05"/>
    <body pos="0 0 -0.3"><joint name="knee" axis="0 1 0"/><geom size="0.05"/></body></body>
</body></worldbody></mujoco>"""


def test_a_base_on_a_stand_collides_with_its_legs_no_more_than_before(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(STANDING)
    free, welded = (load_spec(tmp_path / "robot.xml", weld).compile() for weld in ((), ("0",)))
    found = []
    for model in (free, welded):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        found.append({tuple(sorted(pair)) for pair in data.contact.geom})
    assert found[0] == {(0, 1)}  # with what stands in the way, where the base could still give way
    assert found[1] == set()


def test_a_body_that_slides_is_held_as_mujoco_compiles_it(tmp_path: Path) -> None:
    held = '<mujoco><worldbody><body><joint type="slide" armature="3"/><geom size="0.1"/></body>'
    (tmp_path / "robot.xml").write_text(f"{held}</worldbody></mujoco>")
    plain = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    ours = load_spec(tmp_path / "robot.xml").compile()
    for field in ("body_invweight0", "dof_invweight0"):
        np.testing.assert_array_equal(getattr(ours, field), getattr(plain, field))


def all_by_steps(tune: object, effects: object, vectors: np.ndarray) -> np.ndarray:
    return np.ones(len(vectors), bool)


def test_all_steps_in_one_call_are_the_same_steps(
    arm: RobotCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, records, probed = arm.model, arm.model.records[:3], np.array([[0.1], [0.0]])
    at_once = model.predict(records, ["dry_friction_elbow"], probed)
    monkeypatch.setattr(rollout, "stepwise", all_by_steps)
    assert model.predict(records, ["dry_friction_elbow"], probed).tobytes() == at_once.tobytes()


def beside_mujoco(
    model: mujoco.MjModel, case: RobotCase, record: Record
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions in a window (k, nq) as they are simulated, and by MuJoCo alone."""
    simulator = case.model.rollout
    window = simulator.windows[record.trial]
    data, path = mujoco.MjData(model), []
    data.qpos[:], data.qvel[:] = window.qpos, window.qvel
    for command in simulator.logs[window.log].drive[window.first : window.end]:
        path.append(data.qpos.copy())
        data.ctrl[:] = command
        mujoco.mj_step(model, data, round(PERIOD_S / model.opt.timestep))
    found = simulator.simulate([record.trial], [record.times_s], (), np.zeros((1, 0)))
    return found[0, 0], np.array(path)


def test_a_window_is_simulated_as_mujoco_alone_would(slider: RobotCase) -> None:
    model = mujoco.MjModel.from_xml_path(str(slider.robot.model_path))
    found, path = beside_mujoco(model, slider, slider.model.records[1])
    np.testing.assert_allclose(found, path, atol=1e-12)


def test_tendons_without_friction_change_nothing(arm: RobotCase) -> None:
    coupled, bare = arm.robot.model, mujoco.MjModel.from_xml_path(str(arm.robot.model_path))
    assert coupled.ntendon == 2
    ends = []
    for model in (coupled, bare):
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.5, 0.2
        mujoco.mj_step(model, data, 300)
        ends.append(data.qpos.tobytes())
    assert ends[0] == ends[1]


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


@pytest.mark.parametrize("name", ["load_friction_elbow", "elastic_joint_elbow"])
def test_predictions_do_not_depend_on_what_they_are_batched_with(arm: RobotCase, name: str) -> None:
    model, records = arm.model, arm.model.records
    ends = np.array([(p.lower, (p.lower + p.upper) / 3) for p in model.effects[name].parameters])
    vectors = np.linspace(ends[:, 0], ends[:, 1], 5)
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


REMEMBERS = ARM.replace('kv="1.2"', 'kv="1.2" timeconst="0.1"').replace(
    'name="e"', 'name="e" delay="0.03" nsample="64"'
)


@pytest.mark.parametrize("xml", [SLIDER, REMEMBERS])
def test_noise_is_read_from_the_logs_and_a_perfect_model_stands_at_the_floor_that_it_makes(
    tmp_path: Path, xml: str
) -> None:
    case = read_case(write_folder(tmp_path, xml, noise=2e-3))
    noise = case.model.units.noise * case.model.units.si
    assert noise[0] == pytest.approx(2e-3, rel=0.3)
    missed = case.model.usual_miss(case.model.nominal_misses)
    assert missed == pytest.approx(case.floor.percent, rel=0.3)


@pytest.mark.parametrize(("finer", "shorter"), [(10, True), (1, False)])
def test_windows_tell_whether_they_follow_the_models_own_step(
    tmp_path: Path, finer: int, shorter: bool
) -> None:
    case = read_case(write_folder(tmp_path, ARM, noise=1e-5, finer=finer))
    assert case.model.step.left == 0.2 and (case.model.step.shift is not None) == shorter
    assert case.floor.whole_step_percent > 4 * case.floor.percent
    assert case.model.usual_miss(case.model.nominal_misses) < case.floor.percent


def test_where_they_follow_a_shorter_step_the_predictions_of_other_models_do(
    tmp_path: Path,
) -> None:
    def heavier(model: mujoco.MjModel) -> None:
        model.body_mass[-1] *= 1.1
        model.body_inertia[-1] *= 1.1

    case = read_case(write_folder(tmp_path, ARM, noise=1e-5, change=heavier))
    paths = case.model.predict(case.model.records, ["mass_fore"], np.array([[0.0], [0.1]]))
    base, truth = (case.model.usual_miss(case.model.misses(path)) for path in paths)
    assert truth < case.floor.percent < case.floor.whole_step_percent / 4 < base


def test_a_start_state_hides_no_more_than_its_deviation_allows(slider: RobotCase) -> None:
    model = slider.model
    record = model.records[0]
    slopes, *_ = model._gain(record)
    wrong = model.predict([record], ["constant_torque_axis"], np.array([[0.0], [50.0]]))[:, 0]
    effect = [model.effects["constant_torque_axis"]]
    raw = model.rollout.simulate([0], [record.times_s], effect, np.array([[50.0]]))[0, 0]
    moved = np.abs(wrong[1] - raw / model.units.si)
    assert (moved <= 3.0 * np.abs(slopes).sum(axis=1).reshape(moved.shape) + 1e-9).all()


def test_windows_of_one_log_are_held_out_together(slider: RobotCase, tmp_path: Path) -> None:
    many = read_case(write_folder(tmp_path, logs=13))
    by_log = {(w.log, w.part) for w in many.model.rollout.windows}
    assert len(by_log) == len({log for log, _ in by_log}) == 13
    few = {(w.log, w.part) for w in slider.model.rollout.windows}
    assert len({part for _, part in few}) == len(few) >= 12  # logs are cut, never joined
    assert any("too few to hold out" in note for note in slider.notes)


def test_windows_are_shorter_where_slopes_cannot_put_starts_right(tmp_path: Path) -> None:
    servo = '<position name="s" joint="shoulder" kp="25" kv="1.2"/>'
    xml = ARM.replace(servo, '<motor name="s" joint="shoulder" gear="3"/>')
    for damping in ('damping="0.05"', 'damping="0.03"'):
        xml = xml.replace(damping, 'damping="0.005" range="-99 99"')
    xml = xml.replace('timestep="0.005"', 'timestep="0.002"')
    folder = write_folder(tmp_path, xml, logs=3, length_s=8.0, noise=3e-3)
    case = read_case(folder)
    assert case.length_s == pytest.approx(0.5, abs=0.01)  # a prediction holds for 1.0 s
    assert case.model.starts_are_put_right()
    missed = case.model.usual_miss(case.model.nominal_misses)
    assert missed < 1.1 * case.floor.percent


def test_a_drive_without_a_column_and_a_log_without_a_window_are_said(tmp_path: Path) -> None:
    drive = {"actuator[s]": {"column": "u_s"}}
    folder = write_folder(tmp_path, ARM, logs=3, drive=drive)
    pl.read_csv(tmp_path / "log1.csv").head(60).write_csv(tmp_path / "log1.csv")
    notes = " ".join(read_case(folder).notes)
    assert "No column drives e: controls that stay 0." in notes
    (tmp_path / "robot.yaml").write_text(
        (tmp_path / "robot.yaml").read_text() + "windows: { length_s: 0.7 }"
    )
    assert "No window could be cut from log1.csv: left out." in " ".join(read_case(folder).notes)


def test_logs_of_one_file_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    same, loads = [["run0/log.csv", "run2/log.csv"]], {"body[table]": {"run1/log.csv": 0.5}}
    folder = write_folder(tmp_path, logs=13, repeats=same, payloads=loads)
    said = folder / "robot.yaml"
    said.write_text(said.read_text().replace("log*.csv", "run*/log.csv"))
    for number, path in enumerate(sorted(folder.glob("log*.csv"), key=lambda p: int(p.stem[3:]))):
        (folder / f"run{number}").mkdir()
        path.rename(folder / f"run{number}" / "log.csv")
    case = read_case(folder)
    rollout = case.model.rollout
    part = {rollout.logs[w.log].path.parent.name: w.part for w in rollout.windows}
    assert part["run0"] == part["run2"] and len(set(part.values())) == 12
    assert [log.path.parent.name for log in rollout.logs if log.payloads] == ["run1"]
    said.write_text(said.read_text().replace("run1/log.csv", "log.csv"))
    with pytest.raises(ValueError, match=r"payloads: log.csv is run0/log.csv as well as run1/log"):
        read_case(folder)


def test_repeats_tell_the_floor(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, logs=6, repeats=[["log0.csv", "log1.csv"]])
    table = pl.read_csv(folder / "log0.csv")
    noise = QUANTUM * np.random.default_rng(1).normal(size=len(table))
    table.with_columns(pl.col("q_axis") + noise).write_csv(folder / "log1.csv")
    case = read_case(folder)
    assert case.floor.repeated
    parts = {w.log: w.part for w in case.model.rollout.windows if w.log < 2 and w.first < 20}
    assert parts[0] == parts[1]


@pytest.fixture(scope="module")
def named(slider: RobotCase) -> dict[str, Any]:
    return diagnosed(slider)


def test_hidden_dry_friction_is_named(named: dict[str, Any]) -> None:
    assert named["verdict"] == ["dry_friction_axis"]
    torque = named["ranking"][0]["parameters"]["torque"]
    assert torque["value"] == pytest.approx(0.8, rel=0.05)


def test_where_it_errs_is_said_in_the_units_of_the_logs(
    slider: RobotCase, named: dict[str, Any]
) -> None:
    (axis,) = slider.wording.axes
    assert (axis.name, axis.unit) == ("axis position", "m")
    travel = [float(np.ptp(r.measured)) * axis.scale for r in slider.model.records]
    assert 1e-3 < np.median(travel) < 1.0  # metres again
    words = [part["sentence"] for part in named["comparison"]["slices"]]
    assert not any("board" in text or "path" in text for text in words)


def test_the_next_motions_stay_within_limits_and_are_written_as_the_logs_are(
    slider: RobotCase, tmp_path: Path
) -> None:
    motions = slider.motions
    assert {one.told["payload_kg"] for one in motions.some} == {0.0, 0.5, 2.0}
    for one in motions.some:
        assert np.abs(one.log.drive).max() <= 10.0 and np.abs(one.log.measured).max() <= 3.0
    row = motions.rows([{"motion": 1, "separates": ["a", "b"]}], tmp_path)[0]
    assert row["separates"] == ["a", "b"] and isinstance(row["motion"], str)
    table = pl.read_csv(tmp_path / row["file"])
    assert table.columns == ["t", "u_motor", "q_axis"]
    np.testing.assert_allclose(table["u_motor"], motions.some[1].log.drive[:, 0])


def test_single_joints_are_tried_where_no_effect_of_a_group_explains_the_logs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stiffer_elbow(model: mujoco.MjModel) -> None:
        model.dof_damping[1] = 0.3

    groups = {"arm": ["shoulder", "elbow"]}
    case = read_case(write_folder(tmp_path, ARM, logs=4, change=stiffer_elbow, groups=groups))
    asked: list[Case] = []

    def no_group_explains(question: Case, tell: object, progress: object) -> dict[str, Any]:
        asked.append(question)
        found = {"verdict": ["unknown"], "code": "unknown", "unexplained": None, "conclusive": True}
        found |= {"base": {"parameters": {}}, "model": {}, "notes": []}
        found |= {"ladder": [{"heldout_typical_error_percent": 1.0}], "noise_floor_percent": 1.0}
        named = {"code": "named", "verdict": question.candidates[:1]}
        return found | named if len(asked) == 2 else found

    monkeypatch.setattr(by_joint, "diagnose", no_group_explains)
    question = case.question((), (), Rule(), Effort(some=12))
    said = diagnose_by_joint(case, question, lambda known: None)
    first, second = (one.candidates for one in asked)
    assert "viscous_friction_arm" in first and not set(first) & set(second)
    assert said["verdict"] == ["viscous_friction_elbow"]  # promises most, so it stands first
    promising, cases = second[: by_joint.LOOKED_INTO], second[by_joint.LOOKED_INTO :]
    inquiry = Inquiry(case.model, question.records, 1.0)
    assert {n for one in promising for n in inquiry.special_cases(one, cases)} == {*cases}
    assert asked[1].comparisons > len(second)  # the level is shared with those left out


def test_within_a_group_richer_laws_compete_with_their_special_cases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    groups = {"arm": ["shoulder", "elbow"]}
    case = read_case(write_folder(tmp_path, ARM, logs=4, groups=groups))
    asked: list[Case] = []

    def the_richer_law(question: Case, tell: object, progress: object) -> dict[str, Any]:
        asked.append(question)
        found = {"verdict": ["stribeck_friction_arm"], "code": "named", "unexplained": None}
        found |= {"model": {}, "notes": [], "conclusive": True, "noise_floor_percent": 1.0}
        return found | {"ladder": [{"heldout_typical_error_percent": 1.0}]}

    monkeypatch.setattr(by_joint, "diagnose", the_richer_law)
    diagnose_by_joint(case, case.question((), (), Rule(), Effort()), lambda known: None)
    laws = ("stribeck_friction", "dry_friction")
    of_joints = {f"{law}_{joint}" for law in laws for joint in ("shoulder", "elbow")}
    assert {"stribeck_friction_arm"} | of_joints <= {*asked[1].candidates}


def test_effects_of_single_joints_may_act_or_be_left_out_from_the_start(tmp_path: Path) -> None:
    groups = {"arm": ["shoulder", "elbow"]}
    folder = write_folder(tmp_path, ARM, logs=4, groups=groups)
    case, some = read_case(folder), (Rule(), Effort())
    asked = case.question(["dry_friction_elbow"], ["viscous_friction_elbow"], *some)
    assert asked.fixed == ("viscous_friction_elbow",)
    assert "viscous_friction_arm" in asked.candidates
    more = {*case.question([], [], *some).candidates} - {*asked.candidates}
    assert more == {"dry_friction_each_joint_of_arm"}  # which the elbow is part of
    inquiry = Inquiry(asked.model, asked.records, 1.0)
    assert inquiry.residuals(asked.fixed)(inquiry.nominal(asked.fixed)[None], np.arange(2)).size
    nearest = "effects: no effect is called viscous_elbow; nearest is viscous_friction_elbow"
    with pytest.raises(ValueError, match=nearest):
        case.question([], ["viscous_elbow"], *some)


def test_a_joint_that_hardly_moves_does_not_shorten_the_windows(tmp_path: Path) -> None:
    held = ARM.replace('damping="0.05"', 'damping="1e4"')
    still = read_case(write_folder(tmp_path, held, logs=4))
    assert still.length_s > 0.2


def test_compare_shows_where_a_model_fails_and_tune_writes_one_that_does_not(
    tmp_path: Path,
) -> None:
    def stiffer(model: mujoco.MjModel) -> None:
        model.dof_damping[:] = 3.0

    bounds = {"joint[axis].damping": [0.5, 6.0]}
    folder = write_folder(tmp_path / "robot", change=stiffer, tune=bounds)

    def run(stage: str, output: Path) -> None:
        given = ["model=mjcf", f"robot={folder}", f"output={output}"]
        command = [sys.executable, ROOT / "stages" / stage, *given]
        subprocess.run(command, check=True, capture_output=True)

    run("tune.py", tmp_path / "out")
    tuned = json.loads((tmp_path / "out/tuned.json").read_text())["parameters"]
    known = tuned["joint[axis].damping"]
    assert known["low"] < 3.0 < known["high"]
    patched = mujoco.MjModel.from_xml_path(str(tmp_path / "out/model.xml"))
    assert patched.dof_damping[0] == pytest.approx(known["value"], rel=1e-5)
    assert (tmp_path / "out/index.html").is_file() and (tmp_path / "out/parameters.yaml").is_file()
    write_folder(folder, change=stiffer)
    run("compare.py", tmp_path / "bare")
    found = json.loads((tmp_path / "bare/comparison.json").read_text())
    assert found["model"] == "the MJCF, as it is"
    assert found["waypoint_error_percent"] > 3 * found["noise_floor_percent"]


def test_the_page_opens_in_a_browser(
    slider: RobotCase, named: dict[str, Any], tmp_path: Path
) -> None:
    """Its sentences are a robot's; it fits narrow windows; what it links to is there."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if chromium is None:
        pytest.skip("there is no Chromium on this machine")
    base, last = named["base"], named["model"]
    rows = slider.motions.rows(4 * [{"motion": 0, "separates": ["drive_gain_axis"]}], tmp_path)
    rows = [{**row, "difference_percent": 3.0, "why": "so far apart"} for row in rows]
    said = {**named, "next_actions": rows, "measurements": "a/robot", "overrides": ["model=mjcf"]}
    write_patched(slider.robot, slider.model.effects, last, tmp_path / "model.xml")
    write_parameters(tmp_path / "parameters.yaml", last["parameters"])
    said |= {"robot": shown(slider, base, last), "patched": "model.xml"}
    (tmp_path / "index.html").write_text(diagnosis_page(plain(said)))
    errors: list[str] = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page()
        page.on("console", lambda message: errors.append(message.text))
        page.on("pageerror", lambda error: errors.append(str(error)))
        for width in (1280, 800):
            page.set_viewport_size({"width": width, "height": 900})
            page.goto((tmp_path / "index.html").as_uri())
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        text = page.locator("body").inner_text()
        links = page.locator("a[download]").evaluate_all("all => all.map(a => a.href)")
        browser.close()
    assert errors == []
    assert not {"cast", "casts", "board", "cable"} & set(re.findall(r"\w+", text.lower()))
    assert len(links) == 6 and all(Path(link.removeprefix("file://")).is_file() for link in links)


def test_a_payload_moves_as_a_mass_that_is_fixed_to_the_link(tmp_path: Path) -> None:
    place = [0.05, 0.0, -0.2]
    said = {"body[fore]": {"log1.csv": {"kg": 0.4, "at": place}}}
    windows = {"length_s": 0.3, "most": 6}
    case = read_case(write_folder(tmp_path, ARM, logs=2, payloads=said, windows=windows))
    record = next(r for r in case.model.records if r.factors["log"] == 2)
    spec = mujoco.MjSpec.from_string(ARM)
    hung = {"mass": 0.4, "ipos": [0, 0, 0], "inertia": [1e-12] * 3, "explicitinertial": True}
    spec.body("fore").add_body(pos=place, **hung)
    found, path = beside_mujoco(spec.compile(), case, record)
    np.testing.assert_allclose(found, path, atol=1e-6)


def test_a_parameter_dict_of_sysid_is_the_nominal_fit_and_comes_back(tmp_path: Path) -> None:
    sysid = pytest.importorskip("mujoco.sysid._src.parameter")
    known = sysid.ParameterDict()
    known.add(sysid.Parameter("friction", 2.0, 1.0, 4.0))
    known.add(sysid.Parameter("weight", 2.0, 1.0, 3.0, frozen=True))
    known["friction"].value[:] = 2.5
    known.save_to_disk(tmp_path / "identified.yaml")
    tune = {"joint[axis].damping": "friction", "body[table].mass": "weight"}
    case = read_case(write_folder(tmp_path, logs=2, sysid="identified.yaml", tune=tune))
    damping, mass = case.model.parameters
    assert (damping.nominal, damping.lower, damping.upper, damping.frozen) == (2.5, 1.0, 4.0, False)
    assert mass.frozen
    size = {"value": 2.4, "low": 2.2, "high": 2.6}
    write_parameters(tmp_path / "parameters.yaml", {damping.name: size, "rest": {"value": 1.0}})
    again = sysid.ParameterDict.load_from_disk(tmp_path / "parameters.yaml")
    assert again["joint[axis].damping"].value == [2.4] and again["rest"].frozen


def test_a_joint_that_resonates_is_named_elastic(tmp_path: Path) -> None:
    xml = SLIDER.replace('damping="2"', 'damping="2" armature="0.6"')
    case = read_case(write_folder(tmp_path, xml, spring=600.0))
    said = diagnosed(case, "elastic_joint_axis", "dead_time_axis", "lag_axis")
    assert said["verdict"] == ["elastic_joint_axis"]
    assert said["model"]["parameters"]["elastic_joint_axis.c"]["value"] == pytest.approx(
        1 / 600, rel=0.1
    )


def test_commands_that_come_late_are_named_dead_time(tmp_path: Path) -> None:
    # commands are logged three rows before they act
    earlier = pl.col("u_motor").shift(-3).fill_null(strategy="forward")
    folder = rewrite(write_folder(tmp_path), earlier)
    said = diagnosed(read_case(folder), "elastic_joint_axis", "dead_time_axis", "lag_axis")
    assert said["verdict"] == ["dead_time_axis"]
    tau_s = said["model"]["parameters"]["dead_time_axis.tau"]["value"]
    assert tau_s == pytest.approx(3 * PERIOD_S, rel=0.1)  # the step is 5 ms


def test_a_drive_of_another_sign_or_unit_is_told(tmp_path: Path) -> None:
    xml = SLIDER.replace('ctrllimited="true" ctrlrange="-10 10"', "")
    folder = write_folder(tmp_path, xml)
    assert "With u_motor" not in " ".join(read_case(folder).notes)
    rewrite(folder, pl.col("u_motor") * 1000)
    assert read_case(folder).notes[0].startswith("With u_motor times 0.001 the model as it is errs")
    rewrite(folder, pl.col("u_motor") * -1e-3)
    assert read_case(folder).notes[0].startswith("With u_motor of the other sign")
    free = {"joint[axis].damping": [0.0, 20.0], "joint[axis].armature": [0.0, 100.0]}
    said = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))
    (folder / "robot.yaml").write_text(yaml.safe_dump(said | {"tune": free}), encoding="utf-8")
    assert read_case(folder).notes[0].startswith("With u_motor of the other sign")


def test_nothing_is_named_that_predicts_worse_than_joints_that_go_on_as_they_moved(
    tmp_path: Path,
) -> None:
    """Whatever slows a hopeless model down lowers its error by much, and explains nothing."""
    xml = SLIDER.replace('ctrllimited="true" ctrlrange="-10 10"', "")
    folder = rewrite(write_folder(tmp_path, xml), pl.col("u_motor").sin() * 100)
    case = read_case(folder)
    record = case.model.records[0]
    path = case.model.idle([record])[0]
    speed = np.diff(path[:, 0]) / np.diff(record.times_s)
    np.testing.assert_allclose(speed, speed[0])
    said = diagnosed(case)
    errors = {row["effect"]: row["realised_typical_error_percent"] for row in said["ranking"]}
    assert errors["drive_gain_axis"] < said["ladder"][0]["heldout_typical_error_percent"] / 5
    assert said["code"] == "cannot tell" and "Joints that go on as they moved" in said["sentence"]


@pytest.mark.parametrize("tuned", [True, False])
def test_windows_are_as_long_as_the_model_that_was_found_predicts(
    tmp_path: Path, tuned: bool
) -> None:
    """Where the file's own model loses them: by what is tuned, or once more by what was named."""

    def brake(model: mujoco.MjModel) -> None:
        model.dof_damping[0] = 20.0

    tune = {"joint[axis].damping": [0.0, 100.0]} if tuned else {}
    case = read_case(write_folder(tmp_path, length_s=3.0, change=brake, tune=tune))
    if not tuned:
        short_s = case.length_s

        def few(asked: RobotCase) -> Case:
            laws = [n for n, e in asked.model.effects.items() if e.depends_on is None]
            effort = Effort(some=12, tried=3, finalists=1)
            return asked.question([n for n in laws if n not in FEW], (), Rule(), effort)

        case, said = diagnose_robot(case, few, lambda known: None)
        assert said["verdict"] == ["viscous_friction_axis"]
        assert short_s < 0.2 and said["notes"] == [*case.notes]
    assert case.length_s > 0.9
    assert case.model.usual_miss(case.model.nominal_misses) < 2 * case.floor.percent


def test_rotors_that_a_light_arm_lacks_are_told_by_inverse_dynamics(tmp_path: Path) -> None:
    """As a URDF lacks them: a thousand times its forearm's inertia, lost within a few samples."""
    xml = """
    <mujoco><option timestep="0.005" integrator="implicitfast"/><worldbody>
    <body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.05"/>
    <inertial pos="0 0 -0.15" mass="0.8" diaginertia="0.006 0.006 0.0005"/>
    <body name="fore" pos="0 0 -0.3"><joint name="elbow" axis="0 1 0" damping="0.03"/>
    <inertial pos="0 0 -0.02" mass="0.02" diaginertia="2e-5 2e-5 1e-6"/></body></body></worldbody>
    <actuator><motor name="s" joint="shoulder"/><motor name="e" joint="elbow"/></actuator>
    </mujoco>"""

    def hide(model: mujoco.MjModel) -> None:
        model.dof_armature[:] = 0.03
        model.dof_damping[1] = 0.1

    case = read_case(write_folder(tmp_path, xml, change=hide))
    guess = case.sizes.lacks
    np.testing.assert_allclose(guess["armature"], 0.03, rtol=0.1)
    np.testing.assert_allclose(guess["viscous_friction"], [0.0, 0.07], atol=0.01)
    assert "as its torques show" in case.notes[0]
    assert case.length_s > 0.4 and case.model.usual_miss(case.model.nominal_misses) < 5
    laws = [n for n, e in case.model.effects.items() if e.depends_on is None]
    kept = [n for n in laws if n.startswith(("armature", "viscous_friction", "dry_friction"))]
    effort = Effort(some=12, tried=3, finalists=1)
    asked = case.question([n for n in laws if n not in kept], (), Rule(), effort)
    named = ["viscous_friction_elbow", "armature_shoulder", "armature_elbow"]
    assert diagnose(asked, lambda known: None)["verdict"] == named
