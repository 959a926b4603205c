"""What the methods beside the diagnosis say of pushes whose hidden effect is known."""

from dataclasses import replace

import numpy as np
import pytest

from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.selection import Rung
from robotcast.hidden_effects.rivals.brute_force import Round, brute_force
from robotcast.hidden_effects.rivals.oracle import told
from robotcast.hidden_effects.rivals.refitting import judged_base, rematched
from robotcast.hidden_effects.rivals.sensitivity import raw_sensitivities
from tests.diagnosis.sliding_puck import NOISE_M
from tests.hidden_effects.rivals.conftest import CANDIDATES, EFFORT, FLOOR, RULE

LATE_S = 0.06


def forced(inquiry: Inquiry, base: Rung) -> list[Round]:
    return list(brute_force(inquiry, base, CANDIDATES, FLOOR, RULE, EFFORT, lambda name: None))


def test_raw_sensitivity_names_what_moves_most_whatever_is_hidden(ask):
    """The reason why it is no diagnosis."""
    named = []
    for hidden in ({}, {"late_clock": [LATE_S]}, {"turn": [0.05]}):
        inquiry = ask(**hidden)
        moved = raw_sensitivities(inquiry, judged_base(inquiry, EFFORT).revision, CANDIDATES)
        assert moved["dead"] == 0
        named.append(max(moved, key=lambda name: moved[name]))
    assert len(set(named)) == 1


def test_brute_force_names_the_hidden_effect_and_pays_for_every_other(ask):
    inquiry = ask(late_clock=[LATE_S])
    base = judged_base(inquiry, EFFORT)
    before = inquiry.simulated
    first, *later = forced(inquiry, base)
    assert first.best == "late_clock" and first.paid
    assert set(first.tried) == set(CANDIDATES)
    assert min(first.tried, key=lambda name: first.tried[name]) == "late_clock"
    assert first.kept.errors.waypoint.mean() < 0.7 * base.errors.waypoint.mean()
    assert first.simulated > len(CANDIDATES) * before / 4
    assert not any(one.paid for one in later)


def test_brute_force_goes_on_until_both_of_two_effects_are_named(ask):
    inquiry = ask(late_clock=[LATE_S], turn=[0.05])
    rounds = forced(inquiry, judged_base(inquiry, EFFORT))
    assert set(rounds[-1].kept.revision.effects) == {"late_clock", "turn"}
    assert len(rounds[1].tried) == len(CANDIDATES) - 1


def test_brute_force_names_nothing_where_nothing_pays(ask):
    inquiry = ask()
    base = judged_base(inquiry, EFFORT)
    (only,) = forced(inquiry, base)
    assert not only.paid and only.kept.revision.effects == ()
    assert only.p_value > 1e-3
    assert only.kept.errors.waypoint.mean() == pytest.approx(base.errors.waypoint.mean(), rel=0.01)


def test_the_oracle_finds_the_size_of_what_it_is_told(ask):
    inquiry = ask(late_clock=[LATE_S])
    base = judged_base(inquiry, EFFORT)
    found = told(inquiry, base, {"late_clock": {"tau": LATE_S}}, FLOOR, EFFORT)
    revision = found.rung.revision
    (values,) = inquiry.values(revision.effects, revision.fit.vector)
    assert values[-1] == pytest.approx(LATE_S, abs=0.01)
    assert found.gain.pays and found.gain.p_value < 1e-6


def test_the_oracle_fits_two_effects_together(ask):
    hidden = {"late_clock": {"tau": LATE_S}, "turn": {"phi": 0.05}}
    inquiry = ask(late_clock=[LATE_S], turn=[0.05])
    base = judged_base(inquiry, EFFORT)
    found = told(inquiry, base, hidden, FLOOR, EFFORT)
    assert found.rung.revision.effects == ("late_clock", "turn")
    assert found.rung.errors.waypoint.mean() < 1.5 * 100 * NOISE_M


def test_an_oracle_told_of_what_does_not_act_gains_nothing(ask):
    inquiry = ask()
    base = judged_base(inquiry, EFFORT)
    found = told(inquiry, base, {"turn": {"phi": 0.0}}, FLOOR, EFFORT)
    assert found.gain.p_value > 1e-3


def test_a_base_model_stuck_in_a_worse_valley_gets_its_rivals_parameters(ask):
    inquiry = ask()
    base = judged_base(inquiry, EFFORT)
    far = np.full_like(base.revision.fit.vector, 0.9)
    residual = inquiry.residuals(())(far[None], inquiry.everything)[0]
    fit = replace(base.revision.fit, vector=far, residual=residual, loss=50.0)
    stuck = replace(base, revision=replace(base.revision, fit=fit))
    better = rematched(inquiry, stuck, base, EFFORT)
    assert better.revision.fit.loss <= base.revision.fit.loss * 1.01
    assert rematched(inquiry, better, stuck, EFFORT) is better
