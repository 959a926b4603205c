"""What the methods beside the diagnosis say of pushes whose hidden effect is known.

A puck whose pushes cost nothing stands in for the cable.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.found import Rung
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.fitting.parameter import Parameter
from studies.hidden_effects.rivals import (
    Question,
    Round,
    all_probes,
    brute_force,
    least_strengths,
    oracle,
    random_guess,
    raw_sensitivities,
    unit_rows,
)
from tests.diagnosis.sliding_puck import (
    DEAD,
    LATE,
    NOISE_M,
    SHIFT,
    TILT,
    TURN,
    Mechanism,
    Puck,
    pushed,
    pushes,
)

EFFECTS = (DEAD, LATE, SHIFT, TILT, TURN)
CANDIDATES = tuple(effect.name for effect in EFFECTS)
LATE_S = 0.06
CASES = [f"case-{n:03d}" for n in range(60)]
PATCH = Mechanism(
    "patch",
    "a place that rubs more",
    (
        Parameter("k", "1", -1.0, 5.0, nominal=0.0, null=0.0, probes=(-0.2, 0.5)),
        Parameter("x0", "m", 0.0, 2.0, nominal=1.0, probes=(0.5, 1.5)),
    ),
)


@pytest.fixture
def ask() -> Callable[..., Question]:
    """Put the puck beside pushes with hidden effects (name → values)."""

    def asked(**hidden: Sequence[float]) -> Question:
        factors = [one.factors for one in pushes(groups=16, repeats=2)]
        inquiry = Inquiry(Puck(*EFFECTS), pushed(factors, 0, **hidden), NOISE_M)
        effort = Effort(base=4, refit=3, fold=2)
        return Question(inquiry, CANDIDATES, Floor.known(100 * NOISE_M, 0.1), Rule(), effort)

    return asked


def guesses(seed: int) -> list[str]:
    return [random_guess(case, CANDIDATES, seed) for case in CASES]


def test_every_candidate_is_drawn_the_same_for_a_case_and_seed_whatever_their_order():
    assert set(guesses(0)) == set(CANDIDATES)
    assert guesses(1) == [random_guess(case, CANDIDATES[::-1], 1) for case in CASES]
    assert guesses(1) != guesses(2)


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


def test_rows_hold_the_base_then_the_effects_clear_of_their_bounds(ask):
    inquiry, base = ask().inquiry, np.array([0.3, 0.7])
    places = [{"late_clock": {"tau": 0.15}}, {"tilt": {"ay": 5.0}}]
    rows = unit_rows(inquiry, base, ["tilt", "late_clock"], places)
    expected = [[0.3, 0.7, 0.5, 0.5, 0.75], [0.3, 0.7, 0.5, 0.999, 0.5]]
    assert rows == pytest.approx(np.array(expected))


def forced(question: Question, base: Rung) -> list[Round]:
    return list(brute_force(question, base, lambda name: None))


def test_raw_sensitivity_names_what_moves_most_whatever_is_hidden(ask):
    """The reason why it is no diagnosis."""
    named = []
    for hidden in ({}, {"late_clock": [LATE_S]}, {"turn": [0.05]}):
        question = ask(**hidden)
        moved = raw_sensitivities(question, question.base().revision)
        assert moved["dead"] == 0
        named.append(max(moved, key=lambda name: moved[name]))
    assert len(set(named)) == 1


def test_brute_force_names_the_hidden_effect_and_pays_for_every_other(ask):
    question = ask(late_clock=[LATE_S])
    base = question.base()
    before = question.inquiry.simulated
    first, *later = forced(question, base)
    assert first.best == "late_clock" and first.paid
    assert set(first.tried) == set(CANDIDATES)
    assert min(first.tried, key=lambda name: first.tried[name]) == "late_clock"
    assert first.kept.errors.waypoint.mean() < 0.7 * base.errors.waypoint.mean()
    assert first.simulated_casts > len(CANDIDATES) * before / 4
    assert not any(one.paid for one in later)


def test_brute_force_goes_on_until_both_of_two_effects_are_named(ask):
    question = ask(late_clock=[LATE_S], turn=[0.05])
    rounds = forced(question, question.base())
    assert set(rounds[-1].kept.revision.effects) == {"late_clock", "turn"}
    assert len(rounds[1].tried) == len(CANDIDATES) - 1


def test_brute_force_names_nothing_where_nothing_pays(ask):
    question = ask()
    base = question.base()
    (only,) = forced(question, base)
    assert not only.paid and only.kept.revision.effects == ()
    assert only.p_value > 1e-3
    assert only.kept.errors.waypoint.mean() == pytest.approx(base.errors.waypoint.mean(), rel=0.01)


def test_the_oracle_finds_the_size_of_what_it_is_told(ask):
    question = ask(late_clock=[LATE_S])
    _, rung, gain = oracle(question, question.base(), {"late_clock": {"tau": LATE_S}})
    revision = rung.revision
    (values,) = question.inquiry.values(revision.effects, revision.fit.vector)
    assert values[-1] == pytest.approx(LATE_S, abs=0.01)
    assert gain.pays and gain.p_value < 1e-6


def test_the_oracle_fits_two_effects_together(ask):
    hidden = {"late_clock": {"tau": LATE_S}, "turn": {"phi": 0.05}}
    question = ask(late_clock=[LATE_S], turn=[0.05])
    _, rung, _ = oracle(question, question.base(), hidden)
    assert rung.revision.effects == ("late_clock", "turn")
    assert rung.errors.waypoint.mean() < 1.5 * 100 * NOISE_M


def test_an_oracle_told_of_what_does_not_act_gains_nothing(ask):
    question = ask()
    assert oracle(question, question.base(), {"turn": {"phi": 0.0}})[2].p_value > 1e-3


def test_a_base_model_stuck_in_a_worse_valley_gets_its_rivals_parameters(ask):
    question = ask()
    base = question.base()
    far = np.full_like(base.revision.fit.vector, 0.9)
    inquiry = question.inquiry
    residual = inquiry.residuals(())(far[None], inquiry.everything)[0]
    fit = replace(base.revision.fit, vector=far, residual=residual)
    stuck = replace(base, revision=replace(base.revision, fit=fit))
    better = question.rematched(stuck, base)
    assert better.revision.fit.loss <= base.revision.fit.loss * 1.01
    assert question.rematched(better, stuck) is better
