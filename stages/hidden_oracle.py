"""Open the sealed answers of the hidden-effect benchmark and fit the model with what they hold.

Run after the sets were diagnosed. Cases that hide nothing, or something that the library has no
name for, have no oracle. What stands is not done again.
"""

import json
from pathlib import Path
from typing import Any

from hidden_inquiry import Question, open_question
from omegaconf import DictConfig
from stage import bar, console, stage

from robotcast.diagnosis.sizes import sizes
from robotcast.files import write_text
from robotcast.hidden_effects.layout import answer_path, measured_sets, oracle_path
from robotcast.hidden_effects.outcome import Truth, read_truth
from robotcast.hidden_effects.rivals.oracle import Told, told
from robotcast.hidden_effects.rivals.refitting import judged_base


def hidden_oracle(config: DictConfig) -> None:
    settings = config.hidden_effects
    reports = Path(settings.reports)
    sets = measured_sets(Path(settings.folder), settings.cases)
    with bar("oracle") as progress:
        for done, measurements in enumerate(sets):
            progress(done, len(sets), measurements.name)
            path = oracle_path(measurements.name, reports)
            truth = read_truth(answer_path(measurements.name, reports))
            if truth.kind in ("single", "pair") and not path.exists():
                write_text(path, json.dumps(_tell(config, measurements, truth), indent=1))
        progress(len(sets), len(sets))
    console.print(f"{reports}: {len(sets)} sets")


def _tell(config: DictConfig, measurements: Path, truth: Truth) -> dict[str, Any]:
    question = open_question(config, measurements)
    inquiry, effort = question.inquiry, question.effort
    base = judged_base(inquiry, effort)
    found = told(inquiry, base, truth.effects, question.floor, effort)
    return {
        "effects": list(truth.effects),
        "base_heldout_waypoint_error_percent": float(found.base.errors.waypoint.mean()),
        "heldout_waypoint_error_percent": float(found.rung.errors.waypoint.mean()),
        "p_value": found.gain.p_value,
        **_sizes(question, found),
        "simulated_casts": inquiry.simulated,
    }


def _sizes(question: Question, found: Told) -> dict[str, Any]:
    """Return the parameters of the base model and of what is hidden, with intervals."""
    inquiry, rung = question.inquiry, found.rung
    every = [
        (size.parameter.name, size.as_dict())
        for size in sizes(inquiry, rung.revision, rung.errors.vectors)
    ]
    first = len(inquiry.model.parameters)
    plain: dict[str, Any] = {"base": {"parameters": dict(every[:first])}, "sizes": []}
    for name in rung.revision.effects:
        last = first + len(inquiry.model.effects[name].parameters)
        plain["sizes"].append({"effect": name, "parameters": dict(every[first:last])})
        first = last
    return plain


if __name__ == "__main__":
    stage(hidden_oracle)()
