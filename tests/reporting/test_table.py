import csv
import io
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from robotcast.reporting.table import Cell, Group, Row, Table, to_latex

TABLE = Table(
    name="made_up",
    caption="Errors in % of cable length for π_R2S2R on D_real ∪ D_sim, 1\u202f200\u00a0casts.",
    label_columns=("Model",),
    groups=(Group("virtual rig", ("Median", "Q1")), Group("paper’s robot", ("Median", "Q1"))),
    rows=(
        Row(("π_RD",), (Cell(12.34), Cell(None), Cell(15, 0), Cell(11, 0))),
        Row(("π_R2S2R",), (Cell(8.06, best=True), Cell(5.5), Cell(8, 0, True), Cell(5, 0))),
    ),
    reference=1,
)


def test_markdown_shows_percent_bold_and_what_was_not_run() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[0].startswith("| Model | virtual rig: Median | virtual rig: Q1 |")
    assert lines[2] == "| π_RD | 12.3% | – | 15% | 11% |"
    assert lines[3] == "| π_R2S2R | **8.1%** | 5.5% | **8%** | 5% |"
    assert TABLE.caption in lines


def test_csv_holds_plain_numbers() -> None:
    rows = list(csv.reader(io.StringIO(TABLE.csv())))
    assert rows[0][1] == "virtual rig: Median [% of cable length]"
    assert rows[1] == ["π_RD", "12.340", "", "15.00", "11.00"]


def test_latex_has_one_cell_for_every_column() -> None:
    text = TABLE.latex()
    bodies = [line for line in text.splitlines() if line.startswith(r"  $\pi_")]
    assert [line.count("&") for line in bodies] == [4, 4]
    assert r"\textbf{8.1\%}" in text
    assert r"\cmidrule(lr){2-3} \cmidrule(lr){4-5}" in text


def test_latex_writes_the_papers_symbols() -> None:
    assert to_latex("π_R2S2R ∪ 5%") == r"$\pi_\mathrm{R2S2R}$ $\cup$ 5\%"
    assert to_latex("a_b & c") == r"a\_b \& c"


WIDE = replace(
    TABLE,
    groups=tuple(Group(f"a group of columns, {k}", ("Median", "Third")) for k in range(9)),
    rows=(Row(("π_RD",), (Cell(12.34),) * 18),),
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
