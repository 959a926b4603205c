"""Casts × parameter vectors in batches, in MuJoCo and in PyBullet alike.

A model of the cable says how a batch of simulations starts and how it makes one step. Everything
else is the same for all models and stands here: the tool's path, the free end's path as the camera
sees it, when a simulation is over, which is run again more finely, and the processes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, Protocol, TypeVar

import numpy as np

from robotcast.casts.tool_motion import ToolMotion
from robotcast.effects.effect import ActiveEffects, Effect, parameters_of
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.processes import PATIENCE_S, cores, parallel_map
from robotcast.progress import Progress, silent
from robotcast.simulators.chain import CableState
from robotcast.simulators.simulator import Cast, Prediction, SimulatedCast

CHECK_EVERY = 25  # steps between looks for runs that rest or diverge
CROWDED = 0.95  # share under way below which the simulations that ended are taken out
FINER = 2  # by how much the step of a run that diverged is cut
REST_SPEED_M_S = 0.01  # slower than this everywhere, once the tool has stopped, is at rest
DIVERGED_RATE = 1e4  # rad/s or m/s: no cable moves like that


class Run(Protocol):
    """One batch of simulations under way."""

    def state(self) -> CableState:
        """Return the mass points of the simulations."""
        ...

    def fastest_rate(self) -> np.ndarray:
        """Return the largest generalised speed of each simulation, (n_sim,)."""
        ...

    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        """Advance one step; the tool reaches `next_pose` (n_sim, 3) at its end."""
        ...

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on with the simulations numbered `kept` only, in this order."""
        ...


Start = Callable[[np.ndarray, np.ndarray, np.ndarray, ActiveEffects], Run]
"""Makes a run in which every cable is straight and at rest, from the tool's poses (n_sim, 3), the
angles from the tools' yaws to the cables (n_sim,) [rad], parameters (n_sim, n_parameters) and the
effects, of which it applies what acts on the cable."""


@dataclass(frozen=True)
class Settings:
    """Numerical settings of every simulator, not tuned."""

    segments: int = 18  # of the cable, as in the paper's segmented one
    step_s: float = 0.004  # runs that diverge with it are run again with half of it
    sliding_speed_m_s: float = 0.01  # ε of the slip v/√(v² + ε²) of regularised Coulomb friction
    batch_size: int = 512  # simulations stepped side by side
    processes: int = 0  # worker processes, 0 for all cores; the result does not depend on it
    patience_s: float = PATIENCE_S  # a process that takes longer over one batch hangs


SettingsT = TypeVar("SettingsT", bound=Settings)


class BatchSimulator(Generic[SettingsT]):
    """A simulator that runs in batches; a model names its parameters and how its runs start.

    Attributes
    ----------
    name : of the simulator.
    own : the names of its own parameters, in order.
    tunes : the effects that are parameters of the simulator already.
    lacks : the hooks through which no effect can act in it.
    few : as many simulations are run here rather than in other processes.
    """

    name: str
    own: ClassVar[tuple[str, ...]]
    tunes: ClassVar[tuple[str, ...]] = ()
    lacks: ClassVar[tuple[str, ...]] = ()
    few: ClassVar[int] = 8

    def __init__(
        self,
        cable: Cable,
        parameters: Sequence[Parameter],
        settings: SettingsT,
        effects: Sequence[Effect] = (),
    ) -> None:
        names = tuple(p.name for p in parameters)
        if names != self.own:
            raise ValueError(f"{self.name} simulator: expected parameters {self.own}, got {names}")
        twice = [effect.name for effect in effects if effect.name in self.tunes]
        if twice:
            raise ValueError(f"{self.name} simulator: {', '.join(twice)} is a parameter of its own")
        deaf = [(e.name, hook) for e in effects for hook in self.lacks if e.acts_through(hook)]
        if deaf:
            said = ", ".join(f"{name} acts through {hook}" for name, hook in deaf)
            raise ValueError(f"{self.name} simulator: {said}, which it cannot carry")
        self.parameters = (*parameters, *parameters_of(effects))
        self.cable, self.settings, self.effects = cable, settings, tuple(effects)

    def start(self, step_s: float) -> Start:
        """Return what starts a batch that is stepped by `step_s`."""
        raise NotImplementedError

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector (see `Simulator`)."""
        vectors = np.atleast_2d(np.asarray(vectors, dtype=float))
        if vectors.shape[1] != len(self.parameters):
            raise ValueError(
                f"expected {len(self.parameters)} parameters a vector, got {vectors.shape[1]}"
            )
        k_max = max((len(c.waypoints_s) for c in casts), default=0)
        shape = len(vectors), len(casts)
        waypoints, diverged = np.full((*shape, k_max, 2), np.nan), np.zeros(shape, dtype=bool)
        sent = [SimulatedCast(c.tool, c.waypoints_s, c.start_m, c.factors) for c in casts]
        longest_first = np.argsort([-c.waypoints_s[-1] for c in casts], kind="stable")
        left = np.stack(np.meshgrid(longest_first, range(len(vectors)), indexing="ij"), axis=2)
        left = left.reshape(-1, 2)  # the casts, and the vectors under which they are simulated
        for step_s in (self.settings.step_s, self.settings.step_s / FINER)[: 1 + retry]:
            done = diverged.size - len(left)
            workers = 1 if len(left) <= self.few else cores(self.settings.processes)
            dealt = _dealt(left, self.settings.batch_size, workers)
            batches = (self._batch(step_s, sent, vectors, pairs) for pairs in dealt)
            found = parallel_map(_run_batch, batches, workers, self.settings.patience_s)
            for (cast, vector), (seen_m, lost) in zip((d.T for d in dealt), found, strict=True):
                diverged[vector, cast] = lost
                waypoints[vector, cast, : seen_m.shape[1]] = seen_m
                done += len(lost)
                progress(done, diverged.size)
            left = left[diverged[left[:, 1], left[:, 0]]]
        return Prediction(waypoints, diverged)

    def _batch(
        self, step_s: float, casts: Sequence[SimulatedCast], vectors: np.ndarray, pairs: np.ndarray
    ) -> "_Batch":
        chosen, which = np.unique(pairs[:, 0], return_inverse=True)
        values, n = vectors[pairs[:, 1]], len(self.own)
        active = ActiveEffects(self.effects, values[:, n:], [casts[k].factors for k in pairs[:, 0]])
        used = [casts[k] for k in chosen]
        return _Batch(self.start(step_s), step_s, used, which, values[:, :n], active)


def _dealt(pairs: np.ndarray, most: int, parts: int) -> list[np.ndarray]:
    """Deal the simulations into batches that take equally long; those that end early leave them."""
    rounds = math.ceil(len(pairs) / (most * parts))
    n = min(rounds * parts, len(pairs))
    return [pairs[first::n] for first in range(n)]


@dataclass(frozen=True)
class _Batch:
    """Simulations that are stepped side by side, with all that a process needs for them."""

    start: Start
    step_s: float
    casts: Sequence[SimulatedCast]  # different ones
    which: np.ndarray  # (n_sim,), of which of them each simulation is
    vectors: np.ndarray  # (n_sim, n), the parameters of the simulator
    active: ActiveEffects


def _run_batch(batch: _Batch) -> tuple[np.ndarray, np.ndarray]:
    """Step the simulations of a batch to their ends.

    Returns
    -------
    waypoints_m : ndarray of shape (n_sim, k_max, 2), as seen; NaN past a cast's own waypoints
        and where a run diverged.
    diverged : bool ndarray of shape (n_sim,).
    """
    casts, which, step_s, active = batch.casts, batch.which, batch.step_s, batch.active
    happened_s = active.seen_at(_padded_times(casts)[which])
    last = np.ceil(np.nanmax(happened_s, axis=1) / step_s - 1e-9).astype(int)
    tool_end = np.array([cast.tool.t_s[-1] / step_s for cast in casts])[which]
    tools = tool_paths([cast.tool for cast in casts], np.arange(last.max() + 2) * step_s)
    pose = active.held_pose(tools[0, which], step_s)
    run = batch.start(pose, _leans(casts, which, pose, active), batch.vectors, active)
    path = np.empty((last.max() + 1, 2, len(which)), np.float32)
    ended = np.full(len(which), -1)  # the step at which each simulation ended, −1 under way
    diverged = np.zeros(len(which), dtype=bool)
    running = np.arange(len(which))  # the simulations that are still stepped
    kept = active
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(len(path)):
            state = run.state()
            path[step][:, running] = state.position_m[:, :, -1]
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
            run.step(state, kept.held_pose(tools[step + 1, which[running]], step_s))
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


def _leans(
    casts: Sequence[Cast], which: np.ndarray, pose: np.ndarray, active: ActiveEffects
) -> np.ndarray:
    """Return the angles [rad] from the held ends' yaws to where the free ends lie, (n_sim,).

    0 where the free end was not seen before the tool moved.
    """
    seen_m = [np.full(2, np.nan) if c.start_m is None else c.start_m for c in casts]
    start_m = active.unseen(np.array(seen_m, float)[which][:, None])[:, 0]
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


def tool_paths(tools: Sequence[ToolMotion], times_s: np.ndarray) -> np.ndarray:
    """Return the poses of many tools at the same times (n,), (n, n_tools, 3).

    Cubics between the samples whose slopes there are central differences; at rest before the
    first and after the last sample. They are local, unlike a spline: what a cast gets does not
    depend on the casts it is batched with.
    """
    paths = np.empty((len(times_s), len(tools), 3))
    for path, tool in zip(paths.swapaxes(0, 1), tools, strict=True):
        first_s, last_s = tool.t_s[0], tool.t_s[-1]
        t_s = np.concatenate([[first_s - 1.0], tool.t_s, [last_s + 1.0]])
        pose = np.concatenate([tool.pose[:1], tool.pose, tool.pose[-1:]])
        slope, span_s = np.zeros_like(pose), np.diff(t_s)[:, None]
        slope[1:-1] = (pose[2:] - pose[:-2]) / (t_s[2:] - t_s[:-2])[:, None]
        rise, start, end = np.diff(pose, axis=0) / span_s, slope[:-1], slope[1:]
        square = (3 * rise - 2 * start - end) / span_s
        cube = (start + end - 2 * rise) / span_s**2
        moving = int(np.searchsorted(times_s, last_s))  # as many times
        times = np.maximum(times_s[:moving], first_s)
        k = np.searchsorted(t_s, times, "right") - 1
        since = (times - t_s[k])[:, None]
        path[:moving] = ((cube[k] * since + square[k]) * since + start[k]) * since + pose[k]
        path[moving:] = tool.pose[-1]
    return paths
