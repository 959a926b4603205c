"""The noise floor as errors are judged."""

from collections.abc import Callable

import numpy as np
import pytest

from robotcast.diagnosis.comparison.repeats import RepeatScatter
from robotcast.diagnosis.search.floor import Floor


def scatter(*groups: list[float]) -> RepeatScatter:
    deviations = tuple(np.array(group) for group in groups)
    return RepeatScatter(1.0, 1.0, np.empty(0), deviations, len(groups), 3 * len(groups))


def test_one_whip_like_action_hardly_moves_the_unit() -> None:
    calm = Floor.of(scatter([1.0, 1.2, 0.9], [0.8, 1.1, 1.0], [1.0, 1.0, 1.1]))
    whip = Floor.of(scatter([1.0, 1.2, 0.9], [0.8, 1.1, 1.0], [10.0, 12.0, 2.0]))
    assert whip.unit_percent == pytest.approx(calm.unit_percent, rel=0.1)
    assert whip.percent is not None and calm.percent is not None
    assert whip.percent > 3 * calm.percent


def test_a_model_that_misses_like_repeats_has_reached_the_floor() -> None:
    floor = Floor.of(scatter([1.0, 1.2, 0.9], [0.8, 1.1, 1.0], [10.0, 12.0, 2.0]))
    errors = np.array([1.0, 1.2, 0.9, 0.8, 1.1, 1.0, 10.0, 12.0, 2.0])
    assert floor.reached(errors)
    assert floor.excess(errors) == pytest.approx(0.0, abs=1e-12)
    assert not floor.reached(1.3 * errors)


def test_without_repeats_no_error_reaches_the_floor() -> None:
    floor = Floor.of(RepeatScatter(None, None, np.empty(0), (), 0, 0))
    assert floor.percent is None
    assert not floor.reached(np.zeros(3))


def test_a_floor_known_from_elsewhere_is_its_own_unit() -> None:
    floor = Floor.known(2.0)
    assert floor.reached(np.full(5, 2.1)) and not floor.reached(np.full(5, 2.5))


@pytest.mark.parametrize(("tell", "times"), [(Floor.above, 2.0), (Floor.far_above, 4.0)])
def test_errors_so_many_times_those_of_repeats_lie_above_the_floor(
    tell: Callable[[Floor, np.ndarray], bool], times: float
) -> None:
    floor = Floor.of(scatter([1.0, 1.2, 0.9], [0.8, 1.1, 1.0], [10.0, 12.0, 2.0]))
    errors = np.array([1.0, 1.2, 0.9, 0.8, 1.1, 1.0, 10.0, 12.0, 2.0])
    assert tell(floor, 1.05 * times * errors) and not tell(floor, 0.95 * times * errors)
    assert not tell(Floor.of(RepeatScatter(None, None, np.empty(0), (), 0, 0)), 100 * errors)
