"""When a fitted size says that an effect is there."""

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.sizes import Size, may_be, sizes
from robotcast.fitting.parameter import Parameter
from tests.diagnosis.sliding_puck import LATE, NOISE_M, Puck, pushes
from tests.diagnosis.test_library import NOMINAL, TIMES_S, Cart


def test_intervals_are_wider_where_the_model_lacks_something() -> None:
    """A clock that is late is less well known while a tilt is missed as well."""
    widths = []
    for tilt in ((0.0, 0.0), (0.0, 0.1)):
        inquiry = Inquiry(Puck(LATE), pushes(groups=12, late_clock=(0.05,), tilt=tilt), NOISE_M)
        whole, own = (late_clock(inquiry, discrepancy) for discrepancy in (0.5, 0.0))
        widths.append(np.sqrt((whole.high - whole.low) ** 2 - (own.high - own.low) ** 2))
    assert widths[1] > 2 * widths[0]


def late_clock(inquiry: Inquiry, discrepancy: float) -> Size:
    """Return the size of the late clock in a model that is fitted with it."""
    effects = ("late_clock",)
    revision = Revision(effects, inquiry.fit(effects, inquiry.nominal(effects), 4))
    (found,) = sizes(inquiry, revision, None, discrepancy)[inquiry.entries(effects, effects[0])]
    return found


def test_intervals_are_wider_by_what_the_step_shifts_a_size() -> None:
    class Coarse(Puck):
        """One whose step makes the clock seem 0.004 s early."""

        @property
        def finer(self) -> Puck:
            return Puck(LATE)

        def predict(self, records, active, vectors):
            return super().predict(records, active, vectors - np.r_[0, 0, 0.004])

    records = pushes(groups=12, late_clock=(0.05,))
    exact, coarse = (
        late_clock(Inquiry(puck(LATE), records, NOISE_M), 0.0) for puck in (Puck, Coarse)
    )
    assert np.isclose(coarse.value, exact.value + 0.004, atol=0.0004)
    wider = (coarse.high - coarse.low) - (exact.high - exact.low)
    assert np.isclose(wider, 2 * 0.004, rtol=0.25)  # slopes are secants over a probe


def test_what_is_held_has_no_width_and_what_no_trial_tells_that_of_what_was_expected() -> None:
    cart, rng = Cart(frozen=True), np.random.default_rng(0)
    path = np.exp(-NOMINAL * TIMES_S)[:, None]  # nothing pushes it, so that no trial tells where
    trials = [path + 0.01 * rng.normal(size=path.shape) for _ in range(8)]
    records = [Record(k, k, TIMES_S, one) for k, one in enumerate(trials)]
    inquiry = Inquiry(cart, records, noise=0.01)
    fit = inquiry.fit(("bump",), np.array([NOMINAL / 10, 0.5, 0.5]), 2)
    rate, strength, place = sizes(inquiry, Revision(("bump",), fit), None, 0.0)
    assert rate.low == rate.value == rate.high == NOMINAL
    assert strength.low < 0 < strength.high < 0.05
    assert place.low < 0.1 and place.high > 0.9


def test_a_law_may_be_its_special_case_where_all_else_may_be_nothing() -> None:
    k, torque = (Parameter(name, "1", -9.0, 9.0, 0.0, null=0.0) for name in ("k", "torque"))
    shape = Parameter("shape", "1", 0.0, 9.0, 1.0)  # no strength
    for low in (-0.1, 0.05):
        spring = [Size(k, 0.1, low, 0.3), Size(torque, 2.0, 1.9, 2.1), Size(shape, 1.0, 0.5, 2.0)]
        assert may_be(spring, [torque]) == (low <= 0)
