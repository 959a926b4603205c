"""How long it takes to choose among the 67 500 candidates for 16 targets at once.

    .venv/bin/python benchmarks/choose.py [--rounds 7]

Network and sparse Gaussian process are of the sizes in conf/policy, trained on a smooth made-up
world; not to the end, so that they are less sure than those of a real run and more candidates come
into question. What the arm can do of
the candidates is found once for all policies (stages/candidates.py) and not timed. Refinement,
which follows, is timed by itself. Exits with 1 when the median of a choice takes 0.2 s or longer.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from robotcast.build import action_space
from robotcast.policies.choosing import Neighbourhood, choose_actions, refine_choices
from robotcast.policies.datasets import Dataset, Examples
from robotcast.rigs.envelope import are_feasible, feasible_actions

ROOT = Path(__file__).resolve().parents[1]
LONGEST_S, TARGETS, EXAMPLES, PASSES = 0.2, 16, 4000, 20


def made_up_endpoints(actions: np.ndarray) -> np.ndarray:
    """Return endpoints (n, 2) [m] as a smooth function of actions (n, 6)."""
    theta1, _, theta2, r2, alpha, vmax = actions.T
    angle = theta2 - 0.25 * theta1 * vmax / 2 - 0.12 * alpha
    reach = r2 + 0.55 * np.cos(0.8 * alpha + 0.5 * theta1)
    return np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=1)


def made_up_dataset(candidates: np.ndarray) -> Dataset:
    """Return casts of that world, a tenth of them held out."""
    rows = np.random.default_rng(0).permutation(len(candidates))[:EXAMPLES]
    ends = made_up_endpoints(candidates[rows])
    examples = Examples(candidates[rows], ends, np.ones(EXAMPLES))
    held = EXAMPLES // 10
    held_out = examples.take(np.arange(held))
    return Dataset("made up", examples.take(np.arange(held, EXAMPLES)), held_out, held_out)


def median_s(work: Callable[[], object], rounds: int) -> float:
    """Return how long `work` takes, the median of some rounds after a first."""
    work()
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        configs = {name: compose("config", overrides=[f"policy={name}"]) for name in ("nn", "gp")}
    config = configs["nn"]
    grid, r0_m, limits, envelope = action_space(config, "candidates")
    candidates = feasible_actions(grid, r0_m, limits, envelope)
    feasible = partial(are_feasible, r0_m=r0_m, limits=limits, envelope=envelope)
    drawn = np.random.default_rng(1).permutation(len(candidates))[:TARGETS]
    targets = made_up_endpoints(candidates[drawn])
    about, dataset, good = Neighbourhood(grid, r0_m, limits), made_up_dataset(candidates), True
    for name, policy in configs.items():
        model = instantiate(policy.policy.learner).shortened(PASSES).fit(dataset, seed=0)
        predicting_s = median_s(partial(model.predict, candidates), rounds)
        choose = partial(choose_actions, model, candidates, targets)
        choosing_s = median_s(choose, rounds)
        refine = partial(refine_choices, model, choose(), about, feasible)
        print(
            f"{name}: {len(candidates)} feasible of {grid.size} candidates, "
            f"{TARGETS} targets: {choosing_s:.3f} s "
            f"(asked: < {LONGEST_S}), of it predicting {predicting_s:.3f} s; "
            f"refining {median_s(refine, rounds):.3f} s"
        )
        good = good and choosing_s < LONGEST_S
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
