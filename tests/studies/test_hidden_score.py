"""How answers and diagnoses become the benchmark's tables, on diagnoses made up here."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotcast.files import seal, write_text
from studies.hidden_effects.cases import answer_path
from studies.hidden_effects.figures import confusion_counts, power_bins
from studies.hidden_effects.layout import result
from studies.hidden_effects.outcomes import read_outcomes
from studies.hidden_effects.score import (
    case_rows,
    criteria,
    criteria_rows,
    method_rows,
    size_rows,
    write_results,
)

TILT = {"effect": "board_tilt", "parameters": {"sx": 0.0, "sy": 0.02}, "shift_percent": 3.0}
DRAG = {"effect": "air_drag", "parameters": {"C": 7.0}, "shift_percent": 3.0}
PLACE = {"k": 0.5, "x0": 0.9, "y0": 0.1, "w": 0.2}
PATCH = {"effect": "friction_patch", "parameters": PLACE, "shift_percent": 1.0}
GRAIN = {"effect": "anisotropic_friction", "parameters": {"a": 0.5}, "shift_percent": 3.0}
BAND = {"effect": "rubber_band", "parameters": {"stiffness": 0.1}, "shift_percent": 3.0}


class Bench:
    """A folder of answers, and of what was said about them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def diagnosis(self, case: str) -> Path:
        return result("diagnoses", case, self.folder)

    def add(self, case: str, kind: str, hidden: list[dict], *said: dict[str, Any]) -> None:
        """Seal an answer; write what the diagnosis, the rivals and the oracle said about it."""
        drawn = {"kind": kind, "cable": "cable1", "strength": "strong" if hidden else ""}
        shift = max((one["shift_percent"] for one in hidden), default=0.0)
        answer = {"drawn": drawn, "effects": hidden, "shift_percent": shift, "casts": 52}
        seal(answer, answer_path(case, self.folder))
        for what, content in zip(("diagnoses", "rivals", "oracle"), said, strict=False):
            write_text(result(what, case, self.folder), json.dumps(content))

    def outcomes(self):
        return read_outcomes(self.folder)


def verdict(*names: str, errors=(4.0, 1.2), ranking=(), **changes) -> dict[str, Any]:
    """A diagnosis.json as far as it is read."""
    ladder = [{"effects": [], "heldout_waypoint_error_percent": e} for e in errors]
    found = {"verdict": list(names), "confusion_set": [], "unexplained": None, "ladder": ladder}
    found |= {"noise_floor_percent": 0.5, "ranking": list(ranking), "simulated_casts": 1000}
    return {**found, "seconds": 60.0, "finished": True, **changes}


def ranked(effect: str, **intervals: tuple[float, float]) -> dict[str, Any]:
    parameters = {n: {"low": low, "high": high} for n, (low, high) in intervals.items()}
    return {"effect": effect, "parameters": parameters}


def beside(brute: str | None = "board_tilt", named: str = "air_drag") -> dict[str, Any]:
    """What the rivals say of a case."""
    forced = {"effects": [brute], "heldout_waypoint_error_percent": 1.1, "simulated_casts": 8000}
    forced["rounds"] = [{"simulated_casts": 4500}, {"simulated_casts": 3000}]
    guesses = {"random": named, "largest_sensitivity": named}
    return {**guesses, "brute_force": forced if brute else None}


def told(p_value: float = 1e-6, sizes=()) -> dict[str, Any]:
    """What the oracle says of a case."""
    errors = {"base_heldout_waypoint_error_percent": 4.0, "heldout_waypoint_error_percent": 1.0}
    return {**errors, "p_value": p_value, "sizes": list(sizes), "simulated_casts": 500}


@pytest.fixture
def bench(tmp_path) -> Bench:
    """Every kind of case once or twice: some diagnosed well, some badly, one not at all."""
    made = Bench(tmp_path)
    good = ranked("board_tilt", sx=(-0.01, 0.01), sy=(0.015, 0.025))
    said = verdict("board_tilt", ranking=[good])
    made.add("case-001", "single", [TILT], said, beside(), told(sizes=[good]))
    wrong = verdict("tool_lag", errors=(4.0, 3.4), confusion_set=[["tool_lag", "air_drag"]])
    near = ranked("air_drag", C=(6.5, 6.9))
    made.add("case-002", "single", [DRAG], wrong, beside("air_drag"), told(sizes=[near]))
    made.add("case-003", "single", [PATCH], verdict("none"), beside("none"), told(p_value=0.2))
    made.add("case-004", "control", [], verdict("none", errors=(1.0,)), beside("tool_lag"))
    made.add("case-005", "control", [], verdict("unknown"), beside(None))
    explained = verdict("unknown", unexplained={"depends_on": "place", "text": "…"})
    made.add("case-006", "outside", [BAND], explained)
    made.add("case-007", "outside", [BAND], verdict("board_tilt"))
    short = ranked("air_drag", C=(8.0, 9.0))
    made.add("case-008", "pair", [TILT, DRAG], verdict("air_drag", "board_tilt", ranking=[short]))
    made.add("case-009", "single", [TILT])
    return made


def test_the_criteria_count_what_they_say(bench):
    shares = {
        one.name: (one.share.part, one.share.whole, one.share.missing)
        for one in criteria(bench.outcomes())
    }
    assert shares == {
        "named first, where the oracle's gain is significant": (1, 2, 1),
        "named first, all cases with one effect": (1, 3, 1),
        "false alarms on controls": (1, 2, 0),
        "outside the library: unknown": (1, 2, 0),
        "outside the library: a wrong name with a clean bill": (1, 2, 0),
        "two effects: both named": (1, 1, 0),
        "truth among the confusable": (2, 2, 0),
        "held-out drop relative to the oracle's": (pytest.approx(3.4), 6.0, 0),
        "intervals that cover the true size": (2, 3, 0),
        "intervals that cover the true size, of the oracle": (2, 3, 0),
        "simulated casts relative to brute force": (4000, 32000, 5),
        "simulated casts relative to brute force that looks for one effect only": (4000, 20000, 5),
    }


def test_a_criterion_is_met_at_its_bound_and_unjudged_when_nothing_was_run(bench, tmp_path):
    met = {one.name: one.met for one in criteria(bench.outcomes())}
    assert met["simulated casts relative to brute force"] is True
    assert met["two effects: both named"] is True
    assert met["false alarms on controls"] is False
    assert met["named first, all cases with one effect"] is None
    empty = Bench(tmp_path / "empty")
    empty.add("case-001", "single", [TILT])
    assert all(one.met is None for one in criteria(empty.outcomes()))


def test_a_name_with_something_open_is_no_clean_bill_and_one_at_work_was_not_run(tmp_path):
    made = Bench(tmp_path)
    left_open = verdict("board_tilt", unexplained={"depends_on": "place", "text": "…"})
    made.add("case-001", "outside", [BAND], left_open)
    made.add("case-002", "single", [TILT], {"finished": False, "doing": "refitting board_tilt"})
    (one,) = [c for c in criteria(made.outcomes()) if "clean bill" in c.name]
    assert one.met is True
    assert made.outcomes()[1].diagnosis is None


def test_methods_stand_beside_the_diagnosis(bench):
    head, *rows = method_rows(bench.outcomes())
    table = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    column = "named first, where the oracle's gain is significant"
    assert {name: row[column] for name, row in table.items()} == {
        "diagnosis": "1 of 2 (50 %)",
        "random": "1 of 2 (50 %)",
        "largest sensitivity": "1 of 2 (50 %)",
        "brute force": "2 of 2 (100 %)",
        "oracle": "2 of 2 (100 %)",
    }
    assert table["brute force"]["false alarms on controls"] == "1 of 1 (100 %)"
    assert table["diagnosis"]["simulated casts a case"] == "1000"
    assert table["brute force"]["simulated casts a case"] == "8000"
    assert table["oracle"]["simulated casts a case"] == "500"


def test_sizes_are_compared_effect_by_effect_where_the_rig_follows_the_library(bench):
    head, *rows = size_rows(bench.outcomes())
    assert head[2:] == ["diagnosis: interval holds", "oracle: interval holds"]
    assert rows == [
        ["air_drag", "1", "–", "0 of 1 (0 %)"],
        ["board_tilt", "2", "2 of 2 (100 %)", "2 of 2 (100 %)"],
        ["friction_patch", "1", "–", "–"],
    ]
    bench.add("case-010", "single", [GRAIN], verdict("anisotropic_friction"))
    assert size_rows(bench.outcomes()) == [head, *rows]


def test_every_case_has_a_row_with_what_is_missing_marked(bench):
    head, *rows = case_rows(bench.outcomes())
    table = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    assert len(table) == 9
    assert table["case-001"]["right"] == "yes"
    assert table["case-001"]["interval"] == "holds 2 of 2"
    assert table["case-003"]["size"] == "k 0.5"
    assert table["case-008"]["hidden"] == "board_tilt + air_drag"
    assert table["case-009"]["verdict"] == "–"


def test_the_confusion_matrix_has_a_row_for_what_was_hidden_and_a_column_for_what_was_named(bench):
    rows, columns, counts = confusion_counts(bench.outcomes())
    assert rows == ["air_drag", "board_tilt", "friction_patch", "none", "outside the library"]
    assert columns == ["air_drag", "board_tilt", "friction_patch", "tool_lag", "none", "unknown"]
    expected = [
        [0, 0, 0, 1, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 0, 0, 1, 0],
        [0, 0, 0, 0, 1, 1],
        [0, 1, 0, 0, 0, 1],
    ]
    np.testing.assert_array_equal(counts, expected)


def test_the_power_curve_sorts_cases_by_their_shift_in_noise_floors(bench):
    assert power_bins(bench.outcomes()) == [(2.0, 0, 1), (6.0, 1, 2)]


def test_the_results_are_written_whatever_is_missing_and_twice_alike(bench, tmp_path):
    tables = ["criteria.csv", "methods.csv", "sizes.csv", "cases.csv"]
    names = [*tables, "confusion.svg", "power.svg", "README.md"]
    written = write_results(bench.outcomes(), tmp_path / "reports")
    assert [path.name for path in written] == names
    again = write_results(bench.outcomes(), tmp_path / "r")
    assert [p.read_bytes() for p in again] == [p.read_bytes() for p in written]
    none_run = Bench(tmp_path / "none")
    none_run.add("case-001", "single", [TILT])
    write_results(none_run.outcomes(), tmp_path / "n")
    text = (tmp_path / "n" / "README.md").read_text()
    assert "0 of them were diagnosed" in text
    assert criteria_rows(none_run.outcomes())[1][2:] == ["–", "–", "1"]


def test_no_answers_and_broken_files_are_refused_by_name(bench, tmp_path):
    with pytest.raises(ValueError, match="no sealed answers"):
        read_outcomes(tmp_path / "nowhere")
    path = bench.diagnosis("case-001")
    path.write_text(json.dumps({"verdict": ["none"]}))
    with pytest.raises(ValueError, match=r"diagnoses/case-001.json: expected the key 'ladder'"):
        bench.outcomes()
    path.write_text("{")
    with pytest.raises(ValueError, match=r"diagnoses/case-001.json: is not JSON"):
        bench.outcomes()
    path.unlink()
    result("rivals", "case-001", bench.folder).write_text(json.dumps({"brute_force": {}}))
    with pytest.raises(ValueError, match=r"rivals/case-001.json: expected the key 'effects'"):
        bench.outcomes()
