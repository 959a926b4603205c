"""Made-up trials whose noise and whose model errors are known."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from robotcast.cast_model import CAST_WORDING as WORDS
from robotcast.diagnosis.compare import Comparison, compare
from robotcast.diagnosis.model import Record

SCALE = 0.5
NOISE = 0.005
TIMES_S = np.arange(25) * 0.1
PHASES = {"swing": 0.0, "coast": 1.0, "rest": 1.8}


MODEL: Any = SimpleNamespace(scale=SCALE, error_unit="% of cable length")


@dataclass(frozen=True)
class MadeUp:
    """Trials and what a model says of them."""

    records: list[Record]
    predicted: np.ndarray


def made_up(
    seed: int = 0,
    groups: int = 30,
    repeats: int = 2,
    wrong: Callable[[Record], np.ndarray] | None = None,
    correlation: float = 0.0,
) -> MadeUp:
    """Return casts along curved paths, predicted with the error `wrong` (k, 2) and noise.

    Parameters
    ----------
    correlation : of the noise of neighbouring samples.
    """
    rng = np.random.default_rng(seed)
    records, predicted = [], []
    for group in range(groups):
        factors = {"alpha": rng.uniform(0, 2), "vmax": rng.uniform(0.5, 1.5)}
        heading = rng.uniform(-1, 1)
        turned = heading + 0.8 * np.minimum(TIMES_S, 1.8)
        path = 0.3 * np.minimum(TIMES_S, 1.8)[:, None] * factors["vmax"]
        true = 0.6 + path * np.stack([np.cos(turned), np.sin(turned)], axis=1)
        for _ in range(repeats):
            noise = NOISE * rng.normal(size=true.shape)
            for k in range(1, len(noise)):
                noise[k] = correlation * noise[k - 1] + np.sqrt(1 - correlation**2) * noise[k]
            record = Record(len(records), group, TIMES_S, true + noise, factors, PHASES)
            records.append(record)
            predicted.append(true + (wrong(record) if wrong else 0))
    return MadeUp(records, np.stack(predicted))


def compared(made: MadeUp) -> Comparison:
    return compare(MODEL, made.records, made.predicted, WORDS)
