import numpy as np
import pytest

from robotcast.policies.evaluating.error_parts import error_parts, median_interval

RANDOM = np.random.default_rng(0)
TARGETS = [np.array([1.0, -0.2 * k]) for k in range(400)]


def casts(offset_m: float, scatter_m: float, repeats: int) -> list[np.ndarray]:
    away = np.array([offset_m, 0.0])
    return [t + away + RANDOM.normal(0, scatter_m, (repeats, 2)) for t in TARGETS]


@pytest.mark.parametrize("repeats", [2, 5])
def test_scatter_and_offset_are_told_apart_whatever_the_number_of_repeats(repeats) -> None:
    parts = error_parts(casts(0.04, 0.02, repeats), TARGETS)
    assert parts is not None
    assert parts.repeatability == pytest.approx(0.02 * np.sqrt(2), rel=0.1)
    assert parts.model == pytest.approx(0.04, rel=0.1)
    assert parts.repeatability_share == pytest.approx(1 / 3, abs=0.06)


def test_casts_without_repeats_tell_no_parts() -> None:
    assert error_parts(casts(0.04, 0.02, 1), TARGETS) is None


def test_the_interval_of_the_median_holds_it_and_narrows_with_targets() -> None:
    def width(count: int) -> float:
        errors = [np.abs(RANDOM.normal(3, 1, 5)) for _ in range(count)]
        low, high = median_interval(errors)
        assert low <= np.median(np.concatenate(errors)) <= high
        return high - low

    assert width(200) < 0.6 * width(16)


def test_repeats_of_one_target_do_not_count_as_independent() -> None:
    errors = [np.full(5, e) for e in RANDOM.normal(3, 1, 16)]
    low, high = median_interval(errors)
    alone_low, alone_high = median_interval([e[:1] for e in errors])
    assert (low, high) == pytest.approx((alone_low, alone_high), rel=0.2)
