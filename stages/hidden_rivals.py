"""Let cruder methods name what the sets of the hidden-effect benchmark hide.

A random guess, the largest raw sensitivity and, on `hidden_effects.brute_force` cases, a refit
of every effect. What stands is not done again. No answer is opened.
"""

import json
import time
from pathlib import Path
from typing import Any

from hidden_inquiry import Question, open_question
from omegaconf import DictConfig
from stage import bar, console, stage

from robotcast.diagnosis.search import Rung
from robotcast.files import write_text
from robotcast.hidden_effects.layout import measured_sets, rivals_path
from robotcast.hidden_effects.rivals.brute_force import brute_force
from robotcast.hidden_effects.rivals.guess import random_guess
from robotcast.hidden_effects.rivals.refitting import judged_base
from robotcast.hidden_effects.rivals.sensitivity import raw_sensitivities
from robotcast.progress import Progress


def hidden_rivals(config: DictConfig) -> None:
    settings = config.hidden_effects
    reports = Path(settings.reports)
    sets = measured_sets(Path(settings.folder), settings.cases)
    with bar("rivals") as progress:
        for done, measurements in enumerate(sets):
            path = rivals_path(measurements.name, reports)
            forced = measurements.name in settings.brute_force
            if not _finished(path, forced):
                _name_effects(config, measurements, path, forced, _noted(progress, done, sets))
        progress(len(sets), len(sets))
    console.print(f"{reports}: {len(sets)} sets")


def _noted(progress: Progress, at: int, sets: list[Path]) -> Progress:
    """Return a progress that stays at one of the sets and notes what it has simulated."""

    def noted(done: int, total: int, note: str = "") -> None:
        progress(at, len(sets), f"{sets[at].name}: {note or f'{done} casts'}")

    return noted


def _finished(path: Path, forced: bool) -> bool:
    if not path.exists():
        return False
    return not forced or json.loads(path.read_text(encoding="utf-8"))["brute_force"] is not None


def _name_effects(
    config: DictConfig, measurements: Path, path: Path, forced: bool, progress: Progress
) -> None:
    question = open_question(config, measurements, progress)
    inquiry = question.inquiry
    base = judged_base(inquiry, question.effort)
    fitted = inquiry.simulated
    moved = raw_sensitivities(inquiry, base.revision, question.candidates)
    said = {
        "random": random_guess(measurements.name, question.candidates, config.seed),
        "largest_sensitivity": max(moved, key=lambda name: moved[name]),
        "moved_noise": moved,
        "brute_force": _forced(question, base, fitted, progress) if forced else None,
    }
    write_text(path, json.dumps(said, indent=1))


def _forced(question: Question, base: Rung, base_casts: int, progress: Progress) -> dict[str, Any]:
    inquiry, started = question.inquiry, time.monotonic()
    before = inquiry.simulated
    found = brute_force(
        inquiry,
        base,
        question.candidates,
        question.floor,
        question.effort,
        lambda name: progress(inquiry.simulated, 0, f"refitting with {name}"),
    )
    return {
        "effect": found.effect,
        "heldout_waypoint_error_percent": found.percent,
        "p_value": found.p_value,
        "tried": dict(found.tried),
        "simulated_casts": base_casts + inquiry.simulated - before,
        "seconds": round(time.monotonic() - started, 1),
    }


if __name__ == "__main__":
    stage(hidden_rivals)()
