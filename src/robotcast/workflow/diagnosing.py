"""The configured simulator beside a measurement set: which effect does it lack?"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.build import (
    action_space,
    build_effects,
    build_fields,
    build_simulator,
    known_effects,
)
from robotcast.cast_model import CAST_WORDING, CastModel, candidate_casts, cast_records, draw_field
from robotcast.casts.table import write_actions
from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.next_trials import Further
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import NO_TOOL
from robotcast.reporting.diagnosis_page import write_diagnosis
from robotcast.rigs.envelope import feasible_actions
from robotcast.stage import as_note, bar, measured_set, output_folder, typed

ACTIONS = "actions.csv"
NO_LOG = (
    "The tool log is missing; the planned motion stands in for it. An arm that is moved by another "
    "planner can be far from it: for a set that has its log, the plan raised the error from 1.3 to "
    "14 % of cable length. What the arm did otherwise looks like a missing effect: a lag of the "
    "tool, a late camera. Log the tool to be sure."
)
OR_THE_PLAN = " Or the arm did otherwise than planned: its log is missing."
FURTHER = 150  # casts of the collected grid, of which the next to run are chosen


def casts_on(measurements: Path, cable: str) -> list[str]:
    """Return what collect must be told to add to a set of the pipeline, hidden effect and all."""
    ours = measurements == Path("data/measurements") / cable
    return [f"cable={cable}", f"hidden=data/hidden/{cable}.sealed"] if ours else []


def diagnose_set(config: DictConfig) -> tuple[Path, dict[str, Any]]:
    """Diagnose the configured set; write JSON, page and next actions; return folder and JSON."""
    measured = measured_set(config.measurements)
    folder = output_folder(config.output, config.measurements)
    (folder / ACTIONS).unlink(missing_ok=True)
    notes = [NO_LOG] if measured.tool_planned else []
    notes += [as_note(notice) for notice in measured.notices if notice != NO_TOOL]
    facts = {
        "rig": measured.rig,
        "measurements": str(config.measurements),
        "output": str(config.output),
        "overrides": typed("simulator"),
        "casts_on": casts_on(Path(config.measurements), measured.cable.name),
        "pipeline": True,
        "notes": [],
    }

    def joined(found: Mapping[str, Any]) -> dict[str, Any]:
        whole = {**facts, **found, "notes": [*notes, *found["notes"]]}
        if measured.tool_planned:
            whole["sentence"] += OR_THE_PLAN if found["verdict"] not in ([], ["none"]) else ""
        return whole

    def write(found: Mapping[str, Any]) -> None:
        write_diagnosis(folder, joined(found))

    with bar("diagnose") as progress:
        whole = joined(diagnose(case_of(config, measured), write, progress))
    if whole["next_actions"]:
        write_actions(whole["next_actions"], folder / ACTIONS)
    return folder, whole


def case_of(config: DictConfig, measured: MeasurementSet) -> Case:
    """Return the question: the model, the casts, and the effects to try."""
    simulator = partial(build_simulator, config, measured.cable)
    bare = simulator()
    left_out = {*config.exclude, *config.effects, *bare.tunes}
    build_effects((*config.effects, *config.exclude))  # a name that nobody knows is refused here
    candidates = [
        effect.name
        for effect in build_effects([n for n in known_effects() if n not in left_out])
        if not any(effect.acts_through(hook) for hook in bare.lacks)
    ]
    effects = (*build_effects((*config.effects, *candidates)), *build_fields())
    model = CastModel(measured, simulator, effects, held=config.simulator.weighed)

    def further() -> Further:
        """Draw from what the arm can do from the radius where the set's casts start."""
        grid, _, limits, envelope = action_space(config, "collected")
        feasible = feasible_actions(grid, measured.r0_m, limits, envelope)
        return candidate_casts(model, measured, feasible, limits, FURTHER, config.seed)

    return Case(
        model=model,
        records=cast_records(measured),
        candidates=candidates,
        fixed=tuple(config.effects),
        wording=CAST_WORDING,
        further=further,
        draw=draw_field,
        rule=instantiate(config.diagnosis.rule),
        effort=instantiate(config.diagnosis.effort),
    )
