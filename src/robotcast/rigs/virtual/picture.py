"""What an overhead webcam sees of a virtual cast, as a video file."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from robotcast.files import atomic_file
from robotcast.rigs.ur5 import Gripper, link_points
from robotcast.rigs.virtual.backdrop import backdrop
from robotcast.rigs.virtual.shot import Shot
from robotcast.vision.camera import Camera
from robotcast.vision.fiducials import FiducialBoard

CODEC = "mp4v"
_BLUR_STEP_PX = 2.5
_MOST_INSTANTS = 12
_STILL_PX = 0.2
_NOISE_SLACK_PX = 64
_NOISE_GREY = 12  # added to the noise and taken off the scene, so that both are unsigned


@dataclass(frozen=True)
class SceneMotion:
    """Everything that moves before the camera.

    Attributes
    ----------
    t_s : ndarray of shape (n,), increasing; the video begins at t_s[0] and ends by t_s[-1].
        Let it begin two frames or more before t = 0, so that a waypoint at t = 0 has frames on
        both sides; 240 Hz or denser, for motion blur.
    cable_m : ndarray of shape (n, m, 3), nodes from the held end to the free end's centre.
    joints_rad : ndarray of shape (n, 6), the arm's joint angles.
    gripper : what the arm holds the cable with.
    cable_radius_m, endpoint_radius_m : radii of the cable and of the ball at its free end.
    """

    t_s: np.ndarray
    cable_m: np.ndarray
    joints_rad: np.ndarray
    gripper: Gripper
    cable_radius_m: float
    endpoint_radius_m: float

    def __post_init__(self) -> None:
        n = len(self.t_s)
        if n < 2 or np.any(np.diff(self.t_s) <= 0):
            raise ValueError("scene: times must be two or more and increase")
        if self.cable_m.shape[0] != n or self.cable_m.shape[2:] != (3,):
            raise ValueError(f"scene: cable must be ({n}, nodes, 3), got {self.cable_m.shape}")
        if self.joints_rad.shape != (n, 6):
            raise ValueError(f"scene: joints must be ({n}, 6), got {self.joints_rad.shape}")


@dataclass(frozen=True)
class PictureSettings:
    """The camera's shutter and sensor, and the colours of what it looks at.

    Attributes
    ----------
    fps, exposure_s : frame k is exposed from t_s[0] + k / fps on, for `exposure_s`.
    noise_grey : standard deviation of the sensor noise [grey levels of 255].
    vignetting : how much darker the image's corners are, 0–1.
    """

    fiducials: FiducialBoard
    board_length_m: float
    board_width_m: float
    fps: float
    exposure_s: float
    noise_grey: float
    vignetting: float
    board_bgr: tuple[float, float, float]
    endpoint_bgr: tuple[float, float, float]
    cable_bgr: tuple[float, float, float]


def frame_starts(motion: SceneMotion, settings: PictureSettings) -> np.ndarray:
    """Return when each frame's exposure begins, (k,) [s]; the first is `video_t0_s`."""
    span = motion.t_s[-1] - motion.t_s[0] - settings.exposure_s
    return motion.t_s[0] + np.arange(int(span * settings.fps + 1e-9) + 1) / settings.fps


def render_cast(
    path: Path, motion: SceneMotion, camera: Camera, settings: PictureSettings, seed: int
) -> None:
    """Film `motion` with `camera` into the video file `path`; the same seed gives the same file."""
    cv2.setNumThreads(1)
    with atomic_file(path) as temporary:
        fourcc = cv2.VideoWriter.fourcc(*CODEC)
        size = (camera.width, camera.height)
        writer = cv2.VideoWriter(str(temporary), cv2.CAP_FFMPEG, fourcc, settings.fps, size)
        if not writer.isOpened():
            raise OSError(f"{path}: OpenCV cannot write {CODEC} video of {size} px")
        try:
            for frame in frames(motion, camera, settings, seed):
                writer.write(frame)
        finally:
            writer.release()


def frames(
    motion: SceneMotion, camera: Camera, settings: PictureSettings, seed: int
) -> Iterator[np.ndarray]:
    """Yield the frames of a cast, uint8 (height, width, 3); each is overwritten by the next."""
    board_m = (settings.board_length_m, settings.board_width_m)
    scene = backdrop(camera, settings.fiducials, settings.board_bgr, board_m)
    light = _vignette(camera, settings.vignetting)
    scene = cv2.multiply(scene, cv2.merge([light] * 3), dtype=cv2.CV_8U)
    offset = np.full_like(scene, _NOISE_GREY)
    darker = cv2.subtract(scene, offset)
    bank = _noise_bank(camera.width, camera.height, settings.noise_grey)
    rng = np.random.default_rng(seed)
    picture, canvas = np.empty_like(scene), np.empty_like(scene)
    total = np.empty(scene.shape, np.float32)
    for shot in _shots(motion, camera, settings, light):
        row, column = rng.integers(0, _NOISE_SLACK_PX, 2)
        noise = bank[row : row + camera.height, column : column + camera.width]
        cv2.add(darker, noise, picture)
        box = shot.box
        moving = _expose(shot, scene[box], canvas[box], total[box])
        picture[box] = cv2.add(cv2.subtract(moving, offset[box]), noise[box])
        yield picture


def _shots(
    motion: SceneMotion, camera: Camera, settings: PictureSettings, light: np.ndarray
) -> Iterator[Shot]:
    """Yield what moves during each frame: at more instants the faster its image moves."""
    arm_m = link_points(motion.joints_rad, motion.gripper)
    begins = frame_starts(motion, settings)
    ends = begins + settings.exposure_s
    cable_travel, arm_travel = (
        np.linalg.norm(
            camera.project(_at(ends, motion.t_s, points))
            - camera.project(_at(begins, motion.t_s, points)),
            axis=-1,
        ).max(axis=-1)
        for points in (motion.cable_m, arm_m)
    )
    fastest = np.maximum(cable_travel, arm_travel)
    counts = np.clip(np.ceil(fastest / _BLUR_STEP_PX), 1, _MOST_INSTANTS).astype(int)
    for begin, count, travel in zip(begins, counts, arm_travel, strict=True):
        times = begin + (np.arange(count) + 0.5) / count * settings.exposure_s
        yield Shot.of(
            _at(times, motion.t_s, motion.cable_m),
            _at(times, motion.t_s, arm_m),
            (motion.cable_radius_m, motion.endpoint_radius_m),
            (settings.cable_bgr, settings.endpoint_bgr),
            camera,
            light,
            arm_moves=bool(travel > _STILL_PX),
        )


def _expose(shot: Shot, scene: np.ndarray, canvas: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the mean over the shot's instants, uint8; `canvas` and `total` are overwritten."""
    total[:] = 0
    for instant in range(len(shot.cable_px)):
        np.copyto(canvas, scene)
        shot.draw_cable(canvas, instant)
        shot.draw_ball(canvas, instant)
        if shot.arm_moves:
            shot.draw_arm(canvas, instant)
        cv2.accumulate(canvas, total)
    mean = cv2.convertScaleAbs(total, alpha=1.0 / len(shot.cable_px))
    if not shot.arm_moves:
        shot.draw_arm(mean, 0)
    return mean


def _at(times: np.ndarray, t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate `values` (n, …) linearly, held constant beyond the ends."""
    after = np.clip(np.searchsorted(t_s, times), 1, len(t_s) - 1)
    share = np.clip((times - t_s[after - 1]) / (t_s[after] - t_s[after - 1]), 0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return (1 - share) * values[after - 1] + share * values[after]


@lru_cache(maxsize=4)
def _vignette(camera: Camera, depth: float) -> np.ndarray:
    """Return the share of light that reaches each pixel, float32 (height, width)."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float32)
    centre = camera.centre_px
    far = np.hypot(camera.width, camera.height) / 2
    share = 1 - depth * ((u - centre[0]) ** 2 + (v - centre[1]) ** 2) / far**2
    return share.astype(np.float32)


@lru_cache(maxsize=4)
def _noise_bank(width: int, height: int, deviation: float) -> np.ndarray:
    """Return sensor noise about `_NOISE_GREY`, larger than a frame: each frame crops its own."""
    shape = (height + _NOISE_SLACK_PX, width + _NOISE_SLACK_PX, 3)
    drawn = np.random.default_rng(0).standard_normal(shape, dtype=np.float32)
    return np.clip(np.rint(_NOISE_GREY + deviation * drawn), 0, 2 * _NOISE_GREY).astype(np.uint8)
