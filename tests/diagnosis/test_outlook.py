"""The bar's total is an estimate that gets better as steps are taken."""

from robotcast.diagnosis.found import Outlook, Step

TRIALS = 10


def test_the_total_counts_what_is_sure_to_come_and_stays_ahead_of_what_is_done() -> None:
    outlook = Outlook(TRIALS)
    assert outlook.total(0) == TRIALS * (Step.BASE.runs + Step.LIBRARY.runs)
    for step in Step:
        outlook.step(step, 5000)
        assert outlook.total(5000) == 5000 + TRIALS * (
            step.runs + Step.LIBRARY.runs * (step is Step.BASE)
        )
        assert outlook.total(90000) > 90000


def test_every_step_says_what_it_does() -> None:
    assert Step.REFIT.says("air_drag + tilt") == "refitting with air drag + tilt"
    assert Step.BASE.says("") == "fitting the model as it is"
