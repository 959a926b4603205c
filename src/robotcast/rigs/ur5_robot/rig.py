"""The UR5 rig: it resets, casts and films as the virtual rig does, on a robot.

Nothing moves before the whole motion was checked, and nothing moves after a fault: every fault
ends the program on the controller and raises `RigStopped`, after which nobody casts.
"""

import atexit
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.cast_files import (
    TOOL_FILE,
    VIDEO_FILE,
    CastRecord,
    write_frame_times,
    write_record,
    write_tool,
)
from robotcast.rigs.rig import CastNotUsed, RigStopped
from robotcast.rigs.ur5 import Gripper, joints_pointing_down, link_points
from robotcast.rigs.ur5_robot.camera_time import ArmPixels, camera_offset
from robotcast.rigs.ur5_robot.checks import SafetyLimits, refuse_motion, refuse_unsafe
from robotcast.rigs.ur5_robot.connection import Robot
from robotcast.rigs.ur5_robot.drive import ServoSettings
from robotcast.rigs.ur5_robot.motion import JointMotion, WholeMotion, held_pose, plan_whole, sway
from robotcast.rigs.ur5_robot.notes import CastNotes, write_notes
from robotcast.rigs.ur5_robot.stream import RobotLog, WatchSettings, stream
from robotcast.rigs.ur5_robot.tool_log import ROBOT_FILE, tool_motion, write_robot_log
from robotcast.rigs.ur5_robot.webcam import Webcam, WebcamSettings, require_rate
from robotcast.vision.calibration import calibrate
from robotcast.vision.camera import Camera
from robotcast.vision.detector import EndpointDetector
from robotcast.vision.facts import TrackerFacts

RESETS = 3
BEFORE_S = 0.3  # filmed before the start
REST_FILM_S = 0.5
MOST_DIFFERENCE_M = 0.01


@dataclass(frozen=True)
class RunSettings:
    """How casts are run.

    Attributes
    ----------
    speed : 1 for casts; slower ones are kept aside, they are no casts of their action.
    first_speed : of the first run of every session.
    rest_s : how long the cable is filmed after the tool stopped.
    end_m : how far from the axis the free end may lie after a reset.
    most_missed : share of cycles without a target in time, above which a cast is not used.
    """

    speed: float = 1.0
    first_speed: float = 0.1
    rest_s: float = 3.0
    end_m: float = 0.08
    most_missed: float = 0.01


@dataclass
class Running:
    """What is open and was measured in this session."""

    robot: Robot
    camera: Webcam
    camera_offset_s: float = 0.0
    kinematic_difference_m: float = 0.0
    rehearsed: bool = False


@dataclass(frozen=True)
class Ur5Rig:
    """A `Rig` made of a UR5, a webcam and an operator.

    Attributes
    ----------
    confirm : asks the operator; whatever is not True stops.
    tell : shows the operator a sentence.
    """

    cable: Cable
    r0_m: float
    host: str
    limits: SafetyLimits
    gripper: Gripper
    reset: ResetSettings
    servo: ServoSettings
    watch: WatchSettings
    webcam: WebcamSettings
    tracker: TrackerFacts
    run: RunSettings
    confirm: Callable[[str], bool]
    tell: Callable[[str], None]
    name: str = "ur5"
    workers: int = 1
    _open: list[Running] = field(default_factory=list, repr=False, compare=False)

    def facts(self) -> dict[str, Any]:
        """Return what session.yaml tells the tracker."""
        parts = (self.gripper, self.reset, self.servo, self.run.speed)
        made = hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
        return {"vision": self.tracker.as_dict(), "made": made}

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        """Reset, execute and film one cast into the empty `folder`."""
        log = RobotLog()
        try:
            running = self.open_session()
            self._rehearse(running, planned)
            resets = self._reset(running, planned)
            self._film(running, planned, number, folder, log, rest_only)
            self._write_notes(running, folder, log, resets)
        except RigStopped as stop:
            if log.states:
                write_robot_log(log, folder / ROBOT_FILE)
            raise RigStopped(self._way_on(stop, number)) from None
        self._refuse_poor(log)

    def close(self) -> None:
        """Hang up and let go of the camera."""
        while self._open:
            running = self._open.pop()
            running.camera.close()
            running.robot.close()

    def planned_motion(self, planned: PlannedCast, joints_rad: np.ndarray) -> WholeMotion:
        """Return the whole motion from joints (6,), checked; raise ValueError when refused."""
        whole = plan_whole(
            planned,
            joints_rad,
            self.cable.length_m + self.tracker.endpoint_radius_m,
            r0_m=self.r0_m,
            settings=self.reset,
            gripper=self.gripper,
        )
        refuse_unsafe(whole, joints_rad, self.limits)
        return whole

    def home_rad(self) -> np.ndarray:
        """Return the joint angles (6,) that hold the cable's end where casts start."""
        return joints_pointing_down(np.array([self.r0_m, 0.0, 0.0]), self.gripper)

    def open_session(self) -> Running:
        """Open what is not open yet; compare clocks and kinematics once, which moves the arm."""
        if self._open:
            return self._open[0]
        try:
            camera = Webcam(self.webcam)
            try:
                robot = Robot(self.host, self.gripper.length_m, self.servo)
            except ValueError:
                camera.close()
                raise
            running = Running(robot, camera)
            self._open.append(running)
            atexit.register(self.close)
            if camera.unfixed:
                self.tell(f"the camera does not let {' and '.join(camera.unfixed)} be fixed")
            self._compare_clocks(running)
        except ValueError as error:
            self.close()
            raise RigStopped(str(error)) from None
        return running

    def _compare_clocks(self, running: Running) -> None:
        """Sway the arm before the camera: offset of the clocks, difference of the kinematics."""
        start = self._start(running)
        swaying = sway(start, running.robot.period_s)
        refuse_motion(swaying, self.limits.cast, self.limits, "swaying before the camera")
        self._ask("The arm will sway by a few centimetres to compare the clocks.")
        arm = ArmPixels(self._calibrated(running.camera.picture()), self.r0_m)
        log, pictures, seen_s = RobotLog(), [], []

        def look() -> None:
            running.camera.require_alive()
            newest, at_s = running.camera.newest()
            if not seen_s or at_s > seen_s[-1]:
                pictures.append(arm.of(newest))
                seen_s.append(at_s)

        held = _held_before(swaying, BEFORE_S, running.robot.period_s, after_s=BEFORE_S)
        with running.robot.driving() as drive:
            stream(running.robot, drive, held, log, self.watch, self.gripper, look)
        times_s = log.controller_time(np.array(seen_s))
        rate = require_rate(times_s, self.webcam)
        angle = log.column("joints_rad")[:, 0]
        offset_s = camera_offset(np.array(pictures), times_s, log.column("t_s"), angle)
        ours = link_points(log.column("joints_rad"), self.gripper)[:, -1]
        away = np.linalg.norm(ours - log.column("tool_pose")[:, :3], axis=1)
        running.camera_offset_s, running.kinematic_difference_m = offset_s, float(away.mean())
        self.tell(
            f"camera: {rate:.1f} frames/s, {offset_s * 1e3:.1f} ms behind the controller; "
            f"kinematics: {away.mean() * 1e3:.2f} mm between the controller's tool pose and ours"
        )
        if not away.mean() <= MOST_DIFFERENCE_M:
            raise RigStopped(
                f"the controller puts the tool {away.mean() * 1e3:.0f} mm from where our "
                "kinematics does: this is no UR5, or its base is turned or moved"
            )

    def _start(self, running: Running) -> np.ndarray:
        """Return the live joints (6,) of an arm that may start; raise `RigStopped` otherwise."""
        state = running.robot.live()
        if state.trouble:
            raise RigStopped(f"the robot is not ready: {state.trouble}")
        if state.speed_fraction < 0.99:
            raise RigStopped(
                f"the speed slider stands at {state.speed_fraction:.0%}; set it to 100 %: "
                "it would stretch every cast"
            )
        try:
            held_pose(state.joints_rad, self.gripper)
        except ValueError as error:
            raise RigStopped(str(error)) from None
        return state.joints_rad

    def _rehearse(self, running: Running, planned: PlannedCast) -> None:
        """Run the first motion of a session slowly, once, under the operator's eyes."""
        if running.rehearsed:
            return
        whole = self.planned_motion(planned, self._start(running))
        slow = self.run.first_speed
        self._ask(f"The first reset and cast run at {slow:.0%} of their speed.")
        for motion in (whole.reset, whole.cast):
            self._drive(running, motion.at_speed(slow, running.robot.period_s), RobotLog())
        self._ask("Was that as expected? From now on the arm moves at full speed.")
        running.rehearsed = True

    def _reset(self, running: Running, planned: PlannedCast) -> int:
        """Reset until the camera sees the free end on the axis; return how often it took."""
        for attempt in range(1, RESETS + 1):
            whole = self.planned_motion(planned, self._start(running))
            reset = whole.reset.at_speed(self.run.speed, running.robot.period_s)
            self._drive(running, reset, RobotLog())
            if self._end_lies_right(running.camera.picture()):
                return attempt
        raise RigStopped(
            f"the cable's end was not found on the axis after {RESETS} resets; "
            "look whether the cable hangs in the gripper and its end is in the camera's view"
        )

    def _calibrated(self, picture: np.ndarray) -> Camera:
        """Return the camera as the markers in its picture tell it."""
        try:
            return calibrate(picture, self.tracker, self.webcam.source).camera
        except ValueError as error:
            raise RigStopped(str(error)) from None

    def _end_lies_right(self, picture: np.ndarray) -> bool:
        camera = self._calibrated(picture)
        found = EndpointDetector(camera, self.tracker, picture).detect(picture)
        if found is None:
            return False
        wanted = np.array([self.r0_m + self.cable.length_m + self.tracker.endpoint_radius_m, 0.0])
        return bool(np.linalg.norm(found.xy_m - wanted) <= self.run.end_m)

    def _film(
        self,
        running: Running,
        planned: PlannedCast,
        number: int,
        folder: Path,
        log: RobotLog,
        rest_only: bool,
    ) -> None:
        robot, camera, run = running.robot, running.camera, self.run
        start = self._start(running)
        away = np.abs(start - self.home_rad())
        away = np.abs((away + np.pi) % (2 * np.pi) - np.pi)
        if not (away <= self.limits.start_rad).all():
            raise RigStopped("the arm does not stand where the reset should have left it")
        cast = self._cast_from(planned, start).at_speed(run.speed, robot.period_s)
        moved = _held_before(cast, BEFORE_S, robot.period_s, after_s=run.rest_s)
        before = round(BEFORE_S / robot.period_s)
        resting = len(moved.t_s) - round(REST_FILM_S / robot.period_s)
        try:
            if not rest_only:
                camera.start_recording(folder / VIDEO_FILE)
            with robot.driving() as drive:
                for part in (slice(0, resting), slice(resting, None)):
                    if rest_only and part.start:
                        camera.start_recording(folder / VIDEO_FILE)
                    motion = JointMotion(moved.t_s[part], moved.joints_rad[part])
                    stream(
                        robot, drive, motion, log, self.watch, self.gripper, camera.require_alive
                    )
        finally:
            seen_s = camera.stop_recording()
        start_s = float(log.states[before].t_s)
        frames_s = log.controller_time(seen_s) - running.camera_offset_s - start_s
        kept = (seen_s >= log.states[0].heard_s) & (seen_s <= log.states[-1].heard_s)
        write_frame_times(np.where(kept, frames_s, np.nan), folder)
        write_tool(tool_motion(log, start_s), folder / TOOL_FILE)
        write_robot_log(log, folder / ROBOT_FILE)
        record = CastRecord(
            number=number,
            action=planned.action,
            rig=self.name,
            cable=self.cable.name,
            video_t0_s=float(frames_s[0] - self.tracker.exposure_s / 2),
            fps=self.webcam.fps,
            turn_s=planned.turn_s,
            end_s=planned.end_s,
            rest_s=planned.end_s + run.rest_s,
            rest_only=rest_only,
        )
        write_record(record, folder)

    def _cast_from(self, planned: PlannedCast, start: np.ndarray) -> JointMotion:
        """Return the cast's motion, checked again from where the arm really stands."""
        whole = self.planned_motion(planned, start)
        turns = 2 * np.pi * np.round((start - whole.cast.joints_rad[0]) / (2 * np.pi))
        return JointMotion(whole.cast.t_s, whole.cast.joints_rad + turns)

    def _drive(self, running: Running, motion: JointMotion, log: RobotLog) -> None:
        robot = running.robot
        with robot.driving() as drive:
            watch = running.camera.require_alive
            stream(robot, drive, motion, log, self.watch, self.gripper, watch)
            settled = _held_before(_still(motion), 0.0, robot.period_s, after_s=0.3)
            stream(robot, drive, settled, log, self.watch, self.gripper, watch)

    def _ask(self, text: str) -> None:
        if self.confirm(text) is not True:
            raise RigStopped("the operator did not confirm")

    def _write_notes(self, running: Running, folder: Path, log: RobotLog, resets: int) -> None:
        notes = CastNotes(
            host=self.host,
            controller_period_s=running.robot.period_s,
            cycles=log.cycles,
            missed_deadlines=log.missed,
            camera_offset_s=round(running.camera_offset_s, 5),
            kinematic_difference_m=round(running.kinematic_difference_m, 6),
            speed=self.run.speed,
            resets=resets,
            not_fixed=running.camera.unfixed,
        )
        write_notes(notes, folder)

    def _refuse_poor(self, log: RobotLog) -> None:
        if log.missed > self.run.most_missed * log.cycles:
            raise CastNotUsed(
                f"ur5: {log.missed} of {log.cycles} servo deadlines were missed, more than "
                f"{self.run.most_missed:.1%}; the cast is kept aside and will be cast again by the "
                "next call (use a computer with less to do, or a real-time kernel)"
            )
        if self.run.speed < 1:
            raise CastNotUsed(f"ur5: cast at {self.run.speed:.0%} of its speed, kept aside")

    def _way_on(self, stop: RigStopped, number: int) -> str:
        home = ", ".join(f"{angle:.1f}" for angle in np.degrees(self.home_rad()))
        return (
            f"ur5: {stop}. The motion was stopped at cast {number}; finished casts stay, what was "
            "recorded of this one is kept aside. Mend the cause, release the robot on its pendant, "
            f"let the tool hold the cable over the board (home: {home}°) and run the same "
            "command again: it goes on with this cast"
        )


def _held_before(
    motion: JointMotion, before_s: float, period_s: float, *, after_s: float
) -> JointMotion:
    """Return a motion with its first and last joints held for a while."""
    path = motion.joints_rad
    counts = round(before_s / period_s), round(after_s / period_s)
    held = [np.repeat(end, n, axis=0) for end, n in zip((path[:1], path[-1:]), counts, strict=True)]
    joints = np.concatenate([held[0], path, held[1]])
    return JointMotion(np.arange(len(joints)) * period_s, joints)


def _still(motion: JointMotion) -> JointMotion:
    return JointMotion(motion.t_s[-1:], motion.joints_rad[-1:])
