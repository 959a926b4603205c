from dataclasses import replace
from pathlib import Path

import pytest

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.table import read_actions, write_actions

FIRST = Action(0.6, 0.62, -0.4, 0.7, 0.2, 1.5)
ACTIONS = [FIRST, replace(FIRST, alpha_rad=1.25)]


def test_what_a_diagnosis_writes_can_be_cast(tmp_path: Path) -> None:
    rows = [
        {"separates": ["board_tilt", "camera_offset"], "why": "so, far apart"}
        | dict(zip(ACTION_COLUMNS, action.as_array().tolist(), strict=True))
        for action in ACTIONS
    ]
    path = tmp_path / "new" / "actions.csv"
    write_actions(rows, path)
    assert read_actions(path) == ACTIONS
    assert path.read_text().startswith(",".join(ACTION_COLUMNS))
    assert "board_tilt camera_offset" in path.read_text()


HEADER = ",".join(ACTION_COLUMNS) + "\n"
GOOD = "0.5,0.6,-0.6,0.65,0.3,1.2\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "there is no such file"),
        ("theta1,r1\n0.5,0.6\n", "column theta2 is missing"),
        (",".join(ACTION_COLUMNS) + "\n", "holds no action"),
        (HEADER + GOOD + "0.6,0.6,-0.4,,0.2,1.5\n", "line 3: r2 must be a finite number, got an e"),
        (HEADER + GOOD + "0.6,0.6,-0.4,NaN,0.2,1.5\n", "line 3: r2 must be a finite number"),
        (HEADER + "0.6,0.6,-0.4,0.7,0.2,true\n", "line 2: vmax must be .* number, got 'true'"),
        (HEADER + GOOD + "0.6,0.6,-0.4,0.7\n", "line 3: alpha must be .* number, got an empty"),
        (HEADER + GOOD + "28.6,0.6,-34.4,0.65,17.2,1.2\n", "line 3: theta1 is 28.6, .* degrees"),
        (HEADER + GOOD + "0.5,600,-0.6,650,0.3,1.2\n", "line 3: r1 is 600, .* millimetres"),
        ("# my casts\n" + HEADER + GOOD, "line 1: expected the names of the columns, got a comm"),
        (HEADER.replace(",", ";") + "0,5;0,6;-0,6;0,65;0,3;1,2\n", "semicolons"),
        ("\t".join(ACTION_COLUMNS) + "\n", "separated by tabs"),
        ((HEADER + GOOD).encode("utf-16"), "is not text in UTF-8; export it"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(
    tmp_path: Path, text: str | bytes | None, said: str
) -> None:
    path = tmp_path / "actions.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=said):
        read_actions(path)


@pytest.mark.parametrize(
    "before", ["\n", "   \n", ",,,,,\n", "\r\n\r\n", '0.5,0.6,-0.6,0.65,0.3,"1.2\n"\n']
)
def test_a_message_names_the_line_that_an_editor_shows(tmp_path: Path, before: str) -> None:
    path = tmp_path / "actions.csv"
    text = HEADER + GOOD + before + "0.6,0.62,-0.4,0.7,0.2,1.5\n"
    path.write_bytes(text.encode())
    refusal = rf"actions.csv line {len(text.splitlines())}: the arm cannot do this action"
    with pytest.raises(ValueError, match=refusal):
        read_actions(path, lambda actions: actions[:, 0] < 0.55)


def test_a_blank_line_and_notes_with_commas_are_read(tmp_path: Path) -> None:
    path = tmp_path / "actions.csv"
    path.write_text(f'{HEADER.strip()},"note, more"\n{GOOD.strip()},"a, b"\n\n')
    assert read_actions(path) == [Action(0.5, 0.6, -0.6, 0.65, 0.3, 1.2)]
