import math

import pytest

from robotcast.reporting.names import error, number, odds, p_value, share, with_interval


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0251, "0.0251"), (-3.14159, "−3.14"), (0.0, "0"), (None, "–"), (math.nan, "–"),
        (math.inf, "–"), (1234.6, "1235"), (9.996, "10.0"), (3.2e-6, "3.20·10⁻⁶"),
        (-2.5e7, "−2.50·10⁷"), (9.999e-5, "0.000100"),
    ],
)  # fmt: skip
def test_numbers_have_three_significant_digits(value, text) -> None:
    assert number(value) == text


def test_p_values_and_odds_are_read_by_people() -> None:
    assert [p_value(p) for p in (0.31, 0.0042, 1.3e-7)] == ["0.31", "0.0042", "1.3·10⁻⁷"]
    assert p_value(0.0) == "<\u202f10⁻¹²"
    assert odds(0.00021) == "1 in 4\u202f800"
    assert odds(1e-9) == "< 1 in 1\u202f000\u202f000"
    assert odds(0.9) == "1 in 2 or more"


def test_shares_never_round_to_certainty() -> None:
    assert [share(s).replace("\u202f", " ") for s in (0.999, 1.0, 0.001, 0.0, 0.56)] == [
        "> 99 %", "100 %", "< 1 %", "0 %", "56 %",
    ]  # fmt: skip


def test_errors_have_two_decimals_below_ten() -> None:
    assert error(0.7612) == "0.76\u202f%" and error(12.34) == "12.3\u202f%"
    assert error(9.999) == "10.0\u202f%" and error(None) == "–"


def test_an_interval_sets_the_decimals() -> None:
    assert with_interval(-0.02491, -0.0268, -0.0231) == ("−0.0249", "−0.0268", "−0.0231")
    assert with_interval(7.13, 6.2, 8.04) == ("7.13", "6.20", "8.04")
    assert with_interval(1.14, None, None) == ("1.14", "–", "–")
