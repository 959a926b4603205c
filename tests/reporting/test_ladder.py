"""The error ladder as it is drawn."""

import re

from robotcast.reporting.ladder import Rung, ladder

BASE = Rung("base model", 3.12, 0.24, kind="base")
TILT = Rung("+ board tilt", 1.04, 0.09, predicted=1.31, compared_to=3.12)


def bar_widths(figure: str) -> list[float]:
    return [float(w) for w in re.findall(r'width="([\d.]+)" height="17"', figure)]


def test_bars_are_as_long_as_errors_are_large() -> None:
    base, tilt = bar_widths(ladder([BASE, TILT], 0.76))
    assert abs(tilt / base - 1.04 / 3.12) < 0.01


def test_each_rung_says_its_error_what_was_predicted_and_how_far_it_fell() -> None:
    figure = ladder([BASE, TILT], 0.76)
    assert "1.04\u202f%" in figure and "predicted 1.31\u202f%" in figure and "−67 %" in figure
    assert "noise floor 0.76\u202f%" in figure


def test_a_rung_that_is_only_predicted_has_no_bar() -> None:
    figure = ladder([BASE, Rung("+ air drag", None, predicted=2.0)], None)
    assert len(bar_widths(figure)) == 1
    assert "predicted 2.00" in figure and "noise floor" not in figure


def test_names_are_escaped() -> None:
    assert "<b>" not in ladder([Rung("<b>", 1.0)], None)
