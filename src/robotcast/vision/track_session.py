"""All casts of a session, tracked side by side into a measurement set."""

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.sessions import TOOL_FILE, CastRequest, Session, read_tool
from robotcast.vision.facts import TrackerFacts
from robotcast.vision.tracker import TrackedCast, track_cast


@dataclass(frozen=True)
class TrackedSession:
    """What the videos of a session show.

    Attributes
    ----------
    tracked : the casts that were tracked, by their number.
    lost : why a cast could not be tracked, by its number.
    """

    session: Session
    tracked: dict[int, TrackedCast]
    lost: dict[int, str]

    @property
    def noise_m(self) -> float | None:
        """Standard deviation of one tracked coordinate, the median of the casts'."""
        noises = [c.noise_m for c in self.tracked.values() if np.isfinite(c.noise_m)]
        return float(np.median(noises)) if noises else None

    def measurement_set(self) -> MeasurementSet:
        """Return the tracked casts as a measurement set."""
        session = self.session
        if not self.tracked:
            first = next(iter(self.lost.values()), "it holds no casts")
            raise ValueError(f"{session.folder}: no cast could be tracked ({first})")
        trials = tuple(
            Trial(
                cast.number,
                cast.action_id,
                cast.action,
                read_tool(session.cast_folder(cast) / TOOL_FILE),
                self.tracked[cast.number].t_s,
                self.tracked[cast.number].xy_m,
            )
            for cast in session.casts
            if cast.number in self.tracked
        )
        period_s = TrackerFacts.of(session).period_s
        return MeasurementSet(
            session.cable, session.r0_m, period_s, self.noise_m, trials, session.rig
        )

    def summary(self) -> dict[str, Any]:
        """Return what a person wants to know about the tracking, as plain numbers."""
        casts = list(self.tracked.values())
        errors_px = [c.reprojection_px for c in casts]
        return {
            "casts": len(self.session.casts),
            "tracked": len(casts),
            "lost": [{"trial": n, "reason": reason} for n, reason in self.lost.items()],
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
    session: Session, *, workers: int = 1, progress: Progress = silent
) -> TrackedSession:
    """Track every cast of a session; a cast that cannot be tracked is lost, the others go on.

    Parameters
    ----------
    workers : how many casts are tracked side by side, each in a process of its own.
    """
    tracked: dict[int, TrackedCast] = {}
    lost: dict[int, str] = {}
    total = len(session.casts)
    progress(0, total)
    with closing(_outcomes(session, min(workers, total))) as outcomes:
        for cast, outcome in zip(session.casts, outcomes, strict=True):
            if isinstance(outcome, str):
                lost[cast.number] = outcome
            else:
                tracked[cast.number] = outcome
            progress(len(tracked) + len(lost), total, f"{len(lost)} lost" if lost else "")
    return TrackedSession(session, tracked, lost)


def _outcomes(session: Session, workers: int) -> Generator[TrackedCast | str, None, None]:
    """Yield, in the order of the casts, what was tracked or why it was not."""
    if workers <= 1:
        yield from (_attempt(session, cast) for cast in session.casts)
        return
    with process_pool(workers, partial(cv2.setNumThreads, 1)) as pool:
        yield from pool.map(_attempt, [session] * len(session.casts), session.casts)


def _attempt(session: Session, cast: CastRequest) -> TrackedCast | str:
    try:
        return track_cast(session.cast_folder(cast), session)
    except ValueError as error:
        return str(error)
