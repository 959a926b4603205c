"""The study's table counts tunings by their worst parameter that the casts tell."""

from dataclasses import replace
from pathlib import Path

import pytest

from robotcast.sim2sim.outcome import Outcome, read_outcomes, write_outcomes
from robotcast.sim2sim.tables import HEAD, csv_text, markdown, rows

FRICTION = Outcome(
    simulator="segmented", optimizer="bo_lcb", casts=5, model=0, start=0, parameter="friction",
    unit="1", true=0.4, found=0.402, told_within_percent=3.0, tuning_percent=0.1,
    test_percent=0.2, simulated_casts=2000, diverged_casts=1,
)  # fmt: skip
STIFFNESS = replace(FRICTION, parameter="stiffness", true=2e-4, found=2.1e-4)
UNTOLD = replace(FRICTION, parameter="joint", true=1e-5, found=9e-5, told_within_percent=400.0)


def cells(*outcomes: Outcome) -> list[dict[str, str]]:
    return [dict(zip(HEAD, row, strict=True)) for row in rows(outcomes, 20.0)[1:]]


def test_a_parameter_that_the_casts_do_not_tell_is_left_out() -> None:
    (cell,) = cells(FRICTION, STIFFNESS, UNTOLD)
    assert cell["Parameters told"] == "2 of 3"
    assert cell["Parameter error [%]"] == "5"
    assert cell["Within 1 %"] == "0 of 1"


def test_each_tuning_counts_once() -> None:
    again = [replace(o, start=1, found=o.true) for o in (FRICTION, STIFFNESS)]
    (cell,) = cells(FRICTION, STIFFNESS, *again)
    assert cell["Tunings"] == "2"
    assert (cell["Parameter error [%]"], cell["Worst [%]"]) == ("2.5", "5")
    assert cell["Within 1 %"] == "1 of 2"


def test_the_casts_are_those_of_the_tuning_that_took_most() -> None:
    (cell,) = cells(FRICTION, replace(FRICTION, start=1, simulated_casts=900))
    assert cell["Simulated casts, at most"] == "2\u202f000"


def test_a_cell_where_the_casts_tell_nothing_has_no_error() -> None:
    (cell,) = cells(UNTOLD)
    assert cell["Parameter error [%]"] == "–"
    assert cell["Waypoint error [%]"] == "0.2"


def test_the_papers_ranges_stand_where_it_has_them() -> None:
    with_de = replace(FRICTION, optimizer="de")
    with_gn = replace(FRICTION, optimizer="gn")
    more = replace(FRICTION, casts=20)
    paper = [cell["Paper [%]"] for cell in cells(FRICTION, with_de, with_gn, more)]
    assert paper == ["1.09 to 9.25", "< 1", "–", "–"]


def test_outcomes_come_back_as_they_were_written(tmp_path: Path) -> None:
    write_outcomes(tmp_path / "a.csv", [FRICTION, STIFFNESS])
    write_outcomes(tmp_path / "b.csv", [UNTOLD])
    assert read_outcomes(tmp_path) == [FRICTION, STIFFNESS, UNTOLD]


def test_a_folder_without_outcomes_says_what_to_run(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"run stages/sim2sim\.py first"):
        read_outcomes(tmp_path)


def test_the_written_forms_agree() -> None:
    table = rows([FRICTION], 20.0)
    assert markdown(table).count("\n") == 3
    assert "2000" in csv_text(table) and "–" not in csv_text(table)
