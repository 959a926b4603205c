import xml.etree.ElementTree as ET

import numpy as np
import polars as pl
import pytest
from matplotlib.patches import Ellipse
from matplotlib.text import Text

from robotcast.reporting.figures import (
    confidence_ellipse,
    errors_figure,
    overlay_figure,
    targets_figure,
    trace_figure,
)
from robotcast.reporting.results import Results, read_results
from robotcast.reporting.style import style, svg


@pytest.fixture(scope="module")
def results(data_folder) -> Results:
    return read_results(data_folder)


def test_the_same_results_give_the_same_bytes(results) -> None:
    def once() -> str:
        with style():
            return svg(targets_figure(results.evaluations[:1], results.cables[:1]))

    assert once() == once()
    assert "<dc:date>" not in once()


def test_axes_have_units_and_the_rig_is_named(results) -> None:
    tuning = results.tunings[0]
    with style():
        figures = [
            overlay_figure(tuning, tuning.test_paths, 0.63),
            trace_figure(results.tunings, {"cable1": 0.8}),
            errors_figure(results.evaluations, {"cable1": 1.2}),
            targets_figure(results.evaluations[:1], results.cables[:1]),
        ]
    for figure in figures:
        texts = [t.get_text() for t in figure.findobj(Text) if isinstance(t, Text)]
        assert any("virtual rig" in t for t in texts)
        labels = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
        assert labels and all("[" in label for label in labels)
        ET.fromstring(svg(figure))


def test_the_overlay_runs_from_the_best_to_the_worst_cast(results) -> None:
    tuning = results.tunings[0]
    with style():
        figure = overlay_figure(tuning, tuning.test_paths, 0.63)
    errors = [float(a.get_title().split(": ")[1].removesuffix(" %")) for a in figure.axes]
    assert errors == sorted(errors)
    assert figure.axes[0].get_title().startswith("best")
    assert figure.axes[-1].get_title().startswith("worst")


def test_the_ellipse_holds_95_percent_of_a_normal_cloud() -> None:
    rng = np.random.default_rng(0)
    mixing = np.array([[0.03, 0.02], [0.0, 0.01]])
    points = rng.standard_normal((20000, 2)) @ mixing + [0.8, -0.4]
    centre, large, small, angle = confidence_ellipse(points)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    along, across = turn @ (points - centre).T
    inside = (2 * along / large) ** 2 + (2 * across / small) ** 2 <= 1
    assert inside.mean() == pytest.approx(0.95, abs=0.005)
    assert large > small


def test_two_repeats_make_no_ellipse(results) -> None:
    with style():
        many = targets_figure(results.evaluations[:1], [None])
        first = results.evaluations[0]
        few = type(first)(**{**vars(first), "casts": first.casts.filter(pl.col("repeat") < 2)})
        none = targets_figure([few], [None])
    assert len(many.findobj(Ellipse)) == 16
    assert len(none.findobj(Ellipse)) == 0
