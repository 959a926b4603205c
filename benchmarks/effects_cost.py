"""What effects cost: casts a second of D_sim with five effects active, beside none, in one run.

    .venv/bin/python benchmarks/effects_cost.py [--rounds 5] [--effects board_tilt air_drag …]

All five act on the cable at every step. Rounds alternate, so that a machine whose speed drifts is
fair to both. Exits with 1 when generation keeps less than 80 % of its speed.
"""

import argparse
import statistics
import sys
from collections.abc import Sequence

import numpy as np
from generate import CABLE, ROOT, make_casts, seconds
from hydra import compose, initialize_config_dir

from robotcast.build import build_effects, build_simulator
from robotcast.simulators.simulator import Simulator

FIVE = ("board_tilt", "air_drag", "viscous_friction", "endpoint_friction", "resting_curvature")
KEPT = 0.8


def make_simulator(names: Sequence[str]) -> Simulator:
    """Return the segmented simulator with these effects, all as conf/ has them."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        return build_simulator(compose("config"), CABLE, build_effects(names))


def acting(simulator: Simulator) -> np.ndarray:
    """Return a parameter vector (n,) at which every effect acts: its first probe."""
    own = [
        p.nominal if p.null is None or not p.probes else p.probes[0] for p in simulator.parameters
    ]
    return np.array(own)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--effects", nargs="+", default=list(FIVE))
    asked = parser.parse_args()
    bare, full = make_simulator(()), make_simulator(asked.effects)
    casts = make_casts(1024)
    for simulator in (bare, full):
        simulator.simulate(casts[:16], acting(simulator))
    kept = []
    for _ in range(asked.rounds):
        without_s, with_s = (
            seconds(lambda: simulator.simulate(casts, acting(simulator)))  # noqa: B023
            for simulator in (bare, full)
        )
        kept.append(without_s / with_s)
        print(
            f"without effects {len(casts) / without_s:6.1f} casts/s   "
            f"with {len(asked.effects)} {len(casts) / with_s:6.1f}   kept {kept[-1]:.0%}"
        )
    median = statistics.median(kept)
    print(f"median: generation keeps {median:.0%} of its speed (asked: ≥ {KEPT:.0%})")
    sys.exit(0 if median >= KEPT else 1)


if __name__ == "__main__":
    main()
