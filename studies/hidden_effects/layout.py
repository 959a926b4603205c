"""Where the benchmark's files lie: all that a diagnosis has to know of it.

`folder` holds what is bulky and can be made again, `reports` what was said, which is kept with
the code: a benchmark of hours goes on in another checkout, and is scored there.
"""

from fnmatch import fnmatch
from pathlib import Path
from typing import Literal


def result(kind: Literal["diagnoses", "rivals", "oracle"], case: str, reports: Path) -> Path:
    """Return where stands what was said of a case."""
    return reports / kind / f"{case}.json"


def measured_sets(folder: Path, cases: str = "*") -> list[Path]:
    """Return the folders of the measured sets whose names match a pattern, by name."""
    found = sorted(path for path in (folder / "sets").glob("case-*") if path.is_dir())
    sets = [path for path in found if fnmatch(path.name, cases)]
    if not sets:
        raise FileNotFoundError(
            f"{folder / 'sets'} holds no set that matches {cases}: run "
            "python -m studies.hidden_effects.draw first"
        )
    return sets
