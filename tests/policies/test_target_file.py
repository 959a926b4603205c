from pathlib import Path

import pytest

from robotcast.policies.choosing.target_file import read_targets
from robotcast.policies.choosing.targets import Board

BOARD = Board(1.55, 2.45)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "targets.csv"


def test_targets_are_read_in_their_order(path: Path) -> None:
    path.write_text("name,x,y\nfar,1.2,-0.4\nnear,0.9,1\n")
    assert read_targets(path, BOARD).tolist() == [[1.2, -0.4], [0.9, 1.0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,z\n1,2\n", "column y is missing; expected x, y, found x, z"),
        ("x,y\n1,0.2\n,0.3\n", "line 3: x must be a finite number, got an empty cell"),
        ("x,y\n1,left\n", "line 2: y must be a finite number"),
        ("x,y\n1,nan\n", "line 2: y must be a finite number, got 'nan'"),
        ("x,y\n1,0.2\n1.6,0\n", "line 3: (1.6, 0) m lies off the board, x from 0 to 1.55 m"),
        ("x,y\n", "holds no target"),
        ("", "expected the names of the columns"),
    ],
)
def test_bad_targets_get_one_clear_message(path: Path, text: str, said: str) -> None:
    path.write_text(text)
    with pytest.raises(ValueError) as caught:
        read_targets(path, BOARD)
    assert str(caught.value).startswith(str(path))
    assert said in str(caught.value)


def test_a_missing_file_is_named(path: Path) -> None:
    with pytest.raises(ValueError, match=r"targets\.csv: there is no such file"):
        read_targets(path, BOARD)
