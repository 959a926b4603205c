"""How well casts tell parameters is read off a Jacobian, whatever found them."""

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.tuning.certainty import MOST, certainty
from robotcast.tuning.search import Problem, Query, Response

PARAMETERS = (
    Parameter("sharp", "1", 0.0, 2.0, 1.0),
    Parameter("one_half", "1", 0.0, 1.0, 0.5),
    Parameter("other_half", "1", 0.0, 1.0, 0.5),
)
CASTS = 12
NOISE = 0.5


def problem(parameters=PARAMETERS) -> Problem:
    return Problem(parameters, np.full(len(parameters), 0.5), CASTS, noise_percent=NOISE)


class Lines:
    """Casts whose one waypoint moves in proportion to a few combinations of the parameters."""

    def __init__(self, slopes: np.ndarray, true: float | np.ndarray = 0.5) -> None:
        self.slopes, self.true = slopes, true
        self.noise = NOISE * np.random.default_rng(0).normal(size=len(slopes))

    def __call__(self, query: Query) -> Response:
        misses = (query.vectors - self.true) @ self.slopes.T + self.noise
        return Response(np.abs(misses).mean(axis=1), np.zeros(len(misses), int), misses[..., None])


def own_slopes(columns: int, seed: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(CASTS, columns)) * 30


def test_an_interval_is_a_little_wider_than_two_standard_errors_of_least_squares() -> None:
    slopes = own_slopes(3)
    found = certainty(Lines(slopes), problem(), np.full(3, 0.5), np.arange(CASTS))
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    for p, error in zip(PARAMETERS, expected, strict=True):
        low, high = found.intervals[p.name]
        assert low < 0.5 * (p.lower + p.upper) < high
        least = 4 * error * (p.upper - p.lower)
        assert least < high - low < 2 * least  # robust weights trust no cast fully
    assert found.vague == ()
    assert found.simulated_casts == 2 * 7 * CASTS


def test_two_parameters_that_casts_tell_only_together_are_named() -> None:
    slopes = own_slopes(2)[:, [0, 1, 1]]
    found = certainty(Lines(slopes), problem(), np.full(3, 0.5), np.arange(CASTS))
    assert found.least_known == ("one_half", "other_half")
    assert found.vague == ("one_half", "other_half")
    assert found.condition == MOST


def test_a_parameter_that_moves_nothing_is_vague_over_its_whole_range() -> None:
    slopes = own_slopes(3) * [1, 0, 1]
    found = certainty(Lines(slopes), problem(), np.full(3, 0.5), np.arange(CASTS))
    assert found.vague == ("one_half",)
    assert found.intervals["one_half"] == (0.0, 1.0)


def test_at_a_bound_the_difference_is_taken_inwards() -> None:
    corner = np.array([0.0, 1.0, 0.5])
    found = certainty(Lines(own_slopes(3), corner), problem(), corner, np.arange(CASTS))
    assert found.intervals["sharp"][0] == 0.0
    assert found.intervals["one_half"][1] == 1.0
    assert found.vague == ()


def test_repeats_of_one_action_tell_less_than_different_ones() -> None:
    slopes, noise = own_slopes(1)[:, [0]], np.repeat([0.5, -0.7, 0.9, -0.6], 3)
    lines = Lines(slopes)
    lines.noise = noise * np.sign(slopes[:, 0])  # each group errs to one side
    one = problem(PARAMETERS[:1])
    apart = certainty(lines, one, np.array([0.5]), np.arange(CASTS))
    groups = certainty(lines, one, np.array([0.5]), np.repeat(np.arange(4), 3))
    width = [high - low for low, high in (apart.intervals["sharp"], groups.intervals["sharp"])]
    assert width[1] > width[0]
