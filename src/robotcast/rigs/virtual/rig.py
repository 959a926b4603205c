"""The virtual rig: it stands in for the robot, the cable, the board and the camera."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robotcast import sessions
from robotcast.casts.action import ToolMotion
from robotcast.casts.plan import PlannedCast
from robotcast.files import digest
from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.rigs.kinematics import Gripper, joint_path, link_points
from robotcast.rigs.virtual.cable import (
    TOOL_JOINTS,
    ArmDynamics,
    CableRun,
    CableTruth,
    CastNoise,
    Motion,
    StartScatter,
    build_cable,
    compile_cable,
    generator,
)
from robotcast.rigs.virtual.mechanisms import Disturbance, HiddenEffect, acting, changed
from robotcast.rigs.virtual.picture import PictureSettings, SceneMotion, frame_starts, render_cast
from robotcast.vision.camera import Camera, TrackerFacts

LOG_S = 0.008
BEFORE_S = 0.1  # filmed before the start
AFTER_S = 0.1  # filmed after the end was seen at rest
SLOWEST_S = 4.0  # cap on how long the cable moves on after the arm stopped


@dataclass(frozen=True)
class Truth:
    """What really happened in a cast until the cable rested: the cable and the arm's tool."""

    cable: Motion
    tool: ToolMotion  # at the same times


@dataclass(frozen=True)
class VirtualRig:
    """A `Rig` made of a 3-D cable in MuJoCo, an arm that lags, and a rendered camera.

    Every cast draws its chance from `seed` and its number. The `hidden` effects of the cable, the
    board and the gripper act in every cast; those of the camera act on waypoints
    (`measure_cast`), not on the video.
    """

    cable: Cable
    truth: CableTruth
    r0_m: float
    arm: ArmDynamics
    noise: CastNoise
    scatter: StartScatter
    gripper: Gripper
    camera: Camera
    picture: PictureSettings
    tracker: TrackerFacts
    seed: int = 0
    workers: int = 1
    name: str = "virtual"
    hidden: tuple[HiddenEffect, ...] = ()

    def facts(self) -> dict[str, Any]:
        """Return what the tracker may know, and a digest of all that shapes a cast."""
        start = digest(self.scatter.headings_rad, self.scatter.places)
        parts = (self.truth, self.arm, self.noise, start, self.seed, *self.hidden)
        return {"vision": self.tracker.as_dict(), "made": digest(parts)[:16]}

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        """Simulate, log and film one cast into the empty `folder`."""
        truth = self.simulate_truth(planned, number)
        sessions.write_tool(self.log_tool(truth.tool, number), folder / sessions.TOOL_FILE)
        scene = self._scene(truth, rest_only=rest_only)
        frames = frame_starts(scene, self.picture)
        film_seed = int(generator(self.seed, number, "film").integers(2**31))
        render_cast(folder / sessions.VIDEO_FILE, scene, self.camera, self.picture, film_seed)
        middle_s = frames + self.picture.exposure_s / 2
        x, y, _ = ToolMotion(truth.cable.t_s, truth.cable.end_m).at(middle_s).T
        sessions.write_columns({"t": middle_s, "x": x, "y": y}, folder / sessions.TRUTH_FILE)
        record = sessions.CastRecord(
            number=number,
            action=planned.action,
            rig=self.name,
            cable=self.cable.name,
            video_t0_s=float(frames[0]),
            fps=float(self.picture.fps),
            turn_s=planned.turn_s,
            end_s=planned.end_s,
            rest_s=float(truth.cable.t_s[-1]),
            rest_only=rest_only,
        )
        sessions.write_record(record, folder)

    def simulate_truth(self, planned: PlannedCast, number: int) -> Truth:
        """Simulate cast `number` and return what really happened."""
        run, path = self.begin(planned, number)
        held, step_s = changed(self.hidden, "hold", path, self.truth.step_s), self.truth.step_s
        motion = run.drive(held, moving_s=planned.end_s + 5 * self.arm.lag_s)
        tool = ToolMotion(np.arange(len(path)) * step_s, path[:, [0, 1, 3]])
        return Truth(motion, ToolMotion(motion.t_s, tool.at(motion.t_s)))

    def begin(self, planned: PlannedCast, number: int) -> tuple[CableRun, np.ndarray]:
        """Lay the cable down for cast `number`; return it and the arm's path (steps, 5)."""
        friction_factor, gain, delay_s = self.noise.draw(self.seed, number)
        # a reset leaves the cable along the ray on which the cast starts
        drawn = self.scatter.draw(self.truth.segments, generator(self.seed, number, "start"))
        headings_rad = drawn + planned.tool.pose[0, 2]
        truth = replace(self.truth, friction=self.truth.friction * friction_factor)
        arm = replace(self.arm, gain_error=self.arm.gain_error + gain)
        steps = np.arange(round((planned.end_s + SLOWEST_S) / truth.step_s) + 1) * truth.step_s
        path = np.zeros((len(steps), TOOL_JOINTS))
        path[:, [0, 1, 3]] = arm.follow(planned.tool, steps, delay_s=delay_s)
        cable = changed(self.hidden, "cable", self.cable, planned)
        spec = build_cable(cable, truth)
        for effect in acting(self.hidden, "model"):
            effect(spec, cable, truth)
        model = compile_cable(spec)
        held = changed(self.hidden, "hold", path, truth.step_s)[0]
        run = CableRun(model, headings_rad, held, Disturbance(self.hidden, model, number))
        run.settle()
        return run, path

    def log_tool(self, tool: ToolMotion, number: int) -> ToolMotion:
        """Return the tool's motion as the controller logs it, at 125 Hz."""
        t_s = np.arange(int(tool.t_s[-1] / LOG_S + 1e-9) + 1) * LOG_S
        wrong = generator(self.seed, number, "log").standard_normal((len(t_s), 3))
        wrong *= [self.noise.tool_log_m, self.noise.tool_log_m, self.noise.tool_log_rad]
        return ToolMotion(t_s, tool.at(t_s) + wrong)

    def _scene(self, truth: Truth, *, rest_only: bool) -> SceneMotion:
        t_s, cable, tool = truth.cable.t_s, truth.cable.nodes_m, truth.tool.pose
        still = [t_s[-1], t_s[-1] + AFTER_S]
        times = np.array(still) if rest_only else np.concatenate([[-BEFORE_S], t_s, still[1:]])
        rows = np.searchsorted(t_s, np.clip(times, t_s[0], t_s[-1]))
        joints = joint_path(ToolMotion(times, tool[rows]), self.gripper)
        radii = self.cable.radius_m, self.truth.endpoint_radius_m
        return SceneMotion(times, cable[rows], link_points(joints, self.gripper), *radii)


@dataclass(frozen=True)
class Eye:
    """How the free end is tracked without a video: a waypoint every `period_s`.

    One coordinate has the standard deviation `noise_m`, and `noise_s` more with the end's speed
    [m per m/s], as in blurred frames.
    """

    period_s: float = 0.1
    noise_m: float = 0.001
    noise_s: float = 0.0


def measure_cast(
    rig: VirtualRig, eye: Eye, planned: PlannedCast, number: int, action_id: int
) -> Trial:
    """Simulate cast `number`, log its tool and track its free end until it rests."""
    truth = rig.simulate_truth(planned, number)
    cable = truth.cable
    stamps = np.arange(int(cable.t_s[-1] / eye.period_s + 1e-9) + 1) * eye.period_s
    places = seen_places(rig, cable, stamps)
    velocities = np.gradient(cable.end_m[:, :2], cable.t_s, axis=0)
    speeds = np.interp(stamps, cable.t_s, np.linalg.norm(velocities, axis=1))
    spread = (eye.noise_m + eye.noise_s * speeds)[:, None]
    wrong = spread * generator(rig.seed, number, "track").standard_normal(places.shape)
    tool = rig.log_tool(truth.tool, number)
    return Trial(number, action_id, planned.action, tool, stamps, places + wrong)


def seen_places(rig: VirtualRig, cable: Motion, stamp_s: np.ndarray) -> np.ndarray:
    """Return where the rig's camera puts the free end in waypoints so stamped, (k, 2)."""
    end = ToolMotion(cable.t_s, cable.end_m).at(changed(rig.hidden, "stamps", stamp_s))
    return changed(rig.hidden, "places", end[:, :2])
