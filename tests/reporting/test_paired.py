import numpy as np
import pytest

from robotcast.reporting.paired import median_change


def hard_and_easy(targets: int, seed: int = 3) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [np.abs(random.normal(hard, 0.02 * hard, 5)) for hard in random.lognormal(1, 1, targets)]


def test_a_change_that_all_targets_share_is_known_well_however_different_they_are() -> None:
    before = hard_and_easy(16)
    change, low, high = median_change(before, [0.7 * e for e in before])
    assert (change, low, high) == pytest.approx((-0.3, -0.3, -0.3))


def test_no_change_lies_in_the_interval_of_policies_that_are_alike() -> None:
    _, low, high = median_change(hard_and_easy(40, seed=1), hard_and_easy(40, seed=2))
    assert low < 0 < high


def test_more_targets_narrow_the_interval() -> None:
    def width(targets: int) -> float:
        pairs = [(hard_and_easy(targets, k), hard_and_easy(targets, k + 50)) for k in range(1, 5)]
        intervals = np.array([median_change(*pair)[1:] for pair in pairs])
        return float(np.diff(intervals).mean())

    assert width(200) < 0.5 * width(16)
