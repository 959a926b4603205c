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
from robotcast.vision.camera import Camera

CODEC = "mp4v"
FIRST_FRAME_S = 10.0
OPENING_MS = 10_000
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

    @property
    def device(self) -> bool:
        return self.source.isdigit() or self.source.startswith("/dev/")


class Webcam:
    """An open camera whose frames arrive in a thread of their own.

    So none waits in a queue: the time at which a frame leaves the driver is its capture time,
    late by what `camera_offset` measures. `unfixed` lists what the driver did not let be fixed.
    """

    def __init__(self, settings: WebcamSettings) -> None:
        self.settings = settings
        self.unfixed: list[str] = []
        self._capture = _opened(settings)
        if settings.device:
            self._fix()
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
            raise RigStopped(
                f"the camera {self.settings.source} gave no frame for {silent_s:.1f} s"
            )

    def start_recording(self, path: Path) -> None:
        """Write every frame from now on into the video file `path`."""
        size = (self.settings.width, self.settings.height)
        fourcc = cv2.VideoWriter.fourcc(*CODEC)
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, self.settings.fps, size)
        if not writer.isOpened():
            raise OSError(f"{path}: OpenCV cannot write {CODEC} video of {size} px")
        with self._lock:
            self._times, self._writer = [], writer

    def stop_recording(self) -> np.ndarray:
        """Close the file; return the capture times of its frames by the monotonic clock, (k,)."""
        with self._lock:
            writer, self._writer = self._writer, None
            times = np.array(self._times)
        if writer is not None:
            writer.release()
        return times

    def close(self) -> None:
        self._running = False
        self._thread.join()
        self.stop_recording()

    def _take_frames(self) -> None:
        # The thread lets go of the camera itself: nobody may while it waits for a frame.
        is_file = not self.settings.device and "://" not in self.settings.source
        played, begun_s = 0, time.monotonic()
        try:
            while self._running:
                if is_file:
                    due_s = begun_s + played / self.settings.fps
                    time.sleep(max(0.0, due_s - time.monotonic()))
                if not self._capture.grab():
                    return
                now_s = time.monotonic()
                read, frame = self._capture.retrieve()
                if not read:
                    continue
                played += 1
                with self._lock:
                    self._latest, self._seen_s = frame, now_s
                    if self._writer is not None:
                        self._writer.write(frame)
                        self._times.append(now_s)
        finally:
            self._capture.release()

    def _fix(self) -> None:
        asked = [
            ("exposure", cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL_EXPOSURE),
            ("focus", cv2.CAP_PROP_AUTOFOCUS, 0.0),
            ("exposure", cv2.CAP_PROP_EXPOSURE, self.settings.exposure),
            ("focus", cv2.CAP_PROP_FOCUS, self.settings.focus),
        ]
        wanted = [(name, key, value) for name, key, value in asked if value is not None]
        refused = {name for name, key, value in wanted if not self._capture.set(key, value)}
        self.unfixed = sorted(refused)

    def _require_size(self) -> None:
        until = time.monotonic() + FIRST_FRAME_S
        while self._latest is None and self._thread.is_alive() and time.monotonic() < until:
            time.sleep(0.01)
        if self._latest is None:
            self.close()
            raise ValueError(f"rig.camera={self.settings.source}: opens, but gives no frame")
        height, width = self._latest.shape[:2]
        if (width, height) != (self.settings.width, self.settings.height):
            self.close()
            raise ValueError(
                f"rig.camera={self.settings.source}: asked for {self.settings.width} × "
                f"{self.settings.height} px, gives {width} × {height}; "
                "ask for a size that it has (rig.width, rig.height)"
            )


def require_rate(times_s: np.ndarray, settings: WebcamSettings) -> float:
    """Return the rate of frames at `times_s` (k,); refuse another than the asked one."""
    span_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
    rate = (len(times_s) - 1) / span_s if span_s > 0 else 0.0
    if not abs(rate - settings.fps) <= RATE_TOLERANCE * settings.fps:
        raise ValueError(
            f"rig.camera={settings.source}: asked for {settings.fps:g} frames/s, gives {rate:.1f}; "
            "ask for a rate that it has at this size and light (rig.fps)"
        )
    return rate


def _opened(settings: WebcamSettings) -> cv2.VideoCapture:
    if not settings.source:
        raise ValueError("rig=ur5 needs a camera: rig.camera=0, /dev/video0, or a recorded file")
    if settings.device:
        number = settings.source.removeprefix("/dev/video")
        capture = cv2.VideoCapture(int(number), cv2.CAP_V4L2)
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        capture.set(cv2.CAP_PROP_FPS, settings.fps)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    else:
        options = {
            cv2.CAP_PROP_N_THREADS: 1,  # more would decode several frames late
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC: OPENING_MS,
            cv2.CAP_PROP_READ_TIMEOUT_MSEC: round(2e3 * settings.gone_s),
        }
        pairs = [number for pair in options.items() for number in pair]
        capture = cv2.VideoCapture(settings.source, cv2.CAP_FFMPEG, pairs)
    if not capture.isOpened():
        raise ValueError(
            f"rig.camera={settings.source}: no camera or video opens there; plug the camera in "
            "(ls /dev/video*) or name another one"
        )
    return capture


def arm_pixels(camera: Camera, held_m: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what picks the grey pixels (m,) that the arm may cover, few, out of a picture.

    The cable lies beyond `held_m`, at which distance from the base the arm holds it: it follows
    the arm late, and would be taken for a late camera.
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
    component of the frames follows the angle. The offset is where it fits the angle best.

    Parameters
    ----------
    pictures : ndarray of shape (k, m), each frame's `arm_pixels`.
    seen_s : ndarray of shape (k,), when each was captured, in the controller's time.
    t_s, angle_rad : ndarrays of shape (n,), the arm's actual motion.
    """
    inside = (seen_s - WIDEST_OFFSET_S >= t_s[0]) & (seen_s <= t_s[-1])
    if inside.sum() < FEWEST_FRAMES:
        raise ValueError(
            f"camera: only {int(inside.sum())} frames during the arm's swaying, "
            f"at least {FEWEST_FRAMES} are needed"
        )
    values = pictures[inside].astype(float)
    _, _, directions = np.linalg.svd(values - values.mean(axis=0), full_matrices=False)
    signal = (values - values.mean(axis=0)) @ directions[0]
    tried_s = np.linspace(-WIDEST_OFFSET_S / 3, WIDEST_OFFSET_S, OFFSETS_TRIED)
    fits = np.array([_fit(signal, np.interp(seen_s[inside] - o, t_s, angle_rad)) for o in tried_s])
    best = int(np.argmax(fits))
    if fits[best] < LEAST_CORRELATION or not 0 < best < OFFSETS_TRIED - 1:
        raise ValueError(
            f"camera: the arm's swaying is not seen in the picture (correlation {fits[best]:.2f}); "
            "the arm must be in the camera's view, and its exposure short"
        )
    low, middle, high = fits[best - 1 : best + 2]
    shift = 0.5 * (low - high) / (low - 2 * middle + high) if low - 2 * middle + high else 0.0
    return float(tried_s[best] + shift * (tried_s[1] - tried_s[0]))


def _fit(signal: np.ndarray, angle: np.ndarray) -> float:
    """Return the multiple correlation of a signal with an angle and its square, 0–1."""
    shapes = np.column_stack([np.ones_like(angle), angle, angle**2])
    left = signal - shapes @ np.linalg.lstsq(shapes, signal, rcond=None)[0]
    whole = signal - signal.mean()
    return float(np.sqrt(max(0.0, 1 - left @ left / (whole @ whole))))
