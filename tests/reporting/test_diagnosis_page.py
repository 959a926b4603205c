"""What a person finds on the diagnosis page, in each of its states."""

import re

import pytest

from robotcast.reporting.diagnosis_page import diagnosis_page
from robotcast.reporting.names import error
from tests.reporting.diagnosis_states import (
    STATES,
    confused,
    effect,
    near,
    none,
    running,
    several,
    too_few,
    unknown,
    untestable,
)


def text_of(page: str) -> str:
    """The words of a page without its tags, style and drawings' coordinates."""
    body = re.sub(r"<(style|script)[^>]*>.*?</\1>", "", page, flags=re.S)
    words = re.sub(r"<[^>]+>", " ", body).replace("&#39;", "'").replace("&#34;", '"')
    return re.sub(r"\s+", " ", words)


def first_screen(page: str) -> str:
    return text_of(page.split("</section>\n</div>")[0])


@pytest.mark.parametrize("state", STATES)
def test_every_state_is_one_page_that_needs_nothing_else(state: str) -> None:
    page = diagnosis_page(STATES[state]())
    links = set(re.findall(r'(?:src|href)="([^"]*)"', page))
    assert {link for link in links if not link.startswith(("data:", "#"))} <= {"actions.csv"}
    assert "://" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "@import" not in page and not re.search(r"url\((?!#)", page)
    for anchor in (link for link in links if link.startswith("#")):
        assert f'id="{anchor[1:]}"' in page
    assert "nan" not in text_of(page).lower().split()
    assert page == diagnosis_page(STATES[state]())


@pytest.mark.parametrize(
    ("state", "color"),
    [
        ("none", "is-none"), ("near", "is-near"), ("effect", "is-found"), ("several", "is-found"),
        ("confused", "is-confused"), ("unknown", "is-unknown"), ("without_repeats", "is-open"),
        ("too_few", "is-too-few"), ("running", "is-running"),
    ],
)  # fmt: skip
def test_the_colour_is_the_verdict_s(state: str, color: str) -> None:
    assert f'<body class="{color}">' in diagnosis_page(STATES[state]())


def test_verdict_evidence_and_the_command_stand_before_everything_else() -> None:
    said, screen = effect(), first_screen(diagnosis_page(effect()))
    assert "The model lacks this: the board is not level" in screen
    assert "effects=[tilt]" in screen and "python stages/tune.py" in screen
    assert "paths.tuned=outputs/b/tilt" in screen
    assert "dvc exp run -S" in screen
    assert text_of(f"noise floor {error(said['noise_floor_percent'])}") in screen
    first, last = (rung["heldout_typical_error_percent"] for rung in said["ladder"])
    assert text_of(f"{error(first)} → {error(last)}") in screen
    assert f"−{100 * (1 - last / first):.0f} %" in screen


def test_the_commands_go_on_with_the_simulator_that_was_diagnosed() -> None:
    chosen = ["simulator=hybrid", "simulator.model.settings.step_s=0.002"]
    screen = first_screen(diagnosis_page({**effect(), "overrides": chosen}))
    assert f"python stages/tune.py {' '.join(chosen)} paths.measurements" in screen
    assert "dvc exp run" not in screen  # that generates with another one


def test_effects_go_by_readable_names() -> None:
    screen = first_screen(diagnosis_page(several()))
    assert "Add tilt and late clock" in screen
    assert "effects=[tilt,late_clock]" in screen and "effects=tilt+late_clock" in screen
    for label in ("base model", "+ tilt", "+ late clock"):
        assert f">{label}</text>" in diagnosis_page(several())


def test_a_clean_bill_names_no_effect_to_add() -> None:
    screen = first_screen(diagnosis_page(none()))
    assert "effects=[" not in screen
    assert "4 of 4 effects would have been noticed" in screen


def test_confused_pairs_and_what_came_near_are_answered_with_trials_to_run() -> None:
    screen = first_screen(diagnosis_page(confused()))
    assert "hardly told from turn" in screen
    assert "shear and turn predict different paths" in screen
    assert "actions.csv" in screen and "speed" in screen
    screen = first_screen(diagnosis_page(near()))
    assert "Not confirmed: shear or turn" in screen
    assert "actions.csv" in screen and "effects=[" not in screen


def test_an_unknown_force_is_drawn_drafted_as_an_effect_and_said_to_be_the_missing_one() -> None:
    explained = unknown()
    page = diagnosis_page(explained)
    assert "fitted field" in page
    assert "(1.05, −0.250)" in text_of(page)
    assert "class MyEffect(Effect)" in page and "conf/effects.yaml" in page
    assert "What is missing depends on: place" in page
    nearest = {**explained, "unexplained": {**explained["unexplained"], "explains": False}}
    page = diagnosis_page(nearest)
    assert "What comes nearest depends on: place" in page
    assert "What is missing depends on" not in page
    nameless = dict.fromkeys(explained["unexplained"])
    page = diagnosis_page({**effect(), "unexplained": nameless})
    assert 'id="field"' not in page and 'id="write"' in page


def test_a_running_diagnosis_says_what_it_does_and_reloads() -> None:
    page = diagnosis_page(running())
    assert '<meta http-equiv="refresh" content="3">' in page
    assert "refitting the model as it is" in first_screen(page)
    assert "refresh" not in diagnosis_page(effect())


def test_limits_of_the_data_are_said() -> None:
    words = text_of(diagnosis_page(too_few()))
    assert "The set has 3 pushes" in words
    assert "no ladder was drawn" in words


def test_effects_that_cannot_be_judged_are_told_apart_from_absent_ones() -> None:
    page = diagnosis_page(untestable())
    rows = page[page.index("<tbody>") : page.index("</tbody>")]
    assert ">tilt<" in rows and ">dead<" not in rows and ">faint<" not in rows
    words = text_of(page)
    assert "faint (simulating it changes no prediction" in words
    assert "dead (the model does not react" in words


def test_text_from_data_cannot_break_the_page() -> None:
    plain = {**effect(), "sentence": "a < b & <b>c</b>", "measurements": '"><i>'}
    page = diagnosis_page(plain)
    assert "a &lt; b &amp; &lt;b&gt;" in page
    assert "<b>c" not in page and "<i>" not in page


def test_a_model_of_another_kind_is_spoken_of_in_its_own_words_and_unit() -> None:
    for state in (effect, none, several, unknown, running, too_few):
        page = diagnosis_page({**state(), "pipeline": False, "error_unit": "cm"})
        words = text_of(page).lower().replace("\u202f", " ")
        assert "cast" not in words and "pushes" in words
        assert "stages/" not in page and "dvc" not in page
        assert "0.39 cm" in words or state is too_few
    page = diagnosis_page({**effect(), "pipeline": False, "error_unit": "cm"})
    assert "fixed=[&#39;tilt&#39;]" in page
    assert "on held-out pushes [cm]" in page


def test_the_command_names_the_set_s_own_folder_and_the_diagnosis_whose_promise_is_kept() -> None:
    known = {"measurements": "../sets/my set", "output": "data/diagnosis/cable1"}
    screen = first_screen(diagnosis_page({**effect(), **known}))
    assert "paths.measurements='../sets/my set' paths.diagnosis=data/diagnosis/cable1" in screen
    assert "DIR" not in screen and "paths.tuned=outputs/my_set/tilt" in screen


def test_where_the_base_model_fails_is_shown_and_trials_play_once_it_has_finished() -> None:
    page = diagnosis_page(effect())
    assert "Where the base model fails" in page and "<script>" in page
    assert page.index("Every effect that was tested") < page.index("Where the base model fails")
    reloading = diagnosis_page({**effect(), "finished": False, "doing": "screening"})
    assert "Where the base model fails" in reloading and "<script" not in reloading


def test_effects_fixed_in_advance_are_in_the_base_and_in_the_command() -> None:
    given = [["air_drag"], ["air_drag", "tilt"]]
    ladder = [{**rung, "effects": e} for rung, e in zip(effect()["ladder"], given, strict=True)]
    page = diagnosis_page({**effect(), "ladder": ladder})
    assert ">with air drag</text>" in page and ">+ tilt</text>" in page
    assert "effects=[air_drag,tilt]" in page
