"""A split never shows one side an action of the other."""

from pathlib import Path

import pytest

from robotcast.measurements.measurement_set import MeasurementSet, split_by_action
from robotcast.measurements.reader import read_measurement_set


@pytest.fixture(scope="module")
def measured(recorded_sets: Path) -> MeasurementSet:
    return read_measurement_set(recorded_sets / "a")


@pytest.mark.parametrize("seed", range(20))
def test_sides_are_full_and_share_no_action(measured: MeasurementSet, seed: int) -> None:
    first, second = split_by_action(measured, 20, 30, seed)
    assert (len(first.trials), len(second.trials)) == (20, 30)
    assert not {t.action_id for t in first.trials} & {t.action_id for t in second.trials}


def test_repeats_stay_together(measured: MeasurementSet) -> None:
    repeats = {a: {t.trial for t in measured.trials if t.action_id == a} for a in range(6)}
    first, second = split_by_action(measured, 12, 40, seed=1)
    sides = [{t.trial for t in side.trials} for side in (first, second)]
    for casts in repeats.values():
        assert any(casts <= side or not casts & side for side in sides)


def test_the_seed_alone_decides(measured: MeasurementSet) -> None:
    def numbers(seed: int) -> list[int]:
        return [t.trial for t in split_by_action(measured, 20, 30, seed)[0].trials]

    assert numbers(4) == numbers(4)
    assert numbers(4) != numbers(5)


@pytest.mark.parametrize(
    ("actions", "sides", "said"),
    [
        (40, (30, 30), r"needs 30 \+ 30 casts, the set has 52"),
        (6, (2, 2), "repeats of an action together"),
        (40, (20, 0), "both sides"),
    ],
)
def test_what_cannot_be_split_is_refused(
    measured: MeasurementSet, actions: int, sides: tuple[int, int], said: str
) -> None:
    some = measured.select(t.trial for t in measured.trials if t.action_id < actions)
    with pytest.raises(ValueError, match=said):
        split_by_action(some, *sides, seed=0)


def test_a_spread_is_even_and_no_larger_than_the_set(measured: MeasurementSet) -> None:
    numbers = [t.trial for t in measured.trials]
    assert [t.trial for t in measured.spread(2).trials] == [numbers[0], numbers[len(numbers) // 2]]
    assert measured.spread(10_000) == measured
