"""A tuned simulator on disk, and the revisions of the model that were tuned on a cable's casts.

A revision, a rung of the cable's error ladder, is written twice: to `revision.json` in the tuned
folder, and to the ledger `revisions.jsonl` beside the tuned folders, which remembers those that a
later tuning has replaced. The ledger is no output of a DVC stage, since DVC deletes outputs before
a rerun and the cells of one cable share it. The same revisions make the same bytes, whichever was
tuned first.
"""

import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.files import atomic_file, digest, write_text
from robotcast.fitting import least_squares
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import PredictionErrors
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from robotcast.tuning.search import Batch, Objective, Problem, Query, residuals_at

ILL_CONDITIONED = 1000.0  # condition number of the Jacobian
AT_BOUND = 0.01  # of a parameter's range: closer to a bound than this is on it


STANDARD_ERRORS = 2.0  # on either side of a value
VAGUE = 0.5  # of a parameter's range: an interval wider than that says little
MOST = 1e6  # a larger condition number tells no more
TAKES_PART = 0.3  # share of a direction from which on a parameter belongs to it


@dataclass(frozen=True)
class Certainty:
    """What a Jacobian at the optimum says of the tuned parameters.

    Its condition number over the ranges, at most `MOST`, is by how much better the casts tell the
    best-known direction than the worst. Several parameters of the worst direction are told only in
    combination.
    """

    intervals: Mapping[str, tuple[float, float]]  # two standard errors to a side, inside the bounds
    vague: tuple[str, ...]  # names whose interval covers more than half of their range
    condition: float
    least_known: tuple[str, ...]  # the parameters of the worst direction
    simulated_casts: int


def certainty_casts(problem: Problem) -> int:
    """Return how many casts `certainty` simulates."""
    return 2 * (2 * len(problem.parameters) + 1) * problem.casts


def certainty(
    objective: Objective, problem: Problem, vector: np.ndarray, groups: np.ndarray
) -> Certainty:
    """Differentiate every waypoint at a unit vector (n_free,), in two queries.

    The first takes a step in each parameter; the second one along each axis of the curvature that
    the first showed, as long as moves the casts by about the noise. A standard error is the larger
    of two: the sandwich estimator with `groups` as clusters, the actions of the casts (n_casts,)
    numbered from 0, which sees what the model misses, and the one that takes each cast for one
    measurement, which does not trust a few that agree.
    """
    coarse = _about(vector, np.diag(least_squares.difference_steps(problem.parameters)))
    residuals = residuals_at(objective, Query(coarse)) / problem.noise_percent
    fit = least_squares.Fit(vector, residuals[0], least_squares.slopes(coarse, residuals))
    fine = _about(vector, least_squares.noise_axes(fit, np.ones(len(vector), dtype=bool)))
    residuals = residuals_at(objective, Query(fine)) / problem.noise_percent
    fit = least_squares.Fit(vector, residuals[0], least_squares.steady_slopes(fine, residuals))
    inverse = least_squares.bread(fit, np.array([p.prior_sd for p in problem.parameters]))
    error = np.maximum(least_squares.sandwich(fit, inverse, groups), np.sqrt(np.diag(inverse)))
    ends = np.clip(vector + STANDARD_ERRORS * error * np.array([[-1.0], [1.0]]), 0.0, 1.0)
    values, axes = np.linalg.eigh(least_squares.curvature(fit))
    least, most = max(float(values[0]), 0.0), float(values[-1])
    names = np.array([p.name for p in problem.parameters])
    return Certainty(
        intervals={
            p.name: (float(p.from_unit(low)), float(p.from_unit(high)))
            for p, low, high in zip(problem.parameters, *ends, strict=True)
        },
        vague=tuple(names[2 * STANDARD_ERRORS * error > VAGUE].tolist()),
        condition=float(np.sqrt(most / least)) if least * MOST**2 > most else MOST,
        least_known=tuple(names[axes[:, 0] ** 2 > TAKES_PART**2].tolist()),
        simulated_casts=(len(coarse) + len(fine)) * problem.casts,
    )


def _about(vector: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the vector and those a step (n_steps, n) to either side of it, inside the bounds."""
    return np.clip(np.vstack([vector, vector + steps, vector - steps]), 0.0, 1.0)


@dataclass(frozen=True)
class Tuned:
    """A simulator's parameters as tuning left them, with the effects that act in it."""

    simulator: str
    optimizer: str
    effects: tuple[str, ...]
    seed: int
    rig: str
    cable: Cable
    r0_m: float
    period_s: float
    parameters: tuple[Parameter, ...]
    values: Mapping[str, float]  # of all parameters by name, frozen ones and the effects' included
    errors: Mapping[str, PredictionErrors]  # by "tune" and "test", the casts
    certainty: Certainty | None  # None where the budget was too small for it
    improved: bool  # whether the search went on to anything better than what it tried first
    simulated_casts: int  # of the search
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
    write_text(folder / "trace.csv", table.write_csv())


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


LEDGER, REVISION = "revisions.jsonl", "revision.json"


@dataclass(frozen=True)
class ModelRevision:
    """One tuned model and how it did; errors are in % of cable length."""

    cable: str
    rig: str
    split: str  # the casts it was tuned to and judged on; revisions compare only within one
    tuning_casts: int
    heldout_casts: int
    simulator: str
    optimizer: str
    effects: tuple[str, ...]  # sorted, none for the base model
    tuning_waypoint_error_percent: float
    heldout_waypoint_error_percent: float
    heldout_final_error_percent: float
    standard_error_percent: float | None  # of the held-out waypoint error
    noise_floor_percent: float | None
    simulated_casts: int
    sizes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # value and unit by name
    predicted_waypoint_error_percent: float | None = None  # what a diagnosis promised before

    @property
    def key(self) -> tuple[Any, ...]:
        """What makes it another revision, in the order in which revisions are listed."""
        model = (self.simulator, self.optimizer, len(self.effects), self.effects)
        return (self.cable, self.split, *model)


def revision_of(
    tuned: Tuned,
    tuning: MeasurementSet,
    heldout: MeasurementSet,
    noise_floor_percent: float | None,
    predicted_percent: float | None,
) -> ModelRevision:
    """Return the revision that a simulator is, tuned to one set and judged on another."""
    named = tuple(f"{effect}." for effect in tuned.effects)
    test = tuned.errors["test"]
    return ModelRevision(
        cable=tuned.cable.name,
        rig=tuned.rig,
        split=split_identity(tuning, heldout),
        tuning_casts=len(tuning.trials),
        heldout_casts=len(heldout.trials),
        simulator=tuned.simulator,
        optimizer=tuned.optimizer,
        effects=tuple(sorted(tuned.effects)),
        tuning_waypoint_error_percent=tuned.errors["tune"].waypoint_percent,
        heldout_waypoint_error_percent=test.waypoint_percent,
        heldout_final_error_percent=test.final_percent,
        standard_error_percent=test.standard_error_percent,
        noise_floor_percent=noise_floor_percent,
        simulated_casts=tuned.simulated_casts,
        sizes={
            p.name: {"value": float(tuned.values[p.name]), "unit": p.unit}
            for p in tuned.parameters
            if p.name.startswith(named)
        },
        predicted_waypoint_error_percent=predicted_percent,
    )


def split_identity(tuning: MeasurementSet, heldout: MeasurementSet) -> str:
    """Return a fingerprint of the casts on both sides of a split: their numbers and data."""
    told: list[Any] = []
    for part in (tuning, heldout):
        told.append(f"{part.cable}{part.r0_m}{[t.trial for t in part.trials]}")
        told += (array for trial in part.trials for array in trial_data(trial))
    return digest(*told)[:12]


def trial_data(trial: Trial) -> tuple[np.ndarray, ...]:
    """Return what was measured of a cast."""
    return trial.tool.t_s, trial.tool.pose, trial.waypoints_s, trial.waypoints_m


def keep_revision(tuned_folder: Path, revision: ModelRevision) -> None:
    """Write a revision into its tuned folder and into the ledger beside it.

    The prediction goes into the ledger only: tuning did not find it.
    """
    own = replace(revision, predicted_waypoint_error_percent=None)
    text = json.dumps(asdict(own), indent=2, ensure_ascii=False)
    write_text(tuned_folder / REVISION, text + "\n")
    record_revision(tuned_folder.parent / LEDGER, revision)


def record_revision(path: Path, revision: ModelRevision) -> tuple[ModelRevision, ...]:
    """Put a revision into the ledger at `path`, in place of one of the same key; return all.

    Several may record at once: each reads and writes under a lock on the folder.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        revisions = _merged([*read_revisions(path), revision])
        text = "".join(json.dumps(asdict(r), ensure_ascii=False) + "\n" for r in revisions)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)
    finally:
        os.close(folder)  # which lets the lock go
    return revisions


def read_revisions(path: Path) -> tuple[ModelRevision, ...]:
    """Read a ledger; there are no revisions where there is no file."""
    if not path.exists():
        return ()
    lines = path.read_text(encoding="utf-8").splitlines()
    return _merged(_parsed(line, f"{path} line {n}") for n, line in enumerate(lines, start=1))


def comparable_revisions(folder: Path) -> tuple[ModelRevision, ...]:
    """Return all in a cable's ledger and tuned folders that share their casts with the latter.

    A folder that DVC restored without running anything brings its revision along.
    """
    tuned = sorted(folder.glob(f"*/{REVISION}"))
    now = [_parsed(path.read_text(encoding="utf-8"), str(path)) for path in tuned]
    splits = {revision.split for revision in now}
    ledger = read_revisions(folder / LEDGER)
    return _merged([*(r for r in ledger if r.split in splits), *now])


def _merged(revisions: Iterable[ModelRevision]) -> tuple[ModelRevision, ...]:
    """Keep the last revision of every key, in order; what was predicted is not forgotten."""
    kept: dict[tuple[Any, ...], ModelRevision] = {}
    for revision in revisions:
        before = kept.get(revision.key)
        if before is not None and revision.predicted_waypoint_error_percent is None:
            predicted = before.predicted_waypoint_error_percent
            revision = replace(revision, predicted_waypoint_error_percent=predicted)
        kept[revision.key] = revision
    return tuple(kept[key] for key in sorted(kept))


def _parsed(text: str, where: str) -> ModelRevision:
    try:
        plain = json.loads(text)
        known = {f.name: plain[f.name] for f in fields(ModelRevision)}
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"{where} is not a revision of a model ({error}); delete it") from error
    return ModelRevision(**{**known, "effects": tuple(known["effects"])})
