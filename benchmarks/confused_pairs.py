"""Two effects that few casts cannot tell apart, and whether the casts asked for next can.

    .venv/bin/python benchmarks/confused_pairs.py [--pairs 10]

Sets of 11 casts hide one effect each (conf/hidden_effects/pairs.yaml). One after another is
diagnosed until so many confuse what they hide with something else. The virtual rig executes the
casts that these diagnoses ask for, and a second diagnosis has to choose between the hidden effect
and its strongest rival. Where a diagnosis says that no further cast would tell, its first verdict
counts. Sets that are named at once, or in which what is hidden does not show, are no pairs; the
lines say so. What stands in the benchmark's folder is not done again. Exits with 1 when fewer than
8 of 10 are named rightly, or there are not so many pairs.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from robotcast.hidden_effects.layout import answer_path, pages_folder, sets_folder
from robotcast.hidden_effects.outcome import read_truth

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "data" / "hidden_effects_pairs"
REPORTS = ROOT / "reports" / "hidden_effects_pairs"
MOST_SETS = 24  # that pairs.yaml composes
ENOUGH = 0.8


def run(stage: str, *overrides: str) -> None:
    """Run a stage as a user does."""
    command = [sys.executable, f"stages/{stage}.py", *overrides]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr[-800:]}")


def diagnosis(output: Path, *overrides: str) -> dict[str, Any]:
    """Return what a diagnosis says, and make it where it is not finished."""
    path = output / "diagnosis.json"
    if not path.exists() or not json.loads(path.read_text(encoding="utf-8"))["finished"]:
        run("diagnose", *overrides, f"output={output}")
    return json.loads(path.read_text(encoding="utf-8"))


def confused_with(truth: str, said: dict[str, Any]) -> str | None:
    """Return the effect that the true one is confused with, the strongest if there are more."""
    confused = {name for group in said["confusion_set"] if truth in group for name in group}
    ranked = [entry["effect"] for entry in said["ranking"]]
    return next((name for name in ranked if name != truth and name in confused), None)


def chosen_between(measurements: Path, truth: str, rival: str) -> list[str]:
    """Return the verdict of a diagnosis that knows the two effects alone, after further casts."""
    first, name = pages_folder(measurements.name, FOLDER), measurements.name
    grown = FOLDER / "grown" / name
    if not grown.exists():
        run(
            "hidden_cast",
            "hidden_effects=pairs",
            f"measurements={measurements}",
            f"hidden_effects.actions={first / 'actions.csv'}",
            f"output={grown}",
        )
    known = [path.stem for path in (ROOT / "conf" / "effect").glob("*.yaml")]
    others = sorted(effect for effect in known if effect not in (truth, rival))
    second = FOLDER / "second" / name
    return diagnosis(second, f"measurements={grown}", f"exclude=[{','.join(others)}]")["verdict"]


def judged(case: str) -> bool | None:
    """Print how a case ends: whether the right one of two is named, None where it is no pair."""
    run("hidden_draw", "hidden_effects=pairs", f"hidden_effects.cases={case}")
    measurements = sets_folder(FOLDER) / case
    (truth,) = read_truth(answer_path(case, REPORTS)).effects
    said = diagnosis(pages_folder(case, FOLDER), f"measurements={measurements}")
    rival, first = confused_with(truth, said), ", ".join(said["verdict"])
    line = f"{case}: hidden {truth}, first {first}"
    if rival is None:
        print(f"{line}; not confused", flush=True)
        return None
    casts = len(said["next_actions"])
    if not casts:
        print(f"{line}, confused with {rival}; no further cast would tell", flush=True)
        return said["verdict"] == [truth]
    verdict = chosen_between(measurements, truth, rival)
    after = f"after {casts} further casts {', '.join(verdict)}"
    print(f"{line}, confused with {rival}; {after}", flush=True)
    return verdict == [truth]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--pairs", type=int, default=10)
    wanted = parser.parse_args().pairs
    right: list[bool] = []
    for number in range(1, MOST_SETS + 1):
        if len(right) == wanted:
            break
        found = judged(f"case-{number:03d}")
        right += [] if found is None else [found]
    print(f"{sum(right)} of {len(right)} pairs named rightly")
    sys.exit(0 if len(right) == wanted and sum(right) >= ENOUGH * wanted else 1)


if __name__ == "__main__":
    main()
