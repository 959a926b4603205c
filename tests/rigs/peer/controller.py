"""What the controller knows and does in a cycle: state, registers, the program it runs.

Modelled: a program that ur_rtde uploaded, as far as its register handshake goes (the command in
input register 0, ready and done flags in output register 0), servoj, stops, set_tcp and the
watchdog on input register 0; protective and emergency stop; the log of every cycle.

Not modelled: URScript. An upload that names `rtde_control` counts as the running program, any
other text is refused; every command that is not listed in `_process` is answered as done and
changes nothing. Nor are modelled: dynamics, payload and force, joint torques, the speed slider's
effect on servoj, singularities, the controller's own refusal of fast targets, URCaps.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

BRAKE_RAD_S2 = 20.0


class Arm:
    """Joints behind two first-order lags: servoj's look-ahead, then the drives.

    Parameters
    ----------
    joints : ndarray of shape (6,) [rad], where the arm stands.
    lag_s : time constant of the drives.
    """

    def __init__(self, joints: np.ndarray, lag_s: float) -> None:
        self.lag_s = lag_s
        self.place(joints)

    def place(self, joints: np.ndarray) -> None:
        """Stand still elsewhere, as after somebody moved the arm by hand."""
        self.joints = np.array(joints, dtype=float)
        self.told = self.joints.copy()
        self.smoothed = self.joints.copy()
        self.speed = np.zeros(6)
        self.drift = np.zeros(6)

    def follow(self, told: np.ndarray, lookahead_s: float, step_s: float) -> None:
        """Move on by one cycle towards `told` (6,)."""
        self.told = np.array(told)
        before = self.joints
        self.smoothed = self.smoothed + _share(step_s, lookahead_s) * (self.told - self.smoothed)
        aim = self.smoothed + self.drift
        self.joints = before + _share(step_s, self.lag_s) * (aim - before)
        self.speed = (self.joints - before) / step_s

    def brake(self, step_s: float) -> None:
        """Slow down by one cycle and forget what was told."""
        fastest = np.abs(self.speed).max()
        left = max(fastest - BRAKE_RAD_S2 * step_s, 0.0)
        self.speed = self.speed * (left / fastest) if fastest > 0 else np.zeros(6)
        self.joints = self.joints + self.speed * step_s
        self.told, self.smoothed = self.joints.copy(), self.joints.copy()


def _share(step_s: float, lag_s: float) -> float:
    return 1 - float(np.exp(-step_s / lag_s))


READY, DONE = 1, 2
STOPPED, PLAYING, PAUSED = 1, 2, 4
NO_COMMAND, SERVOJ, SERVO_STOP, SET_TCP, STOPJ, WATCHDOG, STOP_PROGRAM = 0, 11, 16, 29, 34, 35, 255
REALTIME = (6, 9, 10, 11, 24, 25, 26, 27, 38, 58)  # answered at once, without a done flag
MOVES = (1, 2, 3, 4, 6, 9, 10, 11, 12, 36)
NORMAL, PROTECTIVE, EMERGENCY = 1 << 0, (1 << 2) | (1 << 10), (1 << 6) | (1 << 7) | (1 << 10)


@dataclass
class Settings:
    """How the peer behaves.

    Attributes
    ----------
    version : of the control software: major, minor, bugfix, build; 3.x is a CB3, 5.x an e-Series.
    misplaced_m : by how much the tool really stands off the nominal kinematics.
    patience_s : how long a cycle waits for servoj's next target; 0 as a real controller, more
        where a busy machine shall not decide a test.
    haste : how many times as fast as on a real controller the cycles follow each other.
    """

    joints_rad: tuple[float, ...]
    version: tuple[int, int, int, int] = (3, 15, 8, 106339)
    lag_s: float = 0.03
    misplaced_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    speed_fraction: float = 1.0
    patience_s: float = 0.0
    haste: float = 1.0

    @property
    def step_s(self) -> float:
        return 0.008 if self.version[0] <= 3 else 0.002


@dataclass
class Log:
    """One row a cycle, and every motion command that arrived; of servoj also its target."""

    t_s: list[float] = field(default_factory=list)
    told: list[np.ndarray] = field(default_factory=list)
    joints: list[np.ndarray] = field(default_factory=list)
    commands: list[tuple[float, int]] = field(default_factory=list)
    targets: list[list[float]] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)


class Controller:
    """One robot and the program it runs."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.step_s = settings, settings.step_s
        self.arm = Arm(np.array(settings.joints_rad), settings.lag_s)
        self.int_in, self.double_in = [0] * 48, [0.0] * 48
        self.int_out, self.double_out = [0] * 48, [0.0] * 48
        self.t_s, self.log = 0.0, Log()
        self.safety, self.runtime = NORMAL, STOPPED
        self.tcp_m = 0.0
        self._servo: tuple[np.ndarray, float] | None = None
        self._executing = False
        self._watchdog_s, self._heard_s = np.inf, 0.0
        self._fresh = False

    def start_program(self) -> None:
        """Run the uploaded program, unless the robot is stopped for safety."""
        if self.safety == NORMAL:
            self.runtime, self._executing = PLAYING, False
            self._servo, self._watchdog_s = None, np.inf
            self.int_in[0] = NO_COMMAND

    def stop_program(self) -> None:
        """End the program; the arm brakes."""
        self.runtime, self._servo = STOPPED, None
        self.int_out[0] = 0

    def stop_for_safety(self, kind: str) -> None:
        """Stop as after a collision ("protective stop") or a pressed button ("emergency stop")."""
        self.safety = PROTECTIVE if kind == "protective stop" else EMERGENCY
        self._servo = None
        self.runtime = PAUSED if kind == "protective stop" else STOPPED

    def release(self) -> None:
        """Be ready again, as after somebody unlocked the robot; the old program is gone."""
        self.safety = NORMAL
        self.arm.drift = np.zeros(6)
        self.stop_program()

    def receive(self, names: list[str], values: list[float]) -> None:
        """Take an input package."""
        self._heard_s = self.t_s
        for name, value in zip(names, values, strict=False):
            if name.startswith("input_int_register_"):
                self.int_in[int(name.rsplit("_", 1)[1])] = int(value)
            elif name.startswith("input_double_register_"):
                self.double_in[int(name.rsplit("_", 1)[1])] = value
        self._fresh = True
        if self.int_in[0] in MOVES:
            self.log.commands.append((self.t_s, self.int_in[0]))
        if self.int_in[0] == SERVOJ:
            self.log.targets.append(self.double_in[:6])

    def awaits_target(self) -> bool:
        """Tell whether servoj runs and got no new target since the last cycle."""
        return self._servo is not None and not self._fresh

    def cycle(self) -> None:
        """Go on by one cycle."""
        self._fresh = False
        self.t_s += self.step_s
        if self.t_s - self._heard_s > self._watchdog_s and self.runtime == PLAYING:
            self.stop_program()
        if self.runtime == PLAYING:
            self._run_program()
        if self._servo is None:
            self.arm.brake(self.step_s)
        else:
            self.arm.follow(*self._servo, self.step_s)
        self.log.t_s.append(self.t_s)
        self.log.told.append(self.arm.told)
        self.log.joints.append(self.arm.joints)

    def output(self, name: str) -> object:
        """Return the present value of an output variable."""
        if name.startswith("output_int_register_"):
            return self.int_out[int(name.rsplit("_", 1)[1])]
        if name.startswith("output_double_register_"):
            return self.double_out[int(name.rsplit("_", 1)[1])]
        return _STATE[name](self)

    def tool_pose(self) -> np.ndarray:
        """Return the tool centre point as the controller gives it: place and rotation vector."""
        pose = ur5.forward_kinematics(*self.arm.joints)
        place = pose[:3, 3] + self.tcp_m * pose[:3, 2] + self.settings.misplaced_m
        return np.concatenate([place, Rotation.from_matrix(pose[:3, :3]).as_rotvec()])

    def _run_program(self) -> None:
        command = self.int_in[0]
        if command in REALTIME:
            self._process(command)
            self.int_out[0] = READY
        elif command == NO_COMMAND:
            self._executing = False
            self.int_out[0] = READY
        elif not self._executing:
            self._executing = True
            self._process(command)
            if command != STOP_PROGRAM:
                self.int_out[0] = DONE

    def _process(self, command: int) -> None:
        if command == SERVOJ:
            self._servo = np.array(self.double_in[:6]), self.double_in[9]
        elif command in (SERVO_STOP, STOPJ):
            self._servo = None
        elif command == SET_TCP:
            self.tcp_m = self.double_in[2]
        elif command == WATCHDOG:
            self._watchdog_s, self._heard_s = 1 / self.double_in[0], self.t_s
        elif command == STOP_PROGRAM:
            self.stop_program()


_STATE = {
    "timestamp": lambda c: c.t_s,
    "target_q": lambda c: c.arm.told,
    "target_qd": lambda c: np.zeros(6),
    "actual_q": lambda c: c.arm.joints,
    "actual_qd": lambda c: c.arm.speed,
    "actual_TCP_pose": lambda c: c.tool_pose(),
    "speed_scaling": lambda c: 1.0 if c.runtime == PLAYING else 0.0,
    "target_speed_fraction": lambda c: c.settings.speed_fraction,
    "robot_mode": lambda c: 7,
    "safety_mode": lambda c: {NORMAL: 1, PROTECTIVE: 3, EMERGENCY: 7}[c.safety],
    "runtime_state": lambda c: c.runtime,
    "robot_status_bits": lambda c: 1 | (2 if c.runtime == PLAYING else 0),
    "safety_status_bits": lambda c: c.safety,
}
