"""The free end's waypoints from videos alone (paper, "Self-Supervised Physical Data").

Last, all casts of a session, tracked side by side into a measurement set.
"""

import itertools
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robotcast import sessions
from robotcast.casts.action import ToolMotion
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.reader import judged
from robotcast.processes import process_pool
from robotcast.running import Progress, silent
from robotcast.sessions import CastRequest, Session
from robotcast.vision.calibration import LIMITS, Calibration, calibrate
from robotcast.vision.camera import Stillness, TrackerFacts, TrackingLimits
from robotcast.vision.detector import Detection, EndpointDetector

_CALIBRATION_FRAMES = 5
_WHOLE = (0.92, 1.12)
_BRIGHTNESS = (0.8, 1.2)
_RELATIVE_TO_PERCENTILE = 75.0
_WATCHED = 3  # of so many frames, one is looked at for a camera that moves
_OTHER_RATE = 0.05  # that the film's may differ by from the one that was recorded
_LATE = 1.5  # periods between the last waypoint and the rest


@dataclass(frozen=True)
class TrackedCast:
    """What a video shows of the free end."""

    t_s: np.ndarray  # (k,), of the waypoints that were seen
    xy_m: np.ndarray  # (k, 2)
    tool: ToolMotion  # what the arm did, from its log
    gaps: int  # how many waypoints are missing
    frames: int
    hidden: int  # in how many of them the endpoint was hidden
    reprojection_px: float  # how well the fitted camera explains the markers
    noise_m: float  # standard deviation of one coordinate; NaN when too few frames were seen
    unrested: str  # why the last waypoint is no endpoint: not seen at rest; empty where it is one


@dataclass(frozen=True)
class _Track:
    """The endpoint in every frame: mid-exposure times (k,), places (k, 2), NaN where hidden."""

    t_s: np.ndarray
    xy_m: np.ndarray
    calibration: Calibration
    record: sessions.CastRecord
    moved: str  # that the camera was moved, after which nothing is seen; empty where it was not


def track_cast(folder: Path, session: Session, limits: TrackingLimits = LIMITS) -> TrackedCast:
    """Track the free end through `folder`/video.mp4; read what the tool did.

    Raises ValueError when the video shows no fiducials or not where the session says, no
    endpoint, or not where it came to rest.
    """
    facts, video = TrackerFacts.of(session), folder / sessions.VIDEO_FILE
    track = _track(folder, facts, limits)
    seen, last_s = np.isfinite(track.xy_m[:, 0]), track.t_s[-1]
    unrested, rest_s = track.moved, track.record.rest_s
    late_s = _LATE * facts.period_s
    rested = f"and the cable came to rest at {rest_s:.2f} s"
    if not unrested and rest_s - last_s > late_s:
        unrested = f"{video}: its last frame is of t = {last_s:.2f} s, {rested}"
    if not unrested:
        _require_rest(seen, folder)
    wanted = np.arange(int(last_s / facts.period_s + 1e-9) + 1) * facts.period_s
    waypoints = waypoints_at(wanted, track.t_s, track.xy_m)
    kept = np.isfinite(waypoints[:, 0])
    if not kept.any():
        raise ValueError(f"{video}: the endpoint is seen at no waypoint")
    last_s = wanted[kept][-1]
    if not unrested and rest_s - last_s > late_s:
        unrested = f"{video}: the endpoint is seen last at t = {last_s:.2f} s, {rested}"
    return TrackedCast(
        wanted[kept],
        waypoints[kept],
        sessions.read_tool(folder / sessions.TOOL_FILE),
        int(np.sum(~kept)),
        len(seen),
        int(np.sum(~seen)),
        track.calibration.reprojection_px,
        float(np.hypot(frame_noise(track.xy_m), track.calibration.uncertainty_m)),
        unrested,
    )


def track_rest(folder: Path, session: Session) -> np.ndarray:
    """Return where the free end lies in a video taken after it came to rest, (2,) [m]."""
    track = _track(folder, TrackerFacts.of(session), LIMITS)
    if track.moved:
        raise ValueError(track.moved)
    _require_rest(np.isfinite(track.xy_m[:, 0]), folder)
    return np.nanmedian(track.xy_m, axis=0)


def waypoints_at(wanted_s: np.ndarray, t_s: np.ndarray, xy_m: np.ndarray) -> np.ndarray:
    """Interpolate frames `xy_m` (k, 2) at `wanted_s` (n,); NaN unless both neighbours were seen.

    A cubic through four frames where all are seen (a whip's end turns fast), a line through the
    two neighbours otherwise.
    """
    before = np.clip(np.searchsorted(t_s, wanted_s, side="right") - 1, 0, len(t_s) - 2)
    s = ((wanted_s - t_s[before]) / (t_s[before + 1] - t_s[before]))[:, None]
    padded = np.pad(xy_m, ((1, 1), (0, 0)), constant_values=np.nan)
    p0, p1, p2, p3 = (padded[before + i] for i in range(4))
    line = (1 - s) * p1 + s * p2
    inside = (s >= -1e-9) & (s <= 1 + 1e-9)
    bent = (  # Lagrange's, through evenly spaced points at −1, 0, 1, 2
        -s * (s - 1) * (s - 2) / 6 * p0
        + (s + 1) * (s - 1) * (s - 2) / 2 * p1
        - (s + 1) * s * (s - 2) / 2 * p2
        + (s + 1) * s * (s - 1) / 6 * p3
    )
    return np.where(inside, np.where(np.isfinite(bent), bent, line), np.nan)


def frame_noise(xy_m: np.ndarray) -> float:
    """Return the standard deviation of a coordinate of `xy_m` (k, 2) about its neighbours' cubic.

    Each frame is compared with the cubic through the two frames on either side; the median is
    not moved by the few frames where the motion itself is rougher than a cubic.
    """
    around = (4 * (xy_m[1:-3] + xy_m[3:-1]) - xy_m[:-4] - xy_m[4:]) / 6
    misses = np.abs(xy_m[2:-2] - around)
    misses = misses[np.isfinite(misses)]
    return float(np.median(misses) / 0.6745 / np.sqrt(1 + 34 / 36)) if len(misses) else float("nan")


def _track(folder: Path, facts: TrackerFacts, limits: TrackingLimits) -> _Track:
    video = folder / sessions.VIDEO_FILE
    frames = _frames(video)
    first = list(itertools.islice(frames, _CALIBRATION_FRAMES))
    if len(first) < _CALIBRATION_FRAMES:
        raise ValueError(f"{video}: only {len(first)} frames can be read")
    picture = np.rint(np.mean(first, axis=0)).astype(np.uint8)
    calibration = calibrate(picture, facts, str(video), limits)
    detector = EndpointDetector(calibration.camera, facts, picture)
    still = Stillness(picture, calibration.camera, facts.fiducials)
    found: list[Detection | None] = []
    good = None  # how many frames were filmed before the camera moved
    for number, frame in enumerate(itertools.chain(first, frames)):
        found.append(None if good is not None else detector.detect(frame))
        if good is None and number % _WATCHED == 0 and still.moved_px(frame) > limits.moved_px:
            good = max(number - _WATCHED + 1, 0)
    record = sessions.read_record(folder)
    rate = cv2.VideoCapture(str(video), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_FPS)
    if not (folder / sessions.FRAMES_FILE).is_file() and abs(rate / record.fps - 1) > _OTHER_RATE:
        raise ValueError(
            f"{video}: has {rate:g} frames a second, and cast.yaml says {record.fps:g}; "
            f"{sessions.FRAMES_FILE} may say when each was taken"
        )
    t_s = sessions.read_frame_times(record, facts.exposure_s, len(found), folder)
    xy_m, known = _whole_only(found, video), np.isfinite(t_s)
    moved = ""
    if good is not None:
        xy_m[good:] = np.nan
        moved = f"{video}: the camera was moved at t = {t_s[min(good, len(t_s) - 1)]:.2f} s"
    return _Track(t_s[known], xy_m[known], calibration, record, moved)


def _frames(video: Path) -> Iterator[np.ndarray]:
    if not video.is_file():
        raise ValueError(f"{video}: no such video")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is damaged is said here
    reader = cv2.VideoCapture(str(video), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    try:
        while True:
            read, frame = reader.read()
            if not read:
                return
            yield frame
    finally:
        reader.release()


def _whole_only(found: list[Detection | None], video: Path) -> np.ndarray:
    """Return places (k, 2), NaN where the blob is missing or is not the whole ball.

    The endpoint's true brightness is that of its brightest frames, within what its nominal
    colour allows: a ball partly behind the arm has less area, never more.
    """
    areas = np.array([np.nan if d is None else d.area for d in found])
    if not np.any(np.isfinite(areas)):
        raise ValueError(f"{video}: no endpoint found in any of {len(found)} frames")
    whole = np.clip(np.nanpercentile(areas, _RELATIVE_TO_PERCENTILE), *_BRIGHTNESS)
    seen = (areas > _WHOLE[0] * whole) & (areas < _WHOLE[1] * whole)
    if not np.any(seen):
        raise ValueError(f"{video}: the endpoint is partly hidden in every frame")
    xy_m = np.full((len(found), 2), np.nan)
    xy_m[seen] = [d.xy_m for d, s in zip(found, seen, strict=True) if s and d is not None]
    return xy_m


def _require_rest(seen: np.ndarray, folder: Path) -> None:
    if not np.any(seen[-_CALIBRATION_FRAMES:]):
        video = folder / sessions.VIDEO_FILE
        raise ValueError(f"{video}: the endpoint is out of sight where it came to rest")


@dataclass(frozen=True)
class TrackedSession:
    """What the videos of a session show."""

    session: Session
    tracked: dict[int, TrackedCast]  # by the cast's number
    lost: dict[int | str, str]  # why a cast was not tracked, by its number or its folder's name

    @property
    def noise_m(self) -> float | None:
        """Standard deviation of one tracked coordinate, the median of the casts'."""
        noises = [c.noise_m for c in self.tracked.values() if np.isfinite(c.noise_m)]
        return float(np.median(noises)) if noises else None

    @property
    def losses(self) -> list[str]:
        """What was lost and why, a line for each cast."""
        lost = [f"lost: {reason}" for reason in self.lost.values()]
        return lost + [f"no endpoint: {c.unrested}" for c in self.tracked.values() if c.unrested]

    def measurement_set(self, folder: Path) -> MeasurementSet:
        """Return the tracked casts as the measurement set that will be written to `folder`.

        They are judged by the rules of a measurement set; its notices say what these found.
        """
        session = self.session
        if not self.tracked:
            first = next(iter(self.lost.values()), "it holds no casts")
            raise ValueError(f"{session.folder}: no cast could be tracked ({first})")
        trials = tuple(
            Trial(c.number, c.action_id, c.action, t.tool, t.t_s, t.xy_m, rested=not t.unrested)
            for c in session.casts
            if (t := self.tracked.get(c.number)) is not None
        )
        about, period_s = (session.cable, session.r0_m), TrackerFacts.of(session).period_s
        measured = MeasurementSet(*about, period_s, self.noise_m, trials, session.rig)
        return judged(measured, folder)

    def summary(self) -> dict[str, Any]:
        """Return what a person wants to know about the tracking, as plain numbers."""
        casts = list(self.tracked.values())
        errors_px = [c.reprojection_px for c in casts]
        unrested = {n: c.unrested for n, c in self.tracked.items() if c.unrested}
        return {
            "casts": len(self.session.casts),
            "tracked": len(casts),
            "lost": [{"trial": n, "reason": reason} for n, reason in self.lost.items()],
            "unrested": [{"trial": n, "reason": reason} for n, reason in unrested.items()],
            "frames": sum(c.frames for c in casts),
            "hidden_frames": sum(c.hidden for c in casts),
            "waypoints": sum(len(c.t_s) for c in casts),
            "waypoint_gaps": sum(c.gaps for c in casts),
            "reprojection_px": {
                "median": round(float(np.median(errors_px)), 4) if casts else None,
                "worst": round(float(np.max(errors_px)), 4) if casts else None,
            },
            "noise_m": self.noise_m,
        }


def track_session(
    session: Session,
    limits: TrackingLimits = LIMITS,
    workers: int = 1,
    progress: Progress = silent,
) -> TrackedSession:
    """Track every cast of a session, `workers` side by side, each in a process of its own.

    A cast that cannot be tracked is lost, the others go on.
    """
    tracked: dict[int, TrackedCast] = {}
    lost: dict[int | str, str] = {**session.broken}
    total = len(session.casts)
    progress(0, total)
    attempt = partial(_attempt, session, limits)
    with process_pool(min(workers, total), partial(cv2.setNumThreads, 1)) as pool:
        outcomes = pool.map(attempt, session.casts)
        for done, (cast, outcome) in enumerate(zip(session.casts, outcomes, strict=True), 1):
            if isinstance(outcome, str):
                lost[cast.number] = outcome
            else:
                tracked[cast.number] = outcome
            progress(done, total, f"{len(lost)} lost" if lost else "")
    return TrackedSession(session, tracked, lost)


def _attempt(session: Session, limits: TrackingLimits, cast: CastRequest) -> TrackedCast | str:
    folder = session.cast_folder(cast)
    try:
        return track_cast(folder, session, limits)
    except ValueError as error:
        return str(error)
    except Exception as error:  # whatever goes wrong inside one cast loses that cast alone
        return f"{folder}: {type(error).__name__}: {str(error).strip().splitlines()[0]}"
