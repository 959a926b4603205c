"""The configured simulator beside a measurement set: where does it fail?"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.build import build_effects, build_simulator
from robotcast.cast_model import CAST_WORDING, CastModel, cast_records
from robotcast.diagnosis.compare import compare
from robotcast.diagnosis.diagnose import Case, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry, fit_base
from robotcast.effects.effect import parameters_of
from robotcast.reporting.names import effect_name
from robotcast.running import Progress
from robotcast.stage import as_note, bar, measured_set, typed
from robotcast.tuning.tuned import read_tuned, vector_of

ITERATIONS = 8  # of the fit, after its several starts


def compare_model(config: DictConfig) -> dict[str, Any]:
    """Compare the simulator in `tuned`, or one that is fitted to the set first, with the set.

    Returns the comparison as its page takes it, with where both come from.
    """
    measured = measured_set(config.measurements)
    records, tuned = cast_records(measured), config.tuned
    _, active, values = read_tuned(Path(tuned)) if tuned else (None, list(config.effects), {})
    model = CastModel(
        measured, partial(build_simulator, config, measured.cable), build_effects(active)
    )
    with bar("compare") as progress:
        if tuned is None:
            case = Case(model, records, (), rule=instantiate(config.diagnosis.rule))
            vector = _fitted(config, case, active, progress)
        else:
            parameters = parameters_of([model.effects[name] for name in active])
            vector = vector_of((*model.parameters, *parameters), values)
        predicted = model.predict(records, active, vector[None])[0]
        found = compare(model, records, predicted, CAST_WORDING)
    effects = f" with {', '.join(effect_name(name) for name in active)}" if active else ""
    of = "tuned to these casts" if tuned is None else f"tuned in {tuned}"
    return {
        "rig": measured.rig,
        "measurements": str(config.measurements),
        "model": f"the {config.simulator.name} simulator{effects}, {of}",
        "overrides": typed("simulator"),
        "notes": [as_note(notice) for notice in measured.notices],
        **found.as_dict(),
    }


def _fitted(
    config: DictConfig, case: Case, active: Sequence[str], progress: Progress
) -> np.ndarray:
    """Return all parameters, the effects' last, (n,), that fit the set."""
    inquiry = Inquiry(
        case.model,
        case.records,
        floor_and_noise(case)[1],
        # nobody knows how many casts a fit will take
        lambda done, total, note="": progress(done, total, "simulated casts"),
    )
    effort = instantiate(config.diagnosis.effort, base=ITERATIONS)
    return inquiry.values(active, fit_base(inquiry, active, effort).fit.vector)[0]
