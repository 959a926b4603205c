import csv
import io
import shutil
import subprocess
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from robotcast.reporting.page import to_latex
from robotcast.reporting.results import Results, read_results
from robotcast.reporting.tables import (
    Group,
    Table,
    cables_table,
    markdown,
    parts_table,
    policies_table,
    tuning_table,
)
from tests.tuning.some_revisions import TILT

TABLE = Table(
    name="errors",
    caption="Errors in % of cable length for π_R2S2R on D_real ∪ D_sim, 1\u202f200\u00a0casts.",
    label_columns=("Model",),
    groups=(
        Group("virtual rig", ("Median", "Q1"), contest=True),
        Group("paper’s robot", ("Median", "Q1")),
    ),
    rows=(("π_RD", 12.34, None, 15, 11), ("π_R2S2R", 8.06, 5.5, 8, 5)),
    reference=1,
    contests=("one", "one"),
)


def test_markdown_shows_percent_bold_and_what_was_not_run() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[0].startswith("| Model | virtual rig: Median | virtual rig: Q1 |")
    assert lines[2] == "| π_RD | 12.3% | – | 15% | 11% |"
    assert lines[3] == "| π_R2S2R | **8.1%** | 5.5% | 8% | 5% |"
    assert TABLE.caption in lines


def test_csv_holds_plain_numbers() -> None:
    rows = list(csv.reader(io.StringIO(TABLE.csv())))
    assert rows[0][1] == "virtual rig: Median [% of cable length]"
    assert rows[1] == ["π_RD", "12.340", "", "15", "11"]


def test_markdown_of_any_rows_has_one_decimal_and_no_minus_before_zero() -> None:
    table = markdown(("a", "b", "c"), [(1, 2.345, -0.04)])
    assert table == "| a | b | c |\n| --- | --- | --- |\n| 1 | 2.3 | 0.0 |\n"


def test_latex_has_one_cell_for_every_column_and_the_papers_symbols() -> None:
    text = TABLE.latex()
    bodies = [line for line in text.splitlines() if line.startswith(r"  $\pi_")]
    assert [line.count("&") for line in bodies] == [4, 4]
    assert r"\textbf{8.1\%}" in text
    assert r"\cmidrule(lr){2-3} \cmidrule(lr){4-5}" in text
    assert to_latex("π_R2S2R ∪ 5%") == r"$\pi_\mathrm{R2S2R}$ $\cup$ 5\%"
    assert to_latex("a_b & c") == r"a\_b \& c"


WIDE = replace(
    TABLE,
    groups=tuple(Group(f"a group of columns, {k}", ("Median", "Third")) for k in range(9)),
    rows=(("π_RD", *[12.34] * 18),),
    contests=(),
)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX on this machine")
@pytest.mark.parametrize("table", [TABLE, WIDE])
def test_latex_compiles_and_fits_the_page(tmp_path: Path, table: Table) -> None:
    packages = r"\documentclass{article}\usepackage{booktabs,graphicx}"
    document = packages + "\\begin{document}\n" + table.latex() + "\\end{document}"
    (tmp_path / "t.tex").write_text(document)
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "t.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-1500:]
    assert "Overfull" not in done.stdout


@pytest.fixture(scope="module")
def results(data_folder) -> Results:
    return read_results(data_folder)


def row_of(table: Table, *labels: str) -> dict[str, str]:
    names = [f"{g.title}: {c}" for g in table.groups for c in g.columns]
    cells = next(cells for written, cells in table.written if written == labels)
    return dict(zip(names, (c.text for c in cells), strict=True))


def test_tuning_shows_the_papers_simulators_run_or_not_and_the_noise_floor(results) -> None:
    table = tuning_table(results)
    assert row_of(table, "PyBullet, DE")["virtual rig, Cable 1: Wayp."] == "–"
    segmented = row_of(table, "Segmented, DE")
    assert segmented["virtual rig, Cable 1: Last"] == "3.1%"
    assert segmented["paper’s robot, Cable 1: Wayp."] == "9%"
    floor = row_of(table, "Noise floor (repeats)")
    measured = results.cables[0].floor
    assert measured is not None and measured.final_percent is not None
    assert floor["virtual rig, Cable 1: Last"] == f"{measured.final_percent:.1f}%"
    assert floor["paper’s robot, Cable 1: Last"] == "–"


def test_policies_have_the_papers_five_rows_with_its_values(results) -> None:
    table = policies_table(results)
    names = ["Cast and Pull", "Gaussian Proc.", "π_RD", "π_SD", "π_R2S2R"]
    assert [row[1] for row in table.rows] == names
    mixed = row_of(table, "Cable 1", "π_R2S2R", "D_real ∪ D_sim")
    assert mixed["paper’s robot, Cable 1: Max"] == "105%"
    evaluation = results.evaluation("cable1", "nn", "mixed")
    assert evaluation is not None
    assert mixed["virtual rig: Median"] == f"{np.median(evaluation.errors_percent):.1f}%"
    assert float(mixed["Median: from"].rstrip("%")) <= np.median(evaluation.errors_percent)
    assert mixed["Repeats: Scatter"] == f"{evaluation.scatter_percent:.1f}%"
    none = row_of(table, "Cable 1", "Cast and Pull", "N/A")
    assert none["virtual rig: Median"] == none["Repeats: Scatter"] == "–"


def test_the_lowest_of_each_column_is_bold(results) -> None:
    table = policies_table(results)
    medians = [row[3] for row in table.rows]
    best = min(median for median in medians if median is not None)
    assert [cells[0].best for _, cells in table.written] == [median == best for median in medians]
    assert [cells[-1].best for _, cells in table.written] == [False, False, True, False, False]


def test_other_cables_show_only_the_policies_that_were_run(results) -> None:
    mixed = next(e for e in results.evaluations if e.cable == "cable2")
    both = replace(results, evaluations=(*results.evaluations, replace(mixed, policy="residual")))
    assert [row[:3] for row in policies_table(both).rows if row[0] == "Cable 2"] == [
        ("Cable 2", "π_R2S2R", "D_real ∪ D_sim"),
        ("Cable 2", "Residual", "D_real ∪ D_sim"),
    ]


def test_cables_has_one_row_a_cable(results) -> None:
    table = cables_table(results)
    assert [row[0] for row in table.rows] == ["Cable 1", "Cable 2", "Cable 3"]
    assert row_of(table, "Cable 2")["paper’s robot: Median"] == "12%"


def test_captions_name_the_rig_and_the_paper_and_count_targets_and_repeats(results) -> None:
    for table in (tuning_table(results), policies_table(results), cables_table(results)):
        assert "virtual rig" in table.caption and "paper’s robot" in table.caption
    assert "16 targets × 5 casts each" in cables_table(results).caption


def test_parts_tell_repeatability_from_the_models_share(results) -> None:
    table = parts_table(results)
    row = {
        name: float(text.rstrip("%"))
        for name, text in row_of(table, "Cable 1", "π_R2S2R", "D_real ∪ D_sim").items()
    }
    assert row["Median: from"] <= row["Median: Median"] <= row["Median: to"]
    repeats, model = row["Root mean square: Repeatability"], row["Root mean square: Model"]
    share = 100 * repeats**2 / (repeats**2 + model**2)
    assert row["Share: Aleatoric"] == pytest.approx(share, abs=2)
    assert row["Share: Aleatoric"] + row["Share: Epistemic"] == pytest.approx(100, abs=0.11)
    far = row_of(table, "Cable 1", "π_RD", "D_real")["Root mean square: Model"]
    assert float(far.rstrip("%")) > model
    assert row["Model’s spread: Expected"] == pytest.approx(
        100 * np.hypot(0.03, 0.02) / results.cable("cable1").measured.cable.length_m, abs=0.1
    )
    casts = results.evaluation("cable1", "nn", "mixed").casts
    away_x, away_y = casts["x"] - casts["predicted_x"], casts["y"] - casts["predicted_y"]
    inside = (away_x / 0.03) ** 2 + (away_y / 0.02) ** 2 < 5.991
    assert row["Model’s spread: Covered"] == pytest.approx(100 * inside.mean(), abs=0.1)


def test_every_simulator_has_a_row_for_every_optimizer(optimizers: Results) -> None:
    *labels, last = (row[0] for row in tuning_table(optimizers).rows)
    pairs = product(("PyBullet", "Hybrid", "Segmented"), ("DE", "BO", "Gauss–Newton"))
    assert labels == [f"{s}, {o}" for s, o in pairs] and last == "Noise floor (repeats)"


def test_a_row_with_an_effect_stands_where_it_helps(optimizers: Results) -> None:
    first = optimizers.cables[0]
    base = next(t for t in optimizers.tunings if (t.cable, t.optimizer) == (first.name, "de"))
    error = base.error("test", "waypoint_percent") or 0.0
    helps = replace(TILT, cable=first.name, heldout_waypoint_error_percent=error - 0.5)
    hurts = replace(helps, effects=("air_drag",), heldout_waypoint_error_percent=error + 0.5)
    cables = (replace(first, revisions=(helps, hurts)), *optimizers.cables[1:])
    rows = {row[0]: row[1:] for row in tuning_table(replace(optimizers, cables=cables)).rows}
    assert "Segmented, DE + air drag" not in rows
    shown = rows["Segmented, DE + board tilt"]
    assert shown[0] == error - 0.5
    assert shown[2:] == (None,) * 10  # of other cables, and the paper


def test_the_caption_says_who_was_given_how_much(optimizers: Results) -> None:
    assert "Tuned to: " not in tuning_table(optimizers).caption
    fewer = {**optimizers.tunings[0].facts, "simulated_casts": 48}
    tunings = (replace(optimizers.tunings[0], facts=fewer), *optimizers.tunings[1:])
    caption = tuning_table(replace(optimizers, tunings=tunings)).caption
    assert "Tuned to: Segmented, BO 30 casts, 48 simulated; " in caption
