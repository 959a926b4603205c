"""The table of docs/decision.md: what is found, and the verdict on it."""

from dataclasses import replace

import numpy as np
import pytest

from robotcast.diagnosis.decision import Code, Unexplained, Verdict, decide
from robotcast.diagnosis.errors import Floor, Scales
from robotcast.diagnosis.found import Found, Rung
from robotcast.diagnosis.inquiry import HeldOut, Revision
from robotcast.diagnosis.rule import RULE
from robotcast.fitting.least_squares import Fit

TRIALS = np.arange(40)
FLOOR, UNKNOWN_FLOOR = Floor.known(1.0, 0.1), Floor(None, 0.1, 0.0)
NO_FIT = Fit(np.zeros(1), np.zeros((40, 1)), np.zeros((40, 1, 1)))


def rung(level: float, *effects: str) -> Rung:
    """Return a model that misses 40 held-out trials by about so much, in % of the scale."""
    noise = np.random.default_rng(len(effects)).normal(size=len(TRIALS))
    errors = level * np.exp(0.1 * noise)
    return Rung(Revision(effects, NO_FIT), HeldOut(errors, errors, errors, np.zeros((1, 1))))


def found(base: float, chosen: Rung | None, floor: Floor, *others: Rung) -> Found:
    models = [rung(base), *([chosen] if chosen else []), *others]
    usual = np.ones(len(TRIALS), bool)
    scales = Scales(floor, base, TRIALS, usual, RULE)
    effects = chosen.effects if chosen else ()
    return Found({m.effects: m for m in models}, effects, scales=scales)


def field(level: float, enough: bool) -> Unexplained:
    return Unexplained("a field", rung(level, "a field"), enough, 8)


NOTHING = Unexplained()


@pytest.mark.parametrize(
    ("base", "named", "left", "code", "open_page"),
    [
        (1.1, None, NOTHING, Code.NONE, False),  # at the floor
        (2.0, None, NOTHING, Code.NONE, True),  # above it, and nothing explains it
        (3.5, None, NOTHING, Code.UNKNOWN, True),  # too far above it
        (2.0, None, field(1.1, True), Code.UNKNOWN, True),  # a field explains it
        (2.2, None, field(1.8, True), Code.NONE, True),  # explains a part, as honest models differ
        (1.4, None, field(1.1, True), Code.NONE, True),  # at the floor, but a field does better
        (3.0, 1.1, NOTHING, Code.NAMED, False),
        (5.0, 1.9, NOTHING, Code.NAMED, True),  # more is missing
        (3.2, 2.6, NOTHING, Code.UNKNOWN, True),  # too little of it is explained
        (2.0, 1.7, NOTHING, Code.NONE, True),  # so, but honest models differ by as much
        (2.0, 1.7, field(1.1, True), Code.UNKNOWN, True),  # if it is not like the field
        (5.0, 1.9, field(1.2, True), Code.UNKNOWN, True),  # imitates what the field is like
        (5.0, 1.9, field(1.7, True), Code.NAMED, True),  # the field is only more flexible
        (5.0, 1.4, field(1.1, True), Code.NAMED, False),  # at the floor, honest models differ so
        (5.0, 1.4, field(0.9, True), Code.UNKNOWN, True),
    ],
)
def test_the_verdict_follows_from_the_errors(
    base: float, named: float | None, left: Unexplained, code: Code, open_page: bool
) -> None:
    chosen = rung(named, "tilt") if named else None
    known = found(base, chosen, FLOOR)
    verdict = decide(known, lambda: left, lambda own: known)
    assert verdict.code is code and (verdict.left is not None) is open_page
    assert verdict.named == (("tilt",) if code is Code.NAMED else ())


def test_effects_that_only_help_together_are_not_named() -> None:
    together = rung(1.05, "shift", "counter_shift")
    known = replace(found(2.0, together, FLOOR), inseparable=True)
    verdict = decide(known, lambda: NOTHING, lambda own: known)
    assert verdict.code is Code.UNKNOWN and verdict.near == (together,)


@pytest.mark.parametrize(("level", "enough"), [(2.0, True), (2.4, False), (3.1, False)])
def test_no_effect_is_chosen_that_adds_nothing_that_matters(level: float, enough: bool) -> None:
    """Nor is a part of what pays taken that does not help, or leaves what matters."""
    alone = rung(level, "tilt")
    known = found(3.0, rung(1.9, "tilt", "drag"), FLOOR, alone)
    assert known.enough(("tilt", "drag")) == ([alone] if enough else [])


def test_without_repeats_nothing_is_called_fit() -> None:
    known = found(1.0, None, UNKNOWN_FLOOR)
    verdict = decide(known, lambda: NOTHING, lambda own: known)
    assert verdict.code is Code.CANNOT_TELL


def test_a_set_that_only_imitates_hides_no_name() -> None:
    before = found(2.9, rung(2.4, "tilt"), FLOOR)
    known = found(2.9, None, FLOOR, rung(1.05, "drag"))
    verdict = decide(before, lambda: field(1.2, True), lambda own: known)
    assert verdict.named == ("drag",)


@pytest.mark.parametrize(("apart", "code"), [(0.1, Code.NAMED), (0.5, Code.UNKNOWN)])
def test_a_field_that_predicts_what_a_name_does_is_that(apart: float, code: Code) -> None:
    """Even where both stay above the floor: more is missing then, beside what has a name."""
    residuals = (np.full((40, 3), 1.0), np.zeros((40, 3)), np.full((40, 3), apart))
    fits = [Fit(np.zeros(1), one, np.zeros((40, 3, 1))) for one in residuals]
    base, drag, curve = (
        replace(one, revision=Revision(one.effects, fit))
        for one, fit in zip((rung(5.5), rung(3.0, "drag"), rung(3.0, "a field")), fits, strict=True)
    )
    known = found(5.5, None, FLOOR, drag)
    known = replace(known, judged={(): base, ("drag",): drag})
    left = Unexplained("a field", curve, True, 8)
    verdict = decide(replace(known, judged={(): base}), lambda: left, lambda own: known)
    assert verdict.code is code


def test_near_sets_are_called_by_what_not_all_of_them_have() -> None:
    sets = [("tilt", "drag"), ("tilt", "lag"), ("tilt", "slip", "lag")]
    assert Verdict(near=tuple(rung(1.0, *one) for one in sets)).alike == [
        "drag",
        "lag",
        "slip + lag",
    ]
    assert Verdict(near=(rung(1.0, "tilt", "drag"),)).alike == ["drag"]


@pytest.mark.parametrize(("level", "named"), [(1.15, ("drag",)), (1.45, ()), (1.6, ())])
def test_a_name_is_said_where_it_does_as_well_as_a_field_that_pays(level, named) -> None:
    """Not where it leaves most of what the field explains, or stays above the floor."""
    before, known = (found(1.7, None, FLOOR, *more) for more in ((), (rung(level, "drag"),)))
    verdict = decide(before, lambda: field(1.1, True), lambda own: known)
    assert verdict.named == named
    assert verdict.code is (Code.NAMED if named else Code.UNKNOWN)
