"""What was hidden in a case, and what was said about it: answers and JSON files, read together."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robotcast.hidden_effects.layout import (
    answer_path,
    answers_folder,
    diagnosis_path,
    oracle_path,
    rivals_path,
)
from robotcast.hidden_effects.mechanisms import MECHANISMS
from robotcast.hidden_effects.seal import unseal

SIGNIFICANT = 0.001

Intervals = Mapping[tuple[str, str], tuple[float, float]]
"""(effect, parameter) → (low, high)."""


@dataclass(frozen=True)
class Truth:
    """What a sealed answer holds.

    Attributes
    ----------
    kind : "control", "single", "pair" or "outside".
    effects : mechanism → its parameters.
    shift_percent : how far all that is hidden moves the paths, in % of cable length.
    """

    kind: str
    cable: str
    strength: str
    effects: Mapping[str, Mapping[str, float]]
    shift_percent: float

    @property
    def sizes(self) -> dict[tuple[str, str], float]:
        """(effect, parameter) → the true size, of parameters that say how strong it is."""
        return {
            (effect, name): value
            for effect, given in self.effects.items()
            for name, value in given.items()
            if name in MECHANISMS[effect].strengths
        }

    @property
    def comparable_sizes(self) -> dict[tuple[str, str], float]:
        """Those sizes that mean in the library what they mean on the rig."""
        return {key: size for key, size in self.sizes.items() if MECHANISMS[key[0]].same_law}


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis.json says, as far as it is scored.

    Attributes
    ----------
    verdict : effect ids, or "none", or "unknown".
    confusable : every effect of its confusion sets.
    unexplained : whether it says that something is left to explain.
    base_percent, final_percent : held-out waypoint error of the ladder's first and last rung.
    """

    verdict: tuple[str, ...]
    confusable: frozenset[str]
    unexplained: bool
    noise_floor_percent: float | None
    base_percent: float | None
    final_percent: float | None
    intervals: Intervals
    simulated_casts: int
    seconds: float


@dataclass(frozen=True)
class Oracle:
    """A refit that is told what is hidden.

    Attributes
    ----------
    base_percent, final_percent : held-out waypoint error without and with what is hidden.
    p_value : of that saving.
    intervals : of the sizes of what is hidden.
    """

    base_percent: float
    final_percent: float
    p_value: float
    intervals: Intervals
    simulated_casts: int

    @property
    def significant(self) -> bool:
        """Whether the data can show at all what is hidden."""
        return self.p_value < SIGNIFICANT

    @property
    def drop_percent(self) -> float:
        """By how much knowing the truth lowers the held-out waypoint error."""
        return self.base_percent - self.final_percent


@dataclass(frozen=True)
class BruteForce:
    """Refits with every effect in turn, round by round, with all the casts they cost.

    Attributes
    ----------
    effects : those kept, or ("none",).
    later_casts : simulated after the first round, to see whether another effect pays as well.
    """

    effects: tuple[str, ...]
    final_percent: float
    simulated_casts: int
    later_casts: int


@dataclass(frozen=True)
class Outcome:
    """One case; what was not run is None.

    Attributes
    ----------
    random, largest_sensitivity : what those two methods name.
    """

    case: str
    truth: Truth
    diagnosis: Diagnosis | None = None
    random: str | None = None
    largest_sensitivity: str | None = None
    brute_force: BruteForce | None = None
    oracle: Oracle | None = None

    @property
    def shows(self) -> bool:
        """Whether the oracle's gain is significant."""
        return self.oracle is not None and self.oracle.significant


def read_outcomes(reports: Path) -> list[Outcome]:
    """Open every answer below `reports` and read all that was said of its case."""
    answers = answers_folder(reports)
    sealed = sorted(answers.glob("[!.]*.sealed"))
    if not sealed:
        raise ValueError(f"{answers}: no sealed answers; stages/hidden_draw.py draws the cases")
    return [read_outcome(path.stem, reports) for path in sealed]


def read_outcome(case: str, reports: Path) -> Outcome:
    """Open the answer of one case; read its diagnosis, its rivals and its oracle."""
    rivals = rivals_path(case, reports)
    said = _read(rivals) or {}
    with _named(rivals):
        return Outcome(
            case=case,
            truth=read_truth(answer_path(case, reports)),
            diagnosis=_diagnosis(diagnosis_path(case, reports)),
            random=said.get("random"),
            largest_sensitivity=said.get("largest_sensitivity"),
            brute_force=_brute_force(said.get("brute_force")),
            oracle=_oracle(oracle_path(case, reports)),
        )


def read_truth(path: Path) -> Truth:
    """Open a sealed answer."""
    answer = unseal(path)
    drawn = answer["drawn"]
    return Truth(
        kind=drawn["kind"],
        cable=drawn["cable"],
        strength=drawn["strength"],
        effects={one["effect"]: one["parameters"] for one in answer["effects"]},
        shift_percent=answer["shift_percent"],
    )


def _diagnosis(path: Path) -> Diagnosis | None:
    """Read a diagnosis, None while there is none or it is still at work."""
    said = _read(path)
    if not said or not said.get("finished", True):
        return None
    with _named(path):
        rungs = [rung["heldout_waypoint_error_percent"] for rung in said["ladder"]]
        return Diagnosis(
            verdict=tuple(said["verdict"]),
            confusable=frozenset(name for one in said["confusion_set"] for name in one),
            unexplained=bool(said["unexplained"]),
            noise_floor_percent=said["noise_floor_percent"],
            base_percent=rungs[0] if rungs else None,
            final_percent=rungs[-1] if rungs else None,
            intervals=_intervals(said["ranking"]),
            simulated_casts=int(said["simulated_casts"]),
            seconds=float(said["seconds"]),
        )


def _brute_force(said: Mapping[str, Any] | None) -> BruteForce | None:
    if said is None:
        return None
    return BruteForce(
        effects=tuple(said["effects"]),
        final_percent=float(said["heldout_waypoint_error_percent"]),
        simulated_casts=int(said["simulated_casts"]),
        later_casts=sum(int(one["simulated_casts"]) for one in said["rounds"][1:]),
    )


def _oracle(path: Path) -> Oracle | None:
    said = _read(path)
    if said is None:  # not asked yet, or there is nothing to be told
        return None
    with _named(path):
        return Oracle(
            base_percent=float(said["base_heldout_waypoint_error_percent"]),
            final_percent=float(said["heldout_waypoint_error_percent"]),
            p_value=float(said["p_value"]),
            intervals=_intervals(said["sizes"]),
            simulated_casts=int(said["simulated_casts"]),
        )


def _intervals(ranking: list[Mapping[str, Any]]) -> Intervals:
    return {
        (one["effect"], name): (float(found["low"]), float(found["high"]))
        for one in ranking
        for name, found in one["parameters"].items()
        if found.get("low") is not None and found.get("high") is not None
    }


def _read(path: Path) -> dict[str, Any] | None:
    if not path.exists():
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: is not JSON ({error})") from None


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Turn a missing key or a wrong type in a JSON file into a sentence that names the file."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{path}: expected the key {error}") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: an entry has not the expected form ({error})") from None
