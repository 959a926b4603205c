"""Where the benchmark's files lie.

`folder` holds what is bulky and can be made again, `reports` what was said, which is kept with
the code: a benchmark of hours goes on in another checkout, and is scored there.
"""

from fnmatch import fnmatch
from pathlib import Path


def sets_folder(folder: Path) -> Path:
    """Return where the measurement sets lie, one folder a case: all that a diagnosis reads."""
    return folder / "sets"


def pages_folder(name: str, folder: Path) -> Path:
    """Return where the diagnosis of a case works and writes its pages."""
    return folder / "diagnoses" / name


def answers_folder(reports: Path) -> Path:
    """Return where the sealed answers lie, one file a case."""
    return reports / "answers"


def answer_path(name: str, reports: Path) -> Path:
    """Return where the sealed answer of a case lies."""
    return answers_folder(reports) / f"{name}.sealed"


def diagnosis_path(name: str, reports: Path) -> Path:
    """Return where the finished diagnosis of a case stands."""
    return reports / "diagnoses" / f"{name}.json"


def rivals_path(name: str, reports: Path) -> Path:
    """Return where stands what the methods beside the diagnosis say of a case."""
    return reports / "rivals" / f"{name}.json"


def oracle_path(name: str, reports: Path) -> Path:
    """Return where the fit of a case stands that was told its answer."""
    return reports / "oracle" / f"{name}.json"


def results_folder(reports: Path) -> Path:
    """Return where tables and figures are written."""
    return reports / "results"


def measured_sets(folder: Path, cases: str = "*") -> list[Path]:
    """Return the folders of the measured sets whose names match a pattern, by name."""
    found = sorted(path for path in sets_folder(folder).glob("case-*") if path.is_dir())
    sets = [path for path in found if fnmatch(path.name, cases)]
    if not sets:
        raise FileNotFoundError(
            f"{sets_folder(folder)} holds no set that matches {cases}: run "
            "stages/hidden_draw.py first"
        )
    return sets
