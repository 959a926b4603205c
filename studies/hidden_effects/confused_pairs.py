"""Two effects that few casts cannot tell apart, and whether the casts asked for next can.

    python -m studies.hidden_effects.confused_pairs [hidden_effects.wanted=10]

Sets of 11 casts that are alike hide one effect each (pairs.yaml). One after another is diagnosed
until so many confuse what they hide with something else and ask for further casts. The virtual rig
executes these, and a second diagnosis has to choose between the hidden effect and its strongest
rival. Sets that are named at once, or in which what is hidden does not show, are no pairs; the
lines say so. Where a diagnosis says that no cast would tell the two apart, there is nothing to
cast: such sets are counted beside, with what was named first. All of it goes into pairs.csv beside
the sealed answers. What stands in the benchmark's folder is not done again. Exits with 1 when
fewer than 8 of 10 are named rightly, or there are not so many pairs.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl
from omegaconf import DictConfig

from robotcast.build import build, build_rig, known_effects, with_cable
from robotcast.casts.table import read_actions
from robotcast.files import unseal, write_text
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.processes import process_pool
from robotcast.rigs.virtual.rig import Eye
from robotcast.stage import stage, tell
from studies.hidden_effects.cases import answer_path
from studies.hidden_effects.diagnose import diagnosed
from studies.hidden_effects.draw import draw
from studies.hidden_effects.measuring import further_casts

MOST_SETS = 32  # that pairs.yaml composes
ENOUGH = 0.8


def diagnosis(measurements: Path, output: Path, exclude: Sequence[str] = ()) -> dict[str, Any]:
    """Return what a diagnosis says, and make it where it is not finished."""
    path = output / "diagnosis.json"
    if path.exists() and (said := json.loads(path.read_text(encoding="utf-8")))["finished"]:
        return said
    return diagnosed(measurements, output, exclude)


def confused_with(truth: str, said: dict[str, Any]) -> str:
    """Return the effect that the true one is confused with, the strongest if there are more."""
    confused = {name for group in said["confusion_set"] if truth in group for name in group}
    ranked = [entry["effect"] for entry in said["ranking"]]
    return next((name for name in ranked if name != truth and name in confused), "")


def cast(config: DictConfig, answer: dict[str, Any], actions: Path, grown: Path) -> None:
    """Write the set of a case with one cast of each row of `actions` after its own into `grown`."""
    settings = config.hidden_effects
    with process_pool(config.rig.workers) as pool:
        casts = further_casts(
            read_measurement_set(Path(settings.folder) / "sets" / grown.name),
            answer,
            build_rig(with_cable(config, answer["drawn"]["cable"])),
            read_actions(actions),
            Eye(**settings.eye),
            build(config.casts.limits),
            pool,
        )
    write_measurement_set(casts, grown)


def judged(config: DictConfig) -> dict[str, Any]:
    """Return how a set ends: a line of pairs.csv.

    `rival` is "" where what it hides is confused with nothing, `casts` how many further casts the
    first diagnosis asked for, `after` the verdict of a second one that knows the two effects alone,
    "" where there is none.
    """
    draw(config)
    folder, case = Path(config.hidden_effects.folder), config.hidden_effects.cases
    answer = unseal(answer_path(case, Path(config.hidden_effects.reports)))
    (truth,) = (one["effect"] for one in answer["effects"])
    asked, grown = folder / "diagnoses" / case, folder / "grown" / case
    said = diagnosis(folder / "sets" / case, asked)
    rival, first = confused_with(truth, said), " ".join(said["verdict"])
    casts, after = len(said["next_actions"]) if rival else 0, ""
    if casts:
        if not grown.exists():
            cast(config, answer, asked / "actions.csv", grown)
        others = [name for name in known_effects() if name not in (truth, rival)]
        after = " ".join(diagnosis(grown, folder / "second" / case, others)["verdict"])
    line = f"{case}: hidden {truth}, first {first}"
    line += f", confused with {rival}" if rival else "; not confused"
    line += f"; after {casts} further casts {after}" if casts else ""
    line += "; no cast would tell" if rival and not casts else ""
    tell(line)
    found = {"case": case, "hidden": truth, "first": first}
    return {**found, "rival": rival, "casts": casts, "after": after}


def confused_pairs(config: DictConfig) -> None:
    settings, sets = config.hidden_effects, list[dict[str, Any]]()
    for number in range(1, MOST_SETS + 1):
        settings.cases = f"case-{number:03d}"
        sets.append(judged(config))
        table = pl.DataFrame(sets).write_csv().replace('""', "")
        write_text(Path(settings.reports) / "pairs.csv", table)
        if sum(one["casts"] > 0 for one in sets) == settings.wanted:
            break
    pairs = [one for one in sets if one["casts"]]
    right = sum(one["after"] == one["hidden"] for one in pairs)
    tell(f"{right} of {len(pairs)} pairs named rightly after further casts")
    stuck = [one for one in sets if one["rival"] and not one["casts"]]
    named = sum(one["first"] == one["hidden"] for one in stuck)
    tell(f"{len(stuck)} more that no cast would tell apart, {named} of them named rightly at first")
    sys.exit(0 if len(pairs) == settings.wanted and right >= ENOUGH * settings.wanted else 1)


if __name__ == "__main__":
    sys.argv[1:1] = ["--config-name", "pairs"]
    stage(confused_pairs)()
