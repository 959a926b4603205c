"""Two effects that few casts cannot tell apart, and whether the casts asked for next can.

    python -m studies.hidden_effects.confused_pairs [--pairs 10]

Sets of 11 casts that are alike hide one effect each (pairs.yaml). One after
another is diagnosed until so many confuse what they hide with something else and ask for further
casts. The virtual rig executes these, and a second diagnosis has to choose between the hidden
effect and its strongest rival. Sets that are named at once, or in which what is hidden does not
show, are no pairs; the lines say so. Where a diagnosis says that no cast would tell the two apart,
there is nothing to cast: such sets are counted beside, with what was named first. All of it goes
into pairs.csv beside the sealed answers. What stands in the benchmark's folder is not done again.
Exits with 1 when fewer than 8 of 10 are named rightly, or there are not so many pairs.
"""

import argparse
import csv
import io
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from robotcast.files import write_text
from studies.hidden_effects.cases import answer_path, unseal
from studies.hidden_effects.layout import page_folder

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "data" / "hidden_effects_pairs"
REPORTS = ROOT / "reports" / "hidden_effects_pairs"
MOST_SETS = 32  # that pairs.yaml composes
ENOUGH = 0.8


def run(*arguments: str) -> None:
    """Run a stage or a step as a user does."""
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr[-800:]}")


def diagnosis(output: Path, *overrides: str) -> dict[str, Any]:
    """Return what a diagnosis says, and make it where it is not finished."""
    path = output / "diagnosis.json"
    if not path.exists() or not json.loads(path.read_text(encoding="utf-8"))["finished"]:
        run("stages/diagnose.py", *overrides, f"output={output}")
    return json.loads(path.read_text(encoding="utf-8"))


def confused_with(truth: str, said: dict[str, Any]) -> str | None:
    """Return the effect that the true one is confused with, the strongest if there are more."""
    confused = {name for group in said["confusion_set"] if truth in group for name in group}
    ranked = [entry["effect"] for entry in said["ranking"]]
    return next((name for name in ranked if name != truth and name in confused), None)


def chosen_between(measurements: Path, truth: str, rival: str) -> list[str]:
    """Return the verdict of a diagnosis that knows the two effects alone, after further casts."""
    first, name = page_folder(measurements.name, FOLDER), measurements.name
    grown = FOLDER / "grown" / name
    if not grown.exists():
        run(
            *("-m", "studies.hidden_effects.cast", "--config-name", "pairs"),
            f"measurements={measurements}",
            f"hidden_effects.actions={first / 'actions.csv'}",
            f"output={grown}",
        )
    known = [path.stem for path in (ROOT / "conf" / "effect").glob("*.yaml")]
    others = sorted(effect for effect in known if effect not in (truth, rival))
    second = FOLDER / "second" / name
    return diagnosis(second, f"measurements={grown}", f"exclude=[{','.join(others)}]")["verdict"]


@dataclass(frozen=True)
class Outcome:
    """How a set ends; `rival` is "" where what it hides is confused with nothing.

    Attributes
    ----------
    casts : how many further casts the first diagnosis asked for.
    after : the verdict of the second diagnosis, "" where there is none.
    """

    case: str
    hidden: str
    first: str
    rival: str
    casts: int
    after: str

    def __str__(self) -> str:
        line = f"{self.case}: hidden {self.hidden}, first {self.first}"
        if not self.rival:
            return f"{line}; not confused"
        line += f", confused with {self.rival}"
        if not self.casts:
            return f"{line}; no cast would tell"
        return f"{line}; after {self.casts} further casts {self.after}"


def judged(case: str) -> Outcome:
    draw = ("-m", "studies.hidden_effects.draw", "--config-name", "pairs")
    run(*draw, f"hidden_effects.cases={case}")
    measurements = FOLDER / "sets" / case
    (truth,) = (one["effect"] for one in unseal(answer_path(case, REPORTS))["effects"])
    said = diagnosis(page_folder(case, FOLDER), f"measurements={measurements}")
    rival, first = confused_with(truth, said) or "", " ".join(said["verdict"])
    casts = len(said["next_actions"]) if rival else 0
    after = " ".join(chosen_between(measurements, truth, rival)) if casts else ""
    return Outcome(case, truth, first, rival, casts, after)


def write(outcomes: Sequence[Outcome]) -> None:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([field.name for field in fields(Outcome)])
    table.writerows(asdict(outcome).values() for outcome in outcomes)
    write_text(REPORTS / "pairs.csv", text.getvalue())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--pairs", type=int, default=10)
    wanted = parser.parse_args().pairs
    outcomes: list[Outcome] = []
    for number in range(1, MOST_SETS + 1):
        outcomes.append(judged(f"case-{number:03d}"))
        print(outcomes[-1], flush=True)
        write(outcomes)
        if sum(outcome.casts > 0 for outcome in outcomes) == wanted:
            break
    pairs = [outcome for outcome in outcomes if outcome.casts]
    right = sum(outcome.after == outcome.hidden for outcome in pairs)
    print(f"{right} of {len(pairs)} pairs named rightly after further casts")
    stuck = [outcome for outcome in outcomes if outcome.rival and not outcome.casts]
    named = sum(outcome.first == outcome.hidden for outcome in stuck)
    print(
        f"{len(stuck)} more that no cast would tell apart, {named} of them named rightly at first"
    )
    sys.exit(0 if len(pairs) == wanted and right >= ENOUGH * wanted else 1)


if __name__ == "__main__":
    main()
