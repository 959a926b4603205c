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
    """Actions (n, 6), in the order and units of `ACTION_COLUMNS`, and the endpoints they led to.

    `endpoints_m` is of shape (n, 2), `weights` in the loss of shape (n,).
    """

    actions: np.ndarray
    endpoints_m: np.ndarray
    weights: np.ndarray

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
    """What one forward model is fitted to.

    `calibration` casts tell how far casts end from the model: the measured ones of the validation
    part, where it holds any, else all of it. `facts` tell policy.yaml how the dataset was made.
    """

    name: str
    training: Examples
    validation: Examples
    calibration: Examples
    facts: Mapping[str, Any] = field(default_factory=dict)


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
    out = set(leave_out)
    trials = [t for t in measurements.rested.trials if t.trial not in out]
    if not trials:
        raise ValueError(
            "dataset real: once the test casts are out, no cast that was seen at rest is left"
        )
    if casts is not None:
        trials = _first_casts(trials, casts, first, seed)
    examples = Examples(
        np.stack([t.action.as_array() for t in trials]),
        np.stack([t.endpoint_m for t in trials]),
        np.ones(len(trials)),
    )
    groups = np.array([t.action_id for t in trials])
    training, validation = _split(examples, groups, validation_fraction, seed)
    _refuse_not_finite(examples, lambda row: f"dataset real: trial {trials[row].trial}")
    facts = {
        "cable": measurements.cable.name,
        "real_casts": len(trials),
        "left_out_casts": len(measurements.trials) - len(trials),
    }
    return Dataset("real", training, validation, validation, facts)


def _first_casts(
    trials: Sequence[Trial], casts: int, first: Collection[int], seed: int
) -> list[Trial]:
    """Draw `casts` casts, action by action; refuse a number that there is not."""
    if not 0 < casts <= len(trials):
        raise ValueError(f"dataset real: asked for {casts} casts, {len(trials)} are to be had")
    rng = np.random.default_rng(np.random.SeedSequence((seed, 4)))
    order = rng.permutation(np.unique([t.action_id for t in trials])).tolist()
    early = {t.action_id for t in trials if t.trial in set(first)}

    def rank(t: Trial) -> tuple[bool, int, int]:
        return t.action_id not in early, order.index(t.action_id), t.trial

    return sorted(sorted(trials, key=rank)[:casts], key=lambda t: t.trial)


def simulated_dataset(path: Path, *, validation_fraction: float, seed: int) -> Dataset:
    """Make D_sim from the casts.parquet that generate wrote."""
    examples = read_simulated(path)
    made = path.with_name("generation.yaml")
    generation = yaml.safe_load(made.read_text(encoding="utf-8")) if made.exists() else {}
    facts = {name: generation[name] for name in ("cable",) if name in generation}
    training, validation = _split(examples, np.arange(len(examples)), validation_fraction, seed)
    facts["simulated_casts"] = len(examples)
    return Dataset("simulated", training, validation, validation, facts)


def read_simulated(path: Path) -> Examples:
    """Read the actions and endpoints of D_sim."""
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing: run the generate stage first")
    table = pl.read_parquet(path)
    missing = [c for c in (*ACTION_COLUMNS, "x", "y") if c not in table.columns]
    if missing:
        raise ValueError(f"{path}: column {missing[0]} is missing")
    actions = table.select(ACTION_COLUMNS).to_numpy().astype(float)
    endpoints = table.select("x", "y").to_numpy().astype(float)
    examples = Examples(actions, endpoints, np.ones(len(actions)))
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

    Real casts are duplicated at random until they make `real_fraction` of the training examples
    (paper: 30 to 40 %); one that is already larger stays as it is. Each real example, duplicate
    or not, weighs `real_weight` in the loss, a simulated one 1. In the validation part the real
    casts carry by weight what the training part gives them by number and weight.
    """
    if not 0 < real_fraction < 1:
        raise ValueError(f"dataset mixed: real_fraction must be in (0, 1), got {real_fraction}")
    if real_weight <= 0:
        raise ValueError(f"dataset mixed: real_weight must be positive, got {real_weight}")
    refuse_other_cables(real, simulated)
    n_real, n_simulated = len(real.training), len(simulated.training)
    wanted = max(n_real, round(n_simulated * real_fraction / (1 - real_fraction)))
    rng = np.random.default_rng(np.random.SeedSequence((seed, 1)))
    rows = np.concatenate([np.arange(n_real), rng.integers(n_real, size=wanted - n_real)])
    upsampled = real.training.take(rows).weighted(real_weight)
    share = real_weight * (wanted / n_simulated) * len(simulated.validation) / len(real.validation)
    facts = {
        **simulated.facts,
        **real.facts,
        "real_examples_after_upsampling": wanted,
        "real_fraction": round(wanted / (wanted + n_simulated), 4),
        "real_weight": real_weight,
    }
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
    """Hold out every cast of D_real once, repeats of an action together.

    Yields the rest, with a validation part as large, and the casts held out. There are `count`
    folds, or as many as there are actions; none of fewer than three, which could not leave two.
    """
    casts = real.training.joined(real.validation)
    groups = casts.action_groups()
    n_groups = groups.max() + 1
    count = min(count, n_groups) if n_groups > 2 else 0
    rng = np.random.default_rng(np.random.SeedSequence((seed, 5)))
    order = rng.permutation(n_groups)[groups]
    fraction = len(real.validation) / len(casts)
    for fold in range(count):
        out = order % count == fold
        training, validation = _split(casts.take(~out), groups[~out], fraction, seed)
        yield Dataset(real.name, training, validation, validation, real.facts), casts.take(out)


def _split(
    examples: Examples, groups: np.ndarray, fraction: float, seed: int
) -> tuple[Examples, Examples]:
    """Split into training and validation, keeping each group of `groups` (n,) on one side."""
    if not 0 < fraction < 1:
        raise ValueError(f"validation_fraction must be in (0, 1), got {fraction}")
    names = np.unique(groups)
    if len(names) < 2:
        raise ValueError(
            f"a dataset needs at least 2 different actions to hold some out, got {len(names)}"
        )
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0)))
    n_held = min(max(1, round(fraction * len(names))), len(names) - 1)
    held = np.isin(groups, rng.permutation(names)[:n_held])
    return examples.take(~held), examples.take(held)
