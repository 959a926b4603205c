"""A measurement set that somebody recorded, in place of a rig."""

import filecmp
import shutil
from dataclasses import asdict
from pathlib import Path

import yaml

from robotcast.files import atomic_folder, write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set
from robotcast.sessions.session import SESSION_FILE, read_session

NAME = "recorded"
COPY = "measurements"


def adopt_recorded_set(path: Path | None, folder: Path) -> MeasurementSet:
    """Validate the set in `path` and make `folder` a session that holds a copy of it."""
    if path is None or not str(path):
        raise ValueError("rig=recorded needs the folder of a measurement set: rig.path=DIR")
    if not path.is_dir():
        raise ValueError(f"rig.path={path}: no such folder; expected one with a measurement set")
    measured = read_measurement_set(path)
    if (folder / SESSION_FILE).exists() or recorded_copy(folder):
        _require_same(path, folder)
    else:
        with atomic_folder(folder / COPY) as copy:
            for entry in _set_files(path):
                shutil.copyfile(entry, copy / entry.name)
    values = {"rig": NAME, "cable": asdict(measured.cable), "r0_m": measured.r0_m}
    write_text(folder / SESSION_FILE, yaml.safe_dump(values, sort_keys=False))
    return measured


def recorded_copy(folder: Path) -> Path | None:
    """Return the measurement set that a session passes on, None when it holds casts of a rig."""
    return folder / COPY if (folder / COPY).is_dir() else None


def _require_same(path: Path, folder: Path) -> None:
    copy = recorded_copy(folder)
    if copy is None:
        raise ValueError(
            f"{folder}: this session holds casts of the rig {read_session(folder).rig}; "
            "give the recorded set a folder of its own (paths.sessions=…)"
        )
    names = sorted({entry.name for entry in (*_set_files(path), *_set_files(copy))})
    _, changed, lost = filecmp.cmpfiles(path, copy, names, shallow=False)
    if changed or lost:
        raise ValueError(
            f"{folder}: this session holds another recorded set than {path} "
            f"(differs in {', '.join(changed + lost)}); use another folder (paths.sessions=…)"
        )


def _set_files(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.suffix in (".yaml", ".csv", ".parquet"))
