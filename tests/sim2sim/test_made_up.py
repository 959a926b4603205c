"""What a search may know of a made-up model: nothing but its casts."""

import numpy as np
import pytest

from robotcast.sim2sim.made_up import stream


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize("start", [0, 1])
def test_no_start_holds_numbers_of_the_model(number: int, start: int) -> None:
    model = stream(0, number, "model").random(8)
    casts = stream(0, number, "casts").random(8)
    first = stream(0, number, "start", start).random(8)
    assert len(np.unique([model, casts, first])) == 24


def test_a_stream_is_the_same_at_every_call_and_another_for_every_start() -> None:
    one, again = (stream(3, 1, "start", 1).random(4) for _ in range(2))
    np.testing.assert_array_equal(one, again)
    assert not np.isin(one, stream(3, 1, "start", 0).random(4)).any()
