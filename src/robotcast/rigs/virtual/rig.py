"""The virtual rig: it stands in for the robot, the cable, the board and the camera."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from robotcast.casts.plan import PlannedCast
from robotcast.casts.tool_motion import ToolMotion
from robotcast.files import atomic_file
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.ur5 import Gripper, joint_path
from robotcast.rigs.virtual.arm import ArmDynamics
from robotcast.rigs.virtual.cable import TOOL_JOINTS, CableTruth, build_cable, compile_cable
from robotcast.rigs.virtual.chance import CastNoise, draw, generator
from robotcast.rigs.virtual.drive import CableRun, Motion, undisturbed
from robotcast.rigs.virtual.hidden.disturbance import Disturbance
from robotcast.rigs.virtual.hidden.effect import Built, HiddenEffect, Holding
from robotcast.rigs.virtual.picture import PictureSettings, SceneMotion, frame_starts, render_cast
from robotcast.rigs.virtual.scatter import StartScatter
from robotcast.sessions.cast_files import (
    TOOL_FILE,
    TRUTH_FILE,
    VIDEO_FILE,
    CastRecord,
    write_record,
    write_tool,
)
from robotcast.vision.camera import Camera
from robotcast.vision.facts import TrackerFacts

LOG_S = 0.008
BEFORE_S = 0.1  # filmed before the start
AFTER_S = 0.1  # filmed after the end was seen at rest
SLOWEST_S = 4.0  # cap on how long the cable moves on after the arm stopped


@dataclass(frozen=True)
class Truth:
    """What really happened in a cast.

    Attributes
    ----------
    cable : the cable's motion from t = 0 until it rests.
    tool : pose of the held end at the times of `cable`.
    """

    cable: Motion
    tool: ToolMotion


@dataclass(frozen=True)
class VirtualRig:
    """A `Rig` made of a 3-D cable in MuJoCo, an arm that lags, and a rendered camera.

    Attributes
    ----------
    seed : every cast draws its chance from (seed, number of the cast).
    hidden : effects that the cable, the board and the gripper have and nobody is told. Those
        of the camera act on waypoints (`measure`), not on the video.
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
        """Return what session.yaml tells the tracker."""
        return {"vision": self.tracker.as_dict(), "made": self._fingerprint()}

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        """Simulate, log and film one cast into the empty `folder`."""
        truth = self.simulate_truth(planned, number)
        write_tool(self.log_tool(truth.tool, number), folder / TOOL_FILE)
        scene = self._scene(truth, rest_only=rest_only)
        frames = frame_starts(scene, self.picture)
        render_cast(folder / VIDEO_FILE, scene, self.camera, self.picture, self._film_seed(number))
        _write_truth(truth.cable, frames + self.picture.exposure_s / 2, folder / TRUTH_FILE)
        record = CastRecord(
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
        write_record(record, folder)

    def simulate_truth(
        self, planned: PlannedCast, number: int, *, headings_rad: np.ndarray | None = None
    ) -> Truth:
        """Simulate cast `number` and return what really happened.

        Parameters
        ----------
        headings_rad : ndarray of shape (segments,), how the cable lies at the start, in place
            of a draw from the resets' scatter.
        """
        rig = self._in_cast(planned, number)
        run, path = rig.begin(planned, number, headings_rad=headings_rad)
        cable = run.drive(rig._held(path), moving_s=planned.end_s + 5 * self.arm.lag_s)
        steps = np.arange(len(path)) * self.truth.step_s
        tool = ToolMotion(steps, path[:, [0, 1, 3]])
        return Truth(cable, ToolMotion(cable.t_s, tool.at(cable.t_s)))

    def _in_cast(self, planned: PlannedCast, number: int) -> "VirtualRig":
        """Return the rig with its hidden effects as they are in one cast."""
        cable = self.cable
        for effect in self.hidden:
            cable = effect.dragged(cable, planned)
        hidden = tuple(effect.in_cast(planned, number) for effect in self.hidden)
        return replace(self, cable=cable, hidden=hidden)

    def begin(
        self, planned: PlannedCast, number: int, *, headings_rad: np.ndarray | None = None
    ) -> tuple[CableRun, np.ndarray]:
        """Lay the cable down for cast `number`; return it and the arm's path (steps, 5)."""
        chance = draw(self.noise, self.seed, number)
        if headings_rad is None:
            headings_rad = self._reset(planned, number)
        truth = self.truth.with_friction(chance.friction_factor)
        arm = replace(self.arm, gain_error=self.arm.gain_error + chance.tool_gain)
        steps = np.arange(round((planned.end_s + SLOWEST_S) / truth.step_s) + 1) * truth.step_s
        path = np.zeros((len(steps), len(TOOL_JOINTS)))
        path[:, [0, 1, 3]] = arm.follow(planned.tool, steps, delay_s=chance.tool_delay_s)
        run = self._lay_down(truth, headings_rad, self._held(path)[0])
        run.settle()
        return run, path

    def _reset(self, planned: PlannedCast, number: int) -> np.ndarray:
        """Return how a reset leaves the cable, turned to the ray on which the cast starts."""
        random = generator(self.seed, number, "start")
        return self.scatter.draw(self.truth.segments, random) + planned.tool.pose[0, 2]

    def _lay_down(self, truth: CableTruth, headings_rad: np.ndarray, held: np.ndarray) -> CableRun:
        spec = build_cable(self.cable, truth)
        for effect in self.hidden:
            if isinstance(effect, Built):
                effect.build(spec, self.cable, truth)
        model = compile_cable(spec)
        disturb = Disturbance(self.hidden, model) if self.hidden else undisturbed
        return CableRun(model, headings_rad, held, disturb)

    def _held(self, path: np.ndarray) -> np.ndarray:
        """Return where the cable is really held while the arm takes `path` (steps, 5)."""
        for effect in self.hidden:
            if isinstance(effect, Holding):
                path = effect.hold(path, self.truth.step_s)
        return path

    def log_tool(self, tool: ToolMotion, number: int) -> ToolMotion:
        """Return the tool's motion as the controller logs it, at 125 Hz."""
        t_s = np.arange(int(tool.t_s[-1] / LOG_S + 1e-9) + 1) * LOG_S
        noise = self.noise
        sizes = np.array([noise.tool_log_m, noise.tool_log_m, noise.tool_log_rad])
        random = generator(self.seed, number, "log")
        return ToolMotion(t_s, tool.at(t_s) + sizes * random.standard_normal((len(t_s), 3)))

    def _scene(self, truth: Truth, *, rest_only: bool) -> SceneMotion:
        t_s, cable, tool = truth.cable.t_s, truth.cable.nodes_m, truth.tool.pose
        still = [t_s[-1], t_s[-1] + AFTER_S]
        times = np.array(still) if rest_only else np.concatenate([[-BEFORE_S], t_s, still[1:]])
        rows = np.searchsorted(t_s, np.clip(times, t_s[0], t_s[-1]))
        joints = joint_path(ToolMotion(times, tool[rows]), self.gripper)
        radius, end_radius = self.cable.radius_m, self.truth.endpoint_radius_m
        return SceneMotion(times, cable[rows], joints, self.gripper, radius, end_radius)

    def _fingerprint(self) -> str:
        """Return a digest of everything that shapes a cast, so that no session mixes two rigs."""
        parts = (self.truth, self.arm, self.noise, self.scatter.digest(), self.seed, *self.hidden)
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    def _film_seed(self, number: int) -> int:
        return int(generator(self.seed, number, "film").integers(2**31))


def _write_truth(cable: Motion, t_s: np.ndarray, path: Path) -> None:
    end = ToolMotion(cable.t_s, cable.end_m).at(t_s)
    with atomic_file(path) as temporary:
        pl.DataFrame({"t": t_s, "x": end[:, 0], "y": end[:, 1]}).write_csv(
            temporary, float_precision=7
        )
