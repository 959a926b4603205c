"""The ladder of revisions, live while a tuning runs and afterwards."""

import re
from dataclasses import replace

import numpy as np
import pytest

from robotcast.reporting.revisions_page import TuningProgress, comparable, revisions_page
from robotcast.reporting.style import Bar, Row, bars, inline
from robotcast.tuning.search import Batch
from tests.tuning.some_revisions import BASE, TILT

TRACE = tuple(Batch(800, float(b), float(2 * b), 0) for b in 1 + 8 * np.exp(-np.arange(12) / 3))


def tuning(effects=("board_tilt",), trace=TRACE, finished=False) -> TuningProgress:
    return TuningProgress(
        cable="cable1", rig="virtual", split="aaaa", simulator="segmented", optimizer="de",
        effects=effects, noise_floor_percent=0.76, trace=trace, finished=finished,
    )  # fmt: skip


def words(page: str) -> str:
    body = re.sub(r"<style>.*?</style>", "", page, flags=re.S)
    text = re.sub(r"<[^>]+>", " ", body)
    return re.sub(r"\s+", " ", text.replace("\u202f", " ").replace("\u2011", "-"))


def test_while_it_runs_the_page_reloads_and_shows_the_best_so_far_beside_the_base() -> None:
    page = revisions_page([BASE], tuning())
    assert '<meta http-equiv="refresh"' in page
    assert f"Best so far: {TRACE[-1].best_percent:.2f} % of cable length" in words(page)
    assert "after 12 batches" in words(page)
    assert "base model 2.46 %" in words(page)


def test_afterwards_it_says_how_far_the_error_fell() -> None:
    page = revisions_page([BASE, TILT], tuning(finished=True))
    assert "refresh" not in page
    assert "With board tilt, the error on held-out casts fell from 3.12 % to 1.04 %" in words(page)
    assert "−67 %" in page and "predicted 1.31" in words(page)
    assert "sy −0.0249" in words(page)


def test_the_first_tuning_of_a_set_has_a_page_from_its_start() -> None:
    assert "No revision of this set" in revisions_page([], tuning((), ()))


def test_a_model_that_became_worse_with_another_budget_is_said_to_be_so() -> None:
    worse = replace(TILT, heldout_waypoint_error_percent=3.5, simulated_casts=60000)
    page = words(revisions_page([BASE, worse], tuning(finished=True)))
    assert "rose from 3.12 % to 3.50 %" in page and "not tuned with the same number" in page


def test_revisions_of_other_casts_stand_apart() -> None:
    other = replace(BASE, split="bbbb", heldout_waypoint_error_percent=0.5)
    page = revisions_page([BASE, other, TILT], tuning(finished=True))
    ladder = page[: page.index("Every revision")]
    assert "0.50" not in words(ladder)
    assert "Judged on other casts" in page


def test_falls_are_from_the_base_of_the_same_method() -> None:
    other = replace(BASE, simulator="hybrid", heldout_waypoint_error_percent=6.0)
    figure = inline(comparable([BASE, TILT, other])[0].figure(), "ladder")
    assert "−67 %" in figure and len(re.findall(r">[−+]\d+ %<", figure)) == 1
    assert "Hybrid, DE" in figure


def test_the_page_needs_nothing_else() -> None:
    page = revisions_page([BASE, TILT], tuning())
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page) and "<script" not in page
    assert page == revisions_page([BASE, TILT], tuning())


ROWS = (
    Row("base model", (Bar(3.12, "before", interval=(2.88, 3.36)),)),
    Row("+ board tilt", (Bar(1.04, note="−67 %", interval=(0.95, 1.13), predicted=1.31),)),
)


def drawn(rows: tuple[Row, ...], floor: float | None) -> str:
    return inline(bars(rows, "error", floor), "ladder")


def bar_widths(rows: tuple[Row, ...], floor: float | None) -> list[float]:
    axes = bars(rows, "error", floor).axes[0]
    return [bar.get_width() for of in axes.containers for bar in of if hasattr(bar, "get_width")]


def test_bars_are_as_long_as_errors_and_say_them_what_was_predicted_and_the_fall() -> None:
    assert bar_widths(ROWS, 0.76) == [3.12, 1.04]
    figure = drawn(ROWS, 0.76)
    assert "1.04\u202f%" in figure and "predicted 1.31\u202f%" in figure and "−67 %" in figure
    assert "noise floor 0.76\u202f%" in figure


@pytest.mark.parametrize("reached", [0.6, 0.74, 0.78, 3.12])
def test_nothing_that_is_drawn_crosses_what_is_written(reached: float) -> None:
    figure = bars((ROWS[0], Row("+ air drag", (Bar(reached, predicted=0.7),))), "error", 0.76)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    for text in axes.texts:
        if text.get_text() and "floor" not in text.get_text():
            box = text.get_window_extent()
            assert box.x0 >= axes.bbox.x1 or box.x1 <= axes.bbox.x0
            assert box.x1 <= figure.bbox.x1


def test_a_row_that_is_only_predicted_has_no_bar() -> None:
    rows = (ROWS[0], Row("+ air drag", (Bar(None, predicted=2.0),)))
    assert len(bar_widths(rows, None)) == 1
    figure = drawn(rows, None)
    assert "predicted 2.00" in figure and "noise floor" not in figure


def test_names_are_escaped() -> None:
    assert "<b>" not in inline(bars((Row("<b>", (Bar(1.0),)),), "<b>"), "<b>")
