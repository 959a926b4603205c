"""robot.yaml of a cast: what the robot, the camera and their clocks did beside the cast itself."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from robotcast.files import write_text
from robotcast.sessions.session import Session

NOTES_FILE = "robot.yaml"


@dataclass(frozen=True)
class CastNotes:
    """What a person wants to know who doubts a cast.

    Attributes
    ----------
    cycles, missed_deadlines : of the controller during the cast, and those without a new target.
    camera_offset_s : by how much frames were stamped late; their times are corrected for it.
    kinematic_difference_m : between the controller's tool place and our kinematics.
    resets : how often the cable was reset until its end lay right.
    not_fixed : what the camera's driver did not let be fixed.
    """

    host: str
    controller_period_s: float
    cycles: int
    missed_deadlines: int
    camera_offset_s: float
    kinematic_difference_m: float
    speed: float
    resets: int
    not_fixed: list[str]


def write_notes(notes: CastNotes, folder: Path) -> None:
    """Write robot.yaml into a cast's folder."""
    write_text(folder / NOTES_FILE, yaml.safe_dump(asdict(notes), sort_keys=False))


def session_notes(session: Session) -> dict[str, Any]:
    """Return what the casts' notes say together, {} when the rig wrote none."""
    paths = [session.cast_folder(cast) / NOTES_FILE for cast in session.casts]
    notes = [CastNotes(**yaml.safe_load(p.read_text("utf-8"))) for p in paths if p.is_file()]
    if not notes:
        return {}
    return {
        "camera_offset_s": sorted({n.camera_offset_s for n in notes}),
        "kinematic_difference_m": max(n.kinematic_difference_m for n in notes),
        "missed_deadlines": sum(n.missed_deadlines for n in notes),
        "cycles": sum(n.cycles for n in notes),
        "casts_with_missed_deadlines": sum(n.missed_deadlines > 0 for n in notes),
    }
