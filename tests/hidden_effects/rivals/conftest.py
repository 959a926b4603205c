"""A puck whose pushes cost nothing stands in for the cable."""

from collections.abc import Callable, Sequence

import pytest

from robotcast.diagnosis.errors import Floor
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from tests.diagnosis.sliding_puck import (
    DEAD,
    LATE,
    NOISE_M,
    SHIFT,
    TILT,
    TURN,
    Puck,
    pushed,
    pushes,
)

EFFORT = Effort(base=4, refit=3, fold=2)
CANDIDATES = (DEAD.name, LATE.name, SHIFT.name, TILT.name, TURN.name)
FLOOR = Floor.known(100 * NOISE_M, 0.1)
RULE = Rule()


@pytest.fixture
def ask() -> Callable[..., Inquiry]:
    """Put the puck beside pushes with hidden effects (name → values)."""

    def asked(**hidden: Sequence[float]) -> Inquiry:
        factors = [one.factors for one in pushes(groups=16, repeats=2)]
        return Inquiry(Puck(DEAD, LATE, SHIFT, TILT, TURN), pushed(factors, 0, **hidden), NOISE_M)

    return asked
