"""Let other methods name what the sets of the hidden-effect benchmark hide.

A random guess, the largest raw sensitivity and, on `hidden_effects.brute_force` cases, refits of
every effect in turn read a set alone. Once they have spoken, the oracle opens its answer and fits
the model with what is hidden; cases that hide nothing, or something that the library has no name
for, have none. All start from one fit of the model as it is. What stands is not done again.
"""

import json
import time
from pathlib import Path
from typing import Any

from hidden_inquiry import Question, open_question
from omegaconf import DictConfig
from stage import bar, console, stage

from robotcast.diagnosis.selection import Rung
from robotcast.diagnosis.sizes import sizes
from robotcast.files import write_text
from robotcast.hidden_effects.layout import answer_path, measured_sets, oracle_path, rivals_path
from robotcast.hidden_effects.outcome import Truth, read_truth
from robotcast.hidden_effects.rivals.brute_force import brute_force
from robotcast.hidden_effects.rivals.guess import random_guess
from robotcast.hidden_effects.rivals.oracle import Told, told
from robotcast.hidden_effects.rivals.refitting import judged_base
from robotcast.hidden_effects.rivals.sensitivity import raw_sensitivities
from robotcast.progress import Progress


def hidden_rivals(config: DictConfig) -> None:
    settings = config.hidden_effects
    reports = Path(settings.reports)
    sets = measured_sets(Path(settings.folder), settings.cases)
    with bar("rivals") as progress:
        for done, measurements in enumerate(sets):
            if not _finished(measurements.name, settings, reports):
                _ask(config, measurements, reports, _noted(progress, done, sets))
        progress(len(sets), len(sets))
    console.print(f"{reports}: {len(sets)} sets")


def _noted(progress: Progress, at: int, sets: list[Path]) -> Progress:
    """Return a progress that stays at one of the sets and notes what it has simulated."""

    def noted(done: int, total: int, note: str = "") -> None:
        progress(at, len(sets), f"{sets[at].name}: {note or f'{done} casts'}")

    return noted


def _finished(case: str, settings: DictConfig, reports: Path) -> bool:
    return _spoken(case, settings, reports) and oracle_path(case, reports).exists()


def _spoken(case: str, settings: DictConfig, reports: Path) -> bool:
    path = rivals_path(case, reports)
    if not path.exists():
        return False
    forced = case in settings.brute_force
    return not forced or json.loads(path.read_text(encoding="utf-8"))["brute_force"] is not None


def _ask(config: DictConfig, measurements: Path, reports: Path, progress: Progress) -> None:
    """Let every method speak that has not; the answer is opened after those that guess."""
    case, settings = measurements.name, config.hidden_effects
    question = open_question(config, measurements, progress)
    base = judged_base(question.inquiry, question.effort)
    fitted = question.inquiry.simulated
    if not _spoken(case, settings, reports):
        said = _name_effects(question, base, case, config.seed)
        if case in settings.brute_force:
            said["brute_force"] = _forced(question, base, fitted, progress)
        write_text(rivals_path(case, reports), json.dumps(said, indent=1))
    truth = read_truth(answer_path(case, reports))
    known = truth.kind in ("single", "pair")
    found = _tell(question, base, fitted, truth) if known else None
    write_text(oracle_path(case, reports), json.dumps(found, indent=1))


def _name_effects(question: Question, base: Rung, case: str, seed: int) -> dict[str, Any]:
    moved = raw_sensitivities(question.inquiry, base.revision, question.candidates)
    return {
        "random": random_guess(case, question.candidates, seed),
        "largest_sensitivity": max(moved, key=lambda name: moved[name]),
        "moved_noise": moved,
        "brute_force": None,
    }


def _forced(question: Question, base: Rung, base_casts: int, progress: Progress) -> dict[str, Any]:
    inquiry, started = question.inquiry, time.monotonic()
    rounds = list(
        brute_force(
            inquiry,
            base,
            question.candidates,
            question.floor,
            question.rule,
            question.effort,
            lambda name: progress(inquiry.simulated, 0, f"refitting with {name}"),
        )
    )
    kept = rounds[-1].kept
    return {
        "effects": list(kept.revision.effects) or ["none"],
        "heldout_waypoint_error_percent": float(kept.errors.waypoint.mean()),
        "rounds": [
            {
                "best": one.best,
                "p_value": one.p_value,
                "tried": dict(one.tried),
                "simulated_casts": one.simulated,
            }
            for one in rounds
        ],
        "simulated_casts": base_casts + sum(one.simulated for one in rounds),
        "seconds": round(time.monotonic() - started, 1),
    }


def _tell(question: Question, base: Rung, base_casts: int, truth: Truth) -> dict[str, Any]:
    inquiry, effort = question.inquiry, question.effort
    before = inquiry.simulated
    found = told(inquiry, base, truth.effects, question.floor, effort)
    return {
        "effects": list(truth.effects),
        "base_heldout_waypoint_error_percent": float(found.base.errors.waypoint.mean()),
        "heldout_waypoint_error_percent": float(found.rung.errors.waypoint.mean()),
        "p_value": found.gain.p_value,
        **_sizes(question, found),
        "simulated_casts": base_casts + inquiry.simulated - before,
    }


def _sizes(question: Question, found: Told) -> dict[str, Any]:
    """Return the parameters of the base model and of what is hidden, with intervals."""
    inquiry, rung = question.inquiry, found.rung
    every = [
        (size.parameter.name, size.as_dict())
        for size in sizes(inquiry, rung.revision, rung.errors.vectors, question.rule.discrepancy)
    ]
    first = len(inquiry.model.parameters)
    plain: dict[str, Any] = {"base": {"parameters": dict(every[:first])}, "sizes": []}
    for name in rung.revision.effects:
        last = first + len(inquiry.model.effects[name].parameters)
        plain["sizes"].append({"effect": name, "parameters": dict(every[first:last])})
        first = last
    return plain


if __name__ == "__main__":
    stage(hidden_rivals)()
