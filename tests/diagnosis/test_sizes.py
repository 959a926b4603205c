"""When a fitted size says that an effect is there."""

import numpy as np

from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.sizes import sizes, sizes_of_effect
from tests.diagnosis.sliding_puck import LATE, NOISE_M, TILT, Puck, pushes


def test_sizes_of_one_effect_among_several() -> None:
    inquiry = Inquiry(Puck(LATE, TILT), pushes(groups=8), 0.004)
    effects = ("late_clock", "tilt")
    vector = inquiry.nominal(effects)
    revision = Revision(effects, inquiry.fit(effects, vector, 1))
    own = [s.parameter.name for s in sizes_of_effect(inquiry, revision, None, "tilt", 0.5)]
    assert own == ["ax", "ay"]
    first = sizes_of_effect(inquiry, revision, None, "late_clock", 0.5)
    assert np.isclose(first[0].value, sizes(inquiry, revision, None, 0.5)[2].value)


def test_intervals_are_wider_where_the_model_lacks_something() -> None:
    """A clock that is late is less well known while a tilt is missed as well."""
    widths = []
    for tilt in ((0.0, 0.0), (0.0, 0.1)):
        inquiry = Inquiry(Puck(LATE), pushes(groups=12, late_clock=(0.05,), tilt=tilt), NOISE_M)
        effects = ("late_clock",)
        revision = Revision(effects, inquiry.fit(effects, inquiry.nominal(effects), 4))
        whole, own = (
            sizes_of_effect(inquiry, revision, None, "late_clock", discrepancy=share)[0]
            for share in (0.5, 0.0)
        )
        widths.append(np.sqrt((whole.high - whole.low) ** 2 - (own.high - own.low) ** 2))
    assert widths[1] > 2 * widths[0]


def test_intervals_are_wider_by_what_the_step_shifts_a_size() -> None:
    class Coarse(Puck):
        """One whose step makes the clock seem 0.004 s early."""

        @property
        def finer(self) -> Puck:
            return Puck(LATE)

        def predict(self, records, active, vectors):
            return super().predict(records, active, vectors - np.r_[0, 0, 0.004])

    effects, records, found = ("late_clock",), pushes(groups=12, late_clock=(0.05,)), []
    for puck in (Puck, Coarse):
        inquiry = Inquiry(puck(LATE), records, NOISE_M)
        revision = Revision(effects, inquiry.fit(effects, inquiry.nominal(effects), 4))
        found += sizes_of_effect(inquiry, revision, None, "late_clock", 0.0)
    exact, coarse = found
    assert np.isclose(coarse.value, exact.value + 0.004, atol=0.0004)
    wider = (coarse.high - coarse.low) - (exact.high - exact.low)
    assert np.isclose(wider, 2 * 0.004, rtol=0.25)  # slopes are secants over a probe
