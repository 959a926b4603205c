from robotcast.reporting.diagnosis.page import diagnosis_page
from robotcast.reporting.diagnosis.reading import read_diagnosis
from tests.reporting.diagnosis.diagnosis_states import LADDER, effect, several


def test_a_ladder_names_what_each_rung_adds() -> None:
    labels = [rung.label for rung in read_diagnosis(several()).ladder]
    assert labels == ["base model", "+ board tilt", "+ air drag"]


def test_effects_fixed_in_advance_are_in_the_base_and_in_the_command() -> None:
    ladder = [
        {**LADDER[0], "effects": ["air_drag"]},
        {**LADDER[1], "effects": ["air_drag", "board_tilt"]},
    ]
    plain = {**effect(), "ladder": ladder}
    read = read_diagnosis(plain)
    assert [(r.label, r.kind) for r in read.ladder] == [
        ("with air drag", "base"),
        ("+ board tilt", "model"),
    ]
    assert "effects=[air_drag,board_tilt]" in diagnosis_page(plain)


def test_an_empty_diagnosis_reads_as_nothing_known() -> None:
    read = read_diagnosis({})
    assert read.ladder == () and read.ranking == () and read.unexplained is None
    assert read.finished
