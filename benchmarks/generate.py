"""How fast D_sim is generated, beside the bare chain in mujoco.batch, in one run.

    .venv/bin/python benchmarks/generate.py [--rounds 5] [--tuned data/tuned/cable1/segmented-de]

The bare chain has the same masses, springs and dampers, no forces, no Python between steps and
no recording; it starts bent and swinging. Rounds of the two alternate, so that a machine whose
speed drifts is fair to both.
With --tuned it then runs the generate stage at paper scale on one cable and prints its time and
memory. Exits with 1 when the ratio is below 0.8, D_sim takes 4.5 minutes or memory 4 GiB.
"""

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from mujoco.batch import Batch

from robotcast.casts.plan import PlanLimits, plan_actions
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.chain import ChainGeometry
from robotcast.simulators.mujoco_cables import SegmentedSimulator, chain_model
from robotcast.simulators.simulator import SimulatedCast

ROOT = Path(__file__).resolve().parents[1]
CABLE = Cable("cable1", 0.63, 0.008, 0.0045, 0.02)
RATIO, LONGEST_S, MOST_GIB = 0.8, 270.0, 4.0


def make_simulator() -> SegmentedSimulator:
    """Return the segmented simulator as conf/ has it."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        return instantiate(compose("config").simulator.model, cable=CABLE)


def make_casts(n: int) -> list[SimulatedCast]:
    """Return casts that end with the tool's motion, so that every step of theirs is needed."""
    random = np.random.default_rng(0)
    ranges = ((0.3, 1.1), (0.55, 0.7), (-1.2, -0.3), (0.55, 0.8), (0.0, 1.5), (1.4, 1.9))
    actions = np.column_stack([random.uniform(*ends, n) for ends in ranges])
    planned = plan_actions(actions, r0_m=0.6, limits=PlanLimits())
    return [SimulatedCast(one.tool, np.array([one.end_s])) for one in planned]


def seconds(work: Callable[[], object]) -> float:
    """Return how long `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def bare_chain(simulator: SegmentedSimulator, n_sim: int) -> Batch:
    """Return a batch of the simulator's chain at its nominal parameters."""
    settings = simulator.settings
    geometry = ChainGeometry.of_cable(CABLE.length_m, settings.segments, settings.stretches)
    model = chain_model(geometry, settings.step_s)
    values = {p.name: p.nominal for p in simulator.parameters}
    bending = values["bending_stiffness_n_m2"] / geometry.bends_m
    model.jnt_stiffness[geometry.hinges] = bending
    model.dof_damping[geometry.hinges] = values["bending_damping_s"] * bending
    slides, stretching = geometry.slides[geometry.stretching], values["axial_stiffness_n"]
    model.jnt_stiffness[slides] = stretching / geometry.stretches_m
    model.dof_damping[slides] = settings.stretch_damping_s * stretching / geometry.stretches_m
    return Batch(model, n_sim, settings.processes)


def compare(rounds: int) -> float:
    """Print casts/s of generation and of the bare chain; return the median ratio."""
    simulator = make_simulator()
    settings = simulator.settings
    casts = make_casts(2 * settings.batch_size)
    steps = [int(np.ceil(c.waypoints_s[-1] / settings.step_s)) for c in casts]
    vector = np.array([p.nominal for p in simulator.parameters])
    bare = bare_chain(simulator, len(casts))
    hinges = ChainGeometry.of_cable(1.0, settings.segments, settings.stretches).hinges
    moving = np.random.default_rng(1).normal(0.0, 0.2, (2, len(casts), settings.segments))
    simulator.simulate(casts[:16], vector)
    ratios = []
    for _ in range(rounds):
        bare.bind("qpos")[:, hinges] = moving[0]
        bare.bind("qvel")[:, hinges] = 10 * moving[1]
        bare_s = seconds(lambda: bare.step(nstep=int(np.mean(steps))))
        simulated_s = seconds(lambda: simulator.simulate(casts, vector))
        ratios.append(bare_s / simulated_s)
        print(
            f"generation {len(casts) / simulated_s:6.1f} casts/s   "
            f"bare chain {len(casts) / bare_s:6.1f} casts/s   ratio {ratios[-1]:.2f}"
        )
    ratio = statistics.median(ratios)
    print(f"median ratio {ratio:.2f} (asked: ≥ {RATIO})")
    return ratio


def paper_grid() -> dict[str, int]:
    """Return how many values of each number of an action the paper's D_sim has."""
    text = (ROOT / "conf/scale/paper.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["generate"]["grid"]


def generate_paper_scale(tuned: str) -> tuple[float, float]:
    """Run the generate stage at paper scale; return its seconds and its peak memory [GiB]."""
    with tempfile.TemporaryDirectory() as folder:
        # only the grid is the paper's: the casts that were tuned to are those of any run
        counts = ", ".join(f"{name}: {count}" for name, count in paper_grid().items())
        command = [sys.executable, str(ROOT / "stages/generate.py")]
        command += [f"scale.generate.grid={{{counts}}}", f"paths.tuned={tuned}"]
        command += [f"paths.simulated={folder}"]
        start = time.perf_counter()
        if status := subprocess.run(command, cwd=ROOT).returncode:
            sys.exit(status)  # the stage has said why
        took_s = time.perf_counter() - start
    gib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    print(f"D_sim at paper scale: {took_s:.0f} s (asked: < {LONGEST_S:.0f}), {gib:.2f} GiB")
    return took_s, gib


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--tuned", help="folder of a tuned simulator: also run the paper's D_sim")
    asked = parser.parse_args()
    good = compare(asked.rounds) >= RATIO
    if asked.tuned:
        took_s, gib = generate_paper_scale(asked.tuned)
        good = good and took_s < LONGEST_S and gib < MOST_GIB
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
