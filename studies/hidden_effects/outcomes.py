"""What was hidden in a case and what each method said of it: answers and JSON files together."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robotcast.files import unseal
from robotcast.rigs.virtual.hiding import MECHANISMS
from studies.hidden_effects.cases import answer_path
from studies.hidden_effects.layout import result

SIGNIFICANT = 0.001


@dataclass(frozen=True)
class Said:
    """What one method says of a case, as far as it is scored; errors are in % of cable length."""

    names: tuple[str, ...]  # effects, the likeliest first, or "none", or "unknown"
    casts: int | None = None  # simulated for it, None where a method is not charged for any
    base_percent: float | None = None  # held-out waypoint error of the model as it is
    final_percent: float | None = None  # and with what is named
    # (effect, parameter) → (low, high)
    intervals: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    p_value: float = 1.0  # of what the model gains by the oracle's effects
    confusable: frozenset[str] = frozenset()  # every effect of the diagnosis's confusion sets
    unexplained: bool = False  # whether the diagnosis says that something is left to explain
    noise_floor_percent: float | None = None
    seconds: float = 0.0
    later_casts: int = 0  # of brute force after its first round, which looks for a second effect


@dataclass(frozen=True)
class Outcome:
    """One case."""

    case: str
    kind: str  # "control", "single", "pair" or "outside"
    cable: str
    strength: str
    effects: Mapping[str, Mapping[str, float]]  # mechanism → its parameters
    shift_percent: float  # of cable length, that all that is hidden moves the paths
    said: Mapping[str, Said]  # by method; those that were not run are not there

    @property
    def diagnosis(self) -> Said | None:
        """What the diagnosis says; None while there is none or it is still at work."""
        return self.said.get("diagnosis")

    @property
    def shows(self) -> bool:
        """Whether the data can show at all what is hidden: the oracle's gain is significant."""
        return "oracle" in self.said and self.said["oracle"].p_value < SIGNIFICANT

    def sizes(self, comparable: bool = False) -> dict[tuple[str, str], float]:
        """Return true sizes by (effect, parameter), all or those of the library's own meaning."""
        return {
            (effect, name): value
            for effect, given in self.effects.items()
            if MECHANISMS[effect].same_law or not comparable
            for name, value in given.items()
            if name in MECHANISMS[effect].strengths
        }

    def held(self, method: str) -> list[bool]:
        """Tell for every comparable size whose effect a method names whether its interval holds."""
        said = self.said.get(method)
        return [
            said.intervals[key][0] <= size <= said.intervals[key][1]
            for key, size in self.sizes(comparable=True).items()
            if said and key[0] in said.names and key in said.intervals
        ]


def read_outcomes(reports: Path) -> list[Outcome]:
    """Open every answer below `reports` and read all that was said of its case."""
    answers = reports / "answers"
    sealed = sorted(answers.glob("[!.]*.sealed"))
    if not sealed:
        raise ValueError(
            f"{answers}: no sealed answers; python -m studies.hidden_effects.draw draws the cases"
        )
    return [read_outcome(path.stem, reports) for path in sealed]


def read_outcome(case: str, reports: Path) -> Outcome:
    """Open the answer of one case; read its diagnosis, its rivals and its oracle."""
    answer = unseal(answer_path(case, reports))
    effects = {one["effect"]: one["parameters"] for one in answer["effects"]}
    said: dict[str, Said] = {}
    with _read(result("diagnoses", case, reports)) as plain:
        if plain and plain.get("finished", True):
            errors = [rung["heldout_waypoint_error_percent"] for rung in plain["ladder"]]
            said["diagnosis"] = Said(
                names=tuple(plain["verdict"]),
                confusable=frozenset(name for one in plain["confusion_set"] for name in one),
                unexplained=bool(plain["unexplained"]),
                noise_floor_percent=plain["noise_floor_percent"],
                base_percent=errors[0] if errors else None,
                final_percent=errors[-1] if errors else None,
                intervals=_intervals(plain["ranking"]),
                casts=int(plain["simulated_casts"]),
                seconds=float(plain["seconds"]),
            )
    with _read(result("rivals", case, reports)) as plain:
        for method in ("random", "largest_sensitivity"):
            if plain and plain.get(method) is not None:
                said[method] = Said((plain[method],))
        if plain and (forced := plain.get("brute_force")) is not None:
            said["brute_force"] = Said(
                names=tuple(forced["effects"]),
                final_percent=float(forced["heldout_waypoint_error_percent"]),
                casts=int(forced["simulated_casts"]),
                later_casts=sum(int(one["simulated_casts"]) for one in forced["rounds"][1:]),
            )
    with _read(result("oracle", case, reports)) as plain:
        if plain is not None:  # None: not asked yet, or there is nothing to be told
            said["oracle"] = Said(
                names=tuple(effects) or ("none",),
                base_percent=float(plain["base_heldout_waypoint_error_percent"]),
                final_percent=float(plain["heldout_waypoint_error_percent"]),
                p_value=float(plain["p_value"]),
                intervals=_intervals(plain["sizes"]),
                casts=int(plain["simulated_casts"]),
            )
    drawn = {name: answer["drawn"][name] for name in ("kind", "cable", "strength")}
    return Outcome(case, **drawn, effects=effects, shift_percent=answer["shift_percent"], said=said)


def _intervals(ranking: list[Mapping[str, Any]]) -> dict[tuple[str, str], tuple[float, float]]:
    return {
        (one["effect"], name): (float(found["low"]), float(found["high"]))
        for one in ranking
        for name, found in one["parameters"].items()
        if found.get("low") is not None and found.get("high") is not None
    }


@contextmanager
def _read(path: Path) -> Iterator[dict[str, Any] | None]:
    """Read a JSON file, None where there is none; what is wrong with it names the file."""
    try:
        yield json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: is not JSON ({error})") from None
    except KeyError as error:
        raise ValueError(f"{path}: expected the key {error}") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: an entry has not the expected form ({error})") from None
