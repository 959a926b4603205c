"""The bar's total is an estimate that gets better as steps are taken."""

from robotcast.diagnosis.outlook import BEGUN, STEPS, Outlook

TRIALS, CANDIDATES, FIELDS = 10, 5, 3


def run(outlook: Outlook, pace: float) -> list[tuple[int, int]]:
    """Take every step of one search; each takes `pace` times what it usually takes."""
    plan = [
        "fitting the model as it is",
        *["looking at this"] * CANDIDATES,
        "refitting the model around every effect",
        "refitting with these",
        "refitting the best further",
        *["judging this"] * 2,
        *["trying a field that depends on place"] * FIELDS,
        *["beginning with a force"] * BEGUN,
        "fitting a force",
        "refitting it further",
        "choosing the next trials",
    ]
    simulated, seen = 0.0, []
    for note in plan:
        outlook.step(note, int(simulated))
        seen.append((int(simulated), outlook.total(int(simulated))))
        simulated += pace * TRIALS * next(n for kind, n in STEPS.items() if note.startswith(kind))
    return [*seen, (int(simulated), int(simulated))]


def test_the_total_is_right_from_the_second_step_on() -> None:
    for pace in (0.5, 1.0, 2.0):
        *seen, (whole, _) = run(Outlook(TRIALS, CANDIDATES, FIELDS), pace)
        assert all(abs(total - whole) <= 0.02 * whole for _, total in seen[1:])
        assert all(total > done for done, total in seen)


def test_a_further_round_and_steps_that_are_left_out_move_the_total() -> None:
    outlook = Outlook(TRIALS, CANDIDATES, FIELDS)
    outlook.step("fitting the model as it is", 0)
    for _ in range(CANDIDATES):
        outlook.step("looking at this", 8000)
    before = outlook.total(8000)
    outlook.step("looking at this", 8300)
    assert outlook.total(8300) > before + 300
    outlook.step("choosing the next trials", 8400)
    assert outlook.total(8400) < 8400 + 2 * 10 * STEPS["choosing"]
