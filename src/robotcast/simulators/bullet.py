"""The PyBullet simulator (see `bullet_bodies`)."""

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from robotcast.effects.effect import ActiveEffects
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.batch import BatchSimulator, Settings, Start
from robotcast.simulators.bullet_bodies import BulletChain, fastest_frequency, spring_torques
from robotcast.simulators.chain import GRAVITY_M_S2, CableState, ChainEffects, ChainGeometry

STEP_RATE = 1.5  # step × fastest frequency of the springs; from 2 on an explicit step diverges


@dataclass(frozen=True)
class BulletSettings(Settings):
    """Numerical settings, not tuned; the step is cut for a cable whose springs need it."""

    step_s: float = 0.003
    batch_size: int = field(default=1, init=False)  # a physics client holds one cable
    patience_s: float = 600.0
    iterations: int = 50  # of Bullet's constraint solver in every step


class BulletSimulator(BatchSimulator[BulletSettings]):
    """Capsules on a plane in PyBullet, in processes with a physics client each."""

    name = "bullet"
    own = (
        "twist_stiffness_n_m2",
        "bending_stiffness_n_m2",
        "cable_mass_kg",
        "lateral_friction",
        "spinning_friction_m",
        "rolling_friction_m",
        "endpoint_mass_kg",
        "linear_damping_per_s",
        "angular_damping_per_s",
        "dynamic_friction",
    )
    tunes = ("bending_damping",)  # as the capsules' angular damping
    lacks = ("damping_time", "extra_length")
    few = 0  # one takes as long as a batch of the others

    def start(self, step_s: float) -> Start:
        return partial(BulletRun, self.cable, self.settings, step_s)


class BulletRun:
    """A run (`batch.Run`) of one simulation, in this process's physics client.

    Parameters
    ----------
    step_s : of the batch; it is cut as finely as the springs need.
    pose, lean_rad, vectors, active : see `batch.Start`, of one simulation.
    """

    def __init__(
        self,
        cable: Cable,
        settings: BulletSettings,
        step_s: float,
        pose: np.ndarray,
        lean_rad: np.ndarray,
        vectors: np.ndarray,
        active: ActiveEffects,
    ) -> None:
        geometry = ChainGeometry.of_cable(cable.length_m, settings.segments)
        values = dict(zip(BulletSimulator.own, vectors[0], strict=True))
        self._geometry, self._settings, self._step_s = geometry, settings, step_s
        self._time_s, self._height_m = 0.0, cable.radius_m
        self._effects = ChainEffects(active, cable, geometry)
        capsules_kg = values["cable_mass_kg"] * geometry.lengths_m / cable.length_m
        capsules_kg = self._effects.distributed(capsules_kg[None])[0].astype(float)
        self._bending = values["bending_stiffness_n_m2"] / geometry.bends_m
        self._twisting = values["twist_stiffness_n_m2"] / geometry.bends_m
        fastest = fastest_frequency(
            geometry.lengths_m,
            capsules_kg,
            values["endpoint_mass_kg"],
            cable.radius_m,
            self._bending,
            self._twisting,
        )
        self._parts = max(1, int(np.ceil(step_s * fastest / STEP_RATE)))
        self._part_s = step_s / self._parts
        self._chain = BulletChain(
            geometry,
            cable.radius_m,
            pose[0],
            float(pose[0, 2] + lean_rad[0]),
            capsules_kg,
            values,
            step_s=self._part_s,
            iterations=settings.iterations,
        )
        n = settings.segments
        points_kg = np.append(capsules_kg, values["endpoint_mass_kg"]).astype(np.float32)
        self._points_kg = points_kg[None]
        friction = np.append(np.full(n, values["lateral_friction"]), 1.0)
        friction = values["dynamic_friction"] * friction
        self._friction_n = (friction * GRAVITY_M_S2).astype(np.float32) * self._points_kg
        self._torques, self._bends = np.empty((n + 1, 3)), np.empty(n)
        self._look()

    def state(self) -> CableState:
        x, y, z, w = self._quaternions[1:-1].T
        heading = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w)])
        heading /= np.maximum(np.hypot(*heading), 1e-9)
        velocity = _points(self._velocity)
        rate = np.sqrt((velocity**2).sum(axis=0) + np.float32(self._settings.sliding_speed_m_s**2))
        return CableState(
            heading[:, None].astype(np.float32),
            _points(self._position),
            velocity,
            velocity / rate,
            np.zeros_like(velocity),
        )

    def fastest_rate(self) -> np.ndarray:
        return np.array([max(np.abs(self._velocity).max(), np.abs(self._turning).max())])

    def keep(self, kept: np.ndarray, active: ActiveEffects) -> None:
        """Go on as before: a run of one simulation that goes on goes on whole."""

    def step(self, state: CableState, next_pose: np.ndarray) -> None:
        moments = None
        if self._effects.acting:
            moments = self._effects.act(
                state,
                self._time_s,
                self._step_s,
                (self._bending * self._geometry.bends_m)[None],
                mass_kg=self._points_kg,
                friction_n=self._friction_n,
                bend_rad=self._bends[None],
                bend_rate_rad_s=np.diff(self._turning[:-1, 2])[None],
            )
        for part in range(self._parts):
            if part:
                self._place()
            torques = self._torques
            if moments is not None:
                torques = torques.copy()
                torques[1:, 2] += moments[0]
                torques[:-1, 2] -= moments[0]
            self._chain.turn(torques)
            if state.force_n.any():
                self._chain.push(state.force_n[:, 0].T, self._position)
            self._chain.drive(*self._way_to(next_pose[0], self._step_s - part * self._part_s))
            self._chain.step()
        self._time_s += self._step_s
        self._look()

    def _look(self) -> None:
        self._place()
        self._velocity, self._turning = self._chain.velocities()

    def _place(self) -> None:
        """See where the bodies are and what the springs do there."""
        self._position, self._quaternions = self._chain.poses()
        spring_torques(
            self._quaternions[:-1], self._bending, self._twisting, self._torques, self._bends
        )

    def _way_to(self, pose: np.ndarray, left_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return how the held end must move and turn to be at `pose` (3,) in `left_s`."""
        position, (x, y, z, w) = self._position[0], self._quaternions[0]
        turn = pose[2] - 2 * np.arctan2(z, w)
        turn = np.arctan2(np.sin(turn), np.cos(turn))
        level = np.array([pose[0], pose[1], self._height_m]) - position
        return level / left_s, np.array([-2 * x, -2 * y, turn]) / left_s


def _points(vectors: np.ndarray) -> np.ndarray:
    """Return x and y of capsules and endpoint, float32 (2, 1, n + 1)."""
    return vectors[1:, :2].T[:, None].astype(np.float32)
