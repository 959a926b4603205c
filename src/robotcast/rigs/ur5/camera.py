"""The camera over the board: frames with their capture times, and how late they are.

A webcam, a stream or a recorded file through OpenCV.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robotcast.rigs import RigStopped
from robotcast.sessions import video_writer
from robotcast.vision.camera import Camera

FIRST_FRAME_S, OPENING_MS = 10.0, 10_000
RATE_TOLERANCE = 0.1
MANUAL_EXPOSURE = 1.0  # V4L2's menu: 1 manual, 3 automatic
WIDEST_OFFSET_S, OFFSETS_TRIED = 0.3, 601
FEWEST_FRAMES, LEAST_CORRELATION = 15, 0.9
ARM_PICTURE_WIDTH_PX, ARM_MARGIN_M = 320, 0.05


@dataclass(frozen=True)
class WebcamSettings:
    """What is asked of a camera."""

    source: str  # a number, /dev/videoN, or the path or address of a video
    width: int
    height: int
    fps: float
    exposure: float | None = None  # in the driver's own units; None: the driver's choice, fixed
    focus: float | None = None
    gone_s: float = 0.5  # without a new frame for so long, the camera is gone


class Webcam:
    """An open camera whose frames arrive in a thread of their own.

    So none waits in a queue: the time at which a frame leaves the driver is its capture time,
    late by what `camera_offset` measures. `unfixed` lists what the driver did not let be fixed.
    """

    def __init__(self, settings: WebcamSettings) -> None:
        self.settings = settings
        self._capture, self.unfixed = _opened(settings)
        self._lock = threading.Lock()
        self._latest: np.ndarray | None = None
        self._seen_s = time.monotonic()
        self._writer: cv2.VideoWriter | None = None
        self._times: list[float] = []
        self._running = True
        self._thread = threading.Thread(target=self._take_frames, daemon=True)
        self._thread.start()
        self._require_size()

    def picture(self) -> np.ndarray:
        self.require_alive()
        return self.newest()[0].copy()

    def newest(self) -> tuple[np.ndarray, float]:
        """Return the latest frame, not to be changed, and when it was captured."""
        with self._lock:
            assert self._latest is not None
            return self._latest, self._seen_s

    def require_alive(self) -> None:
        """Raise `RigStopped` when no frame came for too long."""
        silent_s = time.monotonic() - self._seen_s
        if silent_s > self.settings.gone_s:
            source = self.settings.source
            raise RigStopped(f"the camera {source} gave no frame for {silent_s:.1f} s")

    def require_rate(self, times_s: np.ndarray) -> float:
        """Return the rate of frames at `times_s` (k,); refuse another than the asked one."""
        asked = self.settings
        rate = float(1 / np.diff(times_s).mean()) if len(times_s) > 1 else 0.0
        if not abs(rate - asked.fps) <= RATE_TOLERANCE * asked.fps:
            raise ValueError(
                f"rig.camera={asked.source}: asked for {asked.fps:g} frames/s, gives {rate:.1f}; "
                "ask for a rate that it has at this size and light (rig.fps)"
            )
        return rate

    def start_recording(self, path: Path) -> None:
        """Write every frame from now on into the video file `path`."""
        asked = self.settings
        writer = video_writer(path, asked.fps, asked.width, asked.height)
        with self._lock:
            self._times, self._writer = [], writer

    def stop_recording(self) -> np.ndarray:
        """Close the file; return the capture times of its frames by the monotonic clock, (k,)."""
        with self._lock:
            if self._writer is not None:
                self._writer.release()
            self._writer = None
            return np.array(self._times)

    def close(self) -> None:
        self._running = False
        self._thread.join()
        self.stop_recording()

    def _take_frames(self) -> None:
        # The thread lets go of the camera itself: nobody may while it waits for a frame.
        source = self.settings.source
        is_file = not source.isdigit() and Path(source).is_file()
        due_s = time.monotonic()
        try:
            while self._running:
                if is_file:
                    time.sleep(max(0.0, due_s - time.monotonic()))
                if not self._capture.grab():
                    return
                now_s = time.monotonic()
                read, frame = self._capture.retrieve()
                if not read:
                    continue
                due_s += 1 / self.settings.fps
                with self._lock:
                    self._latest, self._seen_s = frame, now_s
                    if self._writer is not None:
                        self._writer.write(frame)
                        self._times.append(now_s)
        finally:
            self._capture.release()

    def _require_size(self) -> None:
        asked, until = self.settings, time.monotonic() + FIRST_FRAME_S
        while self._latest is None and self._thread.is_alive() and time.monotonic() < until:
            time.sleep(0.01)
        height, width = (0, 0) if self._latest is None else self._latest.shape[:2]
        if (width, height) == (asked.width, asked.height):
            return
        self.close()
        raise ValueError(
            f"rig.camera={asked.source}: asked for {asked.width} × {asked.height} px, gives "
            f"{width} × {height}; ask for a size that it has (rig.width, rig.height)"
            if width
            else f"rig.camera={asked.source}: opens, but gives no frame"
        )


def _opened(asked: WebcamSettings) -> tuple[cv2.VideoCapture, list[str]]:
    """Open the camera; return it and what its driver did not let be fixed."""
    if not asked.source:
        raise ValueError("rig=ur5 needs a camera: rig.camera=0, /dev/video0, or a recorded file")
    wanted: list[tuple[str, int, float | None]] = []
    if asked.source.isdigit() or asked.source.startswith("/dev/"):
        capture = cv2.VideoCapture(int(asked.source.removeprefix("/dev/video")), cv2.CAP_V4L2)
        wanted = [
            ("", cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG")),
            ("", cv2.CAP_PROP_FRAME_WIDTH, asked.width),
            ("", cv2.CAP_PROP_FRAME_HEIGHT, asked.height),
            ("", cv2.CAP_PROP_FPS, asked.fps),
            ("", cv2.CAP_PROP_BUFFERSIZE, 1),
            ("exposure", cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL_EXPOSURE),
            ("focus", cv2.CAP_PROP_AUTOFOCUS, 0.0),
            ("exposure", cv2.CAP_PROP_EXPOSURE, asked.exposure),
            ("focus", cv2.CAP_PROP_FOCUS, asked.focus),
        ]
    else:
        options = [cv2.CAP_PROP_N_THREADS, 1]  # more would decode several frames late
        options += [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPENING_MS]
        options += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, round(2e3 * asked.gone_s)]
        capture = cv2.VideoCapture(asked.source, cv2.CAP_FFMPEG, options)
    if not capture.isOpened():
        raise ValueError(
            f"rig.camera={asked.source}: no camera or video opens there; plug the camera in "
            "(ls /dev/video*) or name another one"
        )
    refused = {name for name, key, to in wanted if to is not None and not capture.set(key, to)}
    return capture, sorted(refused - {""})


def arm_pixels(camera: Camera, held_m: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what picks the few grey pixels (m,) that the arm may cover out of a picture.

    The cable, beyond `held_m` from the base, follows late and would be taken for a late camera.
    """
    scale = ARM_PICTURE_WIDTH_PX / camera.width
    size = ARM_PICTURE_WIDTH_PX, round(camera.height * scale)
    v, u = np.mgrid[: size[1], : size[0]]
    places = camera.to_plane((np.stack([u, v], axis=-1) + 0.5) / scale - 0.5)
    inside = np.linalg.norm(places, axis=-1) < held_m - ARM_MARGIN_M

    def pick(picture: np.ndarray) -> np.ndarray:
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        return cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)[inside]

    return pick


def camera_offset(
    pictures: np.ndarray, seen_s: np.ndarray, t_s: np.ndarray, angle_rad: np.ndarray
) -> float:
    """Return by how much frames are stamped late [s].

    Whatever moves with the arm moves the picture along one direction: the first principal
    component of the frames, `arm_pixels` (k, m) captured at `seen_s` (k,) of the controller's time,
    follows the arm's actual angle (n,) at `t_s` (n,). The offset is where it fits that best.
    """
    inside = (seen_s - WIDEST_OFFSET_S >= t_s[0]) & (seen_s <= t_s[-1])
    if inside.sum() < FEWEST_FRAMES:
        raise ValueError(
            f"camera: only {int(inside.sum())} frames during the arm's swaying, "
            f"at least {FEWEST_FRAMES} are needed"
        )
    values = pictures[inside] - pictures[inside].mean(axis=0)
    signal = values @ np.linalg.svd(values, full_matrices=False)[2][0]
    tried_s = np.linspace(-WIDEST_OFFSET_S / 3, WIDEST_OFFSET_S, OFFSETS_TRIED)
    fits = np.array([_fit(signal, np.interp(seen_s[inside] - o, t_s, angle_rad)) for o in tried_s])
    best = int(np.argmax(fits))
    if fits[best] < LEAST_CORRELATION or not 0 < best < OFFSETS_TRIED - 1:
        raise ValueError(
            f"camera: the arm's swaying is not seen in the picture (correlation {fits[best]:.2f}); "
            "the arm must be in the camera's view, and its exposure short"
        )
    curvature, slope, _ = np.polyfit([-1, 0, 1], fits[best - 1 : best + 2], 2)
    shift = -slope / (2 * curvature) if curvature else 0.0
    return float(tried_s[best] + shift * (tried_s[1] - tried_s[0]))


def _fit(signal: np.ndarray, angle: np.ndarray) -> float:
    """Return the multiple correlation of a signal of mean 0 with an angle and its square, 0–1."""
    shapes = np.vander(angle, 3)
    left = signal - shapes @ np.linalg.lstsq(shapes, signal, rcond=None)[0]
    return float(np.sqrt(max(0.0, 1 - left @ left / (signal @ signal))))
