"""Planted errors are found where they were planted, and chance names nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robotcast.diagnosis.misfit import misfit
from robotcast.diagnosis.model import Record
from tests.diagnosis.made_up_trials import PHASES, SCALE, TIMES_S, MadeUp, compared, made_up

ERROR_M = 0.02


def where(inside: Callable[[Record], np.ndarray | float]) -> Callable[[Record], np.ndarray]:
    """Return an error of fixed size for the samples (k,) that are inside."""
    return lambda r: ERROR_M * (np.ones(len(r.times_s)) * inside(r))[:, None] * np.ones(2)


def in_coast(record: Record) -> np.ndarray:
    return (record.times_s >= PHASES["coast"]) & (record.times_s < PHASES["rest"])


def lagging(record: Record) -> np.ndarray:
    return -0.06 * np.gradient(record.measured, record.times_s, axis=0)


@pytest.mark.parametrize("repeats", [1, 2])
@pytest.mark.parametrize("correlation", [0.0, 0.95])
def test_noise_alone_names_no_slice(repeats: int, correlation: float) -> None:
    named = [
        seed
        for seed in range(12)
        if compared(made_up(seed, repeats=repeats, correlation=correlation)).findings
    ]
    assert len(named) <= 1


def test_noise_that_grows_with_time_is_no_finding_when_repeats_show_it() -> None:
    made = made_up(groups=12, repeats=5)
    grown = [
        replace(r, measured=p + (r.measured - p) * (1 + TIMES_S[:, None]))
        for r, p in zip(made.records, made.predicted, strict=True)
    ]
    assert compared(MadeUp(grown, made.predicted)).findings == ()


@pytest.mark.parametrize(
    ("kind", "named", "wrong"),
    [
        ("alpha", "alpha above 1.", where(lambda r: r.factors["alpha"] > 1.5)),
        ("vmax", "vmax below 0.", where(lambda r: r.factors["vmax"] < 0.8)),
        ("phase", "in the coast", where(in_coast)),
        ("place", "on the left (y above 0.", where(lambda r: r.measured[:, 1] > 0.75)),
        ("heading", "along the path", lagging),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_planted_error_is_found_first(kind, named, wrong, seed) -> None:
    first, *more = compared(made_up(seed, wrong=wrong)).findings
    assert first.slice.kind == kind
    assert first.slice.name.startswith(named)
    assert first.share_of_error > first.share_of_samples + 0.1
    assert len(more) <= 4
    assert len({f.slice.kind for f in [first, *more]}) == 1 + len(more)


def test_the_sentence_says_how_much_and_the_slice_what_another_prediction_mends() -> None:
    made = made_up(wrong=where(lambda r: r.factors["alpha"] > 1.5))
    (found,) = compared(made).findings
    part = np.mean([r.factors["alpha"] > 1.45 for r in made.records])
    assert found.sentence == (
        f"Casts with alpha above 1.45 rad hold {100 * found.share_of_error:.0f} % of the squared "
        f"error; they are {100 * part:.0f} % of the casts."
    )
    before, after = (
        found.slice.percent(misfit(made.records, predicted, SCALE))
        for predicted in (made.predicted, made_up().predicted)
    )
    assert before == pytest.approx(100 * np.sqrt(2) * ERROR_M / SCALE, rel=0.2)
    assert before == pytest.approx(found.error_percent) and after < 1.5


def test_a_model_that_is_late_is_said_to_lag() -> None:
    sentences = [f.sentence for f in compared(made_up(wrong=lagging)).findings]
    assert "not across it: the prediction lags behind." in sentences[0]


def test_an_even_error_and_one_in_three_trials_have_no_place() -> None:
    assert compared(made_up(wrong=where(lambda r: True))).findings == ()
    few = made_up(groups=3, repeats=1, wrong=where(lambda r: r.trial == 0))
    assert compared(few).findings == ()


def test_one_bad_cast_is_named_and_hides_nothing() -> None:
    wrong = where(lambda r: 20.0 * (r.trial == 17) + (r.factors["vmax"] > 1.1))
    first, second = compared(made_up(wrong=wrong)).findings
    assert first.sentence.startswith("Cast 17 alone holds 9")
    assert second.slice.kind == "vmax"
