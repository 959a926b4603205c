"""What the controller knows and does in a cycle: state, registers, the program it runs.

Modelled: a program that ur_rtde uploaded, as far as its register handshake goes (the command in
input register 0, ready and done flags in output register 0), servoj, stops, set_tcp and the
watchdog on input register 0; protective and emergency stop; the log of every cycle.

Not modelled: URScript. An upload that names `rtde_control` counts as the running program, any
other text is refused; every command that is not listed in `_process` is answered as done and
changes nothing. Nor are modelled: dynamics, payload and force, joint torques, the speed slider's
effect on servoj, singularities, the controller's own refusal of fast targets, URCaps.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation
from ur_analytic_ik import ur5  # pyright: ignore[reportAttributeAccessIssue]

VERSION, STEP_S = (3, 15, 8, 106339), 0.008  # of a CB3
BRAKE_RAD_S2, LAG_S = 20.0, 0.03


class Arm:
    """Joints (6,) [rad] behind two first-order lags: servoj's look-ahead, then the drives."""

    def __init__(self, joints: np.ndarray) -> None:
        """Stand still there, as after somebody moved the arm by hand."""
        self.joints = np.array(joints, dtype=float)
        self.told = self.smoothed = self.joints
        self.speed = self.drift = np.zeros(6)

    def follow(self, told: np.ndarray, lookahead_s: float) -> None:
        """Move on by one cycle towards `told` (6,)."""
        self.told, before = told, self.joints
        self.smoothed = self.smoothed + _share(lookahead_s) * (told - self.smoothed)
        self.joints = before + _share(LAG_S) * (self.smoothed + self.drift - before)
        self.speed = (self.joints - before) / STEP_S

    def brake(self) -> None:
        """Slow down by one cycle and forget what was told."""
        fastest = np.abs(self.speed).max()
        left = max(fastest - BRAKE_RAD_S2 * STEP_S, 0.0)
        self.speed = self.speed * (left / fastest) if fastest > 0 else np.zeros(6)
        self.joints = self.joints + self.speed * STEP_S
        self.told = self.smoothed = self.joints


def _share(lag_s: float) -> float:
    return 1 - float(np.exp(-STEP_S / lag_s))


READY, DONE = 1, 2
STOPPED, PLAYING, PAUSED = 1, 2, 4
NO_COMMAND, SERVOJ, SERVO_STOP, SET_TCP, STOPJ, WATCHDOG, STOP_PROGRAM = 0, 11, 16, 29, 34, 35, 255
REALTIME = (6, 9, 10, 11, 24, 25, 26, 27, 38, 58)  # answered at once, without a done flag
MOVES = (1, 2, 3, 4, 6, 9, 10, 11, 12, 36)
NORMAL, PROTECTIVE, EMERGENCY = 1 << 0, (1 << 2) | (1 << 10), (1 << 6) | (1 << 7) | (1 << 10)


@dataclass
class Settings:
    """How the peer behaves.

    A real controller has no patience; with some a busy machine does not decide a test.
    """

    joints_rad: tuple[float, ...]
    misplaced_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # the tool off nominal kinematics
    patience_s: float = 0.0  # for which a cycle waits for servoj's next target
    haste: float = 1.0  # so many times as fast as on a real controller the cycles follow


@dataclass
class Log:
    """One row a cycle, and every motion command that arrived; of servoj also its target."""

    t_s: list[float] = field(default_factory=list)
    joints: list[np.ndarray] = field(default_factory=list)
    commands: list[tuple[float, int]] = field(default_factory=list)
    targets: list[list[float]] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)


class Controller:
    """One robot and the program it runs."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.arm = settings, Arm(np.array(settings.joints_rad))
        self.command, self.numbers, self.flag = NO_COMMAND, [0.0] * 24, 0  # in the registers
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
            self.command = NO_COMMAND

    def stop_program(self) -> None:
        """End the program; the arm brakes."""
        self.runtime, self._servo = STOPPED, None
        self.flag = 0

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
            if name == "input_int_register_0":
                self.command = int(value)
            elif name.startswith("input_double_register_"):
                self.numbers[int(name.rsplit("_", 1)[1])] = value
        self._fresh = True
        if self.command in MOVES:
            self.log.commands.append((self.t_s, self.command))
        if self.command == SERVOJ:
            self.log.targets.append(self.numbers[:6])

    def awaits_target(self) -> bool:
        """Tell whether servoj runs and got no new target since the last cycle."""
        return self._servo is not None and not self._fresh

    def cycle(self) -> None:
        """Go on by one cycle."""
        self._fresh = False
        self.t_s += STEP_S
        if self.t_s - self._heard_s > self._watchdog_s and self.runtime == PLAYING:
            self.stop_program()
        if self.runtime == PLAYING:
            self._run_program()
        if self._servo is None:
            self.arm.brake()
        else:
            self.arm.follow(*self._servo)
        self.log.t_s.append(self.t_s)
        self.log.joints.append(self.arm.joints)

    def tool_pose(self) -> np.ndarray:
        """Return the tool centre point as the controller gives it: place and rotation vector."""
        pose = ur5.forward_kinematics(*self.arm.joints)
        place = pose[:3, 3] + self.tcp_m * pose[:3, 2] + self.settings.misplaced_m
        return np.concatenate([place, Rotation.from_matrix(pose[:3, :3]).as_rotvec()])

    def _run_program(self) -> None:
        command = self.command
        if command in REALTIME:
            self._process(command)
            self.flag = READY
        elif command == NO_COMMAND:
            self._executing = False
            self.flag = READY
        elif not self._executing:
            self._executing = True
            self._process(command)
            if command != STOP_PROGRAM:
                self.flag = DONE

    def _process(self, command: int) -> None:
        if command == SERVOJ:
            self._servo = np.array(self.numbers[:6]), self.numbers[9]
        elif command in (SERVO_STOP, STOPJ):
            self._servo = None
        elif command == SET_TCP:
            self.tcp_m = self.numbers[2]
        elif command == WATCHDOG:
            self._watchdog_s, self._heard_s = 1 / self.numbers[0], self.t_s
        elif command == STOP_PROGRAM:
            self.stop_program()


OUTPUTS: dict[str, tuple[str, Callable[[Controller], object]]] = {
    "timestamp": ("DOUBLE", lambda c: c.t_s),
    "target_q": ("VECTOR6D", lambda c: c.arm.told),
    "actual_q": ("VECTOR6D", lambda c: c.arm.joints),
    "actual_TCP_pose": ("VECTOR6D", lambda c: c.tool_pose()),
    "target_speed_fraction": ("DOUBLE", lambda c: 1.0),
    "runtime_state": ("UINT32", lambda c: c.runtime),
    "robot_status_bits": ("UINT32", lambda c: 1 | (2 if c.runtime == PLAYING else 0)),
    "safety_status_bits": ("UINT32", lambda c: c.safety),
    "output_int_register_0": ("INT32", lambda c: c.flag),
    **{f"output_int_register_{i}": ("INT32", lambda c: 0) for i in (1, 2)},
    **{f"output_double_register_{i}": ("DOUBLE", lambda c: 0.0) for i in range(6)},
}
"""Of the RTDE guide's outputs those that ur_rtde asks for, with their types."""
INPUT_TYPES = {
    "external_force_torque": "VECTOR6D",
    **{f"input_int_register_{i}": "INT32" for i in range(24)},
    **{f"input_double_register_{i}": "DOUBLE" for i in range(24)},
}
