"""What lags behind the tool follows the difference equation that SciPy solves, bit for bit."""

import numpy as np
import pytest
from scipy.signal import lfilter, lfilter_zi

from robotcast.rigs.virtual.arm import lagged

DECAY = np.exp(-0.01)
SECOND_ORDER = ([1.0, 2.0, 1.0], [1325.0, -2588.0, 1267.0])
FIRST_ORDER = ([0.6, 0.4 - DECAY, 0.0], [1.0, -DECAY, 0.0])


@pytest.mark.parametrize("equation", [SECOND_ORDER, FIRST_ORDER])
def test_it_gives_the_bits_of_scipy(equation):
    numerator, denominator = (np.array(c) for c in equation)
    asked = np.cumsum(np.random.default_rng(0).normal(size=(500, 3)), axis=0)
    state = lfilter_zi(numerator, denominator)[:, None] * asked[0]
    expected = lfilter(numerator, denominator, asked, axis=0, zi=state)[0]
    np.testing.assert_array_equal(lagged(numerator, denominator, asked), expected)


def test_what_rests_stays():
    asked = np.full((50, 2), 0.7)
    numerator, denominator = (np.array(c) for c in SECOND_ORDER)
    unit = numerator.sum() / denominator.sum()
    np.testing.assert_allclose(lagged(numerator, denominator, asked), unit * asked, rtol=1e-9)
