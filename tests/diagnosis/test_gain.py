"""When a saving is beyond luck and worth an effect."""

import numpy as np
import pytest

from robotcast.diagnosis.search.floor import Floor
from robotcast.diagnosis.search.gain import Gain, gain, worse

FLOOR = Floor.known(0.5)
GROUPS = np.arange(40)


def errors(level: float, seed: int) -> np.ndarray:
    """Return average errors of 40 trials [% of the scale]."""
    return level * np.exp(0.2 * np.random.default_rng(seed).normal(size=len(GROUPS)))


def test_a_clear_saving_pays_and_none_does_not() -> None:
    clear = gain(errors(2.0, 0), errors(0.6, 1), GROUPS, FLOOR)
    assert clear.pays
    assert clear.percent == pytest.approx(1.4, abs=0.1)
    assert 0.7 < clear.share <= 1.0
    assert not gain(errors(2.0, 0), errors(2.0, 1), GROUPS, FLOOR).pays


def test_a_sure_but_small_saving_is_not_worth_an_effect() -> None:
    before = errors(2.0, 0)
    small = gain(before, 0.97 * before, GROUPS, FLOOR)
    assert small.p_value < 1e-3
    assert small.share < 0.1
    assert not small.pays


def test_what_promises_takes_much_away_but_need_not_be_beyond_doubt() -> None:
    assert Gain(percent=0.4, share=0.9, p_value=0.02).promises
    assert not Gain(percent=0.1, share=0.2, p_value=0.02).promises
    assert not Gain(percent=0.4, share=0.9, p_value=0.1).promises


def test_what_may_pay_is_wider_than_what_pays() -> None:
    undecided = Gain(percent=0.1, share=0.06, p_value=0.005)
    assert undecided.may_pay
    assert not undecided.pays
    assert not Gain(percent=0.1, share=0.5, p_value=0.02).may_pay
    assert not Gain(percent=0.1, share=0.04, p_value=1e-6).may_pay


def test_one_diverged_trial_does_not_hide_what_all_others_save() -> None:
    saved = np.full(40, 0.5) + 0.1 * np.random.default_rng(0).normal(size=40)
    saved[7] = -50.0
    assert worse(saved, GROUPS) < 1e-3
