"""How a model is fitted to whole trials."""

from collections.abc import Sequence

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Record
from robotcast.fitting.parameter import Parameter

TIMES_S = np.linspace(0.0, 10.0, 41)
RATE = 3.0


class Swing:
    """sin(rate t), which is missed alike at many rates; a `Model` without effects."""

    scale, error_unit, effects = 1.0, "% of a metre", {}
    parameters = (Parameter("rate", "rad/s", 1.0, 6.0, 4.0),)

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        path = np.sin(vectors[:, :1] * TIMES_S)
        return np.tile(path[:, None, :, None], (1, len(records), 1, 1))


def test_whole_trials_are_fitted_from_the_start_that_leads_to_the_better_valley() -> None:
    path = np.sin(RATE * TIMES_S)[:, None]
    records = [Record(k, k, TIMES_S, path, {"speed": 1.0}) for k in range(4)]
    inquiry = Inquiry(Swing(), records, noise=0.01)
    rates = [(4.0 - 1.0) / 5.0, (RATE + 0.1 - 1.0) / 5.0]
    begun = [inquiry.fit((), np.array([rate]), 0) for rate in rates]
    found = [
        inquiry.values((), inquiry.fit_whole((), some, 4).vector)[0, 0]
        for some in (begun[:1], begun, begun[::-1])
    ]
    assert abs(found[0] - RATE) > 0.5
    np.testing.assert_allclose(found[1:], RATE, atol=1e-3)
