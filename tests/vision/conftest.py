"""A small lab: a camera over a board with markers, and casts made up to be filmed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from robotcast.casts.action import Action, ToolMotion
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.kinematics import joint_path, link_points
from robotcast.rigs.virtual.picture import PictureSettings, SceneMotion, render_cast
from robotcast.sessions import (
    TOOL_FILE,
    VIDEO_FILE,
    CastRecord,
    CastRequest,
    Session,
    write_record,
    write_tool,
)
from robotcast.vision.camera import Camera
from robotcast.vision.facts import BLOCK, FiducialBoard, TrackerFacts

RADIUS_M = 0.015
FPS, EXPOSURE_S = 60.0, 0.004
BOARD_BGR, BALL_BGR = (150.0, 85.0, 35.0), (150.0, 30.0, 240.0)
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

    def session(self, folder: Path = Path("session")) -> Session:
        return Session(folder, "virtual", CABLE, 0.6, {BLOCK: self.facts.as_dict()})

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
        render_cast(folder / VIDEO_FILE, scene, self.camera, self.picture, seed)
        write_tool(tool, folder / TOOL_FILE)
        start, end = float(scene.t_s[0]), float(tool.t_s[-1])
        record = CastRecord(seed, ACTION, "virtual", "rope", start, FPS, end / 2, end, end, False)
        write_record(record, folder)
        return folder

    def cast(self, folder: Path, number: int) -> Path:
        """Film a cast in which the free end trails the tool on a taut cable until both rest."""
        tool = plan_action(ACTION, r0_m=0.6, limits=PlanLimits()).tool

        def trailing(t_s: np.ndarray) -> np.ndarray:
            behind, held = tool.at(t_s - 0.1)[:, :2], tool.at(t_s)[:, :2]
            return held + 0.6 * behind / np.linalg.norm(behind, axis=1, keepdims=True)

        scene = self.scene(trailing, until_s=tool.t_s[-1] + 0.3, tool=(0.3, 0.0))
        write_record(CastRequest(number, number, ACTION), folder)
        return self.film(folder, scene, number, tool)

    def without_markers(self) -> "Lab":
        bare = FiducialBoard(self.picture.fiducials.side_m, ())
        return replace(self, picture=replace(self.picture, fiducials=bare))


def make_lab(width: int) -> Lab:
    """A lab whose true camera is tilted, off-centre, distorted and not quite of nominal focus."""
    camera = Camera.overhead(
        width,
        width * 9 // 16,
        focal_widths=0.711,
        position_m=(0.81, 0.03, 2.2),
        tilt_rad=(0.025, -0.018, 0.012),
        centre_offset_widths=(0.002, -0.0015),
        distortion=(-0.06, 0.02, 0.0005, -0.0004, 0.0),
    )
    markers = FiducialBoard.along_edges(1.55, 2.45, side_m=0.08, margin_m=0.07, spacing_m=0.35)
    picture = PictureSettings(
        markers,
        1.55,
        2.45,
        fps=FPS,
        exposure_s=EXPOSURE_S,
        noise_grey=2.5,
        vignetting=0.12,
        board_bgr=BOARD_BGR,
        endpoint_bgr=BALL_BGR,
        cable_bgr=(205.0, 210.0, 215.0),
    )
    facts = TrackerFacts(0.1, EXPOSURE_S, 0.708, RADIUS_M, RADIUS_M, BALL_BGR, BOARD_BGR, markers)
    return Lab(camera, picture, facts)


@pytest.fixture(scope="session")
def lab() -> Lab:
    return make_lab(960)


@pytest.fixture(scope="session")
def full_hd_lab() -> Lab:
    return make_lab(1920)
