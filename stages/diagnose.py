"""Learn which physical effect a simulator lacks on a set of measured casts.

python stages/diagnose.py measurements=DIR output=DIR [effects=[…]] [exclude=[…]]
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from effects import build_effects, build_fields, known_effects
from grids import build_envelope, build_grid, build_limits
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, require, stage, typed

from robotcast.cast_model import CAST_WORDING, CastModel, candidate_casts, cast_records, draw_field
from robotcast.casts.action_file import write_actions
from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.next_trials import Further
from robotcast.effects.effect import Effect
from robotcast.files import write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set
from robotcast.reporting.diagnosis_page import diagnosis_page
from robotcast.rigs.envelope import feasible_actions
from robotcast.simulators.simulator import Simulator

ACTIONS = "actions.csv"
NO_LOG = (
    "The tool log is missing; the planned motion stands in for it. An arm that is moved by another "
    "planner can be far from it: for a set that has its log, the plan raised the error from 1.3 to "
    "14 % of cable length. What the arm did otherwise looks like a missing effect: a lag of the "
    "tool, a late camera. Log the tool to be sure."
)
OR_THE_PLAN = " Or the arm did otherwise than planned: its log is missing."
FURTHER = 150  # casts of the collected grid, of which the next to run are chosen


def diagnose_stage(config: DictConfig) -> None:
    require(config, "measurements", "output")
    measured = read_measurement_set(Path(config.measurements))
    if measured.notice:
        console.print(measured.notice, style="yellow", markup=False)
    folder = output_folder(config.output)
    if folder.resolve() == Path(config.measurements).resolve():
        raise ValueError("output=DIR must be another folder than the measurement set's")
    (folder / ACTIONS).unlink(missing_ok=True)
    facts = _facts(config, measured)
    with bar("diagnose") as progress:
        said = diagnose(
            case_of(config, measured), lambda said: _write(folder, _joined(facts, said)), progress
        )
    said = _joined(facts, said)
    if said["next_actions"]:
        write_actions(said["next_actions"], folder / ACTIONS)
    console.print(f"{folder}: {said['sentence']}", markup=False)
    for note in said["notes"]:
        console.print(f"- {note}", markup=False)
    console.print(f"open {folder / 'index.html'}", markup=False)


def case_of(config: DictConfig, measured: MeasurementSet) -> Case:
    """Return the question: the model, the casts, and the effects to try."""

    def make_simulator(effects: Sequence[Effect]) -> Simulator:
        return instantiate(config.simulator.model, cable=measured.cable, effects=list(effects))

    bare = make_simulator(())
    tuned, lacks = (getattr(bare, name, ()) for name in ("tunes", "lacks"))
    left_out = {*config.exclude, *config.effects, *tuned}
    build_effects((*config.effects, *config.exclude))  # a name that nobody knows is refused here
    candidates = [
        effect.name
        for effect in build_effects([n for n in known_effects() if n not in left_out])
        if not any(effect.acts_through(hook) for hook in lacks)
    ]
    effects = (*build_effects((*config.effects, *candidates)), *build_fields())
    model = CastModel(measured, make_simulator, effects, held=config.simulator.weighed)
    return Case(
        model=model,
        records=cast_records(measured),
        candidates=candidates,
        fixed=tuple(config.effects),
        wording=CAST_WORDING,
        further=lambda: _further(config, model, measured),
        draw=draw_field,
        rule=instantiate(config.diagnosis.rule),
        effort=instantiate(config.diagnosis.effort),
    )


def _further(config: DictConfig, model: CastModel, measured: MeasurementSet) -> Further:
    """Return some of the casts that the arm can do, from the radius where the set's casts start."""
    grid, limits = build_grid(config, "collected"), build_limits(config)
    feasible, _ = feasible_actions(grid, measured.r0_m, limits, build_envelope(config))
    return candidate_casts(model, measured, feasible, limits, FURTHER, config.seed)


def _facts(config: DictConfig, measured: MeasurementSet) -> dict[str, Any]:
    """Return what the page says of where the casts come from."""
    return {
        "rig": measured.rig,
        "measurements": str(config.measurements),
        "output": str(config.output),
        "overrides": typed("simulator"),
        "pipeline": True,
        "notes": [NO_LOG] if measured.tool_planned else [],
    }


def _joined(facts: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """Join what is known of the set with what was found in it."""
    doubt = NO_LOG in facts["notes"] and said["verdict"] not in ([], ["none"])
    return {
        **facts,
        **said,
        "sentence": said["sentence"] + (OR_THE_PLAN if doubt else ""),
        "notes": [*facts["notes"], *said["notes"]],
    }


def _write(folder: Path, plain: Mapping[str, Any]) -> None:
    text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1)
    write_text(folder / "diagnosis.json", text)
    write_text(folder / "index.html", diagnosis_page(plain))


if __name__ == "__main__":
    stage(diagnose_stage)()
