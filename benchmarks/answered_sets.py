"""Diagnose measurement sets whose hidden effect is known, and count the right verdicts.

python benchmarks/answered_sets.py DIR [--sets abc] [--output DIR] [--table FILE]

The folder holds one set a folder, and answers.yaml: of every set what is hidden and the verdicts
that are right. The diagnoses read the sets alone; what stands in the output is not done again.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from robotcast.reporting.page import markdown

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = ("set", "hidden", "verdict", "right", "before", "after", "floor", "times", "s", "casts")

HEAD = """# Sets of casts whose hidden effect is known

`python benchmarks/answered_sets.py DIR --table FILE`. Errors are typical errors on held-out casts,
in % of cable length; `times` is the error after over the noise floor, `s` the seconds of a
diagnosis, `casts` what it simulated. Right is any verdict that the answers accept: `none` too where
what is hidden is too weak to show, a name of today too for what had none when the sets were made.

"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Count the right verdicts on answered sets.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", default="", help="names of one letter, all by default")
    parser.add_argument("--output", type=Path, default=Path("outputs/answered_sets"))
    parser.add_argument("--table", type=Path, help="a Markdown file for the table")
    parser.add_argument("--override", action="append", default=[], help="of the configuration")
    given = parser.parse_args()
    answers = yaml.safe_load((given.folder / "answers.yaml").read_text(encoding="utf-8"))
    rows = []
    for name in sorted(given.sets or answers):
        said = diagnosed(given.folder / name, given.output / name, given.override)
        rows.append(row_of(name, answers[name], said))
        print(" ".join(str(cell) for cell in rows[-1]), flush=True)
    text = table(rows)
    print(text)
    if given.table:
        given.table.write_text(HEAD + text, encoding="utf-8")


def diagnosed(measurements: Path, output: Path, overrides: Sequence[str]) -> dict[str, Any]:
    """Return what the stage says of a set."""
    path = output / "diagnosis.json"
    if not (path.exists() and json.loads(path.read_text(encoding="utf-8"))["finished"]):
        stage = [sys.executable, str(ROOT / "stages" / "diagnose.py")]
        places = [f"measurements={measurements}", f"output={output}"]
        began = time.monotonic()
        done = subprocess.run([*stage, *places, *overrides], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{measurements}: {done.stderr or done.stdout}")
        (output / "seconds").write_text(f"{time.monotonic() - began:.0f}")
    seconds = (output / "seconds").read_text().strip()
    return {**json.loads(path.read_text(encoding="utf-8")), "seconds": seconds}


def row_of(name: str, answer: Mapping[str, Any], said: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the cells of one set; errors are those of the cast in the middle, in %."""
    verdict = set(said["verdict"])
    right = verdict in [set(one) for one in answer["accept"]]
    errors = [rung["heldout_typical_error_percent"] for rung in said["ladder"]]
    after = errors[-1] if verdict - {"none", "unknown"} else errors[0]
    floor = said["noise_floor_percent"]
    more = said["code"] == "named" and said["unexplained"]  # something is left beside the named
    return (
        name,
        answer["hidden"],
        " + ".join(said["verdict"]) + (" + more" if more else ""),
        "yes" if right else "no",
        f"{errors[0]:.2f}",
        f"{after:.2f}",
        f"{floor:.2f}",
        f"{after / floor:.2f}",
        said["seconds"],
        str(said["simulated_casts"]),
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as a Markdown table, with the count of right verdicts."""
    right = sum(row[3] == "yes" for row in rows)
    return f"{markdown(COLUMNS, rows)}\n{right} of {len(rows)} verdicts are right.\n"


if __name__ == "__main__":
    main()
