"""When a fitted size says that an effect is there."""

import numpy as np
import pytest

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.rule import RULE, Effort
from robotcast.diagnosis.selection import Selection
from robotcast.diagnosis.sizes import Size, may_be, sizes
from robotcast.fitting.parameter import Parameter
from tests.diagnosis.sliding_puck import LATE, NOISE_M, Mechanism, Puck, pushes
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


@pytest.mark.parametrize(("truth", "named"), [((0.0, 0.1, 0.1), "payload"), ((0.3, 0, 0), "mass")])
def test_strengths_that_only_hold_zero_together_are_no_special_case(
    truth: tuple[float, ...], named: str
) -> None:
    """What a payload's k, x and z do is alike where a link hardly swings; two explain, one not."""
    k, x, z = (Parameter(n, "1", -2.0, 2.0, 0.0, null=0.0, probes=(-0.1, 0.1)) for n in "kxz")
    rng, times_s = np.random.default_rng(1), np.linspace(0, 1, 41)
    own = [np.sin(2 * np.pi * (rng.uniform(0.5, 2) * times_s + rng.uniform())) for _ in range(48)]
    swings = np.deg2rad(12) * np.array(own)
    acts = {"k": np.sin(swings), "x": np.cos(swings + 0.8), "z": np.sin(swings + 0.8)}

    class Link:
        scale, error_unit, parameters = 1.0, "% of a newton metre", ()

        def __init__(self) -> None:
            laws = {"payload": (k, x, z), "mass": (k,)}
            self.effects = {name: Mechanism(name, "", some) for name, some in laws.items()}

        def predict(self, records, active, vectors):
            names = [p.name for name in active for p in self.effects[name].parameters]
            trials, n = [r.trial for r in records], max(len(r.times_s) for r in records)
            moved = np.zeros((len(vectors), len(trials), n))
            for name, size in zip(names, vectors.T, strict=True):
                moved += size[:, None, None] * acts[name][trials, :n]
            return moved[..., None]

    model, empty = Link(), [Record(n, n // 3, times_s, np.zeros((41, 1))) for n in range(48)]
    seen = model.predict(empty, ["payload"], np.array([truth]))[0]
    noisy = seen + 0.02 * rng.normal(size=seen.shape)
    records = [Record(n, n // 3, times_s, noisy[n]) for n in range(48)]
    floor, effort = Floor.known(1.6, 0.1), Effort(some=12)
    laws = ("payload", "mass")
    search = Selection(
        Inquiry(model, records, 0.02), laws, (), floor, RULE, effort, lambda *_: None
    )
    assert search.run().chosen == (named,)
