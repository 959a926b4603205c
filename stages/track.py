"""Track the free end through every video of a session: a measurement set."""

import json

from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.measurements import reader
from robotcast.processes import cores
from robotcast.sessions import read_session, recorded_copy, summed_robot_notes
from robotcast.stage import bar, named_session, output_folder, stage, tell, warn
from robotcast.vision.camera import TrackingLimits
from robotcast.vision.tracker import track_session


def track(config: DictConfig) -> None:
    sessions, folder = named_session(config), output_folder(config.paths.measurements)
    if copy := recorded_copy(sessions):
        measured, summary = reader.read_measurement_set(copy), {"recorded": True}
        tell(f"{sessions}: {len(measured.trials)} recorded casts passed on")
    else:
        session = read_session(sessions)
        with bar(f"track {config.cable.name}") as progress:
            found = track_session(session, TrackingLimits(**config.tracking), cores(0), progress)
        measured, summary = found.measurement_set(folder), found.summary()
        summary |= {"robot": robot} if (robot := summed_robot_notes(session)) else {}
        for line in found.losses:
            warn(line)
        tell(f"{len(found.tracked)} of {len(session.casts)} casts tracked, {len(found.lost)} lost")
    for notice in measured.notices:
        warn(notice)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "tracking.json").is_file():
        raise ValueError(f"{folder}: holds files that this stage did not write")
    with reader.replaced(folder) as draft:
        reader.write_measurement_set(measured, draft)
        write_text(draft / "tracking.json", json.dumps(summary, indent=2) + "\n")


if __name__ == "__main__":
    stage(track)()
