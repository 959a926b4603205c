"""A tuned simulator on disk: its parameters, how well it does, and how it was found."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.files import atomic_file, write_text
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import PredictionErrors
from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.tuning.certainty import Certainty
from robotcast.tuning.search import Batch

ILL_CONDITIONED = 1000.0  # condition number of the Jacobian
AT_BOUND = 0.01  # of a parameter's range: closer to a bound than this is on it


@dataclass(frozen=True)
class Tuned:
    """A simulator's parameters as tuning left them.

    Attributes
    ----------
    effects : names of the effects that act in the simulator.
    values : parameter name → value, frozen ones and those of the effects included.
    errors : "tune" and "test" → errors on these casts.
    certainty : None where the budget was too small for it.
    improved : whether the search went on to anything better than what it tried first.
    simulated_casts, diverged_casts : of the search.
    """

    simulator: str
    optimizer: str
    effects: tuple[str, ...]
    seed: int
    rig: str
    cable: Cable
    r0_m: float
    period_s: float
    parameters: tuple[Parameter, ...]
    values: Mapping[str, float]
    errors: Mapping[str, PredictionErrors]
    certainty: Certainty | None
    improved: bool
    simulated_casts: int
    diverged_casts: int

    def at_bound(self, parameter: Parameter) -> bool:
        """Tell whether a free parameter ended on one of its bounds."""
        unit = float(parameter.to_unit(np.asarray(self.values[parameter.name])))
        return not parameter.frozen and not AT_BOUND < unit < 1 - AT_BOUND

    def warnings(self) -> list[str]:
        """Return what a user should know before trusting the parameters, a sentence each."""
        found = [
            f"{p.name} ended on a bound: {self.values[p.name]:.3g} "
            f"in [{p.lower:.3g}, {p.upper:.3g}] {p.unit}"
            for p in self.parameters
            if self.at_bound(p)
        ]
        if not self.improved:
            found.append(
                f"in {self.simulated_casts} simulated casts the search found nothing better than "
                "what it tried first: raise optimizer.budget_casts"
            )
        found += _doubts(self.certainty)
        lost = sum(errors.n_diverged for errors in self.errors.values())
        if lost:
            found.append(f"{lost} of the final runs diverged and count with one cable length")
        return found


def _doubts(known: Certainty | None) -> Iterator[str]:
    """Yield what the casts do not tell, a sentence each."""
    if known is None:
        yield "the budget was too small to say how well the casts tell the parameters"
        return
    if known.vague:
        yield f"these casts hardly tell {', '.join(known.vague)}"
    if known.condition > ILL_CONDITIONED:
        yield (
            f"the condition number is {known.condition:.0f}; the direction that these "
            f"casts tell least is {', '.join(known.least_known)}"
        )


def write_tuned(folder: Path, tuned: Tuned) -> None:
    """Write `tuned.yaml`."""
    plain = {
        "simulator": tuned.simulator,
        "optimizer": tuned.optimizer,
        "effects": list(tuned.effects),
        "seed": tuned.seed,
        "rig": tuned.rig,
        "cable": asdict(tuned.cable),
        "r0_m": tuned.r0_m,
        "period_s": tuned.period_s,
        "parameters": {p.name: _plain_parameter(tuned, p) for p in tuned.parameters},
        **({"certainty": _plain_certainty(tuned.certainty)} if tuned.certainty else {}),
        "warnings": tuned.warnings(),
        "errors": {split: asdict(errors) for split, errors in tuned.errors.items()},
        "simulated_casts": tuned.simulated_casts,
        "diverged_casts": tuned.diverged_casts,
    }
    write_text(folder / "tuned.yaml", yaml.safe_dump(plain, sort_keys=False, allow_unicode=True))


def _plain_certainty(known: Certainty) -> dict[str, Any]:
    return {
        "condition": known.condition,
        "least_known": list(known.least_known),
        "vague": list(known.vague),
        "simulated_casts": known.casts,
    }


def _plain_parameter(tuned: Tuned, parameter: Parameter) -> dict[str, Any]:
    intervals = tuned.certainty.intervals if tuned.certainty else {}
    low, high = intervals.get(parameter.name, (None, None))
    return {
        "value": float(tuned.values[parameter.name]),
        "low": low,
        "high": high,
        "unit": parameter.unit,
        "lower": parameter.lower,
        "upper": parameter.upper,
        "frozen": parameter.frozen,
        "at_bound": tuned.at_bound(parameter),
    }


def read_values(folder: Path) -> tuple[Cable, dict[str, float]]:
    """Return the cable and the parameter values of a tuned simulator."""
    plain = _read(folder)
    values = {name: numbers["value"] for name, numbers in plain["parameters"].items()}
    return Cable(**plain["cable"]), values


def read_effects(folder: Path) -> list[str]:
    """Return the names of the effects that act in a tuned simulator, in order."""
    return _read(folder).get("effects", [])


def _read(folder: Path) -> dict[str, Any]:
    path = folder / "tuned.yaml"
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: run the tune stage first")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def vector_of(parameters: Sequence[Parameter], values: Mapping[str, float]) -> np.ndarray:
    """Return values as a vector (n_parameters,) in the order of `parameters`."""
    missing = [p.name for p in parameters if p.name not in values]
    if missing:
        raise ValueError(f"the tuned simulator has no value for {', '.join(missing)}")
    return np.array([values[p.name] for p in parameters])


def write_trace(folder: Path, trace: Sequence[Batch]) -> None:
    """Write `trace.csv`: one row a batch."""
    table = pl.DataFrame(
        {
            "batch": range(len(trace)),
            "simulated_casts": np.cumsum([batch.casts for batch in trace]),
            "best_percent": [batch.best_percent for batch in trace],
            "median_percent": [batch.median_percent for batch in trace],
            "diverged": [batch.diverged for batch in trace],
        }
    )
    with atomic_file(folder / "trace.csv") as temporary:
        table.write_csv(temporary)


def write_predictions(
    folder: Path, predicted: Mapping[str, tuple[Sequence[Trial], np.ndarray]]
) -> None:
    """Write `predictions.parquet`: measured and predicted waypoints, by split.

    `predicted` maps a split's name to its trials and waypoints of shape (n_trials, k_max, 2).
    """
    rows = [
        (split, trial.trial, t, *measured, *simulated)
        for split, (trials, waypoints_m) in predicted.items()
        for trial, path in zip(trials, waypoints_m, strict=True)
        for t, measured, simulated in zip(
            trial.waypoints_s.tolist(), trial.waypoints_m.tolist(), path.tolist(), strict=False
        )
    ]
    columns = ["split", "trial", "t", "x", "y", "x_predicted", "y_predicted"]
    with atomic_file(folder / "predictions.parquet") as temporary:
        pl.DataFrame(rows, schema=columns, orient="row").write_parquet(temporary)
