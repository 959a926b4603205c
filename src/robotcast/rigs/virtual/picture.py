"""What an overhead webcam sees of a virtual cast, as a video file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotcast.vision.camera import Camera
from robotcast.vision.fiducials import FiducialBoard


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
    cable_radius_m, endpoint_radius_m : radii of the cable and of the ball at its free end.
    """

    t_s: np.ndarray
    cable_m: np.ndarray
    joints_rad: np.ndarray
    cable_radius_m: float
    endpoint_radius_m: float


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
    fps: float = 60.0
    exposure_s: float = 0.004
    noise_grey: float = 2.5
    vignetting: float = 0.12
    board_bgr: tuple[float, float, float] = (150.0, 85.0, 35.0)
    endpoint_bgr: tuple[float, float, float] = (150.0, 30.0, 240.0)
    cable_bgr: tuple[float, float, float] = (205.0, 210.0, 215.0)


def frame_starts(motion: SceneMotion, settings: PictureSettings) -> np.ndarray:
    """Return when each frame's exposure begins, (k,) [s]; the first is `video_t0_s`."""
    span = motion.t_s[-1] - motion.t_s[0] - settings.exposure_s
    return motion.t_s[0] + np.arange(int(span * settings.fps + 1e-9) + 1) / settings.fps


def render_cast(
    path: Path, motion: SceneMotion, camera: Camera, settings: PictureSettings, seed: int
) -> None:
    """Film `motion` with `camera` into the video file `path`; the same seed gives the same file."""
    raise NotImplementedError
