"""Where the benchmark's files lie, below its folder."""

from pathlib import Path


def sets_folder(folder: Path) -> Path:
    """Return where the measurement sets lie, one folder a case: all that a diagnosis reads."""
    return folder / "sets"


def answers_folder(folder: Path) -> Path:
    """Return where the sealed answers lie, one file a case."""
    return folder / "answers"


def answer_path(name: str, folder: Path) -> Path:
    """Return where the sealed answer of a case lies."""
    return answers_folder(folder) / f"{name}.sealed"


def diagnosis_folder(name: str, folder: Path) -> Path:
    """Return where the diagnosis of a case is written."""
    return folder / "diagnoses" / name


def rivals_path(name: str, folder: Path) -> Path:
    """Return where stands what the methods beside the diagnosis say of a case."""
    return folder / "rivals" / f"{name}.json"


def oracle_path(name: str, folder: Path) -> Path:
    """Return where the fit of a case stands that was told its answer."""
    return folder / "oracle" / f"{name}.json"


def measured_sets(folder: Path) -> list[Path]:
    """Return the folders of all sets that were measured, by name."""
    sets = sorted(path for path in sets_folder(folder).glob("case-*") if path.is_dir())
    if not sets:
        raise FileNotFoundError(
            f"{sets_folder(folder)} holds no set: run stages/hidden_draw.py first"
        )
    return sets
