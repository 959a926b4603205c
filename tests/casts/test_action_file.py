from dataclasses import replace
from pathlib import Path

import pytest

from robotcast.casts.action import ACTION_COLUMNS, Action
from robotcast.casts.action_file import read_actions, write_actions

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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "there is no such file"),
        ("theta1,r1\n0.5,0.6\n", "expected a column theta2"),
        (",".join(ACTION_COLUMNS) + "\n", "holds no action"),
        (",".join(ACTION_COLUMNS) + "\n0.6,0.6,-0.4,,0.2,1.5\n", "line 2: expected six numbers"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "actions.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=said):
        read_actions(path)
