"""What the tunings of a made-up model came to, and the table that keeps it."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import polars as pl

from robotcast.files import atomic_file
from robotcast.fitting.parameter import Parameter
from robotcast.tuning.certainty import Certainty

TEXTS = ("simulator", "optimizer", "parameter", "unit")  # columns that are no numbers


@dataclass(frozen=True)
class Outcome:
    """One parameter of one tuning.

    Attributes
    ----------
    casts : to which the model was tuned.
    model, start : numbers of the made-up model and of the random start.
    true, found : its values.
    told_within_percent : half the interval that casts with a little noise leave it, at the true
        model, in % of its value: small where the casts tell the parameter at all.
    tuning_percent, test_percent : average waypoint errors of the tuning, % of cable length.
    simulated_casts, diverged_casts : of the whole tuning.
    """

    simulator: str
    optimizer: str
    casts: int
    model: int
    start: int
    parameter: str
    unit: str
    true: float
    found: float
    told_within_percent: float
    tuning_percent: float
    test_percent: float
    simulated_casts: int
    diverged_casts: int

    @property
    def error_percent(self) -> float:
        """How far the found value is from the true one, in % of the true one."""
        return 100 * abs(self.found - self.true) / abs(self.true)

    @property
    def tuning(self) -> tuple[str, str, int, int, int]:
        """Which tuning it belongs to."""
        return self.simulator, self.optimizer, self.casts, self.model, self.start


def told_within_percent(
    parameters: Sequence[Parameter], true: np.ndarray, known: Certainty
) -> np.ndarray:
    """Return half the interval of every parameter in % of its true value (n,)."""
    ends = np.array([known.intervals[p.name] for p in parameters])
    return 100 * np.abs(ends - true[:, None]).max(axis=1) / np.abs(true)


def write_outcomes(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write one row a parameter."""
    with atomic_file(path) as temporary:
        pl.DataFrame([asdict(outcome) for outcome in outcomes]).write_csv(temporary)


def read_outcomes(folder: Path) -> list[Outcome]:
    """Read the outcomes of all simulators, optimizers and numbers of casts in a folder."""
    paths = sorted(folder.glob("[!.]*.csv"))
    if not paths:
        raise FileNotFoundError(f"{folder} holds no outcomes: run stages/sim2sim.py first")
    texts: dict[str, type[pl.DataType]] = dict.fromkeys(TEXTS, pl.String)
    tables = [pl.read_csv(path, schema_overrides=texts) for path in paths]
    return [Outcome(**row) for table in tables for row in table.to_dicts()]
