"""How well casts tell parameters is read off a Jacobian, whatever found them."""

import numpy as np

from robotcast.fitting.parameter import Parameter
from robotcast.tuning.search import Problem, Query, Response
from robotcast.tuning.tuned import MOST, Certainty, certainty

PARAMETERS = (
    Parameter("sharp", "1", 0.0, 2.0, 1.0),
    Parameter("one_half", "1", 0.0, 1.0, 0.5),
    Parameter("other_half", "1", 0.0, 1.0, 0.5),
)
CASTS = 12
NOISE = 0.5


def found(lines: "Lines", at: float | np.ndarray = 0.5, groups=None) -> Certainty:
    """Ask how well casts tell as many of the parameters as they have slopes for."""
    n = lines.slopes.shape[1]
    problem = Problem(PARAMETERS[:n], np.full(n, 0.5), CASTS, noise_percent=NOISE)
    groups = np.arange(CASTS) if groups is None else groups
    return certainty(lines, problem, np.broadcast_to(at, n), groups)


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
    told = found(Lines(slopes))
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    for p, error in zip(PARAMETERS, expected, strict=True):
        low, high = told.intervals[p.name]
        assert low < 0.5 * (p.lower + p.upper) < high
        least = 4 * error * (p.upper - p.lower)
        assert least < high - low < 2 * least  # robust weights trust no cast fully
    assert told.vague == ()
    assert told.simulated_casts == 2 * 7 * CASTS


def test_two_parameters_that_casts_tell_only_together_are_named() -> None:
    told = found(Lines(own_slopes(2)[:, [0, 1, 1]]))
    assert told.least_known == told.vague == ("one_half", "other_half")
    assert told.condition == MOST


def test_a_parameter_that_moves_nothing_is_vague_over_its_whole_range() -> None:
    told = found(Lines(own_slopes(3) * [1, 0, 1]))
    assert told.vague == ("one_half",)
    assert told.intervals["one_half"] == (0.0, 1.0)


def test_at_a_bound_the_difference_is_taken_inwards() -> None:
    corner = np.array([0.0, 1.0, 0.5])
    told = found(Lines(own_slopes(3), corner), corner)
    assert told.intervals["sharp"][0] == 0.0
    assert told.intervals["one_half"][1] == 1.0
    assert told.vague == ()


def test_repeats_of_one_action_tell_less_than_different_ones() -> None:
    slopes, noise = own_slopes(1)[:, [0]], np.repeat([0.5, -0.7, 0.9, -0.6], 3)
    lines = Lines(slopes)
    lines.noise = noise * np.sign(slopes[:, 0])  # each group errs to one side
    told = found(lines), found(lines, groups=np.repeat(np.arange(4), 3))
    apart, grouped = (high - low for low, high in (one.intervals["sharp"] for one in told))
    assert grouped > apart
