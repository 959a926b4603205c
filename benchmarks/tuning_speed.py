"""Tuning the segmented simulator, beside what users would pick instead, in one run.

    .venv/bin/python benchmarks/tuning_speed.py [--measurements DIR] [--only evolution]

Evolution: casts/s of differential evolution whose generations are one simulate call each, against
SciPy's with workers=2 on the same chain as one would write it (plain_chain.py), one cast under
one vector at a time. Both see the same casts; rounds of the two alternate.

Least squares: Gauss–Newton as tune runs it, which looks for a start by itself, against
`mujoco.sysid.optimize` with MuJoCo's own least squares, on the same casts and from the same starts:
the nominal parameters first, then random ones. sysid's rollout knows no
friction on a board and no joint whose dry friction is integrated with it, so sysid is given the
segmented simulator itself, all its parameters, on their scales, and the same batches and threads
for its differences: what is compared is the search. Its differences are taken over each of
several shares of the ranges, and the one that does best counts: the default, 1.5e-8, is below
what the simulator's single precision resolves. How far the model is off on held-out casts is
looked at afterwards, off the clock.

Exits with 1 when the batched evolution is less than 8 times as fast, or Gauss–Newton takes more
than a third of the time in which sysid reaches its best held-out error.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from mujoco import sysid
from omegaconf import DictConfig
from plain_chain import PlainChain
from scipy.optimize import differential_evolution

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.noise_floor import noise_floor
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.tuning.objective import LEAST_NOISE_PERCENT, WaypointError, full_vectors
from robotcast.tuning.search import Problem, Query, Response, search

ROOT = Path(__file__).resolve().parents[1]
FASTER, QUICKER = 8.0, 3.0
DIFFERENCES = (1e-2, 1e-3)  # of the ranges, for sysid
_alone: list[PlainChain] = []  # of a worker process: one a cast
_parameters: list[Parameter] = []


@dataclass(frozen=True)
class Split:
    """The casts to tune to and those to judge on."""

    tuning: MeasurementSet
    heldout: MeasurementSet
    noise_percent: float


def composed(*overrides: str) -> DictConfig:
    """Return the configuration at paper scale."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        return compose("config", overrides=["scale=paper", *overrides])


def read_split(folder: Path, tune_casts: int, test_casts: int) -> Split:
    """Split a measurement set as tune does."""
    measured = read_measurement_set(folder)
    floor = noise_floor(measured).waypoint_percent
    sides = split_by_action(measured, tune_casts, test_casts, seed=0)
    return Split(*sides, max(floor or 0.0, LEAST_NOISE_PERCENT))


def objective(part: MeasurementSet) -> WaypointError:
    """Return the error of the segmented simulator on some casts."""
    simulator = instantiate(composed().simulator.model, cable=part.cable, effects=[])
    return WaypointError(simulator, part.trials, part.cable.length_m)


def start_vector(error: WaypointError) -> np.ndarray:
    """Return the nominal parameters, each mapped to [0, 1]."""
    return np.array([p.to_unit(np.asarray(p.nominal)) for p in error.free])


def rate(work: Callable[[], int]) -> float:
    """Return how many casts `work` simulates a second."""
    begun_s = time.perf_counter()
    return work() / (time.perf_counter() - begun_s)


def prepare_alone(tuning: MeasurementSet) -> None:
    """Make what a worker process evaluates: every cast by itself."""
    simulator = instantiate(composed().simulator.model, cable=tuning.cable, effects=[])
    _parameters.extend(simulator.parameters)
    _alone.extend(PlainChain(tuning.cable, simulator.settings, trial) for trial in tuning.trials)


def error_alone(vector: np.ndarray) -> float:
    """Return the error of one unit vector, cast by cast, in %."""
    full = full_vectors(_parameters, vector)[0]
    values = dict(zip((p.name for p in _parameters), full, strict=True))
    return float(np.mean([chain.error_percent(values) for chain in _alone]))


def compare_evolution(split: Split, population: int, generations: int, rounds: int) -> float:
    """Print casts/s of both evolutions; return the median ratio."""
    batched, n_casts = objective(split.tuning), len(split.tuning.trials)
    dimensions = len(batched.free)
    first = np.random.default_rng(0).random((population, dimensions))
    common = {
        "bounds": [(0.0, 1.0)] * dimensions, "init": first, "maxiter": generations, "tol": 0,
        "polish": False, "updating": "deferred", "mutation": (0.5, 1.0), "recombination": 0.9,
    }  # fmt: skip

    def percent(columns: np.ndarray) -> np.ndarray:
        return batched(Query(np.ascontiguousarray(columns.T))).percent

    def together() -> int:
        rng = np.random.default_rng(0)
        differential_evolution(percent, vectorized=True, rng=rng, **common)
        return population * (generations + 1) * n_casts

    def apart() -> int:
        rng = np.random.default_rng(0)
        # any map serves as workers, which SciPy's annotation does not say
        workers: Any = pool.map
        found = differential_evolution(error_alone, workers=workers, rng=rng, **common)
        return found.nfev * n_casts

    ratios = []
    percent(first[:1].T)
    for _ in range(rounds):
        with get_context("spawn").Pool(2, prepare_alone, (split.tuning,)) as pool:
            pool.map(error_alone, [first[0]] * 2)
            at_once, one_by_one = rate(together), rate(apart)
        ratios.append(at_once / one_by_one)
        print(
            f"differential evolution: batched {at_once:6.1f} casts/s, one at a time with "
            f"workers=2 {one_by_one:6.1f} casts/s, ratio {ratios[-1]:.1f}",
            flush=True,
        )
    ratio = statistics.median(ratios)
    print(f"median ratio {ratio:.1f} (asked: ≥ {FASTER:g})")
    return ratio


class Clocked:
    """Answers a search's queries and remembers when each best vector was found.

    Attributes
    ----------
    found : (seconds, simulated casts, vector), each better than those before it.
    """

    def __init__(
        self, error: WaypointError, casts: int, worth: Callable[[Response], np.ndarray]
    ) -> None:
        self.found: list[tuple[float, int, np.ndarray]] = []
        self._error, self._worth, self._set_casts = error, worth, casts
        self._best, self._casts = np.inf, 0
        self._begun_s = time.perf_counter()

    def __call__(self, query: Query) -> Response:
        response = self._error(query)
        self._casts += query.cost(self._set_casts)
        if query.whole:
            worth = self._worth(response)
            best = int(np.argmin(worth))
            if worth[best] < self._best:
                self._best = float(worth[best])
                vector = query.vectors[best].copy()
                self.found.append((time.perf_counter() - self._begun_s, self._casts, vector))
        return response


def gauss_newton(split: Split, error: WaypointError, start: np.ndarray) -> Clocked:
    """Search as tune does with optimizer=gn."""
    config = composed("optimizer=gn")
    clocked = Clocked(error, len(split.tuning.trials), lambda response: response.percent)
    problem = Problem(error.free, start, len(split.tuning.trials), split.noise_percent)
    budget = config.optimizer.budget_casts
    search(instantiate(config.optimizer.search), problem, clocked, budget)
    return clocked


def system_identification(
    split: Split, error: WaypointError, start: np.ndarray, difference: float
) -> Clocked:
    """Search with mujoco.sysid, which minimises the sum of squares of all misses."""

    def squares(response: Response) -> np.ndarray:
        assert response.residuals is not None
        return (response.residuals**2).sum(axis=(1, 2))

    clocked = Clocked(error, len(split.tuning.trials), squares)

    def residual(x: np.ndarray, params: sysid.ParameterDict) -> tuple[list[np.ndarray], None, None]:
        columns = x.reshape(len(error.free), -1)
        misses = clocked(Query(columns.T.copy(), with_residuals=True)).residuals
        assert misses is not None
        rows = misses.reshape(columns.shape[1], -1).T / split.noise_percent
        return [rows if x.ndim > 1 else rows.ravel()], None, None

    free = [sysid.Parameter(p.name, s, 0.0, 1.0) for p, s in zip(error.free, start, strict=True)]
    with redirect_stdout(StringIO()):
        sysid.optimize(
            sysid.ParameterDict({p.name: p for p in free}),
            residual,
            optimizer="mujoco",
            verbose=False,
            eps=difference,
        )
    return clocked


def judged(clocked: Clocked, heldout: WaypointError) -> list[tuple[float, int, float]]:
    """Return (seconds, casts, held-out error in %) of every best vector."""
    vectors = np.array([vector for _, _, vector in clocked.found])
    errors = heldout(Query(vectors)).percent.tolist()
    return [(s, n, e) for (s, n, _), e in zip(clocked.found, errors, strict=True)]


def compare_least_squares(split: Split, differences: Sequence[float], starts: int) -> float:
    """Print how soon both reach sysid's best held-out error; return the median ratio of times."""
    error, heldout = objective(split.tuning), objective(split.heldout)
    nominal = start_vector(error)
    error(Query(nominal[None]))
    rng = np.random.default_rng(0)
    tried = [nominal, *rng.uniform(0.02, 0.98, (starts - 1, len(nominal)))]
    ratios = []
    for number, start in enumerate(tried):
        print(f"start {number}, {'random' if number else 'nominal'}")
        rivals = []
        for difference in differences:
            found = judged(system_identification(split, error, start, difference), heldout)
            rivals.append(min(found, key=lambda point: point[2]))
            _say(f"mujoco.sysid, differences of {difference:g}: best", rivals[-1])
        ours = judged(gauss_newton(split, error, start), heldout)
        _say("Gauss–Newton: ends", ours[-1])
        best = min(rivals, key=lambda point: point[2])
        reached = next((point for point in ours if point[2] <= best[2]), None)
        if reached:
            _say("Gauss–Newton: as good as sysid", reached)
        ratios.append(best[0] / reached[0] if reached else 0.0)
        print(f"  ratio {ratios[-1]:.1f}" + ("" if reached else ": never as good"), flush=True)
    ratio = statistics.median(ratios)
    print(f"sysid takes {ratio:.1f} times as long, the median (asked: ≥ {QUICKER:g})")
    return ratio


def _say(what: str, point: tuple[float, int, float]) -> None:
    seconds, casts, percent = point
    print(f"  {what}: {percent:.2f} % held out after {seconds:.1f} s, {casts} casts", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    default = ROOT / "data/measurements/cable1"
    parser.add_argument("--measurements", type=Path, default=default)
    parser.add_argument("--tune-casts", type=int, default=20)
    parser.add_argument("--test-casts", type=int, default=30)
    parser.add_argument("--population", type=int, default=28)
    parser.add_argument("--generations", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--differences", type=float, nargs="+", default=DIFFERENCES)
    parser.add_argument("--starts", type=int, default=5)
    kinds = ("evolution", "least-squares")
    parser.add_argument("--only", nargs="+", choices=kinds, default=kinds)
    asked = parser.parse_args()
    split = read_split(asked.measurements, asked.tune_casts, asked.test_casts)
    good = True
    if "evolution" in asked.only:
        ratio = compare_evolution(split, asked.population, asked.generations, asked.rounds)
        good = good and ratio >= FASTER
    if "least-squares" in asked.only:
        good = compare_least_squares(split, asked.differences, asked.starts) >= QUICKER and good
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
