"""Learn which physical effect a simulator lacks on a set of measured casts.

python stages/diagnose.py measurements=DIR output=DIR [effects=[…]] [exclude=[…]]
"""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from effects import build_effects, build_fields, known_effects
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage

from robotcast.cast_model.model import CastModel
from robotcast.cast_model.records import cast_records
from robotcast.cast_model.wording import CAST_WORDING
from robotcast.diagnosis import report
from robotcast.diagnosis.compare import compare
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.search import Effort, Found, search
from robotcast.diagnosis.unexplained import Unexplained, look_for_the_unknown, strengths
from robotcast.effects.effect import Effect
from robotcast.effects.fields import PlaceField
from robotcast.files import write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.noise_floor import noise_floor
from robotcast.measurements.reader import read_measurement_set
from robotcast.reporting.diagnosis.page import diagnosis_page
from robotcast.simulators.simulator import Simulator


def diagnose(config: DictConfig) -> None:
    for name in ("measurements", "output"):
        if config[name] is None:
            raise ValueError(f"{name}=DIR is needed")
    measured = read_measurement_set(Path(config.measurements))
    if measured.notice:
        console.print(measured.notice, style="yellow", markup=False)
    model, candidates = _model(config, measured)
    records, floor = cast_records(measured), noise_floor(measured).waypoint_percent
    started, folder = time.monotonic(), output_folder(config.output)
    fixed = tuple(config.effects)

    with bar("diagnose") as progress:
        doing = ""

        def simulated(done: int, total: int, note: str = "") -> None:
            progress(done, None, doing)

        noise = None if floor is None else floor / 100 * model.scale
        inquiry = Inquiry(model, records, noise, simulated)

        def show(found: Found, note: str, left: Unexplained | None = None) -> dict[str, Any]:
            nonlocal doing
            doing = note
            plain = _facts(config, measured, floor) | _said(inquiry, found, len(fixed), left)
            plain |= {
                "simulated_casts": inquiry.simulated,
                "seconds": round(time.monotonic() - started, 1),
                "finished": not note,
                "doing": note,
            }
            _write(folder, plain)
            return plain

        effort = Effort(seed=config.seed)
        found = search(inquiry, candidates, fixed, floor, effort, show)
        fields = [name for name, e in model.effects.items() if e.depends_on is not None]
        left = look_for_the_unknown(
            inquiry, found.ladder[-1], fields, floor, effort, lambda note: show(found, note)
        )
        said = show(found, "", left)
    console.print(f"{folder}: {said['sentence']}", markup=False)
    console.print(f"open {folder / 'index.html'}", markup=False)


def _model(config: DictConfig, measured: MeasurementSet) -> tuple[CastModel, list[str]]:
    """Return the model and the names of the effects to try."""

    def make_simulator(effects: Sequence[Effect]) -> Simulator:
        return instantiate(config.simulator.model, cable=measured.cable, effects=list(effects))

    tuned = getattr(make_simulator(()), "tunes", ())
    left_out = {*config.exclude, *config.effects, *tuned}
    build_effects((*config.effects, *config.exclude))  # a name that nobody knows is refused here
    candidates = [name for name in known_effects() if name not in left_out]
    effects = (*build_effects((*config.effects, *candidates)), *build_fields())
    return CastModel(measured, make_simulator, effects), candidates


def _facts(config: DictConfig, measured: MeasurementSet, floor: float | None) -> dict[str, Any]:
    notes = [] if measured.notice is None else [measured.notice]
    if floor is None:
        notes.append("No action was repeated, so the noise floor is unknown.")
    return {
        "rig": measured.rig,
        "measurements": str(config.measurements),
        "output": str(config.output),
        "casts": len(measured.trials),
        "actions": len({trial.action_id for trial in measured.trials}),
        "error_unit": CastModel.error_unit,
        "noise_floor_percent": floor,
        "notes": notes,
        "next_actions": [],
    }


def _said(inquiry: Inquiry, found: Found, n_fixed: int, left: Unexplained | None) -> dict[str, Any]:
    named = report.verdict(found, n_fixed, left)
    known = bool(found.ladder)
    return {
        "verdict": named if known else [],
        "sentence": report.sentence(inquiry, found, named, left) if known else "",
        "confusion_set": report.confusion_set(found),
        "unexplained": _unexplained(inquiry, left) if left else None,
        "ladder": report.ladder(found),
        "ranking": report.ranking(inquiry, found),
        "base": {},
        "comparison": _comparison(inquiry, found) if known else None,
    }


def _comparison(inquiry: Inquiry, found: Found) -> dict[str, Any]:
    base, model = found.ladder[0].revision, inquiry.model
    difference = inquiry.difference_of(base.fit.residual, inquiry.everything)
    predicted = np.full_like(difference, np.nan)
    for row, record, miss in zip(predicted, inquiry.records, difference, strict=True):
        k = len(record.times_s)
        row[:k] = record.measured + miss[:k]
    return compare(
        inquiry.records,
        predicted,
        scale=model.scale,
        error_unit=model.error_unit,
        wording=CAST_WORDING,
    ).as_dict()


def _unexplained(inquiry: Inquiry, left: Unexplained) -> dict[str, Any]:
    field = inquiry.model.effects[left.field]
    plain: dict[str, Any] = {
        "depends_on": field.depends_on,
        "text": f"What is missing acts like {field.text}.",
        "heldout_waypoint_error_percent": float(left.rung.errors.waypoint.mean()),
        "field": None,
    }
    if isinstance(field, PlaceField):
        x, y = np.meshgrid(np.linspace(0.4, 1.3, 10), np.linspace(-0.8, 0.8, 13))
        points = np.stack([x.ravel(), y.ravel()], axis=1)
        values = field.at(points, strengths(inquiry, left))
        plain["field"] = {
            "acts_on": "the endpoint" if field.endpoint else "the whole cable",
            "axes": ["x [m]", "y [m]"],
            "unit": "m/s²",
            "points": points.round(3).tolist(),
            "values": values.round(3).tolist(),
        }
    return plain


def _write(folder: Path, plain: dict[str, Any]) -> None:
    text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1)
    write_text(folder / "diagnosis.json", text)
    write_text(folder / "index.html", diagnosis_page(plain))


if __name__ == "__main__":
    stage(diagnose)()
