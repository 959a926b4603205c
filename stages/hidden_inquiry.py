"""Asking a set of the hidden-effect benchmark what stages/diagnose.py asks it."""

from dataclasses import dataclass
from pathlib import Path

from diagnose import case_of
from omegaconf import DictConfig

from robotcast.diagnosis.diagnose import floor_and_noise
from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.measurements.reader import read_measurement_set
from robotcast.progress import Progress, silent


@dataclass(frozen=True)
class Question:
    """A set beside the configured simulator.

    Attributes
    ----------
    candidates : names of the effects to try.
    """

    inquiry: Inquiry
    candidates: tuple[str, ...]
    floor: Floor
    rule: Rule
    effort: Effort


def open_question(config: DictConfig, measurements: Path, progress: Progress = silent) -> Question:
    """Put the simulator beside the set in the folder `measurements`."""
    measured = read_measurement_set(measurements)
    case = case_of(config, measured)
    floor, noise = floor_and_noise(case)
    inquiry = Inquiry(case.model, case.records, noise, progress)
    return Question(inquiry, tuple(case.candidates), floor, case.rule, case.effort)
