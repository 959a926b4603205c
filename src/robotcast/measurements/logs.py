"""The tables of a measurement set as the rules see them: all casts in one array."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotcast.measurements.measurement_set import STILL_M, MeasurementSet

REST_OVER_S = 0.09  # time over which the free end's speed is taken: a camera period
STOPPED_M_S = 0.02  # a tool slower than this stands
_APART_S = 1000.0  # between the casts on one line of time


@dataclass(frozen=True)
class Log:
    """One table of all n casts, N rows that stand cast by cast in time."""

    t_s: np.ndarray  # (N,)
    values: np.ndarray  # (N, d)
    first: np.ndarray  # (n,), the row where each cast begins

    @classmethod
    def of(cls, times_s: Sequence[np.ndarray], values: Sequence[np.ndarray]) -> "Log":
        """Join the times (k,) and values (k, d) of each cast."""
        counts = [len(t_s) for t_s in times_s]
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        return cls(np.concatenate(times_s), np.concatenate(values), first)

    @cached_property
    def last(self) -> np.ndarray:
        """The row where each cast ends, (n,)."""
        return np.append(self.first[1:], len(self.t_s)) - 1

    @cached_property
    def cast(self) -> np.ndarray:
        """The cast of each row, (N,), from 0."""
        return np.repeat(np.arange(len(self.first)), self.last - self.first + 1)

    @cached_property
    def line_s(self) -> np.ndarray:
        """Time that grows from cast to cast, (N,), so that one search goes through all of them."""
        return self.t_s + _APART_S * self.cast

    @cached_property
    def dt_s(self) -> np.ndarray:
        """The time from the row before, (N,), 0 where a cast begins."""
        return self.steps(self.t_s)

    @cached_property
    def moved_m(self) -> np.ndarray:
        """The distance from the row before, (N,), 0 where a cast begins."""
        return np.linalg.norm(self.steps(self.values[:, :2]), axis=1)

    @cached_property
    def turned_rad(self) -> np.ndarray:
        """How far poses turned from the row before, (N,), 0 where a cast begins."""
        return np.abs(self.steps(self.values[:, 2]))

    @cached_property
    def speed_m_s(self) -> np.ndarray:
        """The speed since the row before, (N,), 0 where a cast begins."""
        return self.moved_m / np.where(self.dt_s > 0, self.dt_s, np.inf)

    @cached_property
    def spacing_s(self) -> float:
        """The usual time from one row to the next, NaN where no cast has two."""
        inside = np.delete(self.dt_s, self.first)
        return float(np.median(inside)) if len(inside) else np.nan

    def steps(self, values: np.ndarray) -> np.ndarray:
        """Return what `values` (N, ...) differ by from the row before, 0 where a cast begins."""
        found = np.diff(values, axis=0, prepend=values[:1])
        found[self.first] = 0
        return found

    def most(self, values: np.ndarray) -> np.ndarray:
        """Return the largest of `values` (N,) in each cast, (n,)."""
        return np.maximum.reduceat(values, self.first)

    def least(self, values: np.ndarray) -> np.ndarray:
        """Return the smallest of `values` (N,) in each cast, (n,)."""
        return np.minimum.reduceat(values, self.first)

    def row_of_most(self, values: np.ndarray) -> np.ndarray:
        """Return the first row of the largest of `values` (N,) in each cast, (n,)."""
        rows = np.where(values == self.most(values)[self.cast], np.arange(len(values)), len(values))
        return self.least(rows)

    def at(self, t_s: np.ndarray, cast: np.ndarray) -> np.ndarray:
        """Return the values (m, d) at times (m,) of casts (m,); constant beyond a cast's ends."""
        inside = np.clip(t_s, self.t_s[self.first][cast], self.t_s[self.last][cast])
        wanted = inside + _APART_S * cast
        return np.stack([np.interp(wanted, self.line_s, c) for c in self.values.T], axis=1)


class Logs:
    """A measurement set as the rules see it: `tool` poses (N, 3) and `end` places (M, 2)."""

    def __init__(self, measured: MeasurementSet) -> None:
        trials = measured.trials
        self.measured, self.cable, self.trials = measured, measured.cable, trials
        self.tool = Log.of([t.tool.t_s for t in trials], [t.tool.pose for t in trials])
        self.end = Log.of([t.waypoints_s for t in trials], [t.waypoints_m for t in trials])
        self.actions = np.stack([t.action.as_array() for t in trials])
        self.noise_m = measured.noise_m or 0.0

    @cached_property
    def held_m(self) -> np.ndarray:
        """Where the held end was at every waypoint, (M, 2)."""
        return self.tool.at(self.end.t_s, self.end.cast)[:, :2]

    def away_m(self, turn: np.ndarray | None = None, shift: int = 0) -> np.ndarray:
        """Return how far the free end is from the held point at every waypoint, (M,).

        The free end turned by `turn` (2, 2); the held point that of the cast `shift` later.
        """
        end_m = self.end.values if turn is None else self.end.values @ turn.T
        cast = (self.end.cast + shift) % len(self.trials)
        held_m = self.tool.at(self.end.t_s, cast)[:, :2] if shift else self.held_m
        return np.linalg.norm(end_m - held_m, axis=1)

    @cached_property
    def digit_m(self) -> float:
        """The last digit of the free end's places: their smallest step, infinite without one."""
        differ = np.abs(np.diff(self.end.values, axis=0))
        return float(differ[differ > 0].min(initial=np.inf))

    @cached_property
    def from_start_m(self) -> np.ndarray:
        """How far the tool is from where it starts, (N,)."""
        log = self.tool
        return np.linalg.norm(log.values[:, :2] - log.values[log.first[log.cast], :2], axis=1)

    @cached_property
    def starts_s(self) -> np.ndarray:
        """When the tool begins to move, (n,); infinite where it never does."""
        return self.tool.least(np.where(self.from_start_m > STILL_M, self.tool.t_s, np.inf))

    @cached_property
    def stops_s(self) -> np.ndarray:
        """When the tool moves last, (n,), 0 where it never does."""
        moving = self.tool.speed_m_s > STOPPED_M_S
        return self.tool.most(np.where(moving, self.tool.t_s, 0.0))

    @cached_property
    def end_speed_m_s(self) -> np.ndarray:
        """The free end's speed since `REST_OVER_S` ago or more, (M,), 0 where nobody knows.

        Over the time of a camera period, so that noise of single frames does not make a speed.
        """
        log = self.end
        before = np.searchsorted(log.line_s, log.line_s - REST_OVER_S, side="right") - 1
        known = before >= log.first[log.cast]
        before = np.where(known, before, 0)
        moved_m = np.linalg.norm(log.values - log.values[before], axis=1)
        took_s = np.where(known, log.t_s - log.t_s[before], np.inf)
        return moved_m / took_s

    @cached_property
    def start_m(self) -> np.ndarray:
        """From the held point to the free end at the first waypoint, (n, 2).

        NaN where it was taken after the tool began to move.
        """
        first = self.end.first
        away_m = self.end.values[first] - self.tool.values[self.tool.first, :2]
        return np.where((self.end.t_s[first] <= self.starts_s)[:, None], away_m, np.nan)
