"""A robot's MJCF beside its logs: which effect does the model lack?"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.files import plain, write_text
from robotcast.reporting.diagnosis_page import diagnosis_page
from robotcast.reporting.robot_page import traces_figure
from robotcast.reporting.style import svg
from robotcast.robots.by_joint import diagnose_by_joint
from robotcast.robots.describe import describe
from robotcast.robots.patch import write_patched
from robotcast.robots.robot_case import read_case
from robotcast.robots.shown import preview, shown
from robotcast.stage import bar, output_folder

PATCHED, PREVIEW = "model.xml", "robot.svg"


def diagnose_robot(config: DictConfig) -> tuple[Path, dict[str, Any]]:
    """Diagnose the configured folder; write JSON, page and model; return folder and JSON."""
    source, folder = Path(config.robot), output_folder(config.output)
    if folder.resolve() == source.resolve():
        raise ValueError("output=DIR must be another folder than the robot's")
    case = read_case(source)
    question = case.question(
        config.exclude,
        config.effects,
        instantiate(config.diagnosis.rule),
        instantiate(config.diagnosis.effort),
    )
    facts: dict[str, Any] = {
        "rig": "",
        "measurements": str(config.robot),
        "output": str(config.output),
        "overrides": ["model=mjcf"],
        "notes": [],
    }

    def joined(found: Mapping[str, Any]) -> dict[str, Any]:
        return {**facts, **found, "notes": [*case.notes, *found["notes"]]}

    def write(found: Mapping[str, Any]) -> None:
        whole = plain(joined(found))
        text = json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1)
        write_text(folder / "diagnosis.json", text)
        write_text(folder / "index.html", diagnosis_page(whole))

    with bar("diagnose") as progress:
        found = diagnose_by_joint(case, question, write, progress)
    facts["robot"] = shown(case, found)
    if found["model"]:
        effects = case.model.effects
        left_out = write_patched(case.robot, effects, found["model"], folder / PATCHED)
        facts |= {"patched": PATCHED, "robot": {**facts["robot"], "left_out": left_out}}
    write(found)
    return folder, joined(found)


def describe_robot(folder: Path) -> list[str]:
    """Write robot.yaml and a figure of a window beside the simulation; say what was guessed."""
    path, said = describe(folder)
    said = [f"{path}:", *(f"- {sentence}" for sentence in said)]
    try:
        case = read_case(folder)
    except ValueError as error:
        return [*said, f"It does not run yet: {error}"]
    drawn = plain(preview(case))
    write_text(folder / PREVIEW, svg(traces_figure(drawn["signals"], drawn["windows"][0])).decode())
    return [
        *said,
        *(f"- {note}" for note in case.notes),
        f"{folder / PREVIEW} lays a window beside the simulation: does it begin alike?",
        f"Then: python stages/diagnose.py model=mjcf robot={folder} output=OUT",
    ]
