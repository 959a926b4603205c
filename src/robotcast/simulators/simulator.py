"""The one call that every simulator answers, and casts × parameter vectors in batches behind it.

A `Run` of cables makes the steps, in MuJoCo and in PyBullet alike. All else is the same for all
models and stands here: the tool's path, the free end's as the camera sees it, when a simulation is
over, which is run again more finely, and the processes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np

from robotcast.casts.action import ToolMotion
from robotcast.effects.effect import ActiveEffects, Effect, Numbers, parameters_of
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.processes import PATIENCE_S, cores, parallel_map
from robotcast.running import Progress, silent
from robotcast.simulators.chain import Run


@dataclass(frozen=True)
class SimulatedCast:
    """How the tool moves in a cast that was never measured, and when to look."""

    tool: ToolMotion
    waypoints_s: np.ndarray  # (k,)
    # (2,), where the free end was seen before the tool moved; None starts along the tool's yaw
    start_m: np.ndarray | None = None
    # what is known of the cast, for effects that depend on it: "vmax", "order" in the session
    factors: Mapping[str, float] = field(default_factory=dict)


Cast = SimulatedCast | Trial


@dataclass(frozen=True)
class Prediction:
    """Waypoints (n_vectors, n_casts, k_max, 2) of every cast under every parameter vector.

    NaN past a cast's own k waypoints and wherever the run `diverged`, (n_vectors, n_casts) of bool.
    """

    waypoints_m: np.ndarray
    diverged: np.ndarray


CHECK_EVERY = 25  # steps between looks for runs that rest or diverge
CROWDED = 0.95  # share under way below which the simulations that ended are taken out
FINER = 2  # by how much the step of a run that diverged is cut
REST_SPEED_M_S = 0.01  # slower than this everywhere, once the tool has stopped, is at rest
DIVERGED_RATE = 1e4  # rad/s or m/s: no cable moves like that


@dataclass(frozen=True)
class Settings:
    """Numerical settings of every simulator, not tuned."""

    segments: int = 18  # of the cable, as in the paper's segmented one
    stretches: int = 0  # of the segments
    step_s: float = 0.004  # runs that diverge with it are run again with half of it
    sliding_speed_m_s: float = 0.01  # ε of the slip v/√(v² + ε²) of regularised Coulomb friction
    batch_size: int = 512  # simulations stepped side by side
    processes: int = 0  # worker processes, 0 for all cores; the result does not depend on it
    patience_s: float = PATIENCE_S  # a process that takes longer over one batch hangs


class Simulator:
    """Predicts the free end's waypoints for casts × parameter vectors in one call, in batches.

    A model of a cable says what is declared here. The `parameters` it is made of are numbers by
    name: what a `Parameter` has, or in place of its bounds and nominal value `weighed` and
    `spread`: the cable's attribute that is the nominal value, searched from nominal / spread to
    nominal · spread; one that is zero is held at next to nothing.
    """

    name: str
    parameters: tuple[Parameter, ...]
    run: ClassVar[Callable[..., Run]]  # what steps a batch, a class
    own: ClassVar[tuple[str, ...]]  # names of its own parameters, in order
    tunes: ClassVar[tuple[str, ...]] = ()  # effects that are parameters of the simulator already
    lacks: ClassVar[tuple[str, ...]] = ()  # hooks through which no effect can act in it
    few: ClassVar[int] = 8  # as many simulations are run here rather than in other processes

    def __init__(
        self, cable: Cable, parameters: Numbers, settings: Any, effects: Sequence[Effect] = ()
    ) -> None:
        if (found := tuple(parameters)) != self.own:
            raise ValueError(f"{self.name} simulator: expected parameters {self.own}, got {found}")
        if twice := [effect.name for effect in effects if effect.name in self.tunes]:
            raise ValueError(f"{self.name} simulator: {', '.join(twice)} is a parameter of its own")
        deaf = [(e.name, hook) for e in effects for hook in self.lacks if e.acts_through(hook)]
        if deaf:
            said = ", ".join(f"{name} acts through {hook}" for name, hook in deaf)
            raise ValueError(f"{self.name} simulator: {said}, which it cannot carry")
        own = [_parameter(name, dict(numbers), cable) for name, numbers in parameters.items()]
        self.parameters = (*own, *parameters_of(effects))
        self.cable, self.settings, self.effects = cable, settings, tuple(effects)

    def simulate(
        self,
        casts: Sequence[Cast],
        vectors: np.ndarray,
        *,
        retry: bool = True,
        progress: Progress = silent,
    ) -> Prediction:
        """Simulate every cast under every parameter vector.

        The `vectors` (n_vectors, n_parameters) hold values of all `parameters`, frozen ones too, in
        their order and units. With `retry`, what diverges is run again, more finely; a search
        that compares many vectors can do without, as a few such runs cost it much.
        """
        vectors = np.atleast_2d(np.asarray(vectors, dtype=float))
        if (n := vectors.shape[1]) != len(self.parameters):
            raise ValueError(f"expected {len(self.parameters)} parameters a vector, got {n}")
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
            work = partial(_run_batch, type(self).run, self.cable, self.settings, step_s)
            batches = (self._batch(sent, vectors, pairs) for pairs in dealt)
            found = parallel_map(work, batches, workers, self.settings.patience_s)
            for (cast, vector), (seen_m, lost) in zip((d.T for d in dealt), found, strict=True):
                diverged[vector, cast] = lost
                waypoints[vector, cast, : seen_m.shape[1]] = seen_m
                done += len(lost)
                progress(done, diverged.size)
            left = left[diverged[left[:, 1], left[:, 0]]]
        return Prediction(waypoints, diverged)

    def _batch(
        self, casts: Sequence[SimulatedCast], vectors: np.ndarray, pairs: np.ndarray
    ) -> "_Batch":
        chosen, which = np.unique(pairs[:, 0], return_inverse=True)
        values, n = vectors[pairs[:, 1]], len(self.own)
        active = ActiveEffects(self.effects, values[:, n:], [casts[k].factors for k in pairs[:, 0]])
        return [casts[k] for k in chosen], which, values[:, :n], active


_Batch = tuple[Sequence[SimulatedCast], np.ndarray, np.ndarray, ActiveEffects]
"""Different casts; of which of them each simulation is, (n_sim,); parameters; and effects."""


WEIGHTLESS_KG = 1e-5  # a body without mass would stand still in PyBullet


def _parameter(name: str, numbers: dict[str, Any], cable: Cable) -> Parameter:
    if "weighed" in numbers:
        nominal, spread = float(getattr(cable, numbers.pop("weighed"))), numbers.pop("spread")
        if nominal == 0:  # as of a cable without a weight at its end: there is nothing to search
            nominal, numbers["frozen"] = WEIGHTLESS_KG, True
        numbers |= {"lower": nominal / spread, "upper": nominal * spread, "nominal": nominal}
    return Parameter(name=name, **numbers)


def _dealt(pairs: np.ndarray, most: int, parts: int) -> list[np.ndarray]:
    """Deal the simulations into batches that take equally long; those that end early leave them."""
    rounds = math.ceil(len(pairs) / (most * parts))
    n = min(rounds * parts, len(pairs))
    return [pairs[first::n] for first in range(n)]


def _run_batch(
    run_of: Callable[..., Run], cable: Cable, settings: Any, step_s: float, batch: _Batch
) -> tuple[np.ndarray, np.ndarray]:
    """Step the simulations of a batch to their ends.

    Returns their waypoints (n_sim, k_max, 2) as seen, NaN past a cast's own and where a run
    diverged; and which of them did, (n_sim,) of bool.
    """
    casts, which, vectors, active = batch
    happened_s = active.through("seen_at", _padded_times(casts)[which])
    last = np.ceil(np.nanmax(happened_s, axis=1) / step_s - 1e-9).astype(int)
    tool_end = np.array([cast.tool.t_s[-1] / step_s for cast in casts])[which]
    tools = tool_paths([cast.tool for cast in casts], np.arange(last.max() + 2) * step_s)
    pose = active.held_pose(tools[0, which], step_s)
    lean_rad = _leans(casts, which, pose, active)
    run = run_of(cable, settings, step_s, pose, lean_rad, vectors, active)
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
    waypoints_m = active.through("seen", _at_times(path, happened_s, step_s))
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
    """Return the angles [rad] from the held ends' yaws to the free ends, (n_sim,); 0 if unseen."""
    seen_m = [np.full(2, np.nan) if c.start_m is None else c.start_m for c in casts]
    start_m = active.through("unseen", np.array(seen_m, float)[which][:, None])[:, 0]
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

    Cubics between the samples whose slopes there are central differences, and that are local,
    unlike a spline; at rest before the first and after the last sample.
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
