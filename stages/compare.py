"""Compare a tuned simulator with measured casts: how far off is it, when, where, for which?

python stages/compare.py measurements=DIR output=DIR [tuned=DIR]
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage

from robotcast.cast_model.model import CastModel
from robotcast.cast_model.records import cast_records
from robotcast.cast_model.wording import CAST_WORDING
from robotcast.diagnosis.compare import Comparison, compare
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.revision import fit_base
from robotcast.effects.effect import Effect
from robotcast.files import write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.noise_floor import noise_floor
from robotcast.measurements.reader import read_measurement_set
from robotcast.reporting.comparison.page import comparison_page
from robotcast.simulators.simulator import Simulator
from robotcast.tuning.tuned import read_values, vector_of

ITERATIONS = 8  # of the fit, after its several starts


def compare_stage(config: DictConfig) -> None:
    for name in ("measurements", "output"):
        if config[name] is None:
            raise ValueError(f"{name}=DIR is needed")
    measured = read_measurement_set(Path(config.measurements))
    if measured.notice:
        console.print(measured.notice, style="yellow", markup=False)
    records = cast_records(measured)
    model = _model(config, measured)
    with bar("compare") as progress:
        vector, source = _parameters(config, measured, model, records, progress)
        predicted = model.predict(records, (), vector[None])[0]
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
        "model": source,
        "notes": [f"{measured.notice[0].upper()}{measured.notice[1:]}."] if measured.notice else [],
        **found.as_dict(),
    }
    folder = output_folder(config.output)
    write_text(folder / "comparison.json", json.dumps(plain, ensure_ascii=False, allow_nan=False))
    write_text(folder / "index.html", comparison_page(plain))
    _say(found, folder)


def _model(config: DictConfig, measured: MeasurementSet) -> CastModel:
    def make_simulator(effects: Sequence[Effect]) -> Simulator:
        return instantiate(config.simulator.model, cable=measured.cable, effects=list(effects))

    return CastModel(measured, make_simulator, ())


def _parameters(
    config: DictConfig,
    measured: MeasurementSet,
    model: CastModel,
    records: Sequence[Record],
    progress: Callable[..., None],
) -> tuple[np.ndarray, str]:
    """Return the model's parameters (n,), read or tuned to the set, and what to call the model."""
    name = f"the {config.simulator.name} simulator"
    if config.tuned is not None:
        _, values = read_values(Path(config.tuned))
        return vector_of(model.parameters, values), f"{name}, tuned in {config.tuned}"
    floor = noise_floor(measured).waypoint_percent
    noise_m = None if floor is None else floor / 100 * model.scale

    def simulated(done: int, total: int, note: str = "") -> None:
        # nobody knows how many casts a fit will take
        progress(done, total or None, "simulated casts")

    inquiry = Inquiry(model, records, noise_m, simulated)
    revision = fit_base(inquiry, (), config.seed, ITERATIONS)
    return inquiry.values((), revision.fit.vector)[0], f"{name}, tuned to these casts"


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
