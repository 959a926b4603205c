"""The comparison page says what the comparison says, whatever data there were."""

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotcast.reporting.comparison_page import casts_block, comparison_page, where_blocks
from tests.diagnosis import made_up_trials
from tests.diagnosis.made_up_trials import TIMES_S, MadeUp, made_up

EMPTY = {"meta", "link", "br", "input"}


def wrong_above(alpha: float):
    return lambda r: np.full(r.measured.shape, 0.02 * (r.factors["alpha"] > alpha))


def compared(made: MadeUp, notes: tuple[str, ...] = ()) -> dict[str, Any]:
    found = made_up_trials.compared(made)
    given = {
        "rig": "virtual",
        "measurements": "sets/one",
        "model": "a tuned simulator",
        "overrides": ["simulator=hybrid"],
        "notes": list(notes),
    }
    # what the page gets has gone through a file
    return json.loads(json.dumps({**given, **found.as_dict()}))


def one_component() -> MadeUp:
    made = made_up(groups=6)
    records = [replace(r, measured=r.measured[:, :1]) for r in made.records]
    return MadeUp(records, made.predicted[..., :1])


def gappy() -> MadeUp:
    made = made_up(groups=4)
    kept = [
        np.delete(np.arange(len(TIMES_S)), slice(5 + r.trial, 9 + r.trial)) for r in made.records
    ]
    records = [
        replace(r, times_s=r.times_s[k], measured=r.measured[k])
        for r, k in zip(made.records, kept, strict=True)
    ]
    return MadeUp(records, made.predicted)


def diverged(rows: slice) -> MadeUp:
    made = made_up(groups=5)
    made.predicted[rows] = np.nan
    return made


def one_sample() -> MadeUp:
    made = made_up(groups=1, repeats=1)
    record = replace(made.records[0], times_s=TIMES_S[:1], measured=made.records[0].measured[:1])
    return MadeUp([record], made.predicted[:, :1])


def balanced(html: str) -> bool:
    """Tell whether all elements that are opened are closed, in turn, and no others."""
    html, opened = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", html, flags=re.S), []
    for end, tag, closed in re.findall(r"<(/?)(\w+)[^>]*?(/?)>", html):
        if end and (not opened or opened.pop() != tag):
            return False
        if not end and not closed and tag not in EMPTY:
            opened.append(tag)
    return not opened


@pytest.fixture(scope="module")
def page() -> str:
    return comparison_page(compared(made_up(wrong=wrong_above(1.5))))


def test_the_page_needs_nothing_else(page) -> None:
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"|url\((?!data:|#)|@import', page)


def test_the_head_says_the_error_beside_noise_where_it_sits_and_what_to_do(page) -> None:
    head = page[: page.index("When: error over time")]
    assert "The model errs by more than noise" in head
    assert re.search(r"misses a waypoint by [\d.]+\u202f% of cable length on average; noise", head)
    assert "Casts with alpha above 1.45 rad hold" in head
    assert "python stages/diagnose.py simulator=hybrid measurements=sets/one output=OUT" in head
    assert "virtual rig" in head and "60 casts of 30 actions" in head


def test_phases_are_marked_and_every_cast_stands_in_the_table_and_the_player(page) -> None:
    for phase in ("swing", "coast", "rest"):
        assert f">{phase}</text>" in page
    assert page.count('<tr class="pick"') == 60
    assert page.count('<g class="pick" data-trial="3"><title>cast 3: ') >= 3
    written = re.search(r'<script type="application/json" class="paths">(.*?)</script>', page, re.S)
    assert written is not None
    trials = json.loads(written[1])["trials"]
    assert len(trials) == 60
    for trial in trials:
        assert len(trial["measured"][0]) == len(trial["predicted"][0]) == len(trial["t"])


@pytest.mark.parametrize(
    "made",
    [
        made_up(groups=1, repeats=1),
        made_up(groups=12, repeats=1),
        one_sample(),
        one_component(),
        gappy(),
        diverged(slice(2, 3)),
        diverged(slice(None)),
    ],
    ids=["one cast", "no repeats", "one waypoint", "one component", "gaps", "diverged", "all lost"],
)
def test_a_page_is_whole_whatever_the_data(made: MadeUp) -> None:
    text = comparison_page(compared(made))
    assert balanced(text)
    assert not re.search(r"\bnan\b|\bNone\b|\binf\b", text)
    assert text.count('<tr class="pick"') == len(made.records)


def test_without_repeats_the_page_asks_for_some() -> None:
    text = comparison_page(compared(made_up(groups=12, repeats=1)))
    assert "The noise is not known well enough" in text and "No action was repeated" in text


def test_however_far_the_model_errs_it_is_said_in_noises() -> None:
    made = made_up(groups=12, repeats=3)
    text = comparison_page(compared(MadeUp(made.records, made.predicted + 1e3)))
    assert re.search(r"That is \d+\.\d times what repeats differ by", text)


def test_a_right_model_is_not_sent_to_diagnosis() -> None:
    text = comparison_page(compared(made_up(groups=12, repeats=3)))
    assert "errs by about as much as noise" in text
    assert "stages/diagnose.py" not in text
    assert "No part of the casts holds clearly more" in text


def test_diverged_casts_and_notes_are_told() -> None:
    text = comparison_page(compared(diverged(slice(2, 3)), notes=("The tool log is missing.",)))
    assert "The simulation of cast 2 diverged; each counts with an error of 100 %" in text
    assert "The tool log is missing." in text


def test_names_from_data_are_escaped() -> None:
    plain = compared(made_up(groups=4))
    plain["measurements"] = "<b>&</script>"
    plain["trials"][0]["phases"] = {"</script><b>": 0.0}
    text = comparison_page(plain)
    assert "<b>&" not in text and "</script><b>" not in text


def test_blocks_stand_alone_in_other_pages_and_are_always_the_same() -> None:
    plain = compared(made_up(groups=8))
    blocks = [*where_blocks(plain).values(), casts_block(plain)]
    assert all(map(balanced, blocks))
    assert blocks == [*where_blocks(plain).values(), casts_block(plain)]
    assert where_blocks(compared(one_component()))["map"] == ""
