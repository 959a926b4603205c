"""All casts of a session, tracked side by side into a measurement set."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.reader import judged
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.sessions import TOOL_FILE, CastRequest, Session, read_tool
from robotcast.vision.calibration import LIMITS
from robotcast.vision.facts import TrackerFacts, TrackingLimits
from robotcast.vision.tracker import TrackedCast, track_cast

Outcome = tuple[TrackedCast, ToolMotion] | str


@dataclass(frozen=True)
class TrackedSession:
    """What the videos of a session show.

    Attributes
    ----------
    tracked : the casts that were tracked, by their number.
    tools : their tool logs.
    lost : why a cast could not be tracked, by its number, or its folder's name.
    """

    session: Session
    tracked: dict[int, TrackedCast]
    tools: dict[int, ToolMotion]
    lost: dict[int | str, str]

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
            Trial(
                cast.number,
                cast.action_id,
                cast.action,
                self.tools[cast.number],
                self.tracked[cast.number].t_s,
                self.tracked[cast.number].xy_m,
                rested=not self.tracked[cast.number].unrested,
            )
            for cast in session.casts
            if cast.number in self.tracked
        )
        period_s = TrackerFacts.of(session).period_s
        return judged(
            MeasurementSet(
                session.cable, session.r0_m, period_s, self.noise_m, trials, session.rig
            ),
            folder,
        )

    def summary(self) -> dict[str, Any]:
        """Return what a person wants to know about the tracking, as plain numbers."""
        casts = list(self.tracked.values())
        errors_px = [c.reprojection_px for c in casts]
        return {
            "casts": len(self.session.casts),
            "tracked": len(casts),
            "lost": [{"trial": n, "reason": reason} for n, reason in self.lost.items()],
            "unrested": [
                {"trial": n, "reason": c.unrested} for n, c in self.tracked.items() if c.unrested
            ],
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
    """Track every cast of a session; a cast that cannot be tracked is lost, the others go on.

    Parameters
    ----------
    workers : how many casts are tracked side by side, each in a process of its own.
    """
    tracked: dict[int, TrackedCast] = {}
    tools: dict[int, ToolMotion] = {}
    lost: dict[int | str, str] = {**session.broken}
    total = len(session.casts)
    progress(0, total)
    attempt = partial(_attempt, session, limits)
    with closing(_outcomes(attempt, session.casts, min(workers, total))) as outcomes:
        for done, (cast, outcome) in enumerate(zip(session.casts, outcomes, strict=True), 1):
            if isinstance(outcome, str):
                lost[cast.number] = outcome
            else:
                tracked[cast.number], tools[cast.number] = outcome
            progress(done, total, f"{len(lost)} lost" if lost else "")
    return TrackedSession(session, tracked, tools, lost)


def _outcomes(
    attempt: Callable[[CastRequest], Outcome], casts: Sequence[CastRequest], workers: int
) -> Generator[Outcome, None, None]:
    """Yield, in the order of the casts, what was tracked or why it was not."""
    if workers <= 1:
        yield from map(attempt, casts)
        return
    with process_pool(workers, partial(cv2.setNumThreads, 1)) as pool:
        yield from pool.map(attempt, casts)


def _attempt(session: Session, limits: TrackingLimits, cast: CastRequest) -> Outcome:
    folder = session.cast_folder(cast)
    try:
        return track_cast(folder, session, limits), read_tool(folder / TOOL_FILE)
    except ValueError as error:
        return str(error)
    except Exception as error:  # whatever goes wrong inside one cast loses that cast alone
        return f"{folder}: {type(error).__name__}: {str(error).strip().splitlines()[0]}"
