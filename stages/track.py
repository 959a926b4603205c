"""Track the free end through every video of a session: a measurement set."""

import json
import os
import shutil
from pathlib import Path

from omegaconf import DictConfig
from stage import bar, console, named_session, output_folder, stage

from robotcast.files import write_text
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.writer import write_measurement_set
from robotcast.sessions import read_session, recorded_copy, summed_robot_notes
from robotcast.vision.track_session import TrackedSession, track_session

SUMMARY = "tracking.json"


def track(config: DictConfig) -> None:
    sessions = named_session(config)
    folder = output_folder(config.paths.measurements)
    copy = recorded_copy(sessions)
    if copy is not None:
        measured, summary = read_measurement_set(copy), {"recorded": True}
        console.print(f"{sessions}: {len(measured.trials)} recorded casts passed on")
    else:
        with bar(f"track {config.cable.name}") as progress:
            workers = len(os.sched_getaffinity(0))
            tracked = track_session(read_session(sessions), workers=workers, progress=progress)
        _report_lost(tracked)
        robot = summed_robot_notes(tracked.session)
        measured = tracked.measurement_set()
        summary = tracked.summary() | ({"robot": robot} if robot else {})
    _clear(folder)
    write_measurement_set(measured, folder)
    write_text(folder / SUMMARY, json.dumps(summary, indent=2) + "\n")


def _clear(folder: Path) -> None:
    """Remove what an earlier run of this stage wrote; refuse to remove anything else."""
    if folder.is_dir() and any(folder.iterdir()) and not (folder / SUMMARY).is_file():
        raise ValueError(f"{folder}: holds files that this stage did not write")
    shutil.rmtree(folder, ignore_errors=True)


def _report_lost(tracked: TrackedSession) -> None:
    for reason in tracked.lost.values():
        console.print(f"lost: {reason}", style="yellow", markup=False)
    total = len(tracked.session.casts)
    console.print(f"{len(tracked.tracked)} of {total} casts tracked, {len(tracked.lost)} lost")


if __name__ == "__main__":
    stage(track)()
