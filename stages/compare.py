"""Compare a tuned simulator with measured casts: how far off is it, when, where, for which?

python stages/compare.py measurements=DIR output=DIR [tuned=DIR]
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from effects import build_effects
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, require, stage, typed

from robotcast.cast_model import CAST_WORDING, CastModel, cast_records
from robotcast.diagnosis.compare import Comparison, compare
from robotcast.diagnosis.diagnose import Case, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry, fit_base
from robotcast.effects.effect import Effect, parameters_of
from robotcast.files import write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set
from robotcast.reporting.comparison_page import comparison_page
from robotcast.reporting.names import effect_name
from robotcast.simulators.simulator import Simulator
from robotcast.tuning.tuned import read_effects, read_values, vector_of

ITERATIONS = 8  # of the fit, after its several starts


def compare_stage(config: DictConfig) -> None:
    require(config, "measurements", "output")
    measured = read_measurement_set(Path(config.measurements))
    if measured.notice:
        console.print(measured.notice, style="yellow", markup=False)
    records = cast_records(measured)
    active = _active(config)
    model = _model(config, measured, active)
    with bar("compare") as progress:
        vector = _parameters(config, measured, model, active, progress)
        predicted = model.predict(records, active, vector[None])[0]
        found = compare(
            records,
            predicted,
            scale=model.scale,
            error_unit=model.error_unit,
            wording=CAST_WORDING,
        )
    plain = {
        "rig": measured.rig,
        "measurements": str(config.measurements),
        "model": _called(config, active),
        "overrides": typed("simulator"),
        "notes": [f"{measured.notice[0].upper()}{measured.notice[1:]}."] if measured.notice else [],
        **found.as_dict(),
    }
    folder = output_folder(config.output)
    write_text(folder / "comparison.json", json.dumps(plain, ensure_ascii=False, allow_nan=False))
    write_text(folder / "index.html", comparison_page(plain))
    _say(found, folder)


def _active(config: DictConfig) -> list[str]:
    """Return the names of the effects that act: those of the tuned simulator, if one is given."""
    return list(config.effects) if config.tuned is None else read_effects(Path(config.tuned))


def _model(config: DictConfig, measured: MeasurementSet, active: Sequence[str]) -> CastModel:
    def make_simulator(effects: Sequence[Effect]) -> Simulator:
        return instantiate(config.simulator.model, cable=measured.cable, effects=list(effects))

    return CastModel(measured, make_simulator, build_effects(active))


def _parameters(
    config: DictConfig,
    measured: MeasurementSet,
    model: CastModel,
    active: Sequence[str],
    progress: Callable[..., None],
) -> np.ndarray:
    """Return all parameters, the effects' last, (n,): those given, or those that fit the set."""
    if config.tuned is not None:
        _, values = read_values(Path(config.tuned))
        effects = [model.effects[name] for name in active]
        return vector_of((*model.parameters, *parameters_of(effects)), values)
    records = cast_records(measured)
    case = Case(model, records, (), rule=instantiate(config.diagnosis.rule))
    _, noise_m = floor_and_noise(case)

    def simulated(done: int, total: int, note: str = "") -> None:
        # nobody knows how many casts a fit will take
        progress(done, total or None, "simulated casts")

    inquiry = Inquiry(model, records, noise_m, simulated)
    effort = instantiate(config.diagnosis.effort, base=ITERATIONS)
    fit = fit_base(inquiry, active, effort).fit
    return inquiry.values(active, fit.vector)[0]


def _called(config: DictConfig, active: Sequence[str]) -> str:
    """Say what predicted."""
    effects = f" with {', '.join(effect_name(name) for name in active)}" if active else ""
    tuned = "tuned to these casts" if config.tuned is None else f"tuned in {config.tuned}"
    return f"the {config.simulator.name} simulator{effects}, {tuned}"


def _say(found: Comparison, folder: Path) -> None:
    floor = found.repeats.sample_percent
    noise = "unknown" if floor is None else f"{floor:.2f} %"
    console.print(
        f"{folder}: {found.waypoint_error_percent:.2f} % average waypoint, "
        f"{found.final_error_percent:.2f} % median final error, noise floor {noise}, "
        f"{found.error_unit.removeprefix('% ')}; open {folder / 'index.html'}",
        markup=False,
    )
    for finding in found.findings:
        console.print(f"- {finding.sentence}", markup=False)


if __name__ == "__main__":
    stage(compare_stage)()
