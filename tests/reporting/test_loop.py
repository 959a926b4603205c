"""The loop on the report's page: its headline, advice and answer never contradict each other."""

from typing import Any

import pytest

from robotcast.reporting.page import block

HIDDEN = {"board_tilt": {"sx": 0.02, "sy": 0.0}}


def shown(code: str, verdict: list[str], after: float, hidden: dict[str, Any] | None) -> str:
    return str(
        block(
            "loop.html",
            "loop",
            cable="Cable 2",
            before=4.0,
            after=after,
            floor=1.0,
            findings=["Waypoints on the right hold 92 % of the squared error."],
            diagnosis={"code": code, "sentence": "What the diagnosis says."},
            verdict=verdict,
            sizes=[("board tilt, sx", "0.019", "0.02")] if verdict else [],
            paths="",
            ladder="",
            targets=8,
            medians=[],
            hidden=hidden,
            right=hidden is not None and set(hidden) == set(verdict),
        )
    )


def test_an_error_that_falls_is_said_to_fall_and_no_other() -> None:
    falls, rises = (shown("named", ["board_tilt"], after, HIDDEN) for after in (1.5, 4.5))
    assert "the error falls" in falls and "watch the error fall" in falls
    assert "the error does not fall" in rises and "did not help" in rises
    assert "The diagnosis names it." in falls and "0.019" in falls


@pytest.mark.parametrize(
    ("code", "verdict", "hidden", "said"),
    [
        ("none", [], {}, "claims nothing"),
        ("unknown", [], {}, "is wrong"),
        ("cannot tell", [], {}, "too few to tell"),
        ("named", ["air_drag"], HIDDEN, "names air drag instead"),
        ("none", [], HIDDEN, "does not name it"),
    ],
)
def test_the_answer_is_compared_with_what_was_said(code, verdict, hidden, said) -> None:
    assert said in shown(code, verdict, 4.0, hidden)


def test_nothing_is_opened_on_a_rig_that_hides_nothing() -> None:
    assert "What was hidden" not in shown("none", [], 4.0, None)
