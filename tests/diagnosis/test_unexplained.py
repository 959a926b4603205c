"""When a field of no name stands in the place of effects that have one."""

import pytest

from robotcast.diagnosis.search.gain import Gain
from robotcast.diagnosis.search.unexplained import replaces


@pytest.mark.parametrize("named", [1, 2, 3])
def test_a_field_that_is_better_beyond_doubt_replaces_what_was_named(named: int) -> None:
    assert replaces(Gain(percent=1.0, share=0.5, p_value=1e-5), named)


def test_one_field_that_is_likely_better_replaces_several_names_but_not_one() -> None:
    likely = Gain(percent=0.4, share=0.5, p_value=0.02)
    assert replaces(likely, 2)
    assert not replaces(likely, 1)


@pytest.mark.parametrize(
    "saved",
    [Gain(percent=0.1, share=0.2, p_value=0.02), Gain(percent=0.4, share=0.5, p_value=0.2)],
)
def test_several_names_stay_where_a_field_saves_little_or_by_luck(saved: Gain) -> None:
    assert not replaces(saved, 2)
