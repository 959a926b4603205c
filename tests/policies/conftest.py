"""A smooth, made-up world: what a forward model has to learn."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl
import pytest

from robotcast.casts.action import ACTION_COLUMNS, Action, ToolMotion
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial
from robotcast.policies.datasets import Dataset, Examples, real_dataset, simulated_dataset


class World:
    """Endpoints as a smooth function of actions, on the right half of the board."""

    def actions(self, count: int, seed: int | np.random.Generator = 0) -> np.ndarray:
        """Draw actions (count, 6)."""
        rng = np.random.default_rng(seed)
        r2 = rng.uniform(0.55, 0.75, count)
        columns = (
            rng.uniform(0.3, 1.0, count),
            0.5 * (0.6 + r2),
            rng.uniform(-0.9, -0.1, count),
            r2,
            rng.uniform(0.0, 1.5, count),
            rng.choice([1.5, 2.5], count),
        )
        return np.stack(columns, axis=1)

    def endpoints(self, actions: np.ndarray) -> np.ndarray:
        """Return endpoints (n, 2)."""
        theta1, _, theta2, r2, alpha, vmax = actions.T
        angle = theta2 - 0.25 * theta1 * vmax / 2 - 0.12 * alpha
        reach = r2 + 0.55 * np.cos(0.8 * alpha + 0.5 * theta1)
        return np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=1)

    def predict(self, actions: np.ndarray) -> np.ndarray:
        """Answer as a forward model that is never wrong."""
        return self.endpoints(actions)

    def spread(self, actions: np.ndarray) -> np.ndarray:
        """Be surer of quick casts."""
        return np.stack([0.02 / actions[:, 5], 0.01 / actions[:, 5]], axis=1)

    def slopes(self, actions: np.ndarray) -> np.ndarray:
        """Differentiate the endpoints by differences, (n, 2, 6)."""
        steps = 1e-6 * np.eye(6)
        ends = [self.endpoints(actions + s) - self.endpoints(actions - s) for s in steps]
        return np.stack(ends, axis=2) / 2e-6

    def write_simulated(self, path: Path, count: int = 600) -> None:
        """Write a D_sim of `count` casts."""
        actions = self.actions(count)
        x, y = self.endpoints(actions).T
        columns = dict(zip(ACTION_COLUMNS, actions.T, strict=True))
        pl.DataFrame({**columns, "x": x, "y": y}).write_parquet(path)

    def simulated(self, count: int = 600, held_out: float = 0.1) -> Dataset:
        """Make D_sim of `count` casts."""
        with TemporaryDirectory() as folder:
            self.write_simulated(path := Path(folder) / "casts.parquet", count)
            return simulated_dataset(path, validation_fraction=held_out, seed=0)

    def real(self, n_actions: int = 30, n_repeats: int = 6, held_out: float = 0.2) -> Dataset:
        """Make D_real of what is measured."""
        measured = self.measured(n_actions, n_repeats)
        return real_dataset(measured, [], validation_fraction=held_out, seed=0)

    def measured(self, n_actions: int = 30, n_repeats: int = 6) -> MeasurementSet:
        """Measure `n_actions` actions, the first `n_repeats` of them twice."""
        actions = self.actions(n_actions, seed=1)
        ids = np.concatenate([np.arange(n_actions), np.arange(n_repeats)])
        tool = ToolMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
        ends = self.endpoints(actions[ids])
        trials = tuple(
            Trial(n, int(i), Action.from_array(actions[i]), tool, np.array([1.0]), end[None])
            for n, (i, end) in enumerate(zip(ids, ends, strict=True))
        )
        return MeasurementSet(Cable("made up", 0.6, 0.03, 0.01, 0.02), 0.6, 0.1, None, trials)


def moved(dataset: Dataset, away_m: Callable[[np.ndarray], np.ndarray]) -> Dataset:
    """Let every cast of actions (n, 6) end elsewhere, by `away_m` of them."""

    def part(casts: Examples) -> Examples:
        return replace(casts, endpoints_m=casts.endpoints_m + away_m(casts.actions))

    held_out = part(dataset.validation)
    changed = {"training": part(dataset.training), "validation": held_out, "calibration": held_out}
    return replace(dataset, **changed)


@pytest.fixture(scope="session")
def world() -> World:
    return World()


@pytest.fixture(scope="session")
def simulated(world: World) -> Dataset:
    return world.simulated()
