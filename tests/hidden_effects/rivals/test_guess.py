"""A guess is a draw, and a draw is the same the next time."""

from robotcast.hidden_effects.rivals.guess import random_guess
from tests.hidden_effects.rivals.conftest import CANDIDATES

CASES = [f"case-{n:03d}" for n in range(60)]


def guesses(seed: int) -> list[str]:
    return [random_guess(case, CANDIDATES, seed) for case in CASES]


def test_every_candidate_is_drawn_and_no_other():
    assert set(guesses(0)) == set(CANDIDATES)


def test_the_same_case_and_seed_draw_the_same_whatever_the_order_of_the_candidates():
    assert guesses(1) == guesses(1)
    assert guesses(1) == [random_guess(case, CANDIDATES[::-1], 1) for case in CASES]
    assert guesses(1) != guesses(2)
