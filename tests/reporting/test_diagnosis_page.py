"""What a person finds on the diagnosis page, in each of its states."""

import re

import pytest

from robotcast.diagnosis.wording import Wording
from robotcast.reporting.diagnosis_page import diagnosis_page
from tests.reporting.diagnosis_states import (
    LADDER,
    STATES,
    compared,
    confused,
    effect,
    near,
    none,
    running,
    several,
    too_few,
    unknown,
)


def text_of(page: str) -> str:
    """The words of a page without its tags, style and drawings' coordinates."""
    body = re.sub(r"<style>.*?</style>", "", page, flags=re.S)
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


def test_verdict_evidence_and_the_command_stand_before_everything_else() -> None:
    screen = first_screen(diagnosis_page(effect()))
    assert "The board is not level" in screen
    assert "effects=[board_tilt]" in screen and "python stages/tune.py" in screen
    assert "paths.tuned=outputs/b/board_tilt" in screen
    assert "dvc exp run -S" in screen
    assert "noise floor 0.76" in screen
    assert "1.04" in screen and "−67 %" in screen


def test_the_commands_go_on_with_the_simulator_that_was_diagnosed() -> None:
    chosen = ["simulator=hybrid", "simulator.model.settings.step_s=0.002"]
    screen = first_screen(diagnosis_page({**effect(), "overrides": chosen}))
    assert f"python stages/tune.py {' '.join(chosen)} paths.measurements" in screen
    alone = "effects=board_tilt -S 'simulators=[hybrid]' -S generate.simulator=hybrid"
    assert alone in screen
    assert "simulators=" not in first_screen(diagnosis_page(effect()))


def test_effects_go_by_readable_names() -> None:
    screen = first_screen(diagnosis_page(several()))
    assert "board tilt" in screen and "air drag" in screen
    assert "effects=[board_tilt,air_drag]" in screen


def test_a_clean_bill_names_no_effect_to_add() -> None:
    screen = first_screen(diagnosis_page(none()))
    assert "effects=[" not in screen
    assert "2 of 3 effects would have been noticed" in screen


def test_a_confused_pair_is_answered_with_casts_to_run() -> None:
    screen = first_screen(diagnosis_page(confused()))
    assert "hardly told from camera offset" in screen
    assert "board tilt and camera offset predict different paths" in screen
    assert "actions.csv" in screen and "−0.900" in screen


def test_what_came_near_is_named_as_not_confirmed_with_casts_to_run() -> None:
    screen = first_screen(diagnosis_page(near()))
    assert "Not confirmed: board tilt or camera offset" in screen
    assert "actions.csv" in screen and "effects=[" not in screen


def test_an_unknown_force_is_drawn_and_a_draft_of_an_effect_given() -> None:
    page = diagnosis_page(unknown())
    assert "fitted field" in page
    assert "(1.05, −0.250)" in text_of(page)
    assert "class MyEffect(Effect)" in page and "conf/effects.yaml" in page


def test_a_field_that_explains_nothing_is_not_said_to_be_the_missing_force() -> None:
    explained = unknown()
    nearest = {**explained, "unexplained": {**explained["unexplained"], "explains": False}}
    assert "What the missing force depends on: place" in diagnosis_page(explained)
    page = diagnosis_page(nearest)
    assert "What comes nearest to the missing force: place" in page
    assert "What the missing force depends on" not in page


def test_a_running_diagnosis_says_what_it_does_and_reloads() -> None:
    page = diagnosis_page(running())
    assert '<meta http-equiv="refresh" content="3">' in page
    assert "refitting board_tilt" in first_screen(page)
    assert "refresh" not in diagnosis_page(effect())


def test_limits_of_the_data_are_said() -> None:
    words = text_of(diagnosis_page(too_few()))
    assert "The set has 3 casts" in words
    assert "no ladder was drawn" in words


def test_effects_that_cannot_be_judged_are_told_apart_from_absent_ones() -> None:
    page = diagnosis_page(effect())
    rows = page[page.index("<tbody>") : page.index("</tbody>")]
    assert "your casts cannot tell" in rows
    assert "friction patch" not in rows and "resting curvature" not in rows
    words = text_of(page)
    assert "friction patch (simulating it changes no prediction" in words
    assert "resting curvature (the model does not react" in words


def test_text_from_data_cannot_break_the_page() -> None:
    plain = {**effect(), "sentence": "a < b & <b>c</b>", "measurements": '"><script>'}
    page = diagnosis_page(plain)
    assert "a &lt; b &amp; &lt;b&gt;" in page
    assert "<script>" not in page


def test_a_model_of_another_kind_is_spoken_of_in_its_own_words() -> None:
    words = Wording(trial="drop", trials="drops", group="ball", groups="balls").as_dict(1)
    for state in (effect, none, several, unknown, running, too_few):
        own = {**state(), "words": words, "pipeline": False, "error_unit": "cm", "notes": []}
        own["sentence"] = own["sentence"].replace("cast", "drop").replace("Cast", "Drop")
        own["ranking"], own["next_actions"] = own["ranking"][:1], []
        page = diagnosis_page({**own, "unexplained": None})
        assert "cast" not in text_of(page).lower()
        assert "stages/" not in page and "dvc" not in page
    assert "fixed=[&#39;board_tilt&#39;]" in diagnosis_page(
        {**effect(), "words": words, "pipeline": False}
    )


def test_a_model_of_another_kind_shows_its_own_unit() -> None:
    page = text_of(diagnosis_page({**effect(), "error_unit": "cm"}))
    assert "3.12 cm" in page.replace("\u202f", " ")
    assert "on held-out casts [cm]" in page


def test_the_set_s_own_folder_stands_in_the_command_when_it_is_known() -> None:
    screen = first_screen(diagnosis_page({**effect(), "measurements": "../sets/my set"}))
    assert "paths.measurements=&#39;../sets/my set&#39;" in screen or "'../sets/my set'" in screen
    assert "DIR" not in screen and "paths.tuned=outputs/my_set/board_tilt" in screen


def test_where_the_base_model_fails_is_shown_and_casts_play_once_it_has_finished() -> None:
    page = diagnosis_page(compared())
    assert "Where the base model fails" in page and "<script>" in page
    assert page.index("Every effect that was tested") < page.index("Where the base model fails")
    reloading = diagnosis_page({**compared(), "finished": False, "doing": "screening"})
    assert "Where the base model fails" in reloading and "<script" not in reloading


def test_the_command_hands_the_diagnosis_to_tuning_so_that_its_promise_is_kept() -> None:
    screen = first_screen(diagnosis_page({**effect(), "output": "data/diagnosis/cable1"}))
    assert "paths.diagnosis=data/diagnosis/cable1" in screen


def test_a_ladder_names_what_each_rung_adds() -> None:
    page = diagnosis_page(several())
    assert all(f">{label}</text>" in page for label in ("base model", "+ board tilt", "+ air drag"))


def test_effects_fixed_in_advance_are_in_the_base_and_in_the_command() -> None:
    ladder = [
        {**LADDER[0], "effects": ["air_drag"]},
        {**LADDER[1], "effects": ["air_drag", "board_tilt"]},
    ]
    page = diagnosis_page({**effect(), "ladder": ladder})
    assert ">with air drag</text>" in page and ">+ board tilt</text>" in page
    assert "effects=[air_drag,board_tilt]" in page


def test_an_empty_diagnosis_reads_as_nothing_known() -> None:
    assert "Too few data" in text_of(diagnosis_page({}))
