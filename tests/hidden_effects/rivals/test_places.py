"""Where effects are tried."""

import numpy as np
import pytest

from robotcast.fitting.parameter import Parameter
from robotcast.hidden_effects.rivals.places import all_probes, joined, least_strengths, unit_rows
from tests.diagnosis.sliding_puck import LATE, TILT, Mechanism

PATCH = Mechanism(
    "patch",
    "a place that rubs more",
    (
        Parameter("k", "1", -1.0, 5.0, nominal=0.0, null=0.0, probes=(-0.2, 0.5)),
        Parameter("x0", "m", 0.0, 2.0, nominal=1.0, probes=(0.5, 1.5)),
    ),
)


def test_every_strength_is_tried_at_every_place_and_null_once():
    assert all_probes(PATCH) == [
        {"patch": {"k": 0.0}},
        {"patch": {"x0": 0.5, "k": -0.2}},
        {"patch": {"x0": 0.5, "k": 0.5}},
        {"patch": {"x0": 1.5, "k": -0.2}},
        {"patch": {"x0": 1.5, "k": 0.5}},
    ]
    assert len(all_probes(TILT)) == 3 * 3


def test_the_least_strength_is_the_probe_nearest_to_null_one_strength_at_a_time():
    assert least_strengths(PATCH) == [
        {"patch": {"x0": 0.5, "k": -0.2}},
        {"patch": {"x0": 1.5, "k": -0.2}},
    ]
    assert [set(place["tilt"]) for place in least_strengths(TILT)] == [{"ax"}, {"ay"}]


def test_two_effects_are_tried_in_every_combination():
    both = joined([all_probes(LATE), all_probes(PATCH)])
    assert len(both) == 3 * 5
    assert {"late_clock": {"tau": 0.02}, "patch": {"x0": 1.5, "k": 0.5}} in both


def test_rows_hold_the_base_then_the_effects_clear_of_their_bounds(ask):
    inquiry, base = ask(), np.array([0.3, 0.7])
    places = [{"late_clock": {"tau": 0.15}}, {"tilt": {"ay": 5.0}}]
    rows = unit_rows(inquiry, base, ["tilt", "late_clock"], places)
    assert rows == pytest.approx(
        np.array([[0.3, 0.7, 0.5, 0.5, 0.75], [0.3, 0.7, 0.5, 0.999, 0.5]])
    )
