"""A robot's MJCF beside its logs: where does the model fail, and which effect does it lack?"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.diagnosis.compare import compare
from robotcast.diagnosis.diagnose import Case, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry, fit_base, held_out
from robotcast.diagnosis.report import fitted
from robotcast.files import plain, write_text
from robotcast.reporting.comparison_page import comparison_page
from robotcast.reporting.diagnosis_page import write_diagnosis
from robotcast.reporting.missing_force import traces_figure
from robotcast.reporting.names import effect_name
from robotcast.reporting.style import svg
from robotcast.robots.by_joint import diagnose_robot as diagnose
from robotcast.robots.describe import describe
from robotcast.robots.outcome import preview, shown, write_patched
from robotcast.robots.robot_case import RobotCase, read_case
from robotcast.robots.robot_file import write_parameters
from robotcast.running import write_page
from robotcast.stage import bar, output_folder

RUNS, TRIED = 1000, 8  # runs of all windows that a diagnosis takes, effects that tell their time
PATCHED, PARAMETERS, PREVIEW = "model.xml", "parameters.yaml", "robot.svg"


def diagnose_robot(config: DictConfig) -> tuple[Path, dict[str, Any]]:
    """Diagnose the configured folder; write JSON, page and model; return folder and JSON."""
    folder, case = output_folder(config.output, config.robot), read_case(Path(config.robot))
    facts, said = _facts(config), _question(config, config.exclude)
    case.question(*said)  # what it refuses is said before anything is written

    def joined(found: Mapping[str, Any]) -> dict[str, Any]:
        return {**facts, **found}

    def write(found: Mapping[str, Any]) -> None:
        write_diagnosis(folder, plain(joined(found)))

    with bar("diagnose") as progress:
        case, found = diagnose(case, lambda asked: asked.question(*said), write, progress)
    if found["next_actions"]:
        found = {**found, "next_actions": case.motions.rows(found["next_actions"], folder)}
    least = case.question(*said).rule.least_noise
    facts["robot"] = shown(case, found["base"], found["model"], least)
    if found["model"] and found["model"]["parameters"]:
        facts["patched"] = PATCHED
        found = {**found, "notes": [*found["notes"], *_written(case, found["model"], folder)]}
    write(found)
    return folder, joined(found)


def compare_robot(config: DictConfig) -> dict[str, Any]:
    """Fit what robot.yaml lets be tuned, with the effects that act; compare with the logs."""
    _, case, question = _asked(config)
    return _compared(config, case, question)[0]


def tune_robot(config: DictConfig) -> list[str]:
    """Fit as `compare_robot`, write model, parameters and page; return sentences on it."""
    folder, case, question = _asked(config)
    found, model, held = _compared(config, case, question)
    lacks = _written(case, model, folder)
    found |= {"patched": PATCHED, "notes": [*found["notes"], *lacks]}
    write_text(folder / "tuned.json", json.dumps(plain(model), ensure_ascii=False, indent=1))
    write_page(folder / "index.html", comparison_page(plain(found)))
    fell = f"{found['waypoint_error_percent']:.2f} {found['error_unit']}"
    return [
        f"{folder}: {fell} on the windows that it was fitted to, {held:.2f} on windows held out, "
        f"noise floor {found['noise_floor_percent']:.2f}; open {folder / 'index.html'}",
        *(f"- {name} = {p['value']:.5g}" for name, p in model["parameters"].items()),
        f"the model with them: {folder / PATCHED}, {folder / PARAMETERS}",
        *lacks,
    ]


def describe_robot(folder: Path) -> Iterator[str]:
    """Write robot.yaml and say what was guessed; then draw a window beside the simulation."""
    path, said = describe(folder)
    yield f"{path}:"
    yield from (f"- {sentence}" for sentence in said)
    try:
        case = read_case(folder)
    except ValueError as error:
        yield f"It does not run yet: {error}"
        return
    drawn, run_s = plain(preview(case)), _run_s(case)
    write_text(folder / PREVIEW, svg(traces_figure(drawn["signals"], drawn["windows"][0])))
    yield from (f"- {note}" for note in case.notes)
    yield (
        f"- A run of all windows takes {run_s:.2g} s on this machine, and a diagnosis some "
        f"{RUNS} of them, {max(RUNS * run_s / 60, 1):.0f} min; fewer or shorter windows take less: "
        "`windows: {most: …, length_s: …}` in robot.yaml."
    )
    yield f"{folder / PREVIEW} lays a window beside the simulation: does it begin alike?"
    yield f"Then: robotcast diagnose {folder}"


def _run_s(case: RobotCase) -> float:
    """Return how long a run of all windows takes with an effect, the mean over a few of them."""
    model, names = case.model, [*case.model.effects]
    tried, began_s = names[:: -(-len(names) // TRIED)], perf_counter()
    for name in tried:
        more = [p.probes[0] if p.probes else p.nominal for p in model.effects[name].parameters]
        values = [*(p.nominal for p in model.parameters), *more]
        model.predict(model.records, (name,), np.array([values]))
    return (perf_counter() - began_s) / len(tried)


def _asked(config: DictConfig) -> tuple[Path, RobotCase, Case]:
    """Return where to write, the folder as it was read, and what is asked of it."""
    folder = output_folder(config.output, config.robot)
    case = read_case(Path(config.robot))
    return folder, case, case.question(*_question(config, ()))


def _question(config: DictConfig, exclude: Any) -> tuple[Any, ...]:
    of = config.diagnosis
    return exclude, config.effects, instantiate(of.rule), instantiate(of.effort)


def _facts(config: DictConfig) -> dict[str, Any]:
    return {
        "rig": "",
        "measurements": str(config.robot),
        "output": str(config.output),
        "overrides": ["model=mjcf"],
        "notes": [],
    }


def _compared(
    config: DictConfig, case: RobotCase, question: Case
) -> tuple[dict[str, Any], dict[str, Any], float]:
    """Return the comparison, the fitted model, and its mean error on windows held out [%]."""
    model, records, effects = case.model, question.records, tuple(config.effects)
    floor, noise = floor_and_noise(question)
    with bar("compare") as progress:

        def told(done: int, total: int, note: str = "") -> None:
            progress(done, total, "simulated windows")

        inquiry = Inquiry(model, records, noise, told)
        revision = fit_base(inquiry, effects, question.effort)
        errors = held_out(inquiry, revision, question.effort)
        values = inquiry.values(effects, revision.fit.vector)
        predicted = model.predict(records, effects, values)[0]
    found = compare(model, records, predicted, case.wording)
    said = fitted(inquiry, revision, errors.vectors, question.rule)
    start = {"parameters": {p.name: {"value": p.nominal} for p in model.parameters}}
    how = "fitted to these windows" if inquiry.free(effects).any() else "as it is"
    with_effects = f" with {' and '.join(map(effect_name, effects))}" if effects else ""
    facts = {
        "model": f"the MJCF{with_effects}, {how}",
        "noise_floor_percent": floor.percent,
        "notes": list(case.notes),
        "robot": plain(shown(case, start, said, question.rule.least_noise)),
    }
    return found.as_dict() | _facts(config) | facts, said, float(errors.waypoint.mean())


def _written(case: RobotCase, model: Mapping[str, Any], folder: Path) -> list[str]:
    """Write model and parameters; return what to know of them."""
    left_out = write_patched(case.robot, case.model.effects, model, folder / PATCHED)
    write_parameters(folder / PARAMETERS, model["parameters"])
    names = ", ".join(map(effect_name, left_out))
    lacks = f"{PATCHED} lacks what an MJCF file cannot hold: {names}."
    return [f"{lacks} Apply it in your own loop, or to the logs."] if left_out else []
