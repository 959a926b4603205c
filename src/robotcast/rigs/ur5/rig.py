"""The UR5 rig: it resets, casts and films as the virtual rig does, on a robot.

Nothing moves before the whole motion was checked, and nothing moves after a fault: every fault
ends the program on the controller and raises `RigStopped`, after which nobody casts.
"""

import atexit
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robotcast import sessions
from robotcast.casts.plan import PlannedCast
from robotcast.casts.reset import ResetSettings
from robotcast.files import digest, write_yaml
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs import CastNotUsed, RigStopped
from robotcast.rigs.kinematics import Gripper, joints_pointing_down, link_points
from robotcast.rigs.ur5 import motion
from robotcast.rigs.ur5.arm import Arm, RobotLog, ServoSettings, WatchSettings
from robotcast.rigs.ur5.camera import Webcam, WebcamSettings, arm_pixels, camera_offset
from robotcast.rigs.ur5.motion import JointMotion, SafetyLimits, WholeMotion
from robotcast.vision.calibration import calibrate
from robotcast.vision.camera import Camera, TrackerFacts
from robotcast.vision.detector import EndpointDetector

ROBOT_FILE = "robot.csv"
RESETS = 3
MOST_DIFFERENCE_M = 0.01
STILL_S = 0.3  # before and after the swaying
BEFORE_S = 0.3  # filmed before a cast starts
REST_FILM_S = 0.5  # filmed at rest, of a cast whose rest alone is wanted


@dataclass(frozen=True)
class RunSettings:
    """How casts are run."""

    speed: float = 1.0  # slower casts are kept aside, they are no casts of their action
    first_speed: float = 0.1  # of the first run of every session
    rest_s: float = 3.0  # how long the cable is filmed after the tool stopped
    end_m: float = 0.08  # how far from the axis the free end may lie after a reset
    most_missed: float = 0.01  # share of missed servo deadlines above which a cast is not used


@dataclass
class Running:
    """What is open in this session, and what the arm's swaying before the camera showed."""

    arm: Arm
    camera: Webcam
    camera_offset_s: float  # frames are stamped so late
    kinematic_difference_m: float  # mean distance of the controller's tool place from ours
    rehearsed: bool = False


@dataclass
class Ur5Rig:
    """A `Rig` made of a UR5, a webcam and an operator.

    `confirm` asks the operator, and whatever is not True stops; `tell` shows a sentence.
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
    _running: Running | None = field(default=None, init=False, repr=False, compare=False)

    def facts(self) -> dict[str, Any]:
        parts = (self.gripper, self.reset, self.servo, self.run.speed)
        return {"vision": self.tracker.as_dict(), "made": digest(parts)[:16]}

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        log = RobotLog()
        try:
            self._cast(planned, number, folder, log, rest_only=rest_only)
        except RigStopped as stop:
            if log.states:
                log.write(folder / ROBOT_FILE)
            home = ", ".join(f"{angle:.1f}" for angle in np.degrees(self.home_rad()))
            raise RigStopped(
                f"ur5: {stop}. The motion was stopped at cast {number}; finished casts stay, what "
                "was recorded of this one is kept aside. Mend the cause, release the robot on its "
                f"pendant, let the tool hold the cable over the board (home: {home}°) and run the "
                "same command again: it goes on with this cast"
            ) from None
        if log.missed > self.run.most_missed * log.cycles:
            raise CastNotUsed(
                f"ur5: {log.missed} of {log.cycles} servo deadlines were missed, more than "
                f"{self.run.most_missed:.1%}; the cast is kept aside and will be cast again by the "
                "next call (use a computer with less to do, or a real-time kernel)"
            )
        if self.run.speed < 1:
            raise CastNotUsed(f"ur5: cast at {self.run.speed:.0%} of its speed, kept aside")

    def _cast(
        self, planned: PlannedCast, number: int, folder: Path, log: RobotLog, *, rest_only: bool
    ) -> None:
        """Reset, run and film a cast, and write all that is known of it into `folder`."""
        running = self.open_session()
        if not running.rehearsed:
            self._rehearse(running, planned)
        resets, video = self._reset(running, planned), folder / sessions.VIDEO_FILE
        seen_s = self._film(running, planned, video, log, rest_only=rest_only)
        period_s, states = running.arm.period_s, log.states
        start_s = float(states[round(BEFORE_S / period_s)].t_s)
        frames_s = log.controller_time(seen_s) - running.camera_offset_s - start_s
        heard = (seen_s >= states[0].heard_s) & (seen_s <= states[-1].heard_s)
        sessions.write_frame_times(np.where(heard, frames_s, np.nan), folder)
        sessions.write_tool(log.tool_motion(start_s), folder / sessions.TOOL_FILE)
        log.write(folder / ROBOT_FILE)
        record = sessions.CastRecord(
            number=number,
            action=planned.action,
            rig=self.name,
            cable=self.cable.name,
            turn_s=planned.turn_s,
            end_s=planned.end_s,
            video_t0_s=float(frames_s[0] - self.tracker.exposure_s / 2),
            fps=self.webcam.fps,
            rest_s=planned.end_s + self.run.rest_s,
            rest_only=rest_only,
        )
        sessions.write_record(record, folder)
        notes = {  # what a person wants to know who doubts a cast
            "host": self.host,
            "controller_period_s": period_s,
            "cycles": log.cycles,
            "missed_deadlines": log.missed,
            "camera_offset_s": round(running.camera_offset_s, 5),
            "kinematic_difference_m": round(running.kinematic_difference_m, 6),
            "speed": self.run.speed,
            "resets": resets,
            "not_fixed": running.camera.unfixed,
        }
        write_yaml(folder / sessions.ROBOT_NOTES_FILE, notes)

    def close(self) -> None:
        if self._running is not None:
            self._running.camera.close()
            self._running.arm.close()
        self._running = None

    def planned_motion(self, planned: PlannedCast, joints_rad: np.ndarray) -> WholeMotion:
        """Return the whole motion from joints (6,), checked; raise ValueError when refused."""
        given = {"r0_m": self.r0_m, "settings": self.reset, "gripper": self.gripper}
        whole = motion.plan_whole(planned, joints_rad, self._reach_m, **given)
        motion.refuse_unsafe(whole, joints_rad, self.limits)
        return whole

    def home_rad(self) -> np.ndarray:
        """Return the joint angles (6,) that hold the cable's end where casts start."""
        return joints_pointing_down(np.array([self.r0_m, 0.0, 0.0]), self.gripper)

    def open_session(self) -> Running:
        """Open what is not open yet; compare clocks and kinematics once, which moves the arm."""
        if self._running is not None:
            return self._running
        with ExitStack() as opened:
            try:
                camera = Webcam(self.webcam)
                opened.callback(camera.close)
                arm = Arm(self.host, self.gripper, self.servo, self.watch, camera.require_alive)
                opened.callback(arm.close)
                if camera.unfixed:
                    self.tell(f"the camera does not let {' and '.join(camera.unfixed)} be fixed")
                self._running = self._compare_clocks(arm, camera)
            except ValueError as error:
                raise RigStopped(str(error)) from None
            opened.pop_all()
        atexit.register(self.close)
        return self._running

    def _compare_clocks(self, arm: Arm, camera: Webcam) -> Running:
        """Sway the arm before the camera, if that is safe, and see when the picture follows."""
        swaying = motion.sway(arm.start(), arm.period_s)
        motion.refuse_motion(swaying, self.limits.cast, self.limits, "swaying before the camera")
        self._ask("The arm will sway by a few centimetres to compare the clocks.")
        pixels = arm_pixels(self._calibrated(camera.picture()), self.r0_m)
        log, seen = RobotLog(), {}

        def look() -> None:
            newest, at_s = camera.newest()
            if at_s not in seen:
                seen[at_s] = pixels(newest)

        arm.follow(swaying.held(STILL_S, STILL_S, arm.period_s), log, look)
        times_s, pictures = log.controller_time(np.array([*seen])), np.array([*seen.values()])
        rate = camera.require_rate(times_s)
        joints_rad = log.column("joints_rad")
        offset_s = camera_offset(pictures, times_s, log.column("t_s"), joints_rad[:, 0])
        ours_m = link_points(joints_rad, self.gripper)[:, -1]
        away_m = float(np.linalg.norm(ours_m - log.column("tool_pose")[:, :3], axis=1).mean())
        self.tell(
            f"camera: {rate:.1f} frames/s, {offset_s * 1e3:.1f} ms behind the controller; "
            f"kinematics: {away_m * 1e3:.2f} mm between the controller's tool pose and ours"
        )
        if not away_m <= MOST_DIFFERENCE_M:
            raise RigStopped(
                f"the controller puts the tool {away_m * 1e3:.0f} mm from where our "
                "kinematics does: this is no UR5, or its base is turned or moved"
            )
        return Running(arm, camera, offset_s, away_m)

    def _rehearse(self, running: Running, planned: PlannedCast) -> None:
        """Run the first motion of a session slowly, once, under the operator's eyes."""
        arm, slow = running.arm, self.run.first_speed
        whole = self.planned_motion(planned, arm.start())
        self._ask(f"The first reset and cast run at {slow:.0%} of their speed.")
        for part in whole:
            arm.run(part.at_speed(slow, arm.period_s))
        self._ask("Was that as expected? From now on the arm moves at full speed.")
        running.rehearsed = True

    def _reset(self, running: Running, planned: PlannedCast) -> int:
        """Reset until the camera sees the free end on the axis; return how often it took."""
        arm = running.arm
        wanted_m = np.array([self.r0_m + self._reach_m, 0.0])
        for attempt in range(1, RESETS + 1):
            whole = self.planned_motion(planned, arm.start())
            arm.run(whole.reset.at_speed(self.run.speed, arm.period_s))
            picture = running.camera.picture()
            camera = self._calibrated(picture)
            found = EndpointDetector(camera, self.tracker, picture).detect(picture)
            if found is not None and np.linalg.norm(found.xy_m - wanted_m) <= self.run.end_m:
                return attempt
        raise RigStopped(
            f"the cable's end was not found on the axis after {RESETS} resets; "
            "look whether the cable hangs in the gripper and its end is in the camera's view"
        )

    def _film(
        self, running: Running, planned: PlannedCast, video: Path, log: RobotLog, *, rest_only: bool
    ) -> np.ndarray:
        """Run a cast, checked again from where the arm really stands; film it until it rests.

        `log` receives every cycle, also of a cast that fails. Returns when each frame was seen by
        this computer, (k,) [s].
        """
        arm, camera = running.arm, running.camera
        start = arm.start()
        away = np.abs((start - self.home_rad() + np.pi) % (2 * np.pi) - np.pi)
        if not (away <= self.limits.start_rad).all():
            raise RigStopped("the arm does not stand where the reset should have left it")
        t_s, joints_rad = self.planned_motion(planned, start).cast
        cast = JointMotion(t_s, joints_rad + motion.turns_towards(start, joints_rad[0]))
        moved = cast.at_speed(self.run.speed, arm.period_s)
        moved = moved.held(BEFORE_S, self.run.rest_s, arm.period_s)
        resting = len(moved.t_s) - round(REST_FILM_S / arm.period_s)

        def every_cycle() -> None:
            if rest_only and len(log.states) == resting:
                camera.start_recording(video)

        try:
            if not rest_only:
                camera.start_recording(video)
            arm.follow(moved, log, every_cycle)
        finally:
            seen_s = camera.stop_recording()
        return seen_s

    def _calibrated(self, picture: np.ndarray) -> Camera:
        """Return the camera as the markers in its picture show it."""
        try:
            return calibrate(picture, self.tracker, self.webcam.source).camera
        except ValueError as error:
            raise RigStopped(str(error)) from None

    @property
    def _reach_m(self) -> float:
        """Distance from the held end to the free end's centre."""
        return self.cable.length_m + self.tracker.endpoint_radius_m

    def _ask(self, text: str) -> None:
        if self.confirm(text) is not True:
            raise RigStopped("the operator did not confirm")
