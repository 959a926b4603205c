"""Windows × parameter vectors in `mujoco.batch`: all are stepped side by side, effects and all.

Drives are held until the next sample of the log. What a step of the simulation gets is the mean of
the drive over it, so that a delay by a part of a step has an effect; without one it is the sample.
"""

from collections.abc import Sequence
from contextlib import suppress
from copy import copy

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from robotcast.processes import cores
from robotcast.robots.effect import Acting, Motion, RobotEffect
from robotcast.robots.logs import Log
from robotcast.robots.model_fields import BatchFields, load
from robotcast.robots.names import coordinates, moved, quaternions, rates, turned
from robotcast.robots.robot_file import RobotFile, Tunable
from robotcast.robots.transmission import FILTERS, Transmission, control_ends, is_servo
from robotcast.robots.windows import Window
from robotcast.simulators.mujoco_cables import quiet_mujoco

BATCH = 256  # simulations stepped side by side
CHECK_EVERY = 50  # steps between looks for runs that diverged
DIVERGED_RATE = 1e4  # rad/s or m/s: no robot moves like that
INPUTS = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED)
FORCES = ("force", "friction")
STEPWISE = (*FORCES, "transmission")  # hooks that are asked at every step
LEAD_S = 0.3  # of commands before a window, for effects that remember them
MEMORY_S = 1.0  # the same for actuators with a state of their own


class Rollout:
    """Simulates windows of a robot's logs, the model's own step cut into `finer` parts.

    Results do not depend on `threads`.
    """

    def __init__(
        self,
        robot: RobotFile,
        logs: Sequence[Log],
        windows: Sequence[Window],
        threads: int = 0,
        finer: int = 1,
    ) -> None:
        quiet_mujoco()
        self.robot, self.logs, self.windows = robot, tuple(logs), tuple(windows)
        self.threads = cores(threads)
        self._model = copy(robot.model)
        self._model.opt.timestep /= finer
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        free = self._model.actuator_forcelimited == 0  # so that an effect may limit them
        self._model.actuator_forcerange[free] = -np.inf, np.inf
        self._model.actuator_forcelimited[:] = 1
        self._step_s = float(self._model.opt.timestep)
        channels = list(enumerate(robot.drive))
        self._controls = [(c, at.actuator) for c, at in channels if at.actuator is not None]
        self._torques = [(c, at.dof) for c, at in channels if at.dof is not None]
        self._signals = list(robot.measured)
        self._differ = np.ones(self._model.nv, bool)  # speeds that are told by the clock
        self._differ[[s.index for s in self._signals if s.kind == "velocity"]] = False
        self._delay_s, self._latency_s = self._own_delays()
        self.qpos_of_dof = coordinates(self._model)

    def finer(self, parts: int) -> "Rollout":
        """Return the same with a step cut into parts."""
        return Rollout(self.robot, self.logs, self.windows, self.threads, parts)

    def _own_delays(self) -> tuple[np.ndarray, np.ndarray]:
        """Take the model's own delays of commands and of sensors [s] out of it, by column.

        MuJoCo's buffers are made for the model's step, and too short for a finer one.
        """
        model, of_data = self._model, np.repeat(self._model.sensor_delay, self._model.sensor_dim)
        commands = np.zeros(len(self.robot.drive))
        for channel, actuator in self._controls:
            commands[channel] = model.actuator_delay[actuator]
        signals = [of_data[s.index] if s.kind == "sensor" else 0.0 for s in self._signals]
        model.actuator_delay[:], model.sensor_delay[:] = 0.0, 0.0
        return commands, np.array(signals)

    def simulate(
        self,
        numbers: Sequence[int],
        times_s: Sequence[np.ndarray],
        effects: Sequence[RobotEffect],
        vectors: np.ndarray,
        away: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return all signals in SI units, (n_vectors, n_starts, k_max, n_signals).

        Parameters
        ----------
        numbers : of the windows, one for every start.
        times_s : of every start, when its signals are wanted, from the start of its window.
        vectors : ndarray (n_vectors, n), the tuned parameters, then those of the effects.
        away : how far from the measured states it starts, in positions, velocities,
            accelerations and their rates, (n_starts, 4, nv); None for nothing.
        """
        windows = [self.windows[k] for k in numbers]
        away = np.zeros((len(windows), 4, self._model.nv)) if away is None else away
        k_max = max(map(len, times_s))
        found = np.full((len(vectors), len(windows), k_max, len(self._signals)), np.nan)
        by_steps = stepwise(self.robot.tune, effects, vectors)
        for alike in (np.flatnonzero(~by_steps), np.flatnonzero(by_steps)):
            pairs = np.array([(v, s) for s in range(len(windows)) for v in alike])
            for part in np.array_split(pairs, -(-len(pairs) // BATCH)) if len(pairs) else ():
                of_vector, of_start = part.T
                paths = self._run(
                    [windows[s] for s in of_start],
                    away[of_start],
                    [times_s[s] for s in of_start],
                    _acting(self.robot.tune, effects, vectors[of_vector]),
                    vectors[of_vector],
                    bool(by_steps[of_vector[0]]),
                )
                for v, s, path in zip(of_vector, of_start, paths, strict=True):
                    found[v, s, : len(times_s[s])] = path
        return found

    def _run(
        self,
        windows: Sequence[Window],
        away: np.ndarray,
        times_s: Sequence[np.ndarray],
        acting: Acting,
        values: np.ndarray,
        by_steps: bool,
    ) -> list[np.ndarray]:
        """Simulate one batch; row by row a start with its own values (n_sim, n)."""
        slow = self.slow(windows)
        acting = [(effect, effect.in_window(slow, **own)) for effect, own in acting]
        batch = Batch(self._model, len(windows), nthread=self.threads)
        fields = BatchFields(batch)
        for k, tunable in enumerate(self.robot.tune):
            write = fields.multiply if tunable.factor else fields.set
            write(tunable.at, values[:, k : k + 1])
        for effect, own in _through("write", acting):
            effect.write(fields, **own)
        if any(log.payloads for log in self.logs):
            load([self.logs[w.log].payloads for w in windows], fields)
        fields.finish()
        for effect, own in _through("closes", acting):
            effect.closes(self._model, batch.expand("actuator_biasprm"), **own)
        paces = (effect.pace(**own)[:, 0] for effect, own in _through("pace", acting))
        pace = np.prod([np.ones(len(windows)), *paces], axis=0)
        times_s = [t / fast for t, fast in zip(times_s, pace, strict=True)]
        away[:, 1] += self._differ * (pace[:, None] - 1) * [w.qvel for w in windows]
        n_steps = int(np.ceil(max(t[-1] for t in times_s) / self._step_s - 1e-9)) + 1
        before, drive = self._drive(windows, acting, n_steps, pace)
        if self._model.na:
            self._recall(batch, windows, before, pace)
        self._place(batch, windows, away, acting)
        if by_steps:
            bends = np.array([w.bends for w in windows]) + away[:, 2:]
            path = self._stepped(batch, windows, acting, drive, bends)
        else:
            path = self._rolled(batch, drive)
        return self._observed(path, windows, times_s, acting)

    def _place(
        self, batch: Batch, windows: Sequence[Window], away: np.ndarray, acting: Acting
    ) -> None:
        """Write the states at the starts: where encoders show them, less what those distort."""
        qpos = moved(self._model, np.array([w.qpos for w in windows]), away[:, 0])
        for effect, own in _through("unseen", acting):
            at = self.qpos_of_dof[list(effect.where.dofs)]
            qpos[:, at] = effect.unseen(qpos[:, None, at], **_deeper(own))[:, 0]
        qvel, since = np.array([w.qvel for w in windows]) + away[:, 1], np.zeros_like(away[:, 0])
        for effect, own in _through("latency_s", acting):
            dofs, late_s = list(effect.where.dofs), effect.latency_s(**own)
            for state, order in ((since, 0), (qvel, 1)):
                state[:, dofs] += [
                    (w.track(late, order) - w.track(0.0, order))[dofs]
                    for w, (late,) in zip(windows, late_s, strict=True)
                ]
        qpos = moved(self._model, qpos, since)
        batch.bind("qpos")[:], batch.bind("qvel")[:] = qpos, qvel
        self._settle(batch, windows)

    def _settle(self, batch: Batch, windows: Sequence[Window]) -> None:
        """Write where joints are whose position follows from others."""
        qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
        for row, window in enumerate(windows):
            self.robot.followers.settle(qpos[row], qvel[row], window.qpos)

    def slow(self, windows: Sequence[Window]) -> dict[str, np.ndarray]:
        """Return what windows have one value of (see `Log.slow`), (n_windows, 1) each."""
        own = [self.logs[w.log].slow(w.first, w.end) for w in windows]
        return {name: np.array([[one.get(name, np.nan)] for one in own]) for name in own[0]}

    def _recall(
        self, batch: Batch, windows: Sequence[Window], drive: np.ndarray, pace: np.ndarray
    ) -> None:
        """Bring the actuators' own states to where the time before the start leaves them.

        It is simulated with the joints led along as they were measured. When a log begins, drives
        are taken to be at rest: servos want to be where they are, filters had the first command.
        """
        since_s = self._step_s * np.arange(-drive.shape[1], 0)
        keys = [(w.log, w.first, fast) for w, fast in zip(windows, pace, strict=True)]
        led = {key: self._led(w, key[2] * since_s) for key, w in zip(keys, windows, strict=True)}
        qpos, logged = (np.array([led[key][k] for key in keys]) for k in (0, 1))
        qvel = rates(self._model, qpos, self._step_s)
        model, ctrl, act = self._model, batch.bind("ctrl"), batch.bind("act")
        own = np.flatnonzero(model.actuator_actnum == 1)
        gain, bias = model.actuator_gainprm[own, 0], model.actuator_biasprm[own]
        servo = np.array([is_servo(model, a) for a in own.tolist()], bool) & (gain != 0)
        filters = np.isin(model.actuator_dyntype[own], FILTERS) & ~servo
        ends = np.reshape([control_ends(model, a) for a in own.tolist()], (-1, 2)).T
        at, length = model.actuator_actadr[own], batch.bind("actuator_length")
        for k in range(drive.shape[1]):
            batch.bind("qpos")[:], batch.bind("qvel")[:] = qpos[:, k], qvel[:, k]
            for channel, actuator in self._controls:
                ctrl[:, actuator] = drive[:, k, channel]
            with suppress(SimulationError):  # what is lost here is lost after the start, too
                batch.step()
            rest = -(bias[:, 0] + bias[:, 1] * length[:, own]) * servo / np.where(servo, gain, 1.0)
            rest += np.clip(ctrl[:, own], *ends) * filters
            act[:, at] = np.where(logged[:, [k]] & (k > 0), act[:, at], rest)

    def _led(self, window: Window, since_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions as measured (k, nq), and since when there are any (k,)."""
        log = self.logs[window.log]
        at_s = log.times_s[window.first] + since_s
        qpos = np.tile(window.qpos, (len(since_s), 1))
        for k, signal in enumerate(self._signals):
            if signal.kind in ("position", "turn"):
                seen = np.isfinite(log.measured[:, k])
                qpos[:, signal.index] = np.interp(at_s, log.times_s[seen], log.measured[seen, k])
        return qpos, at_s >= log.times_s[0]

    def _drive(
        self, windows: Sequence[Window], acting: Acting, n_steps: int, pace: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what drives the steps before the start and those after, (n_sim, n, n_channels)."""
        lead_s = LEAD_S if any(True for _ in _through("command", acting)) else 0.0
        lead = round((MEMORY_S if self._model.na else lead_s) / self._step_s)
        delay_s = np.tile(self._delay_s, (len(windows), 1))
        for effect, own in _through("delay_s", acting):
            delay_s[:, list(effect.where.channels)] += effect.delay_s(**own)
        since_s = self._step_s * np.arange(-lead, n_steps + 1)
        drive = np.empty((len(windows), lead + n_steps, len(self.robot.drive)))
        known: dict[tuple[int, int, float, bytes], np.ndarray] = {}
        for row, window, fast, late in zip(drive, windows, pace, delay_s, strict=True):
            key = (window.log, window.first, fast, late.tobytes())
            if key not in known:
                from_s = self.logs[window.log].times_s[window.first]
                known[key] = self.logs[window.log].mean_drive(from_s + fast * since_s, fast * late)
            row[:] = known[key]
        for effect, own in _through("command", acting):
            at = list(effect.where.channels)
            drive[:, :, at] = effect.command(drive[:, :, at], self._step_s, **_deeper(own))
        return drive[:, :lead], drive[:, lead:]

    def _rolled(self, batch: Batch, drive: np.ndarray) -> np.ndarray:
        """Do what `_stepped` does where nothing is computed between steps, in one call."""
        model, n_sim, n_steps = self._model, *drive.shape[:2]
        control = np.zeros((n_sim, n_steps, model.nu + model.nv))
        for channel, actuator in self._controls:
            control[:, :, actuator] = drive[:, :, channel]
        for channel, dof in self._torques:
            control[:, :, model.nu + dof] = drive[:, :, channel]
        record = ("qpos", "qvel", *(["sensordata"] if model.nsensor else []))
        size = {"qpos": model.nq, "qvel": model.nv, "sensordata": model.nsensordata}
        out = {name: np.full((n_sim, n_steps, size[name]), np.nan) for name in record}
        first = [batch.bind(name)[:, None].copy() for name in record[:2]]
        lost = np.zeros(n_sim, bool)
        try:
            batch.rollout(n_steps, control, INPUTS, record, out=out)
        except SimulationError as error:
            lost[error.ids] = True
        after = np.abs(out["qvel"][:, [*range(0, n_steps, CHECK_EVERY), -1]])
        lost |= ~(after < DIVERGED_RATE).all(axis=(1, 2)) | batch.warning.any(axis=(1, 2))
        states = [
            np.concatenate([start, out[name][:, :-1]], axis=1)
            for name, start in zip(record, first, strict=False)
        ]
        path = np.concatenate([*states, *(out[name] for name in record[2:])], axis=2)
        path[lost] = np.nan
        return path.swapaxes(0, 1)

    @np.errstate(over="ignore", invalid="ignore")  # of a run that diverges, until that is seen
    def _stepped(
        self,
        batch: Batch,
        windows: Sequence[Window],
        acting: Acting,
        drive: np.ndarray,
        bends: np.ndarray,
    ) -> np.ndarray:
        """Step to the end; return qpos, qvel and sensors of every step (n_steps, n_sim, m)."""
        model, n_steps = self._model, drive.shape[1]
        nq_nv = model.nq + model.nv
        qpos, qvel, ctrl = (batch.bind(name) for name in ("qpos", "qvel", "ctrl"))
        applied = batch.bind("qfrc_applied")
        sensors = batch.bind("sensordata") if model.nsensor else np.zeros((len(windows), 0))
        path = np.empty((n_steps, len(windows), nq_nv + sensors.shape[1]))
        soft = list(_through("transmission", acting))
        between = Transmission(batch, soft, self.robot.followers.dofs) if soft else None
        acts = any(True for hook in FORCES for _ in _through(hook, acting))
        forces = _Forces(self, batch, windows, acting) if acts else None
        lost = np.zeros(len(windows), bool)
        for k in range(n_steps):
            applied[:] = 0.0
            for channel, actuator in self._controls:
                ctrl[:, actuator] = drive[:, k, channel]
            for channel, dof in self._torques:
                applied[:, dof] = drive[:, k, channel]
            if between and k == 0:
                between.place(bends)
                self._settle(batch, windows)
            shown_qpos, shown_qvel = path[k, :, : model.nq], path[k, :, model.nq : nq_nv]
            shown_qpos[:], shown_qvel[:] = qpos, qvel
            if between:
                between.show(shown_qpos, shown_qvel)
                between.apply()
            if forces:
                forces.apply(k * self._step_s)
            try:
                batch.step()
            except SimulationError as error:
                qvel[error.ids] = np.nan
            if between:
                between.advance()
            path[k, :, nq_nv:] = sensors
            if k % CHECK_EVERY == 0 or k == n_steps - 1:
                wild = ~(np.abs(qvel).max(axis=1) < DIVERGED_RATE)
                qpos[wild], qvel[wild] = model.qpos0, 0.0
                lost |= wild
        path[:, lost] = np.nan
        return path

    def _observed(
        self,
        path: np.ndarray,
        windows: Sequence[Window],
        times_s: Sequence[np.ndarray],
        acting: Acting,
    ) -> list[np.ndarray]:
        """Return what the columns show at the wanted times, (k, n_signals) a simulation."""
        nq, nv = self._model.nq, self._model.nv
        for effect, own in _through("seen", acting):
            at = self.qpos_of_dof[list(effect.where.dofs)]
            shown = effect.seen(path[:, :, at].swapaxes(0, 1), **_deeper(own))
            path[:, :, at] = shown.swapaxes(0, 1)
        first = {"position": 0, "turn": 0, "velocity": nq, "sensor": nq + nv}
        columns = [first[s.kind] + s.index for s in self._signals]
        late_s = np.tile(self._latency_s, (path.shape[1], 1))
        for effect, own in _through("latency_s", acting):
            at = [s.dof in effect.where.dofs for s in self._signals]
            late_s[:, at] += effect.latency_s(**own)
        found = []
        for sim, wanted_s in enumerate(times_s):
            since_s = wanted_s[:, None] - late_s[sim]
            steps = np.maximum(since_s, 0.0) / self._step_s
            before = np.minimum(steps.astype(int), len(path) - 2)
            one = path[:, sim, columns]
            at = before, np.arange(len(columns))
            after = before + 1, at[1]
            shown = one[at] + (steps - before) * (one[after] - one[at])
            if late_s[sim].any():
                shown += self._before_start(windows[sim], since_s, late_s[sim])
            found.append(shown)
        return found

    def _before_start(self, window: Window, since_s: np.ndarray, late_s: np.ndarray) -> np.ndarray:
        """Return how far the signals were from where they start, before it, (k, n_signals)."""
        away, first = np.zeros_like(since_s), {dof: q for q, dof in quaternions(self._model)}
        for k, s in enumerate(self._signals):
            if s.dof is None:
                continue
            order, shown_s = int(s.kind == "velocity"), late_s[k] + since_s[:, k]
            track = window.track(np.minimum(shown_s, late_s[k]), order)
            starts = window.track(late_s[k], order)
            if s.kind == "turn":
                q = window.qpos[first[s.dof] : first[s.dof] + 4]
                shown, from_there = (
                    turned(q, by[..., s.dof : s.dof + 3]) for by in (track, starts)
                )
                away[:, k] = (shown - from_there)[:, s.index - first[s.dof]]
            else:
                away[:, k] = track[:, s.dof] - starts[s.dof]
        return away


class _Forces:
    """Applies what effects compute at every step: torques on the joints, and dry friction."""

    def __init__(
        self, owner: Rollout, batch: Batch, windows: Sequence[Window], acting: Acting
    ) -> None:
        self._forces, self._frictions = (
            [(list(e.where.dofs), getattr(e, hook), own) for e, own in _through(hook, acting)]
            for hook in FORCES
        )
        began = [owner.logs[w.log].times_s[w.first] - owner.logs[w.log].times_s[0] for w in windows]
        self._log_time_s = np.array(began)[:, None]
        self._slow = owner.slow(windows)
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._applied, self._actuated = batch.bind("qfrc_applied"), batch.bind("qfrc_actuator")
        self._qpos_of_dof = owner.qpos_of_dof
        if self._frictions:
            self._frictionloss = batch.expand("dof_frictionloss")
            self._nominal = self._frictionloss.copy()

    def apply(self, time_s: float) -> None:
        """Write the forces of the step that begins at `time_s`."""
        torque, log_time_s = self._actuated + self._applied, self._log_time_s + time_s

        def of(dofs: list[int]) -> Motion:
            seen = self._qpos[:, self._qpos_of_dof[dofs]], self._qvel[:, dofs], torque[:, dofs]
            return Motion(self._slow, log_time_s, *seen)

        for dofs, force, own in self._forces:
            self._applied[:, dofs] += force(of(dofs), **own)
        if self._frictions:
            self._frictionloss[:] = self._nominal
        for dofs, friction, own in self._frictions:
            self._frictionloss[:, dofs] += friction(of(dofs), **own)


def stepwise(
    tune: Sequence[Tunable], effects: Sequence[RobotEffect], vectors: np.ndarray
) -> np.ndarray:
    """Tell in which vectors (n_vectors, n) an effect that is asked at every step does anything."""
    found = np.zeros(len(vectors), bool)
    for effect, own in _acting(tune, effects, vectors):
        if any(effect.acts_through(hook) for hook in STEPWISE):
            for parameter in effect.parameters:
                if parameter.null is not None:
                    found |= own[parameter.name][:, 0] != parameter.null
    return found


def _acting(tune: Sequence[Tunable], effects: Sequence[RobotEffect], values: np.ndarray) -> Acting:
    columns = iter(values.T[len(tune) :])
    return [(e, {p.name: next(columns)[:, None] for p in e.parameters}) for e in effects]


def _through(hook: str, acting: Acting):
    return ((effect, own) for effect, own in acting if effect.acts_through(hook))


def _deeper(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return values (n_sim, 1) as (n_sim, 1, 1), to broadcast against samples of joints."""
    return {name: value[:, :, None] for name, value in values.items()}
