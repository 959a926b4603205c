"""What the runs of the study that are kept with the code say of the optimizers (paper, Sim2Sim)."""

from pathlib import Path

import pytest

from robotcast.sim2sim.outcome import Outcome, read_outcomes

RUNS = Path(__file__).resolve().parents[2] / "reports/sim2sim/runs"
TOLD_PERCENT = 20.0  # as conf/sim2sim/full.yaml has it


def told(simulator: str, optimizer: str) -> list[Outcome]:
    """Return the parameters that twenty casts tell."""
    cell = (simulator, optimizer, 20)
    found = [o for o in read_outcomes(RUNS) if (o.simulator, o.optimizer, o.casts) == cell]
    return [o for o in found if o.told_within_percent <= TOLD_PERCENT]


@pytest.mark.parametrize("simulator", ["segmented", "hybrid"])
def test_gauss_newton_needs_a_twentieth_of_what_differential_evolution_needs(
    simulator: str,
) -> None:
    evolved, newton = told(simulator, "de"), told(simulator, "gn")
    assert len({o.tuning for o in evolved}) == len({o.tuning for o in newton}) == 6
    assert max(o.error_percent for o in evolved) < 1.0
    assert max(o.error_percent for o in newton) < 0.5
    most, least = (max(o.simulated_casts for o in newton), min(o.simulated_casts for o in evolved))
    assert most <= least / 20
