"""What lies between a drive and its link where that is not rigid: a spring, play, or both.

Two masses, the rotor at θ with inertia J (the joint's `armature`) and the link at q = θ − δ:

    J θ'' = u − τ,    M(q) q'' + … = τ,    τ = k (δ − clip(δ, −b, b)) + d δ'

with compliance 1/k, retardation time d/k and half a gap b (Spong 1987, doi 10.1115/1.3143860). The
drive u acts on the rotor and closes its loop there; encoders sit on it too, and the joint's damping
and dry friction, which are mostly those of motor and gear, brake it. MuJoCo steps the link, the
rotor is stepped here, and the two are coupled implicitly. With κ = d, or as much more as a step of
dt needs to be stable, N = J + dt κ and s = dt κ / N, the force between them is

    τ = (1 − s) k δ + s (u + J (θ' − q') / dt) − s J q''

so that the link carries s J as armature and the rest as an applied force. Damping and servos brake
the rotor at the end of the step, as if it were heavier; dry friction is as soft as MuJoCo's. A soft
spring has a small s, a stiff one s → 1; the limit is the rigid joint with its whole armature, no
equation is stiff. No second joint is compiled, so that the whole library can be let in at once.
"""

from collections.abc import Collection, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from robotcast.robots.closure import Followers, equalities
from robotcast.robots.effect import Acting, RobotEffect
from robotcast.robots.names import coordinates, in_file, is_hinge, joint_of_actuator

LEAST_ROTOR = 0.02  # of a joint's inertia, taken from its link where the model gives no armature
IMPLICIT = 2 / 3  # of a step, by which a spring that it does not resolve is damped
SURE_SIDE = 0.1  # of the usual torque, from which it is known on which side of a gap a joint rests
POWERS = np.arange(3)  # of the speed, by which a joint's damping grows
FILTERS = [int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)]
FIXED_GAIN, AFFINE = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_AFFINE)


def drives_of(model: mujoco.MjModel, dof: int) -> list[int]:
    """Return the actuators that drive a joint themselves."""
    joint = int(model.dof_jntid[dof])
    return [a for a in range(model.nu) if joint_of_actuator(model, a) == joint]


def is_plain(model: mujoco.MjModel, actuator: int) -> bool:
    """Tell whether an actuator's force is gain × command + bias + stiffness, damping of a servo."""
    return (
        model.actuator_dyntype[actuator] == int(mujoco.mjtDyn.mjDYN_NONE)
        and model.actuator_gaintype[actuator] == FIXED_GAIN
        and model.actuator_biastype[actuator] in (int(mujoco.mjtBias.mjBIAS_NONE), AFFINE)
    )


def is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Tell whether an actuator closes a loop about a position itself."""
    affine = model.actuator_biastype[actuator] == AFFINE
    return bool(affine and model.actuator_biasprm[actuator, 1] != 0)


def control_ends(model: mujoco.MjModel, actuator: int | None) -> np.ndarray:
    """Return between what a control is clipped, (2,), of what is no actuator infinite."""
    clamps = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    if actuator is None or not (clamps and model.actuator_ctrllimited[actuator]):
        return np.array([-np.inf, np.inf])
    return model.actuator_ctrlrange[actuator]


def link_inertia(model: mujoco.MjModel, dofs: Sequence[int]) -> np.ndarray:
    """Return what a joint has to accelerate when others move freely, without its rotor, (n,).

    Equalities move others along: with their Jacobian E and softness R, a torque accelerates by
    M⁻¹ − M⁻¹ Eᵀ (E M⁻¹ Eᵀ + R)⁻¹ E M⁻¹ (Featherstone 2008, section 8.2).
    """
    data, mass = mujoco.MjData(model), np.empty((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    free, (tied, soft, _) = np.linalg.inv(mass), equalities(model, data)
    moved = free @ tied.T
    free -= moved @ np.linalg.solve(tied @ moved + np.diag(soft), moved.T)
    whole = 1 / np.diag(free)[list(dofs)]
    return np.maximum(whole - model.dof_armature[list(dofs)], LEAST_ROTOR * whole)


def rotor_inertia(model: mujoco.MjModel, dofs: Sequence[int], armature: np.ndarray) -> np.ndarray:
    """Return the inertia of joints' rotors, (…, n) as their `armature`."""
    drives = [drives_of(model, dof) for dof in dofs]
    geared = [
        sum(model.actuator_armature[a] * model.actuator_gear[a, 0] ** 2 for a in own)
        for own in drives
    ]
    return np.maximum(armature + np.array(geared), LEAST_ROTOR * link_inertia(model, dofs))


class Transmission:
    """The rotors of all joints that some effect makes soft, in all simulations of a batch.

    All that is `acting` has a `transmission`; rows in which all are at their null are left to
    MuJoCo, bit by bit. `unseen` are the degrees of freedom that no encoder sees.
    """

    def __init__(self, batch: Batch, acting: Acting, unseen: Collection[int] = ()) -> None:
        model = batch.model
        self.dofs = sorted({dof for effect, _ in acting for dof in effect.where.dofs})
        qpos_of_dof = coordinates(model)
        self.qpos_at = qpos_of_dof[self.dofs]
        self._unseen = qpos_of_dof[[*unseen]].tolist()
        self._batch, self._step_s = batch, float(model.opt.timestep)
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._ctrl, self._applied = batch.bind("ctrl"), batch.bind("qfrc_applied")
        self._twist = np.zeros((batch.nsim, len(self.dofs)))  # δ
        self._rate = np.zeros_like(self._twist)  # θ'
        self._set_up(acting)
        self._take_drives()
        self._take_brakes()

    def _set_up(self, acting: Acting) -> None:
        """Add up what the effects say of every joint."""
        model, shape, dt = self._batch.model, self._twist.shape, self._step_s
        compliance, retardation_s, self._half_gap = (np.zeros(shape) for _ in range(3))
        teeth = np.zeros(shape)
        for effect, own in acting:
            at = [self.dofs.index(dof) for dof in effect.where.dofs]
            said = effect.transmission(**own)
            for total, part in zip(
                (compliance, retardation_s, self._half_gap, teeth), said, strict=True
            ):
                total[:, at] += part
        self.soft = (compliance > 0) | (self._half_gap > 0)
        self._armature = self._batch.expand("dof_armature")
        self._rigid = self._armature[:, self.dofs].copy()
        self._inertia = self._batch.expand("dof_M0")  # with armature, read of what only slides
        self._others = self._inertia[:, self.dofs] - self._rigid
        self._link = link = link_inertia(model, self.dofs)
        self._rotor = rotor_inertia(model, self.dofs, self._rigid)  # J
        both = self._rotor * link / (self._rotor + link)
        # teeth are as stiff as a step resolves; less where they would yield by more than the gap
        compliance = compliance + np.minimum(teeth, dt**2 / both)
        self._stiffness = np.where(self.soft, 1 / np.where(self.soft, compliance, 1.0), 0.0)
        self._relaxed_s = retardation_s
        unresolved = np.maximum(0.0, 1 - both * compliance / dt**2)
        damped_s = np.maximum(retardation_s, IMPLICIT * dt * unresolved)
        self._damping = self._stiffness * np.where(teeth > 0, np.maximum(damped_s, dt), damped_s)

    def _take_drives(self) -> None:
        """Take the drives of soft joints from MuJoCo, which would close their loops at the link."""
        model, batch = self._batch.model, self._batch
        gain, bias = batch.expand("actuator_gainprm"), batch.expand("actuator_biasprm")
        force_range = batch.expand("actuator_forcerange")
        self._drives = []
        for k, dof in enumerate(self.dofs):
            for a in drives_of(model, dof):
                limits = control_ends(model, a)
                ends = force_range[:, a].copy()
                if not model.actuator_forcelimited[a]:
                    ends[:] = -np.inf, np.inf
                affine = model.actuator_biastype[a] == AFFINE
                law = np.column_stack([gain[:, a, 0], bias[:, a, :3] * affine])
                self._drives.append((k, a, model.actuator_gear[a, 0], law, limits, ends))
                gain[self.soft[:, k], a] = 0.0
                bias[self.soft[:, k], a] = 0.0

    def _take_brakes(self) -> None:
        """Take damping and dry friction of soft joints from MuJoCo, which would brake the links."""
        model, expand = self._batch.model, self._batch.expand
        of_joint = [expand(f"dof_{name}") for name in ("damping", "dampingpoly", "frictionloss")]
        of_drive = [expand(f"actuator_{name}") for name in ("damping", "dampingpoly")]
        damping, poly, self._dry = (some[:, self.dofs].copy() for some in of_joint)
        # as a constraint of MuJoCo: so much of the force, and at which rate [1/s] it stops a joint
        impedance, solref = model.dof_solimp[self.dofs], model.dof_solref[self.dofs]
        relaxed_s = np.maximum(solref[:, 0], 2 * self._step_s)
        rate = np.where(solref[:, 0] > 0, 2 / relaxed_s, -solref[:, 1])
        self._held, self._stops = impedance[:, 0], rate / impedance[:, 1]
        self._viscous = np.concatenate([damping[:, :, None], poly], axis=2)  # by |v| and v² too
        for k, a, gear, *_ in self._drives:
            own = np.column_stack([of_drive[0][:, a], of_drive[1][:, a]])
            self._viscous[:, k] += gear**2 * own
            for some in of_drive:
                some[self.soft[:, k], a] = 0.0
        for k, dof in enumerate(self.dofs):
            for some in of_joint:
                some[self.soft[:, k], dof] = 0.0

    def place(self, bends: np.ndarray) -> None:
        """Start where encoders show the rotors, the links behind them by the equation of these.

        There `bends` are the rotors' acceleration and its rate, (n_sim, 2, nv). A link that
        equalities tie to joints with encoders of their own is where these say.
        """
        dt, stiffness = self._step_s, np.where(self.soft, self._stiffness, 1.0)
        acceleration, its_rate = bends[:, 0, self.dofs], bends[:, 1, self.dofs]
        self._rate = self._qvel[:, self.dofs].copy()
        drive, _ = self._drive()
        self._rate, self._twist = self._rate + dt * acceleration, dt * self._rate
        drive_rate = (self._drive()[0] - drive) / dt
        self._rate = self._rate - dt * acceleration
        twisting = (drive_rate - self._rotor * its_rate) / stiffness
        carried = drive - self._rotor * acceleration
        carried -= np.clip(self._rotor * self._stops * self._rate, -self._dry, self._dry)
        spring = carried - stiffness * self._relaxed_s * twisting
        sure = SURE_SIDE * self._half_gap * stiffness
        side = np.clip(carried / np.where(sure > 0, sure, 1.0), -1, 1) * self._half_gap
        self._twist = np.where(self.soft, side + spring / stiffness, 0.0)
        for state, at, away in (
            (self._qpos, self.qpos_at, self._twist),
            (self._qvel, self.dofs, twisting),
        ):
            state[:, at] = np.where(self.soft, state[:, at] - away, state[:, at])
        if self._batch.model.neq:
            self._tie()
        self._last = self._qvel[:, self.dofs], carried, np.zeros_like(carried)

    def _tie(self) -> None:
        """Put links where equalities tie them to joints that are seen and not soft."""
        model = self._batch.model
        seen = {*range(model.nq)} - {*self._unseen}
        for soft in np.unique(self.soft, axis=0):
            others = Followers(model, seen - {*self.qpos_at[soft].tolist()})
            tied = soft & np.isin(self.dofs, others.dofs)
            at = self.qpos_at[tied]
            for row in np.flatnonzero((self.soft == soft).all(axis=1)) if tied.any() else ():
                before = self._qpos[row].copy()
                others.settle(self._qpos[row], self._qvel[row], before)
                self._twist[row, tied] += before[at] - self._qpos[row, at]

    def show(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Write what encoders show over positions (n_sim, nq) and velocities (n_sim, nv)."""
        at = qpos[:, self.qpos_at]
        qpos[:, self.qpos_at] = np.where(self.soft, at + self._twist, at)
        qvel[:, self.dofs] = np.where(self.soft, self._rate, qvel[:, self.dofs])

    def apply(self) -> None:
        """Replace what drives soft joints by what reaches their links in the step that begins."""
        dt, rotor = self._step_s, self._rotor
        drive, brake = self._drive()
        stretched = self._twist - np.clip(self._twist, -self._half_gap, self._half_gap)
        touches = (self._half_gap == 0) | (stretched != 0)
        damping = np.where(touches, self._damping, 0.0)
        spring = self._stiffness * stretched
        speed = self._qvel[:, self.dofs]
        # what else acts on the link, by its last step, and what of its inertia the rotor drags
        before, carried, felt = self._last
        other = (self._link + felt) * (speed - before) / dt - carried
        drags = dt * damping * self._link / (self._link + dt * damping)
        coming = speed + dt * (other + spring) / self._link
        force = drive - spring + drags / dt * (coming - self._rate)
        holds = self._held * (force + (rotor + drags) * self._stops * self._rate)
        drive += brake * self._rate - np.clip(holds, -self._dry, self._dry)
        whole = rotor + dt * (brake + damping)
        share = dt * damping / whole  # s
        carried = (1 - share) * spring + share * (
            drive - brake * speed + rotor / dt * (self._rate - speed)
        )
        felt = share * (rotor + dt * brake)
        armature = np.where(self.soft, self._rigid - rotor + felt, self._rigid)
        self._armature[:, self.dofs], self._inertia[:, self.dofs] = (
            armature,
            self._others + armature,
        )
        given = self._applied[:, self.dofs]
        self._applied[:, self.dofs] = np.where(self.soft, carried, given)
        self._last = speed, carried, felt
        self._coming = (rotor * self._rate + dt * (drive - spring)) / whole, share

    def advance(self) -> None:
        """Move the rotors to the end of the step that MuJoCo has done."""
        free, share = self._coming
        speed = self._qvel[:, self.dofs]
        self._rate = free + share * speed
        self._twist = self._twist + self._step_s * (self._rate - speed)

    def _drive(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what drives the rotors but dry friction, and how their own speed brakes them."""
        terms = self._viscous * np.abs(self._rate)[:, :, None] ** POWERS
        drive = self._applied[:, self.dofs] - terms.sum(axis=2) * self._rate
        brake = (terms * (1 + POWERS)).sum(axis=2)
        angle = self._qpos[:, self.qpos_at] + self._twist
        for k, a, gear, law, limits, ends in self._drives:
            force = law[:, 0] * np.clip(self._ctrl[:, a], *limits) + law[:, 1]
            force = force + gear * (law[:, 2] * angle[:, k] + law[:, 3] * self._rate[:, k])
            drive[:, k] += gear * np.clip(force, ends[:, 0], ends[:, 1])
            brake[:, k] += gear**2 * np.maximum(0.0, -law[:, 3])
        return drive, brake


class Transmitted(RobotEffect):
    """Something between a drive and its link, see `Transmission`."""

    def patch(self, spec: mujoco.MjSpec, model: mujoco.MjModel, **values: float) -> bool:
        """Insert a second joint behind each, so that the old one is the rotor's."""
        given = {name: np.array([[v]]) for name, v in values.items()}
        compliance, retardation_s, half_gap, _ = map(np.ndarray.item, self.transmission(**given))
        joints = [int(model.dof_jntid[dof]) for dof in self.where.dofs]
        if spec.keys or not all(is_hinge(model, joint) for joint in joints):
            # MuJoCo takes two slides along one axis of a body for orthogonal ones, and the
            # positions of a keyframe would be one too few
            return False
        for dof, joint in zip(self.where.dofs, joints, strict=True):
            old = spec.joints[joint]
            new = old.parent.add_joint(name=f"{old.name}_{self.name}", type=old.type)
            new.axis, new.pos = old.axis, old.pos
            rotor = LEAST_ROTOR * float(link_inertia(model, [dof])[0])
            old.armature = max(old.armature, rotor)
            if compliance:
                new.stiffness[0], new.damping[0] = 1 / compliance, retardation_s / compliance
            if half_gap:
                reach = in_file(spec, old, half_gap)
                new.limited, new.range = int(mujoco.mjtLimited.mjLIMITED_TRUE), [-reach, reach]
                new.solref_limit = [2 * model.opt.timestep, 1.0]  # as stiff as a step allows
        return True


class ElasticJoint(Transmitted):
    """The link hangs on its drive by a spring of compliance `c`, damped as c d = `retardation`."""

    def transmission(self, *, c: np.ndarray, retardation: np.ndarray) -> tuple[np.ndarray, ...]:
        return c, retardation, np.zeros_like(c), np.zeros_like(c)


class Backlash(Transmitted):
    """The link is free within `gap` about its drive; teeth yield to the `usual` torque by half."""

    def __init__(self, *args: Any, usual: float, **more: Any) -> None:
        super().__init__(*args, **more)
        self.usual = usual

    def transmission(self, *, gap: np.ndarray) -> tuple[np.ndarray, ...]:
        return np.zeros_like(gap), np.zeros_like(gap), gap / 2, gap / 2 / self.usual
