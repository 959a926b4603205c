"""The segmented cable as one would write it without a batch: MuJoCo steps, NumPy forces.

The same chain, masses, springs, dampers, friction and drive of the tool as the segmented simulator,
for one cast under one parameter vector at a time. Friction sees the velocity of the step's
beginning, where the simulator corrects it by half a step.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.simulators.batch import tool_paths
from robotcast.simulators.chain import GRAVITY_M_S2, TOOL_DOFS, ChainGeometry, capsule_inertia
from robotcast.simulators.mujoco_cables import TOOL_ARMATURE, ChainSettings, chain_model


class PlainChain:
    """Simulates one cast.

    Parameters
    ----------
    trial : whose tool is followed, and at whose times the free end is wanted.
    """

    def __init__(self, cable: Cable, settings: ChainSettings, trial: Trial) -> None:
        self._cable, self._settings, self._trial = cable, settings, trial
        self._geometry = ChainGeometry.of_cable(
            cable.length_m, settings.segments, settings.stretches
        )
        self._model = chain_model(self._geometry, settings.step_s)
        self._data = mujoco.MjData(self._model)
        steps = int(np.ceil(trial.waypoints_s[-1] / settings.step_s))
        self._times_s = np.arange(steps + 2) * settings.step_s
        self._poses = tool_paths([trial.tool], self._times_s)[:, 0]

    def error_percent(self, values: Mapping[str, float]) -> float:
        """Return the average waypoint error, in % of cable length, one length at most."""
        seen_m = self.simulate(values)
        average_m = np.linalg.norm(seen_m - self._trial.waypoints_m, axis=1).mean()
        percent = 100 * average_m / self._cable.length_m
        return float(np.minimum(np.nan_to_num(percent, nan=100.0), 100.0))

    def simulate(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the free end at the trial's waypoints (k, 2)."""
        self._set_parameters(values)
        model, data, geometry = self._model, self._data, self._geometry
        mujoco.mj_resetData(model, data)
        data.qpos[:TOOL_DOFS] = self._poses[0]
        data.qpos[geometry.hinges[0]] = self._lean_rad()
        path_m = np.empty((len(self._times_s) - 1, 2))
        for step in range(len(path_m)):
            mujoco.mj_step1(model, data)
            path_m[step] = self._apply_forces(step)
            mujoco.mj_step2(model, data)
        wanted_s, known_s = self._trial.waypoints_s, self._times_s[:-1]
        return np.stack([np.interp(wanted_s, known_s, xy) for xy in path_m.T], axis=1)

    def _lean_rad(self) -> float:
        """Return the angle from the tool's yaw to where the free end was first seen."""
        if self._trial.start_m is None:
            return 0.0
        x, y, yaw = self._poses[0]
        lean = np.arctan2(self._trial.start_m[1] - y, self._trial.start_m[0] - x) - yaw
        return float(np.arctan2(np.sin(lean), np.cos(lean)))

    def _set_parameters(self, values: Mapping[str, float]) -> None:
        model, geometry, cable = self._model, self._geometry, self._cable
        lengths, n = geometry.lengths_m, len(geometry.lengths_m)
        tip = values["endpoint_mass_kg"]
        mass = values["cable_mass_kg"] * lengths / cable.length_m
        self._friction_n = values["friction"] * GRAVITY_M_S2 * np.append(mass, tip)
        inertia, centre = capsule_inertia(mass, lengths, cable.radius_m), 0.5 * lengths
        last = mass[-1]
        mass[-1] += tip
        centre[-1] = (0.5 * last + tip) * lengths[-1] / mass[-1]
        inertia[-1] += last * tip / mass[-1] * (0.5 * lengths[-1]) ** 2
        model.body_mass[-n:], model.body_ipos[-n:, 0] = mass, centre
        model.body_inertia[-n:] = inertia[:, None]
        bending = values["bending_stiffness_n_m2"] / geometry.bends_m
        bending[0] *= values["grip_stiffness"]
        model.jnt_stiffness[geometry.hinges] = bending
        self._viscous = values["bending_damping_s"] * bending
        self._dry_n_m = values["joint_friction_n_m"]
        slides = geometry.slides[geometry.stretching]
        stretching = values["axial_stiffness_n"] / geometry.stretches_m
        model.jnt_stiffness[slides] = stretching
        model.dof_damping[slides] = self._settings.stretch_damping_s * stretching

    def _apply_forces(self, step: int) -> np.ndarray:
        """Write friction, dry joints and the drive of the tool; return the free end (2,)."""
        model, data, geometry = self._model, self._data, self._geometry
        n, step_s = len(geometry.lengths_m), self._settings.step_s
        heading = data.xmat[-n:, [0, 3]]
        centre_m = data.xpos[-n:, :2] + 0.5 * geometry.lengths_m[:, None] * heading
        tip_m = data.xpos[-1, :2] + geometry.lengths_m[-1] * heading[-1]
        points_m = np.vstack([centre_m, tip_m])
        spin = data.cvel[-n:, 2][[*range(n), n - 1]]
        about_m = points_m - data.subtree_com[1, :2]
        speed = data.cvel[-n:, 3:5][[*range(n), n - 1]]
        speed = speed + spin[:, None] * np.stack([-about_m[:, 1], about_m[:, 0]], axis=1)
        slowness = np.sqrt((speed**2).sum(axis=1) + self._settings.sliding_speed_m_s**2)
        force_n = -(self._friction_n / slowness)[:, None] * speed
        lever_m = points_m - data.xipos[-n:, :2][[*range(n), n - 1]]
        turn = lever_m[:, 0] * force_n[:, 1] - lever_m[:, 1] * force_n[:, 0]
        data.xfrc_applied[-n:, :2], data.xfrc_applied[-n:, 5] = force_n[:n], turn[:n]
        data.xfrc_applied[-1, :2] += force_n[n]
        data.xfrc_applied[-1, 5] += turn[n]
        rate = data.qvel[geometry.hinges]
        dry = self._dry_n_m / np.sqrt(rate**2 + self._settings.bending_rate_rad_s**2)
        model.dof_damping[geometry.hinges] = self._viscous + dry
        wanted = (self._poses[step + 1] - data.qpos[:TOOL_DOFS]) / step_s
        change = wanted - data.qvel[:TOOL_DOFS]
        data.qfrc_applied[:TOOL_DOFS] = change * (TOOL_ARMATURE / step_s)
        return tip_m
