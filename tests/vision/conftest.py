"""A small lab: a camera over a board with markers, and casts made up to be filmed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from robotcast import sessions
from robotcast.casts.action import Action, ToolMotion
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.kinematics import joint_path, link_points
from robotcast.rigs.virtual.picture import PictureSettings, SceneMotion, render_cast
from robotcast.vision.camera import BLOCK, Camera, TrackerFacts
from tests.rigs.small_rig import small_rig

RADIUS_M = 0.015
FPS = 60.0
ACTION = Action(0.5, 0.6, -0.5, 0.7, 0.0, 2.0)
CABLE = Cable("rope", 0.6, 0.01, 0.0045, 0.02)

STILL = ToolMotion(np.array([0.0, 0.4]), np.zeros((2, 3)))

Path2D = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Lab:
    """A camera, what it sees, and what its tracker is told."""

    camera: Camera
    picture: PictureSettings
    facts: TrackerFacts

    def session(self, folder: Path = Path("session")) -> sessions.Session:
        return sessions.Session(folder, "virtual", CABLE, 0.6, {BLOCK: self.facts.as_dict()})

    def scene(
        self,
        end: Path2D,
        *,
        until_s: float = 0.5,
        tool: tuple[float, float] = (0.6, 0.0),
        lift_m: float = 0.0,
    ) -> SceneMotion:
        """A straight cable from a resting tool to a free end that follows `end(t)` (n, 2)."""
        t_s = np.arange(-0.05, until_s, 1 / 960)
        ends = np.column_stack([end(t_s), np.full(len(t_s), RADIUS_M + lift_m)])
        held = np.array([*tool, 0.02])
        share = np.linspace(0, 1, 20)[None, :, None]
        cable = (1 - share) * held + share * ends[:, None, :]
        pose = np.tile([*tool, np.arctan2(tool[1], tool[0])], (len(t_s), 1))
        arm = link_points(joint_path(ToolMotion(t_s, pose)))
        return SceneMotion(t_s, cable, arm, CABLE.radius_m, RADIUS_M)

    def film(
        self, folder: Path, scene: SceneMotion, seed: int = 0, tool: ToolMotion = STILL
    ) -> Path:
        """Record one cast into `folder`, with what the tool is said to have done."""
        folder.mkdir(parents=True, exist_ok=True)
        render_cast(folder / sessions.VIDEO_FILE, scene, self.camera, self.picture, seed)
        sessions.write_tool(tool, folder / sessions.TOOL_FILE)
        start, end = float(scene.t_s[0]), float(tool.t_s[-1])
        record = sessions.CastRecord(
            seed, ACTION, "virtual", "rope", start, FPS, end / 2, end, end, False
        )
        sessions.write_record(record, folder)
        return folder

    def cast(self, folder: Path, number: int) -> Path:
        """Film a cast in which the free end trails the tool on a taut cable until both rest."""
        tool = plan_action(ACTION, r0_m=0.6, limits=PlanLimits()).tool

        def trailing(t_s: np.ndarray) -> np.ndarray:
            behind, held = tool.at(t_s - 0.1)[:, :2], tool.at(t_s)[:, :2]
            return held + 0.6 * behind / np.linalg.norm(behind, axis=1, keepdims=True)

        scene = self.scene(trailing, until_s=tool.t_s[-1] + 0.3, tool=(0.3, 0.0))
        sessions.write_record(sessions.CastRequest(number, number, ACTION), folder)
        return self.film(folder, scene, number, tool)


def make_lab(width: int) -> Lab:
    """A lab whose true camera is tilted, off-centre, distorted and not quite of nominal focus."""
    rig = small_rig(width, width * 9 // 16)
    return Lab(rig.camera, rig.picture, replace(rig.tracker, endpoint_height_m=RADIUS_M))


@pytest.fixture(scope="session")
def lab() -> Lab:
    return make_lab(960)


@pytest.fixture(scope="session")
def full_hd_lab() -> Lab:
    return make_lab(1920)
