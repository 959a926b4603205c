"""The UR5 rig with the genuine ur_rtde client, against the loopback controller."""

import re
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("rtde_control", reason="the extra ur5 is not installed")

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.rigs import RigStopped
from robotcast.rigs.collect import collect_casts
from robotcast.rigs.kinematics import joints_pointing_down
from robotcast.rigs.ur5.arm import Arm, RobotLog, ServoSettings, WatchSettings
from robotcast.rigs.ur5.motion import JointMotion, sway
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.sessions import read_session
from robotcast.vision.tracker import track_session
from tests.rigs.peer.controller import Settings
from tests.rigs.peer.lab import CAST_ENVELOPE, GRIPPER, HOME_RAD, scene, ur5_rig
from tests.rigs.peer.process import ROBOT_FAULTS, Peer, running_peer
from tests.rigs.small_rig import SHORT_CAST

pytestmark = pytest.mark.slow

PATIENT = Settings(HOME_RAD, patience_s=3.0)  # after 5 s of silence ur_rtde hangs up
HASTY = replace(PATIENT, haste=3.0, misplaced_m=(0.001, -0.001, 0.0))
UNHURRIED = WatchSettings(stale_s=3.5)  # a busy machine shall not decide a test
ACTION = SHORT_CAST.action
HOME = np.array(HOME_RAD)


@pytest.fixture(scope="module")
def filmed() -> VirtualRig:
    return scene(fps=15.0)


@pytest.fixture(scope="module")
def filmed_peer(filmed: VirtualRig) -> Iterator[Peer]:
    with running_peer(HASTY, filmed) as p:
        yield p


@pytest.fixture
def peer(filmed_peer: Peer) -> Peer:
    """The peer with a camera, without any fault and its arm at home."""
    filmed_peer.mend()
    filmed_peer.place(HOME)
    return filmed_peer


@pytest.fixture
def bare_peer() -> Iterator[Peer]:
    with running_peer(PATIENT) as p:
        yield p


def arm_at(peer: Peer, watchdog_hz: float = 0.2) -> Arm:
    return Arm(peer.host, GRIPPER, ServoSettings(watchdog_hz=watchdog_hz), UNHURRIED)


def session(rig, folder: Path, *actions: Action):
    return collect_casts(rig, list(enumerate(actions)), folder, PlanLimits())


def moves_after_fault(peer: Peer, *, cycles: int = 2) -> int:
    """Count the motion commands that came later than a few cycles after the last fault."""
    log = peer.log()
    fault_s = log.faults[-1][0]
    return sum(t_s > fault_s + cycles * 0.008 + 1e-6 for t_s, _ in log.commands)


def test_a_cast_becomes_a_measurement_and_the_clocks_are_compared(
    peer: Peer, filmed: VirtualRig, tmp_path: Path
):
    said: list[str] = []
    with closing(ur5_rig(peer, filmed, tell=said.append)) as rig:
        collected = session(rig, tmp_path / "session", ACTION)
    assert (collected.added, collected.failed) == (1, {})
    notes = yaml.safe_load((tmp_path / "session" / "cast_00000" / "robot.yaml").read_text())
    assert notes["kinematic_difference_m"] == pytest.approx(0.00141, abs=1e-4)
    told = SHORT_CAST.tool
    in_time = notes["cycles"] - notes["missed_deadlines"]
    assert in_time == pytest.approx((told.t_s[-1] + rig.run.rest_s) / 0.008, abs=2)
    assert "between the controller's tool pose and ours" in said[-1]
    tracked = track_session(read_session(tmp_path / "session"))
    assert not tracked.lost
    write_measurement_set(tracked.measurement_set(tmp_path), tmp_path / "set")
    (trial,) = read_measurement_set(tmp_path / "set").trials
    laid = told.pose[0, :2] + [filmed.cable.length_m, 0.0]  # where resets leave the free end
    assert np.linalg.norm(trial.endpoint_m - laid) > 0.015  # it was pulled
    # the arm lags behind what it was told, and gets there
    assert np.allclose(trial.tool.pose[-1], told.pose[-1] + [0.001, -0.001, 0.0], atol=2e-3)
    assert 0.02 < np.abs(trial.tool.at(told.t_s)[:, :2] - told.pose[:, :2]).max() < 0.15


@pytest.mark.parametrize("fault", ROBOT_FAULTS)
def test_after_a_fault_nothing_moves(bare_peer: Peer, fault: str):
    arm = arm_at(bare_peer)
    motion = sway(HOME, arm.period_s)
    log = RobotLog()

    def every_cycle() -> None:
        if len(log.states) == 1:
            bare_peer.break_in(fault, 1.0)

    with pytest.raises(RigStopped) as stopped:
        arm.follow(motion, log, every_cycle)
    arm.close()
    words = {
        "connection cut": "connection|the process that|sent nothing new",
        "stale packets": "stale|was lost",  # ur_rtde may be the first to give up
        "packets missing": "missing|was lost",
    }
    assert re.search(words.get(fault, fault), str(stopped.value))
    late = 40 if fault == "off its path" else 2  # the arm drifts off over some cycles
    assert moves_after_fault(bare_peer, cycles=late) == 0
    assert log.states
    bare_peer.mend()
    again = arm_at(bare_peer)
    assert np.isfinite(again.live().joints_rad).all()
    again.close()


def test_a_session_goes_on_after_a_fault(peer: Peer, filmed: VirtualRig, tmp_path: Path):
    second = Action(0.25, ACTION.r1_m, -0.25, 0.68, 0.2, 1.3)
    with closing(ur5_rig(peer, filmed)) as rig:
        session(rig, tmp_path, ACTION)
        before = (tmp_path / "cast_00000" / "tool.csv").read_bytes()
        peer.break_in("protective stop", 6.0)
        with pytest.raises(RigStopped, match=r"protective stop.*run the same comm"):
            session(rig, tmp_path, ACTION, second)
    assert moves_after_fault(peer) == 0
    assert (tmp_path / "failed_00001.yaml").is_file()
    peer.mend()
    peer.place(joints_pointing_down(np.array([0.62, 0.03, 0.1])))  # the operator lets it down
    with closing(ur5_rig(peer, filmed)) as rig:
        collected = session(rig, tmp_path, ACTION, second)
    assert (collected.stood, collected.added) == (1, 1)
    assert (tmp_path / "cast_00000" / "tool.csv").read_bytes() == before


def test_a_cable_that_lies_wrong_stops_after_three_resets(
    peer: Peer, filmed: VirtualRig, tmp_path: Path
):
    peer.break_now("cable crooked")
    wrong = pytest.raises(RigStopped, match="not found on the axis after 3 resets")
    with closing(ur5_rig(peer, filmed)) as rig, wrong:
        session(rig, tmp_path, ACTION)


def test_a_camera_that_goes_stops_the_arm(peer: Peer, filmed: VirtualRig, tmp_path: Path):
    webcam = replace(ur5_rig(peer, filmed).webcam, gone_s=1.0)
    peer.break_in("camera gone", 5.0)
    gone = pytest.raises(RigStopped, match="gave no frame for")
    with closing(ur5_rig(peer, filmed, webcam=webcam)) as rig, gone:
        session(rig, tmp_path, ACTION)


@pytest.mark.parametrize(
    ("confirmed", "raised_rad", "said"),
    [(False, 0.0, "did not confirm"), (True, 0.3, "a reset starts from a tool that points down")],
)
def test_an_arm_that_is_not_to_move_stays(
    peer: Peer, filmed: VirtualRig, tmp_path: Path, confirmed: bool, raised_rad: float, said: str
):
    peer.place(HOME - [0.0, raised_rad, 0.0, 0.0, 0.0, 0.0])
    before = len(peer.log().commands)
    rig = ur5_rig(peer, filmed, confirm=lambda _text: confirmed)
    with closing(rig), pytest.raises(RigStopped, match=said):
        session(rig, tmp_path, ACTION)
    assert len(peer.log().commands) == before


def test_targets_that_are_no_numbers_never_leave(bare_peer: Peer):
    arm = arm_at(bare_peer, 10.0)
    bad = JointMotion(np.arange(3) * 0.008, np.full((3, 6), np.nan))
    with pytest.raises(RigStopped):
        arm.follow(bad, RobotLog())
    arm.close()
    assert not bare_peer.log().commands


def test_missed_deadlines_are_counted_and_the_next_target_is_never_skipped(bare_peer: Peer):
    arm = arm_at(bare_peer)
    motion, log = sway(HOME, arm.period_s), RobotLog()
    hiccups = iter(range(10**6))

    def hiccup() -> None:
        if next(hiccups) == 100:
            bare_peer.hurry(0.5)

    arm.follow(motion, log, hiccup)
    arm.close()
    assert log.missed >= 40
    moving = (motion.joints_rad != motion.joints_rad[0]).any(axis=1)
    assert log.cycles == moving.sum() + log.missed
    assert bare_peer.log().targets == pytest.approx(motion.joints_rad)


def test_the_peer_keeps_to_the_envelope(bare_peer: Peer):
    arm = arm_at(bare_peer)
    motion = sway(HOME, arm.period_s)
    arm.follow(motion, RobotLog())
    arm.close()
    joints = bare_peer.log().joints
    speed = np.diff(joints, axis=0) / 0.008
    assert np.abs(speed).max() < CAST_ENVELOPE.joint_speed_rad_s[0]
    assert np.abs(np.diff(speed, axis=0)).max() / 0.008 < CAST_ENVELOPE.joint_acceleration_rad_s2[0]
