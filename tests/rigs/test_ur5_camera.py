"""The UR5 rig's camera: what it refuses, and how late its frames are."""

import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from robotcast.rigs import RigStopped
from robotcast.rigs.ur5.arm import require_ur_rtde
from robotcast.rigs.ur5.camera import Webcam, WebcamSettings, camera_offset
from robotcast.rigs.ur5.motion import sway
from robotcast.sessions import video_writer
from tests.rigs.peer.lab import HOME_RAD

FPS = 30.0


def bar_pictures(angle_rad: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Noisy pictures, (k, m), of a soft bar that turns with the angle."""
    v, u = np.mgrid[:45, :80]
    pictures = []
    for angle in angle_rad:
        away = (u - 40) * np.sin(angle + 0.4) + (v - 22) * np.cos(angle + 0.4)
        picture = 200 * np.exp(-((away / 4) ** 2)) + random.normal(0, 4, v.shape)
        pictures.append(picture.ravel())
    return np.array(pictures)


@pytest.mark.parametrize("delay_s", [-0.03, 0.0, 0.04, 0.12])
def test_a_delay_is_found_from_the_swaying_arm(delay_s: float):
    random = np.random.default_rng(3)
    motion = sway(np.array(HOME_RAD), 0.008)
    angle = motion.joints_rad[:, 0]
    seen_s = np.arange(0.0, motion.t_s[-1], 1 / FPS)
    seen_s += random.normal(0, 0.001, len(seen_s))
    pictures = bar_pictures(np.interp(seen_s - delay_s, motion.t_s, angle), random)
    found = camera_offset(pictures, seen_s, motion.t_s, angle)
    assert found == pytest.approx(delay_s, abs=0.005)


def test_a_camera_that_does_not_see_the_arm_is_told_so():
    random = np.random.default_rng(1)
    motion = sway(np.array(HOME_RAD), 0.008)
    seen_s = np.arange(0.0, motion.t_s[-1], 1 / FPS)
    still = random.normal(100, 3, (len(seen_s), 45 * 80))
    with pytest.raises(ValueError, match="swaying is not seen"):
        camera_offset(still, seen_s, motion.t_s, motion.joints_rad[:, 0])
    with pytest.raises(ValueError, match="only 5 frames"):
        camera_offset(still[:14], seen_s[:14], motion.t_s, motion.joints_rad[:, 0])


@pytest.fixture
def film(tmp_path: Path) -> Path:
    path = tmp_path / "film.mp4"
    writer = video_writer(path, FPS, 160, 90)
    for grey in range(60):
        writer.write(np.full((90, 160, 3), grey, np.uint8))
    writer.release()
    return path


def test_a_recorded_file_stands_in_for_a_camera(film: Path, tmp_path: Path):
    camera = Webcam(WebcamSettings(str(film), 160, 90, FPS, gone_s=5.0))
    camera.start_recording(tmp_path / "copy.mp4")
    time.sleep(0.5)
    times_s = camera.stop_recording()
    assert camera.picture().shape == (90, 160, 3)
    camera.close()
    assert len(times_s) > 1 and (np.diff(times_s) > 0).all()
    reader = cv2.VideoCapture(str(tmp_path / "copy.mp4"))
    assert reader.get(cv2.CAP_PROP_FRAME_COUNT) == len(times_s)


def test_a_file_that_ended_is_a_camera_that_is_gone(film: Path):
    camera = Webcam(WebcamSettings(str(film), 160, 90, 2000.0, gone_s=0.1))
    time.sleep(0.8)
    with pytest.raises(RigStopped, match="gave no frame for"):
        camera.require_alive()
    camera.close()


def test_another_size_than_asked_is_refused(film: Path):
    with pytest.raises(ValueError, match=r"asked for 640 × 480 px, gives 160 × 90"):
        Webcam(WebcamSettings(str(film), 640, 480, FPS))


def test_another_rate_than_asked_is_refused(film: Path):
    camera = Webcam(WebcamSettings(str(film), 160, 90, 60.0))
    camera.close()
    assert camera.require_rate(np.arange(50) / 59.0) == pytest.approx(59.0)
    with pytest.raises(ValueError, match=r"asked for 60 frames/s, gives 30\.0"):
        camera.require_rate(np.arange(50) / 30.0)


@pytest.mark.parametrize("source", ["99", "/dev/video99", "/no/such/file.mp4"])
def test_without_a_camera_the_message_says_what_to_plug_in(source: str):
    with pytest.raises(ValueError, match="no camera or video opens there; plug the camera in"):
        Webcam(WebcamSettings(source, 640, 480, 30.0))


def test_without_ur_rtde_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "rtde_control", None)
    with pytest.raises(ValueError, match=r"pip install 'robotcast\[ur5\]'"):
        require_ur_rtde()
