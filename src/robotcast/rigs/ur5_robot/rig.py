"""The UR5 rig: it resets, casts and films as the virtual rig does, on a robot.

Nothing moves before the whole motion was checked, and nothing moves after a fault: every fault
ends the program on the controller and raises `RigStopped`, after which nobody casts.
"""

import atexit
import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.rig import CastNotUsed, RigStopped
from robotcast.rigs.ur5 import Gripper, joints_pointing_down
from robotcast.rigs.ur5_robot.arm import Arm
from robotcast.rigs.ur5_robot.checks import SafetyLimits, refuse_motion, refuse_unsafe
from robotcast.rigs.ur5_robot.clocks import Clocks, compare_clocks
from robotcast.rigs.ur5_robot.connection import Robot
from robotcast.rigs.ur5_robot.drive import ServoSettings
from robotcast.rigs.ur5_robot.film import Film, film_cast
from robotcast.rigs.ur5_robot.motion import JointMotion, WholeMotion, plan_whole, sway
from robotcast.rigs.ur5_robot.notes import CastNotes, write_notes
from robotcast.rigs.ur5_robot.sight import Sight
from robotcast.rigs.ur5_robot.stream import RobotLog, WatchSettings
from robotcast.rigs.ur5_robot.tool_log import ROBOT_FILE, tool_motion, write_robot_log
from robotcast.rigs.ur5_robot.webcam import Webcam, WebcamSettings
from robotcast.sessions.cast_files import (
    TOOL_FILE,
    CastRecord,
    write_frame_times,
    write_record,
    write_tool,
)
from robotcast.vision.facts import TrackerFacts

RESETS = 3
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

    arm: Arm
    sight: Sight
    clocks: Clocks
    rehearsed: bool = False

    def close(self) -> None:
        """Hang up and let go of the camera."""
        self.sight.camera.close()
        self.arm.robot.close()


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
            film = self._film(running, planned, folder, log, rest_only)
            self._write(film, planned, number, folder, log, rest_only)
            self._write_notes(running, folder, log, resets)
        except RigStopped as stop:
            if log.states:
                write_robot_log(log, folder / ROBOT_FILE)
            raise RigStopped(self._way_on(stop, number)) from None
        self._refuse_poor(log)

    def close(self) -> None:
        """Hang up and let go of the camera."""
        while self._open:
            self._open.pop().close()

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
        if not self._open:
            try:
                self._open.append(self._opened())
            except ValueError as error:
                raise RigStopped(str(error)) from None
            atexit.register(self.close)
        return self._open[0]

    def _opened(self) -> Running:
        with ExitStack() as opened:
            camera = Webcam(self.webcam)
            opened.callback(camera.close)
            robot = Robot(self.host, self.gripper.length_m, self.servo)
            opened.callback(robot.close)
            if camera.unfixed:
                self.tell(f"the camera does not let {' and '.join(camera.unfixed)} be fixed")
            arm = Arm(robot, self.gripper, self.watch, camera.require_alive)
            sight = Sight(camera, self.tracker)
            clocks = self._compare_clocks(arm, sight)
            opened.pop_all()
        return Running(arm, sight, clocks)

    def _compare_clocks(self, arm: Arm, sight: Sight) -> Clocks:
        swaying = sway(arm.start(), arm.robot.period_s)
        refuse_motion(swaying, self.limits.cast, self.limits, "swaying before the camera")
        self._ask("The arm will sway by a few centimetres to compare the clocks.")
        found = compare_clocks(arm, sight, swaying, self.r0_m)
        away_m = found.kinematic_difference_m
        self.tell(
            f"camera: {found.frames_per_s:.1f} frames/s, {found.camera_offset_s * 1e3:.1f} ms "
            f"behind the controller; kinematics: {away_m * 1e3:.2f} mm between the controller's "
            "tool pose and ours"
        )
        if not away_m <= MOST_DIFFERENCE_M:
            raise RigStopped(
                f"the controller puts the tool {away_m * 1e3:.0f} mm from where our "
                "kinematics does: this is no UR5, or its base is turned or moved"
            )
        return found

    def _rehearse(self, running: Running, planned: PlannedCast) -> None:
        """Run the first motion of a session slowly, once, under the operator's eyes."""
        if running.rehearsed:
            return
        arm = running.arm
        whole = self.planned_motion(planned, arm.start())
        slow = self.run.first_speed
        self._ask(f"The first reset and cast run at {slow:.0%} of their speed.")
        for motion in (whole.reset, whole.cast):
            arm.run(motion.at_speed(slow, arm.robot.period_s))
        self._ask("Was that as expected? From now on the arm moves at full speed.")
        running.rehearsed = True

    def _reset(self, running: Running, planned: PlannedCast) -> int:
        """Reset until the camera sees the free end on the axis; return how often it took."""
        arm = running.arm
        wanted = np.array([self.r0_m + self.cable.length_m + self.tracker.endpoint_radius_m, 0.0])
        for attempt in range(1, RESETS + 1):
            whole = self.planned_motion(planned, arm.start())
            arm.run(whole.reset.at_speed(self.run.speed, arm.robot.period_s))
            if running.sight.end_lies_at(wanted, self.run.end_m):
                return attempt
        raise RigStopped(
            f"the cable's end was not found on the axis after {RESETS} resets; "
            "look whether the cable hangs in the gripper and its end is in the camera's view"
        )

    def _film(
        self, running: Running, planned: PlannedCast, folder: Path, log: RobotLog, rest_only: bool
    ) -> Film:
        arm = running.arm
        cast = self._cast_from(planned, arm.start())
        return film_cast(
            arm,
            running.sight.camera,
            cast.at_speed(self.run.speed, arm.robot.period_s),
            folder,
            log,
            rest_s=self.run.rest_s,
            camera_offset_s=running.clocks.camera_offset_s,
            rest_only=rest_only,
        )

    def _cast_from(self, planned: PlannedCast, start: np.ndarray) -> JointMotion:
        """Return the cast's motion, checked again from where the arm really stands."""
        away = np.abs((start - self.home_rad() + np.pi) % (2 * np.pi) - np.pi)
        if not (away <= self.limits.start_rad).all():
            raise RigStopped("the arm does not stand where the reset should have left it")
        whole = self.planned_motion(planned, start)
        turns = 2 * np.pi * np.round((start - whole.cast.joints_rad[0]) / (2 * np.pi))
        return JointMotion(whole.cast.t_s, whole.cast.joints_rad + turns)

    def _write(
        self,
        film: Film,
        planned: PlannedCast,
        number: int,
        folder: Path,
        log: RobotLog,
        rest_only: bool,
    ) -> None:
        """Write what a cast's folder holds beside its video."""
        write_frame_times(np.where(film.known, film.frames_s, np.nan), folder)
        write_tool(tool_motion(log, film.start_s), folder / TOOL_FILE)
        write_robot_log(log, folder / ROBOT_FILE)
        record = CastRecord(
            number=number,
            action=planned.action,
            rig=self.name,
            cable=self.cable.name,
            video_t0_s=float(film.frames_s[0] - self.tracker.exposure_s / 2),
            fps=self.webcam.fps,
            turn_s=planned.turn_s,
            end_s=planned.end_s,
            rest_s=planned.end_s + self.run.rest_s,
            rest_only=rest_only,
        )
        write_record(record, folder)

    def _write_notes(self, running: Running, folder: Path, log: RobotLog, resets: int) -> None:
        notes = CastNotes(
            host=self.host,
            controller_period_s=running.arm.robot.period_s,
            cycles=log.cycles,
            missed_deadlines=log.missed,
            camera_offset_s=round(running.clocks.camera_offset_s, 5),
            kinematic_difference_m=round(running.clocks.kinematic_difference_m, 6),
            speed=self.run.speed,
            resets=resets,
            not_fixed=running.sight.camera.unfixed,
        )
        write_notes(notes, folder)

    def _ask(self, text: str) -> None:
        if self.confirm(text) is not True:
            raise RigStopped("the operator did not confirm")

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
