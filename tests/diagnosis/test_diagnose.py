"""What a whole diagnosis says of a puck: of good data, of bad data and of dead parameters."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.diagnosis.inquiry import Inquiry, Revision
from robotcast.diagnosis.library import Library
from robotcast.diagnosis.model import Record
from robotcast.diagnosis.next_trials import Further, NextTrial, _added
from robotcast.diagnosis.report import next_rows
from robotcast.reporting.diagnosis_page import diagnosis_page
from tests.diagnosis.sliding_puck import (
    DEAD,
    DRAG_PER_S,
    FAINT,
    GAIN,
    LATE,
    NOISE_M,
    NULLED,
    SHEAR,
    SHIFT,
    TILT,
    TIMES_S,
    TURN,
    WORDS,
    Mechanism,
    Puck,
    pushed,
    pushes,
)

TILTED = (0.06, -0.04)
LIVE = (TILT, LATE, SHIFT, TURN)


def diagnosed(
    records: Sequence[Record], *effects: Mechanism, ignored: bool = False, **given: Any
) -> dict[str, Any]:
    effects = effects or LIVE
    model = Puck(*effects, ignored=ignored)
    case = Case(model, records, [e.name for e in effects], wording=WORDS, **given)
    return diagnose(case, lambda said: None)


def row_of(said: dict[str, Any], effect: str) -> dict[str, Any]:
    return next(row for row in said["ranking"] if row["effect"] == effect)


def with_trial_7(records: Sequence[Record], off_m: Any) -> list[Record]:
    """Return the records with one measured beside where it was."""
    moved = replace(records[7], measured=records[7].measured + np.array(off_m))
    return [*records[:7], moved, *records[8:]]


@pytest.fixture(scope="module")
def tilted() -> dict[str, Any]:
    return diagnosed(pushes(tilt=TILTED))


def test_the_missing_effect_is_named_with_its_size(tilted: dict[str, Any]) -> None:
    assert tilted["verdict"] == ["tilt"] and tilted["conclusive"]
    assert "held-out pushes" in tilted["sentence"]
    sizes = row_of(tilted, "tilt")["parameters"]
    for name, true in zip(("ax", "ay"), TILTED, strict=True):
        assert sizes[name]["low"] < true < sizes[name]["high"]
    json.dumps(tilted, allow_nan=False)


def test_every_refitted_effect_shows_what_it_mends(tilted: dict[str, Any]) -> None:
    assert any(r["status"] == "tried" for r in tilted["ranking"])
    for row in tilted["ranking"]:
        refitted = row["status"] in ("confirmed", "refitted")
        assert bool(row["slices"]) == refitted
    confirmed = row_of(tilted, "tilt")
    assert all(s["after_percent"] < 0.3 * s["before_percent"] for s in confirmed["slices"])


def test_nothing_is_named_where_nothing_is_missing() -> None:
    said = diagnosed(pushes())
    assert said["verdict"] == ["none"] and said["code"] == "none" and said["conclusive"]
    assert [note for note in said["notes"] if "drift" not in note] == []
    for name, true in (("drag", DRAG_PER_S), ("gain", GAIN)):
        size = said["base"]["parameters"][name]
        assert size["low"] < true < size["high"]


def test_errors_far_above_noise_are_never_given_a_clean_bill() -> None:
    field = replace(SHEAR, text="a shear of the board", depends_on="place")
    model, records = Puck(TURN, field), pushes(shift=(0.15, 0.1))
    said = diagnose(Case(model, records, ["turn"], wording=WORDS), lambda said: None)
    assert said["verdict"] == ["unknown"]
    assert said["unexplained"]["depends_on"] == "place"
    assert "times what repeats differ by" in said["sentence"]
    assert [rung["effects"] for rung in said["ladder"]] == [[]]
    assert said["model"]["effects"] == []
    bare = diagnosed(records, TURN)
    assert bare["verdict"] == ["unknown"] and "Something is missing" in bare["sentence"]


def test_a_size_that_was_stopped_by_its_range_is_said() -> None:
    narrow = tuple(replace(p, lower=-0.03, upper=0.03) for p in SHIFT.parameters)
    said = diagnosed(pushes(shift=(0.05, 0.0)), replace(SHIFT, parameters=narrow))
    assert said["verdict"] == ["shift"]
    pushed_there = [note for note in said["notes"] if "end of its range" in note]
    assert (
        len(pushed_there) == 1 and "dx of shift to the end of its range, 0.03 m" in pushed_there[0]
    )


def test_what_cannot_act_is_said_and_never_ranked() -> None:
    said = diagnosed(pushes(tilt=TILTED), DEAD, FAINT, NULLED, TILT, ignored=True)
    status = {row["effect"]: row["status"] for row in said["ranking"]}
    assert list(status) == ["tilt", "dead", "faint", "nulled"]
    assert status["dead"] == "ignored by the model"
    assert status["faint"] == "touches nothing"
    assert status["nulled"] == "held at its null"
    for name in ("dead", "faint", "nulled"):
        row = row_of(said, name)
        assert row["p_value"] is row["power"] is row["predicted_typical_error_percent"] is None
    notes = " ".join(said["notes"])
    assert "The model ignores board colour" in notes and "Nulled is held" in notes
    colour = said["base"]["parameters"]["board_colour"]
    assert (colour["low"], colour["high"]) == (0.0, 1.0)


@pytest.mark.parametrize("groups", [1, 2, 3])
def test_a_few_trials_confirm_nothing_and_say_so(groups: int) -> None:
    said = diagnosed(pushes(groups=groups, repeats=1, tilt=TILTED))
    assert said["verdict"] == ["none"] and not said["conclusive"]
    assert "too few to tell" in said["sentence"]
    assert "At least 8 different actions" in said["notes"][0]
    assert {row["status"] for row in said["ranking"]} <= {"screened", "your casts cannot tell"}
    assert said["comparison"]["trials"] and said["base"]["parameters"]


def test_without_repeats_the_page_says_how_to_know_the_noise() -> None:
    said = diagnosed(pushes(groups=30, repeats=1, tilt=TILTED))
    assert said["verdict"] == ["tilt"] and said["noise_floor_percent"] is None
    assert "repeat five actions three times each" in said["notes"][0]


def test_one_trial_half_a_metre_off_is_named_and_decides_nothing() -> None:
    for clean, verdict in ((pushes(tilt=TILTED), ["tilt"]), (pushes(), ["none"])):
        said = diagnosed(with_trial_7(clean, (0.3, 0.4)))
        assert said["verdict"] == verdict
        note = next(n for n in said["notes"] if n.startswith("Push 7 is off by"))
        assert re.search(r" by (4[89]|5[01])\.\d ", note)
        floor = diagnosed(clean)["noise_floor_percent"]
        assert said["noise_floor_percent"] == pytest.approx(floor, rel=0.2)
    missed = diagnosed(with_trial_7(pushes(), (0.015, 0.02)))["notes"]  # as a chaotic model may
    assert not any("Push 7" in note for note in missed)


def test_a_known_noise_floor_is_taken_where_nothing_was_repeated() -> None:
    said = diagnosed(pushes(groups=12, repeats=1), floor=0.5)
    assert said["noise_floor_percent"] == 0.5 and said["notes"] == []


def test_samples_that_were_not_measured_are_left_out_and_decide_nothing(tilted) -> None:
    hole = np.where(np.arange(len(TIMES_S)) == 5, np.nan, 0.0)[:, None]
    said = diagnosed(with_trial_7(pushes(tilt=TILTED), hole))
    assert said["verdict"] == ["tilt"]
    error, before = (s["ladder"][-1]["heldout_typical_error_percent"] for s in (said, tilted))
    assert error == pytest.approx(before, rel=0.1)


def test_a_prediction_of_another_shape_and_an_unknown_effect_are_refused() -> None:
    class Short(Puck):
        def predict(self, records, active, vectors):
            return super().predict(records, active, vectors)[:, :, :-1]

    case = Case(Short(TILT), pushes(groups=8), ["tilt"])
    with pytest.raises(ValueError, match="expected a prediction of shape"):
        diagnose(case, lambda said: None)
    with pytest.raises(ValueError, match="has no effect tlit; it has tilt"):
        Case(Puck(TILT), pushes(groups=8), ["tlit"])


def test_the_unit_of_errors_changes_no_verdict() -> None:
    said = {}
    for scale in (0.1, 1.0, 50.0):
        model = Puck(*LIVE)
        model.scale = scale
        case = Case(model, pushes(tilt=(0.015, 0.0)), [e.name for e in LIVE], wording=WORDS)
        said[scale] = diagnose(case, lambda known: None)["verdict"]
    assert said[0.1] == said[1.0] == said[50.0]


def test_two_effects_that_act_together_are_both_named() -> None:
    said = diagnosed(pushes(tilt=TILTED, late_clock=(0.1,)))
    assert set(said["verdict"]) == {"tilt", "late_clock"}
    sizes = said["model"]["parameters"]
    assert sizes["late_clock.tau"]["low"] < 0.1 < sizes["late_clock.tau"]["high"]


def test_a_small_effect_beside_a_large_one_comes_near() -> None:
    said = diagnosed(pushes(tilt=TILTED, late_clock=(0.05,)))
    assert said["verdict"] == ["tilt"] and said["nearest"] == [["late_clock"]]
    assert "It may be this too: the clock is late" in said["sentence"]


def test_windows_of_one_log_are_held_out_together_and_are_no_repeats() -> None:
    records = [
        replace(r, group=k, held_out_with=k // 3)
        for k, r in enumerate(pushes(groups=36, repeats=1, tilt=TILTED))
    ]
    said = diagnosed(records, floor=0.5)
    assert said["verdict"] == ["tilt"] and said["actions"] == 12
    assert said["comparison"]["repeats"]["groups"] == 0


def test_a_session_that_drifts_is_said_to() -> None:
    rng = np.random.default_rng(1)
    factors = [{"speed": rng.uniform(0.4, 1.2), "heading": rng.uniform(-1, 1)} for _ in range(20)]
    order = [*range(20), *(k for k in range(10) for _ in range(2))]
    for drift in (0.0, 0.3):
        records = [
            replace(r, measured=r.measured * (1 + drift * k / 40))
            for k, r in enumerate(pushed([factors[k] for k in order], 2))
        ]
        notes = " ".join(diagnosed(records)["notes"])
        assert ("drifts over the session" in notes) == bool(drift)


def test_it_is_told_step_by_step_and_ends_with_everything() -> None:
    told: list[dict[str, Any]] = []
    seen: list[tuple[int, int, str]] = []
    records, model = pushes(groups=10), Puck(*LIVE)
    case = Case(model, records, list(model.effects), wording=WORDS)
    diagnose(case, told.append, lambda done, total, note="": seen.append((done, total, note)))
    assert [t["finished"] for t in told] == [False] * (len(told) - 1) + [True]
    assert told[0]["ladder"] == [] and told[0]["verdict"] == []
    assert told[0]["doing"] == "fitting the model as it is"
    assert all(note and total > done for done, total, note in seen[:-1])
    assert seen[-1] == (told[-1]["simulated_casts"],) * 2 + ("",)
    assert len({json.dumps(t) for t in told}) == len(told)


def test_the_next_trials_would_move_what_is_hardly_seen() -> None:
    wide = Further(Puck(*LIVE), pushes(5, groups=60, repeats=1))
    said = diagnosed(pushes(heading=(-0.05, 0.05)), further=lambda: wide)
    weak = {r["effect"] for r in said["ranking"] if r["power"] is not None and r["power"] < 0.8}
    assert len(said["next_actions"]) in range(0, 9)
    for trial in said["next_actions"]:
        assert set(trial["separates"]) <= weak and trial["difference_percent"] > 0.1


def test_two_effects_that_make_one_run_diverge_still_have_a_step() -> None:
    both = ("turn", "shear")
    inquiry = Inquiry(Puck(TURN, SHEAR), pushes(), NOISE_M)
    fit = inquiry.fit(both, inquiry.nominal(both), 1)
    fit.jacobian[:], fit.jacobian[0, 0, -2:] = 0.0, 1e10  # as differences to a lost run may be
    assert np.isfinite(Library(inquiry, both, fit).step(both)).all()


def test_a_trial_that_sets_two_effects_against_none_names_both() -> None:
    records, both = pushes(), ("tilt", "late_clock")
    inquiry = Inquiry(Puck(TILT, LATE), records, NOISE_M)
    with_both = Revision(both, inquiry.fit(both, inquiry.nominal(both), 1))
    contest = _added(with_both, Revision((), inquiry.fit((), inquiry.nominal(()), 1)))
    (row,) = next_rows(inquiry, [NextTrial(records[0], contest, 2.0)], WORDS)
    assert row["separates"] == ["tilt + late_clock"]
    assert "the board is not level and the clock is late: with that" in row["why"]


def test_what_is_above_the_floor_or_without_one_is_never_green() -> None:
    above = diagnosed(pushes(groups=9, tilt=(0.0, 0.02)), SHIFT)
    error = above["ladder"][-1]["heldout_typical_error_percent"]
    assert 1.5 < error / above["noise_floor_percent"] < 3
    assert "times what repeats differ by" in above["sentence"]
    bare = diagnosed(pushes(groups=30, repeats=1))
    assert bare["code"] == "cannot tell"
    for said, text in ((above, ""), (bare, "the noise is unknown")):
        page = diagnosis_page(said)
        assert said["verdict"] == ["none"] and 'class="is-open"' in page and text in page
        assert "Nothing is missing" not in page and "Use the model as it is" not in page


@pytest.mark.parametrize(
    ("hidden", "size", "groups", "seed"),
    [
        ("turn", 0.02, 9, 0),
        ("turn", 0.02, 12, 3),
        pytest.param("shear", 0.03, 20, 2, marks=pytest.mark.slow),
    ],
)
def test_the_suggested_trials_tell_a_confused_pair_apart(hidden, size, groups, seed) -> None:
    """Straight ahead a turned picture and a sheared one look alike; to the side they do not."""
    effects = (TILT, SHIFT, TURN, SHEAR)
    drawn: dict[str, Any] = {hidden: (size,)}
    alike = pushes(seed, groups=groups, heading=(-0.08, 0.08), **drawn)
    wide = Further(Puck(*effects), pushes(5, groups=60, repeats=1))
    said = diagnosed(alike, *effects, further=lambda: wide)
    assert {"turn", "shear"} in [set(some) for some in said["confusion_set"]]
    assert "hardly tell it from this" in said["sentence"]
    rows = {row["effect"]: row["confusable_with"] for row in said["ranking"]}
    assert rows["turn"] == ["shear"] and rows["shear"] == ["turn"]
    telling = [t for t in said["next_actions"] if {"turn", "shear"} == set(t["separates"])]
    assert telling and all(abs(trial["heading"]) > 0.5 for trial in telling)
    chosen = [{n: t[n] for n in ("speed", "heading")} for t in said["next_actions"]]
    told = [dict(record.factors) for record in alike]
    again = diagnosed(pushed([*told, *chosen], seed + 1, **drawn), *effects)
    assert again["verdict"] == [hidden] and not again["confusion_set"]
