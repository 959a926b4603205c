"""Runs casts × parameter vectors in batches, whatever the planar model that steps them."""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robotcast.progress import Progress, silent
from robotcast.simulators.chain import ChainState
from robotcast.simulators.simulator import Cast, Prediction
from robotcast.simulators.tool_path import ToolPaths

CHECK_EVERY = 25  # steps between looks for runs that rest or diverge
CROWDED = 0.95  # share under way below which the simulations that ended are taken out
REST_SPEED_M_S = 0.01  # slower than this everywhere, once the tool has stopped, is at rest
DIVERGED_RATE = 1e4  # rad/s or m/s: no cable moves like that


class PlanarRun(Protocol):
    """One batch of simulations under way."""

    def state(self) -> ChainState:
        """Return the mass points of the simulations."""
        ...

    def fastest_rate(self) -> np.ndarray:
        """Return the largest generalised speed of each simulation, (n_sim,)."""
        ...

    def step(self, state: ChainState, next_pose: np.ndarray) -> None:
        """Advance one step; the tool reaches `next_pose` (n_sim, 3) at its end."""
        ...

    def keep(self, kept: np.ndarray) -> None:
        """Go on with the simulations numbered `kept` only, in this order."""
        ...


class Start(Protocol):
    """Makes a run: every cable straight and at rest."""

    def __call__(self, pose: np.ndarray, lean_rad: np.ndarray, vectors: np.ndarray) -> PlanarRun:
        """Start from the tool's poses (n_sim, 3), with parameters (n_sim, n_parameters).

        `lean_rad` (n_sim,) is the angle from the tool's yaw to the cable.
        """
        ...


@dataclass(frozen=True)
class _Batch:
    """Casts of like duration and the vector that each is run under."""

    vector: np.ndarray  # (n_sim,) numbers of parameter vectors
    cast: np.ndarray  # (n_sim,) numbers of casts


def simulate_planar(
    start: Start,
    casts: Sequence[Cast],
    vectors: np.ndarray,
    *,
    n_parameters: int,
    step_s: float,
    batch_size: int,
    threads: int,
    progress: Progress = silent,
) -> Prediction:
    """Answer a simulate call (see `Simulator.simulate`) in batches, one a thread at a time.

    Each batch is stepped by one thread, so that what Python does between steps runs side by
    side too. `batch_size` is the most simulations a batch holds; `threads` 0 means all cores.
    """
    vectors = np.atleast_2d(np.asarray(vectors, dtype=float))
    if vectors.shape[1] != n_parameters:
        raise ValueError(f"expected {n_parameters} parameters a vector, got {vectors.shape[1]}")
    k_max = max((len(c.waypoints_s) for c in casts), default=0)
    waypoints = np.full((len(vectors), len(casts), k_max, 2), np.nan)
    diverged = np.zeros((len(vectors), len(casts)), dtype=bool)
    threads = threads or len(os.sched_getaffinity(0))
    batches = _batches(casts, len(vectors), batch_size, threads)
    done = 0
    with ThreadPoolExecutor(threads) as pool:
        runs = pool.map(lambda batch: _run_batch(start, casts, vectors, batch, step_s), batches)
        for batch, (path, lost) in zip(batches, runs, strict=True):
            diverged[batch.vector, batch.cast] = lost
            for i in np.flatnonzero(~lost):
                times = casts[batch.cast[i]].waypoints_s
                waypoints[batch.vector[i], batch.cast[i], : len(times)] = _at_times(
                    path[:, :, i], times, step_s
                )
            done += len(lost)
            progress(done, diverged.size)
    return Prediction(waypoints, diverged)


def _batches(casts: Sequence[Cast], n_vectors: int, batch_size: int, threads: int) -> list[_Batch]:
    """Return batches, longest casts first, so that the casts of one batch end together."""
    order = np.argsort([-c.waypoints_s[-1] for c in casts], kind="stable")
    cast = np.repeat(order, n_vectors)
    vector = np.tile(np.arange(n_vectors), len(casts))
    rounds = math.ceil(len(cast) / (batch_size * threads))
    size = math.ceil(len(cast) / max(rounds * threads, 1)) or 1
    return [
        _Batch(vector[first : first + size], cast[first : first + size])
        for first in range(0, len(cast), size)
    ]


def _run_batch(
    start: Start,
    casts: Sequence[Cast],
    vectors: np.ndarray,
    batch: _Batch,
    step_s: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Step one batch to its end.

    Returns
    -------
    path : ndarray of shape (n_steps + 1, 2, n_sim), the free end [m] at every step; constant
        once at rest.
    diverged : bool ndarray of shape (n_sim,).
    """
    chosen, which = np.unique(batch.cast, return_inverse=True)
    last = np.array([int(np.ceil(casts[c].waypoints_s[-1] / step_s - 1e-9)) for c in chosen])[which]
    tool_end = np.array([casts[c].tool.t_s[-1] / step_s for c in chosen])[which]
    times_s = np.arange(last.max() + 2) * step_s
    tools = ToolPaths([casts[c].tool for c in chosen], times_s)
    lean_rad = np.array([_lean(casts[c]) for c in chosen])[which]
    run = start(tools.at(0, which), lean_rad, vectors[batch.vector])
    path = np.empty((last.max() + 1, 2, len(which)), np.float32)
    ended = np.full(len(which), -1)  # the step at which each simulation ended, −1 under way
    diverged = np.zeros(len(which), dtype=bool)
    running = np.arange(len(which))  # the simulations that are still stepped
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(len(path)):
            state = run.state()
            path[step][:, running] = state.end_m
            if step % CHECK_EVERY == 0 or step == len(path) - 1:
                lost = ~(run.fastest_rate() < DIVERGED_RATE)
                speed = np.abs(state.velocity_m_s).max(axis=(0, 1))
                resting = (step >= tool_end[running]) & (speed < REST_SPEED_M_S)
                over = (lost | resting | (step >= last[running])) & (ended[running] < 0)
                diverged[running[over & lost]] = True
                ended[running[over]] = np.minimum(step, last[running[over]])
                under_way = np.flatnonzero(ended[running] < 0)
                if not under_way.size:
                    break
                if under_way.size < CROWDED * len(running):
                    run.keep(under_way)
                    running = running[under_way]
                    state = run.state()
            run.step(state, tools.at(step + 1, which[running]))
    for i, final in enumerate(ended):
        path[final + 1 :, :, i] = path[final, :, i]
    return path, diverged


def _lean(cast: Cast) -> float:
    """Return the angle [rad] from the tool's first yaw to where the free end lies."""
    if cast.start_m is None:
        return 0.0
    x, y, yaw = cast.tool.pose[0]
    lean = np.arctan2(cast.start_m[1] - y, cast.start_m[0] - x) - yaw
    return float(np.arctan2(np.sin(lean), np.cos(lean)))


def _at_times(path: np.ndarray, times_s: np.ndarray, step_s: float) -> np.ndarray:
    """Interpolate the end's path (n_steps + 1, 2) at `times_s`."""
    steps_s = np.arange(len(path)) * step_s
    return np.stack([np.interp(times_s, steps_s, axis) for axis in path.T], axis=-1)
