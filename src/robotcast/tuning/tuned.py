"""A tuned simulator on disk: its parameters, how well it does, and how it was found."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

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
    """A simulator's parameters as tuning left them, with the effects that act in it.

    Attributes
    ----------
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

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know before trusting the parameters, a sentence each."""
        for p in filter(self.at_bound, self.parameters):
            value, ends = self.values[p.name], f"[{p.lower:.3g}, {p.upper:.3g}]"
            yield f"{p.name} ended on a bound: {value:.3g} in {ends} {p.unit}"
        if not self.improved:
            yield (
                f"in {self.simulated_casts} simulated casts the search found nothing better than "
                "what it tried first: raise optimizer.budget_casts"
            )
        known = self.certainty
        if known is None:
            yield "the budget was too small to say how well the casts tell the parameters"
        elif known.vague:
            yield f"these casts hardly tell {', '.join(known.vague)}"
        if known and known.condition > ILL_CONDITIONED:
            yield (
                f"the condition number is {known.condition:.0f}; the direction that these "
                f"casts tell least is {', '.join(known.least_known)}"
            )
        lost = sum(errors.n_diverged for errors in self.errors.values())
        if lost:
            yield f"{lost} of the final runs diverged and count with one cable length"


def write_tuned(folder: Path, tuned: Tuned) -> None:
    """Write `tuned.yaml`."""
    plain = asdict(tuned)
    values, known = plain.pop("values"), plain.pop("certainty")
    intervals = known.pop("intervals") if known else {}
    plain["parameters"] = {
        p.name: {
            "value": float(values[p.name]),
            **dict(zip(("low", "high"), intervals.get(p.name, (None, None)), strict=True)),
            "unit": p.unit,
            "lower": p.lower,
            "upper": p.upper,
            "frozen": p.frozen,
            "at_bound": tuned.at_bound(p),
        }
        for p in tuned.parameters
    }
    plain |= {"certainty": known} if known else {}
    plain["warnings"] = list(tuned.warnings())
    write_text(folder / "tuned.yaml", yaml.safe_dump(plain, sort_keys=False, allow_unicode=True))


def read_tuned(folder: Path) -> tuple[Cable, list[str], dict[str, float]]:
    """Return a tuned simulator's cable, the effects that act in it, in order, and its values."""
    path = folder / "tuned.yaml"
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: run the tune stage first")
    plain = yaml.safe_load(path.read_text(encoding="utf-8"))
    values = {name: numbers["value"] for name, numbers in plain["parameters"].items()}
    return Cable(**plain["cable"]), plain.get("effects", []), values


def vector_of(parameters: Sequence[Parameter], values: Mapping[str, float]) -> np.ndarray:
    """Return values as a vector (n_parameters,) in the order of `parameters`."""
    missing = [p.name for p in parameters if p.name not in values]
    if missing:
        raise ValueError(f"the tuned simulator has no value for {', '.join(missing)}")
    return np.array([values[p.name] for p in parameters])


def write_trace(folder: Path, trace: Sequence[Batch]) -> None:
    """Write `trace.csv`: one row a batch."""
    table = pl.DataFrame(list(map(asdict, trace))).with_row_index("batch")
    table = table.with_columns(pl.col("casts").cum_sum()).rename({"casts": "simulated_casts"})
    with atomic_file(folder / "trace.csv") as temporary:
        table.write_csv(temporary)


def write_predictions(
    folder: Path, predicted: Mapping[str, tuple[Sequence[Trial], np.ndarray]]
) -> None:
    """Write `predictions.parquet`: by split, its trials and waypoints (n_trials, k_max, 2) [m]."""
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
