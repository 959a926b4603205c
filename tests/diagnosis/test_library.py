"""Where the fit of the whole library starts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.library import fit_library
from robotcast.diagnosis.model import Record
from robotcast.fitting.parameter import Parameter
from tests.diagnosis.sliding_puck import Mechanism

TIMES_S = np.linspace(0.0, 1.0, 41)
NOMINAL, TUNED, EARLY_S, LATE_S = 1.0, 8.0, 0.25, 0.75
BUMP = Mechanism(
    "bump",
    "it is pushed once",
    (
        Parameter("k", "m", -2.0, 2.0, 0.0, null=0.0, probes=(0.3,)),
        Parameter("at", "s", 0.0, 1.0, 0.5, probes=(EARLY_S, LATE_S)),
    ),
)


class Cart:
    """x(t) = e^(−rate t), and a bump of height k about one moment; a `Model`."""

    scale, error_unit, effects = 1.0, "% of a metre", {"bump": BUMP}

    def __init__(self, frozen: bool) -> None:
        rate = Parameter("rate", "1/s", 0.0, 10.0, NOMINAL)
        self.parameters = (replace(rate, frozen=frozen),)

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        path = np.exp(-vectors[:, :1] * TIMES_S)
        if active:
            path = path + vectors[:, 1:2] * np.exp(-(((TIMES_S - vectors[:, 2:3]) / 0.1) ** 2))
        return np.tile(path[:, None, :, None], (1, len(records), 1, 1))


@pytest.mark.parametrize("frozen", [False, True])
def test_a_place_is_looked_for_beside_both_starts_or_beside_the_only_one(frozen: bool) -> None:
    cart, empty = Cart(frozen), Record(0, 0, TIMES_S, TIMES_S[:, None], {"speed": 1.0})
    truth = cart.predict([empty], ["bump"], np.array([[NOMINAL, 0.2, EARLY_S]]))[0, 0]
    records = [replace(empty, trial=k, group=k, measured=truth) for k in range(4)]
    inquiry = Inquiry(cart, records, noise=0.01)
    tuned = inquiry.fit((), np.array([TUNED / 10.0]), 0)
    found = fit_library(inquiry, (), ["bump"], tuned, 5)
    places = [round(float(one.fit.vector[2]), 1) for one in found.starts]
    assert places == ([0.2] if frozen else [0.2, 0.8])
    if not frozen:
        np.testing.assert_allclose(
            inquiry.values(["bump"], found.fit.vector)[0], [NOMINAL, 0.2, EARLY_S], atol=0.01
        )
