"""Two effects that few casts cannot tell apart, and whether the casts asked for next can.

    python -m studies.hidden_effects.confused_pairs [--pairs 10]

Sets of 11 casts that are alike hide one effect each (pairs.yaml). One after another is diagnosed
until so many confuse what they hide with something else and ask for further casts. The virtual rig
executes these, and a second diagnosis has to choose between the hidden effect and its strongest
rival. Sets that are named at once, or in which what is hidden does not show, are no pairs; the
lines say so. Where a diagnosis says that no cast would tell the two apart, there is nothing to
cast: such sets are counted beside, with what was named first. All of it goes into pairs.csv beside
the sealed answers. What stands in the benchmark's folder is not done again. Exits with 1 when
fewer than 8 of 10 are named rightly, or there are not so many pairs.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import polars as pl

from robotcast.build import known_effects
from robotcast.files import unseal, write_text
from studies.hidden_effects.cases import answer_path

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


def step(name: str, *overrides: str) -> None:
    run("-m", f"studies.hidden_effects.{name}", "--config-name", "pairs", *overrides)


def diagnosis(output: Path, *overrides: str) -> dict[str, Any]:
    """Return what a diagnosis says, and make it where it is not finished."""
    path = output / "diagnosis.json"
    if not path.exists() or not json.loads(path.read_text(encoding="utf-8"))["finished"]:
        run("stages/diagnose.py", *overrides, f"output={output}")
    return json.loads(path.read_text(encoding="utf-8"))


def confused_with(truth: str, said: dict[str, Any]) -> str:
    """Return the effect that the true one is confused with, the strongest if there are more."""
    confused = {name for group in said["confusion_set"] if truth in group for name in group}
    ranked = [entry["effect"] for entry in said["ranking"]]
    return next((name for name in ranked if name != truth and name in confused), "")


def chosen_between(measurements: Path, truth: str, rival: str) -> list[str]:
    """Return the verdict of a diagnosis that knows the two effects alone, after further casts."""
    asked, grown, second = (
        FOLDER / kind / measurements.name for kind in ("diagnoses", "grown", "second")
    )
    if not grown.exists():
        actions = f"hidden_effects.actions={asked / 'actions.csv'}"
        step("cast", f"measurements={measurements}", actions, f"output={grown}")
    others = ",".join(name for name in known_effects() if name not in (truth, rival))
    return diagnosis(second, f"measurements={grown}", f"exclude=[{others}]")["verdict"]


def judged(case: str) -> dict[str, Any]:
    """Return how a set ends: a line of pairs.csv.

    `rival` is "" where what it hides is confused with nothing, `casts` how many further casts the
    first diagnosis asked for, `after` the verdict of the second one, "" where there is none.
    """
    step("draw", f"hidden_effects.cases={case}")
    measurements = FOLDER / "sets" / case
    (truth,) = (one["effect"] for one in unseal(answer_path(case, REPORTS))["effects"])
    said = diagnosis(FOLDER / "diagnoses" / case, f"measurements={measurements}")
    rival, first = confused_with(truth, said), " ".join(said["verdict"])
    casts = len(said["next_actions"]) if rival else 0
    after = " ".join(chosen_between(measurements, truth, rival)) if casts else ""
    line = f"{case}: hidden {truth}, first {first}"
    line += f", confused with {rival}" if rival else "; not confused"
    line += f"; after {casts} further casts {after}" if casts else ""
    line += "; no cast would tell" if rival and not casts else ""
    print(line, flush=True)
    return {
        **{"case": case, "hidden": truth, "first": first},
        **{"rival": rival, "casts": casts, "after": after},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--pairs", type=int, default=10)
    wanted = parser.parse_args().pairs
    sets: list[dict[str, Any]] = []
    for number in range(1, MOST_SETS + 1):
        sets.append(judged(f"case-{number:03d}"))
        write_text(REPORTS / "pairs.csv", pl.DataFrame(sets).write_csv().replace('""', ""))
        if sum(one["casts"] > 0 for one in sets) == wanted:
            break
    pairs = [one for one in sets if one["casts"]]
    right = sum(one["after"] == one["hidden"] for one in pairs)
    print(f"{right} of {len(pairs)} pairs named rightly after further casts")
    stuck = [one for one in sets if one["rival"] and not one["casts"]]
    named = sum(one["first"] == one["hidden"] for one in stuck)
    print(
        f"{len(stuck)} more that no cast would tell apart, {named} of them named rightly at first"
    )
    sys.exit(0 if len(pairs) == wanted and right >= ENOUGH * wanted else 1)


if __name__ == "__main__":
    main()
