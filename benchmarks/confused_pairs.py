"""Two effects that few casts cannot tell apart, and whether the casts asked for next can.

    .venv/bin/python benchmarks/confused_pairs.py [--cases 10]

Sets of 11 casts hide one effect each (conf/hidden_effects/pairs.yaml). A diagnosis names what it
confuses with what and asks for further casts; the virtual rig executes them, and a second
diagnosis has to choose between the hidden effect and its strongest rival. Where the first one
confused nothing, the rival is the next best effect, and the line says so. What stands in the
benchmark's folder is not done again. Exits with 1 when fewer than 8 of 10 are named rightly.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from robotcast.hidden_effects.layout import answer_path, measured_sets, pages_folder
from robotcast.hidden_effects.outcome import read_truth

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "data" / "hidden_effects_pairs"
REPORTS = ROOT / "reports" / "hidden_effects_pairs"
ENOUGH = 0.8


def run(stage: str, *overrides: str) -> None:
    """Run a stage as a user does."""
    command = [sys.executable, f"stages/{stage}.py", *overrides]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr[-800:]}")


def read(folder: Path) -> dict[str, Any]:
    """Return what a diagnosis said."""
    return json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))


def rival_of(truth: str, said: dict[str, Any]) -> tuple[str, bool]:
    """Return the effect that was nearest to the true one, and whether the two were confused."""
    ranked = [entry["effect"] for entry in said["ranking"]]
    confused = {name for group in said["confusion_set"] if truth in group for name in group}
    others = [name for name in ranked if name != truth]
    near = [name for name in others if name in confused]
    return (near or others)[0], bool(near)


def chosen_between(measurements: Path, truth: str, rival: str) -> list[str]:
    """Return the verdict of a diagnosis that knows the two effects alone, after further casts."""
    first, name = pages_folder(measurements.name, FOLDER), measurements.name
    grown, second = FOLDER / "grown" / name, FOLDER / "second" / name
    if not grown.exists():
        run(
            "hidden_cast",
            "hidden_effects=pairs",
            f"measurements={measurements}",
            f"hidden_effects.actions={first / 'actions.csv'}",
            f"output={grown}",
        )
    if not (second / "diagnosis.json").exists() or not read(second)["finished"]:
        known = [path.stem for path in (ROOT / "conf" / "effect").glob("*.yaml")]
        others = [effect for effect in known if effect not in (truth, rival)]
        run(
            "diagnose",
            f"measurements={grown}",
            f"output={second}",
            f"exclude=[{','.join(sorted(others))}]",
        )
    return read(second)["verdict"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cases", type=int, default=10)
    cases = parser.parse_args().cases
    run("hidden_draw", "hidden_effects=pairs")
    right = 0
    sets = measured_sets(FOLDER)[:cases]
    for measurements in sets:
        first = pages_folder(measurements.name, FOLDER)
        if not (first / "diagnosis.json").exists() or not read(first)["finished"]:
            run("diagnose", f"measurements={measurements}", f"output={first}")
        (truth,) = read_truth(answer_path(measurements.name, REPORTS)).effects
        said = read(first)
        rival, confused = rival_of(truth, said)
        verdict = chosen_between(measurements, truth, rival)
        right += verdict == [truth]
        print(
            f"{measurements.name}: hidden {truth}; first {', '.join(said['verdict'])}, rival "
            f"{rival}{'' if confused else ' (not confused)'}; after "
            f"{len(said['next_actions'])} further casts {', '.join(verdict)}",
            flush=True,
        )
    print(f"{right} of {len(sets)} named rightly")
    sys.exit(0 if right >= ENOUGH * len(sets) else 1)


if __name__ == "__main__":
    main()
