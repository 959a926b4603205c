"""Runs casts × parameter vectors in batches, whatever the planar model that steps them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from robotcast.effects.active import ActiveEffects
from robotcast.effects.effect import Effect
from robotcast.processes.elsewhere import answers, cores, shared
from robotcast.progress import Progress, silent
from robotcast.simulators.cable_state import CableState
from robotcast.simulators.simulator import Cast, Prediction, SimulatedCast
from robotcast.simulators.tool_path import ToolPaths

CHECK_EVERY = 25  # steps between looks for runs that rest or diverge
CROWDED = 0.95  # share under way below which the simulations that ended are taken out
FEW = 8  # simulations that are run here rather than sent to other processes
REST_SPEED_M_S = 0.01  # slower than this everywhere, once the tool has stopped, is at rest
DIVERGED_RATE = 1e4  # rad/s or m/s: no cable moves like that


StateT = TypeVar("StateT", bound=CableState)


class PlanarRun(Protocol[StateT]):
    """One batch of simulations under way."""

    def state(self) -> StateT:
        """Return the mass points of the simulations."""
        ...

    def fastest_rate(self) -> np.ndarray:
        """Return the largest generalised speed of each simulation, (n_sim,)."""
        ...

    def step(self, state: StateT, next_pose: np.ndarray) -> None:
        """Advance one step; the tool reaches `next_pose` (n_sim, 3) at its end."""
        ...

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on with the simulations numbered `kept` only, in this order."""
        ...


class Start(Protocol):
    """Makes a run: every cable straight and at rest."""

    def __call__(
        self, pose: np.ndarray, lean_rad: np.ndarray, vectors: np.ndarray, active: ActiveEffects
    ) -> PlanarRun[Any]:
        """Start from the tool's poses (n_sim, 3), with parameters (n_sim, n_parameters).

        `lean_rad` (n_sim,) is the angle from the tool's yaw to the cable. The run applies what
        of the active effects acts on the cable.
        """
        ...


@dataclass(frozen=True)
class _Pairs:
    """Casts and the vector that each is run under."""

    vector: np.ndarray  # (n_sim,) numbers of parameter vectors
    cast: np.ndarray  # (n_sim,) numbers of casts

    def dealt(self, most: int, parts: int) -> list["_Pairs"]:
        """Deal the casts into batches that take equally long; those that end early leave them."""
        rounds = math.ceil(len(self.cast) / (most * parts))
        n = min(rounds * parts, len(self.cast))
        return [_Pairs(self.vector[first::n], self.cast[first::n]) for first in range(n)]

    def where(self, marked: np.ndarray) -> "_Pairs":
        """Return those that are marked, bool (n_vectors, n_casts)."""
        chosen = marked[self.vector, self.cast]
        return _Pairs(self.vector[chosen], self.cast[chosen])


@dataclass(frozen=True)
class _Batch:
    """Simulations that are stepped side by side, with all that a process needs for them.

    Attributes
    ----------
    casts : different ones; `which` (n_sim,) says which of them each simulation is of.
    vectors : ndarray of shape (n_sim, n), the parameters of the simulator; `values` : of the
        effects.
    """

    start: "Start"
    step_s: float
    casts: Sequence[SimulatedCast]
    which: np.ndarray
    vectors: np.ndarray
    effects: Sequence[Effect]
    values: np.ndarray


def simulate_planar(
    starts: Sequence[tuple[float, Start]],
    casts: Sequence[Cast],
    vectors: np.ndarray,
    *,
    n_parameters: int,
    effects: Sequence[Effect] = (),
    batch_size: int,
    threads: int,
    progress: Progress = silent,
) -> Prediction:
    """Answer a simulate call (see `Simulator.simulate`) in batches, one a thread at a time.

    Vectors hold `n_parameters` of the simulator itself, then those of the effects.

    Each batch is stepped in a process of its own (see `elsewhere`); calls made side by side
    share the processes.

    Parameters
    ----------
    starts : integration steps [s] and what starts a run with each. All runs take the first
        step; those that diverge are run again with the next.
    batch_size : the most simulations a batch holds.
    threads : batches at a time; 0 for one a core, 1 for the one here.
    """
    vectors = np.atleast_2d(np.asarray(vectors, dtype=float))
    expected = n_parameters + sum(len(effect.parameters) for effect in effects)
    if vectors.shape[1] != expected:
        raise ValueError(f"expected {expected} parameters a vector, got {vectors.shape[1]}")
    k_max = max((len(c.waypoints_s) for c in casts), default=0)
    waypoints = np.full((len(vectors), len(casts), k_max, 2), np.nan)
    diverged = np.zeros((len(vectors), len(casts)), dtype=bool)
    order = np.argsort([-c.waypoints_s[-1] for c in casts], kind="stable")
    left = _Pairs(np.tile(np.arange(len(vectors)), len(casts)), np.repeat(order, len(vectors)))
    sent = [SimulatedCast(c.tool, c.waypoints_s, c.start_m, c.factors) for c in casts]
    for step_s, start in starts:
        done = diverged.size - len(left.cast)

        def batch(pairs: _Pairs, start: Start = start, step_s: float = step_s) -> _Batch:
            chosen, which = np.unique(pairs.cast, return_inverse=True)
            values = vectors[pairs.vector]
            own, of_effects = values[:, :n_parameters], values[:, n_parameters:]
            used = [sent[cast] for cast in chosen]
            return _Batch(start, step_s, used, which, own, effects, of_effects)

        at_once = 1 if len(left.cast) <= FEW else cores(threads)
        with shared(at_once) as parts:
            dealt = left.dealt(batch_size, parts)
            found = answers(_run_batch, [batch(pairs) for pairs in dealt], at_once)
            for pairs, (seen_m, lost) in zip(dealt, found, strict=True):
                diverged[pairs.vector, pairs.cast] = lost
                waypoints[pairs.vector, pairs.cast, : seen_m.shape[1]] = seen_m
                done += len(lost)
                progress(done, diverged.size)
        left = left.where(diverged)
    return Prediction(waypoints, diverged)


def _run_batch(batch: _Batch) -> tuple[np.ndarray, np.ndarray]:
    """Step the simulations of a batch to their ends.

    Returns
    -------
    waypoints_m : ndarray of shape (n_sim, k_max, 2), as seen; NaN past a cast's own waypoints
        and where a run diverged.
    diverged : bool ndarray of shape (n_sim,).
    """
    casts, which, step_s = batch.casts, batch.which, batch.step_s
    factors = [casts[k].factors for k in which]
    active = ActiveEffects(batch.effects, batch.values, factors)
    stamped_s = _padded_times(casts)[which]
    happened_s = active.seen_at(stamped_s)
    last = np.ceil(np.nanmax(happened_s, axis=1) / step_s - 1e-9).astype(int)
    tool_end = np.array([cast.tool.t_s[-1] / step_s for cast in casts])[which]
    times_s = np.arange(last.max() + 2) * step_s
    tools = ToolPaths([cast.tool for cast in casts], times_s)
    pose = active.held_pose(tools.at(0, which), step_s)
    lean_rad = _leans(np.array([_start(cast) for cast in casts])[which], pose, active)
    run = batch.start(pose, lean_rad, batch.vectors, active)
    path = np.empty((last.max() + 1, 2, len(which)), np.float32)
    ended = np.full(len(which), -1)  # the step at which each simulation ended, −1 under way
    diverged = np.zeros(len(which), dtype=bool)
    running = np.arange(len(which))  # the simulations that are still stepped
    kept = active
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(len(path)):
            state = run.state()
            path[step][:, running] = state.end_m
            if step % CHECK_EVERY == 0 or step == len(path) - 1:
                lost = ~(run.fastest_rate() < DIVERGED_RATE)
                speed = np.abs(state.velocity_m_s).max(axis=(0, 2))
                resting = (step >= tool_end[running]) & (speed < REST_SPEED_M_S)
                over = (lost | resting | (step >= last[running])) & (ended[running] < 0)
                diverged[running[over & lost]] = True
                ended[running[over]] = np.minimum(step, last[running[over]])
                under_way = np.flatnonzero(ended[running] < 0)
                if not under_way.size:
                    break
                if under_way.size < CROWDED * len(running):
                    kept = kept.keep(under_way)
                    run.keep(under_way, kept)
                    running = running[under_way]
                    state = run.state()
            run.step(state, kept.held_pose(tools.at(step + 1, which[running]), step_s))
    for i, final in enumerate(ended):
        path[final + 1 :, :, i] = path[final, :, i]
    waypoints_m = active.seen(_at_times(path, happened_s, step_s))
    waypoints_m[diverged] = np.nan
    return waypoints_m, diverged


def _padded_times(casts: Sequence[Cast]) -> np.ndarray:
    """Return the waypoints' times (n_casts, k_max); NaN past a cast's own."""
    times_s = np.full((len(casts), max(len(c.waypoints_s) for c in casts)), np.nan)
    for row, cast in zip(times_s, casts, strict=True):
        row[: len(cast.waypoints_s)] = cast.waypoints_s
    return times_s


def _start(cast: Cast) -> np.ndarray:
    """Return where the free end was seen before the tool moved (2,), NaN when it was not."""
    return np.full(2, np.nan) if cast.start_m is None else np.asarray(cast.start_m, float)


def _leans(seen_m: np.ndarray, pose: np.ndarray, active: ActiveEffects) -> np.ndarray:
    """Return the angles [rad] from the held ends' yaws to where the free ends lie, (n_sim,)."""
    start_m = active.unseen(seen_m[:, None])[:, 0]
    x, y, yaw = pose.T
    lean = np.arctan2(start_m[:, 1] - y, start_m[:, 0] - x) - yaw
    return np.nan_to_num(np.arctan2(np.sin(lean), np.cos(lean)), nan=0.0)


def _at_times(path: np.ndarray, times_s: np.ndarray, step_s: float) -> np.ndarray:
    """Interpolate the ends' paths (n_steps + 1, 2, n_sim) at `times_s` (n_sim, k)."""
    steps = np.clip(np.nan_to_num(times_s) / step_s, 0, len(path) - 1)
    before = np.minimum(steps.astype(int), max(len(path) - 2, 0))
    share = (steps - before)[..., None]
    row = np.arange(path.shape[2])[:, None]
    earlier, later = path[before, :, row], path[np.minimum(before + 1, len(path) - 1), :, row]
    found = earlier + share * (later - earlier)
    found[np.isnan(times_s)] = np.nan
    return found
