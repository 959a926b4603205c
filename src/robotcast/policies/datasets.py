"""The three datasets a forward model learns from: real, simulated, mixed (paper, "Experiments").

Every dataset keeps a validation part. Repeats of a real action never stand on both sides, and
duplicates are drawn after the split, so validation never sees a cast that was trained on.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.measurements.measurement_set import MeasurementSet, Trial


@dataclass(frozen=True)
class Examples:
    """Actions, the endpoints they led to, and how much each counts in the loss."""

    actions: np.ndarray  # (n, 6), in the order and units of `ACTION_COLUMNS`
    endpoints_m: np.ndarray  # (n, 2)
    weights: np.ndarray  # (n,)

    def __len__(self) -> int:
        return len(self.actions)

    def take(self, rows: np.ndarray) -> "Examples":
        """Return the examples at `rows`, which may repeat."""
        return Examples(*(column[rows] for column in vars(self).values()))

    def weighted(self, factor: float) -> "Examples":
        """Return the examples with every weight times `factor`."""
        return replace(self, weights=self.weights * factor)

    def joined(self, other: "Examples") -> "Examples":
        """Return these examples followed by `other`."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Examples(*(np.concatenate(pair) for pair in pairs))

    def merged(self) -> "Examples":
        """Return the different examples, each with the summed weight of its duplicates."""
        pairs = np.concatenate([self.actions, self.endpoints_m], axis=1)
        _, first, which = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
        return replace(self.take(first), weights=np.bincount(which.ravel(), weights=self.weights))

    def action_groups(self) -> np.ndarray:
        """Number the different actions and return the number of each example, (n,)."""
        return np.unique(self.actions, axis=0, return_inverse=True)[1].ravel()


@dataclass(frozen=True)
class Dataset:
    """What one forward model is fitted to."""

    name: str
    training: Examples
    validation: Examples
    calibration: Examples  # tell how far casts end from the model: of validation, measured if any
    facts: Mapping[str, Any] = field(default_factory=dict)  # how it was made, for policy.yaml


def real_dataset(
    measurements: MeasurementSet,
    leave_out: Collection[int],
    *,
    validation_fraction: float,
    seed: int,
    casts: int | None = None,
    first: Collection[int] = (),
) -> Dataset:
    """Make D_real: every cast of `measurements` seen at rest, but the trials in `leave_out`.

    With a number of `casts`, so many are taken action by action, fewer contained in more, and the
    trials `first` before others: where a simulator was tuned to those, the policy has seen no more.
    """
    trials = [t for t in measurements.rested.trials if t.trial not in leave_out]
    if not trials:
        raise ValueError(
            "dataset real: once the test casts are out, no cast that was seen at rest is left"
        )
    if casts is not None:
        trials = _first_casts(trials, casts, first, seed)
    actions, ends_m = zip(*((t.action.as_array(), t.endpoint_m) for t in trials), strict=True)
    examples = Examples(np.stack(actions), np.stack(ends_m), np.ones(len(trials)))
    groups = np.array([t.action_id for t in trials])
    training, validation = _split(examples, groups, validation_fraction, seed)
    _refuse_not_finite(examples, lambda row: f"dataset real: trial {trials[row].trial}")
    facts = {"cable": measurements.cable.name, "real_casts": len(trials)}
    facts["left_out_casts"] = len(measurements.trials) - len(trials)
    return Dataset("real", training, validation, validation, facts)


def _first_casts(
    trials: Sequence[Trial], casts: int, first: Collection[int], seed: int
) -> list[Trial]:
    if not 0 < casts <= len(trials):
        raise ValueError(f"dataset real: asked for {casts} casts, {len(trials)} are to be had")
    ids = np.unique([t.action_id for t in trials])
    order = np.random.default_rng((seed, 4)).permutation(ids).tolist()
    early = {t.action_id for t in trials if t.trial in first}

    def rank(t: Trial) -> tuple[bool, int, int]:
        return t.action_id not in early, order.index(t.action_id), t.trial

    return sorted(sorted(trials, key=rank)[:casts], key=lambda t: t.trial)


def simulated_dataset(path: Path, *, validation_fraction: float, seed: int) -> Dataset:
    """Make D_sim from the casts.parquet that generate wrote."""
    examples, made = read_simulated(path), path.with_name("generation.yaml")
    generation = yaml.safe_load(made.read_text(encoding="utf-8")) if made.exists() else {}
    known = {"cable": generation["cable"]} if "cable" in generation else {}
    training, validation = _split(examples, np.arange(len(examples)), validation_fraction, seed)
    facts = {**known, "simulated_casts": len(examples)}
    return Dataset("simulated", training, validation, validation, facts)


def read_simulated(path: Path) -> Examples:
    """Read the actions and endpoints of D_sim."""
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: run the generate stage first")
    table = pl.read_parquet(path)
    for column in (*ACTION_COLUMNS, "x", "y"):
        if column not in table.columns:
            raise ValueError(f"{path}: column {column} is missing")
    actions, ends = (table.select(c).to_numpy().astype(float) for c in (ACTION_COLUMNS, ("x", "y")))
    examples = Examples(actions, ends, np.ones(len(actions)))
    _refuse_not_finite(examples, lambda row: f"{path}: row {row}")
    return examples


def _refuse_not_finite(examples: Examples, name: Callable[[int], str]) -> None:
    finite = np.isfinite(examples.actions).all(axis=1) & np.isfinite(examples.endpoints_m).all(1)
    if not finite.all():
        raise ValueError(f"{name(int(np.argmin(finite)))} is not finite")


def mixed_dataset(
    real: Dataset, simulated: Dataset, *, real_fraction: float, real_weight: float, seed: int
) -> Dataset:
    """Make D_real ∪ D_sim with D_real upsampled and weighted higher.

    Real casts are duplicated at random until they make at least `real_fraction` of the training
    examples (paper: 30 to 40 %). Each weighs `real_weight` in the loss, a simulated one 1. In the
    validation part they carry by weight what the training part gives them by number and weight.
    """
    if not 0 < real_fraction < 1:
        raise ValueError(f"dataset mixed: real_fraction must be in (0, 1), got {real_fraction}")
    if real_weight <= 0:
        raise ValueError(f"dataset mixed: real_weight must be positive, got {real_weight}")
    refuse_other_cables(real, simulated)
    n_real, n_simulated = len(real.training), len(simulated.training)
    wanted = max(n_real, round(n_simulated * real_fraction / (1 - real_fraction)))
    again = np.random.default_rng((seed, 1)).integers(n_real, size=wanted - n_real)
    rows = np.concatenate([np.arange(n_real), again])
    upsampled = real.training.take(rows).weighted(real_weight)
    share = real_weight * (wanted / n_simulated) * len(simulated.validation) / len(real.validation)
    facts = {**simulated.facts, **real.facts, "real_examples_after_upsampling": wanted}
    fraction = round(wanted / (wanted + n_simulated), 4)
    facts |= {"real_fraction": fraction, "real_weight": real_weight}
    training = simulated.training.joined(upsampled)
    validation = simulated.validation.joined(real.validation.weighted(share))
    return Dataset("mixed", training, validation, real.calibration, facts)


def refuse_other_cables(*datasets: Dataset) -> None:
    """Refuse to learn from casts of several cables together."""
    if len(cables := {d.facts["cable"] for d in datasets if "cable" in d.facts}) > 1:
        raise ValueError(
            f"dataset mixed: casts of {' and '.join(sorted(cables))} do not mix; "
            "take measured and simulated casts of one cable"
        )


def folds(real: Dataset, count: int, *, seed: int) -> Iterator[tuple[Dataset, Examples]]:
    """Yield the rest of D_real and the casts held out: each once, repeats of an action together.

    There are `count` folds, or as many as actions; none of fewer than three, which leave not two.
    """
    casts = real.training.joined(real.validation)
    groups = casts.action_groups()
    count = min(count, n_groups) if (n_groups := groups.max() + 1) > 2 else 0
    order = np.random.default_rng((seed, 5)).permutation(n_groups)[groups]
    fraction = len(real.validation) / len(casts)
    for fold in range(count):
        out = order % count == fold
        training, validation = _split(casts.take(~out), groups[~out], fraction, seed)
        yield Dataset(real.name, training, validation, validation, real.facts), casts.take(out)


def _split(
    examples: Examples, groups: np.ndarray, fraction: float, seed: int
) -> tuple[Examples, Examples]:
    """Split into training and validation, each of the `groups` (n,) on one side."""
    if not 0 < fraction < 1:
        raise ValueError(f"validation_fraction must be in (0, 1), got {fraction}")
    names = np.unique(groups)
    if len(names) < 2:
        raise ValueError(
            f"a dataset needs at least 2 different actions to hold some out, got {len(names)}"
        )
    n_held = min(max(1, round(fraction * len(names))), len(names) - 1)
    held = np.isin(groups, np.random.default_rng((seed, 0)).permutation(names)[:n_held])
    return examples.take(~held), examples.take(held)
