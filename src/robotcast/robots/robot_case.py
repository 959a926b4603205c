"""The question that a folder with robot.yaml asks: its model, windows, candidates and noise.

It is asked for groups of joints first, then within the group that is named, and for single joints.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.diagnosis.decision import Unexplained, strengths
from robotcast.diagnosis.diagnose import Case
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.model import Axis, Wording
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.fitting.starts import spread
from robotcast.robots.effect import RobotEffect, effect_of_joints
from robotcast.robots.effects import Field
from robotcast.robots.floor import RobotFloor, read_step
from robotcast.robots.library import alone, candidates, lacking, parts_of
from robotcast.robots.logs import Log, periods, read_logs
from robotcast.robots.names import name_of_dof, names_of, refuse_unknown, to_si
from robotcast.robots.next_motions import Motions, motions
from robotcast.robots.robot_file import RobotFile, read_robot
from robotcast.robots.robot_model import Known, RobotModel
from robotcast.robots.rollout import Rollout
from robotcast.robots.sizes import Sizes, sizes_of
from robotcast.robots.windows import (
    GROUPS,
    LEAST_SAMPLES,
    StartStates,
    Window,
    cut,
    noise_of,
    of_quaternions,
)

LOSES = 0.5  # of how far a joint moves in a log: predictions that err by more have lost the trial
MOVES = 20.0  # times the noise: what moves less stands still
FITS = 4.0  # times as small an error, by which a drive's other sign or unit is told
TURNED = (-1.0, 1e3, 1e-3, 180 / np.pi, np.pi / 180)  # what drives may be off by: sign, unit
LONGEST_S = 2.0
SHORT = 0.5  # of a usual log: what is shorter does not shorten the windows
LEAST_NOISE = 1e-9  # of a joint that never moves
LIKE = 2  # times as many sets are tried as of a cable: mass, inertia and armature are alike
LOOKED_AT = 24  # starts from which the length of windows is judged
TUNING = 4  # steps of a fit to as many windows, before that


@dataclass(frozen=True)
class RobotCase:
    """A robot's model beside its logs, ready to be diagnosed."""

    robot: RobotFile
    logs: Sequence[Log]
    model: RobotModel
    starts: StartStates
    sizes: Sizes
    length_s: float
    floor: RobotFloor
    notes: tuple[str, ...]  # what to know of the data, a sentence each

    @property
    def wording(self) -> Wording:
        """What windows and signals are called, and the units that the logs have them in."""
        axes = []
        for (at, column), si in zip(self.robot.measured.items(), self.model.units.si, strict=True):
            unit = column.unit or at.unit
            axes.append(Axis(at.spoken, unit, scale=si / to_si(unit or None, at.unit, None, "")))
        return Wording(
            trial="window",
            trials="windows",
            group="part of a log",
            groups="parts of logs",
            mover="the robot",
            idle="Joints that go on as they moved",
            floor="repeats differ by" if self.floor.repeated else "noise leaves",
            axes=tuple(axes),
            factor_units={"time in the log": "s"},
        )

    @cached_property
    def motions(self) -> Motions:
        """What could be logged next."""
        noise = self.model.units.noise * self.model.units.si
        return motions(self.robot, self.model, self.sizes, self.length_s, noise)

    @cached_property
    def of_single_parts(self) -> dict[str, RobotEffect]:
        """Effects and fields of each joint, link and drive alone that the model was read without.

        Of few joints it has them all.
        """
        every = candidates(self.robot, self.sizes, alone(self.robot))
        return {one.name: one for one in every if one.name not in self.model.effects}

    def question(
        self, exclude: Sequence[str], fixed: Sequence[str], rule: Rule, effort: Effort
    ) -> Case:
        """Return what is asked of the diagnosis; effects of single joints may be named in it.

        No window is left out as measured wrongly: logs are checked for that, and one that every
        model misses from its start on is one in which a joint sticks.
        """
        left_out, single = {*exclude, *self.robot.exclude}, {**self.of_single_parts}
        every = self.model.effects | single
        made = ((n, effect_of_joints(n, every.values())) for n in fixed if n not in every)
        single |= {n: effect for n, effect in made if effect}
        every |= single
        laws = [n for n, e in every.items() if e.depends_on is None]
        refuse_unknown(f"{self.robot.path}: exclude", self.robot.exclude, laws)
        refuse_unknown("exclude", exclude, laws)
        refuse_unknown("effects", fixed, [*every])
        self.model.effects.update({n: single[n] for n in (*left_out, *fixed) if n in single})
        own = [every[n] for n in left_out]  # which what each joint has of it would bring back
        each = (n for n in laws if every[n].where.each)
        left_out |= {n for n in each if any(one.is_part_of(every[n]) for one in own)}
        names = [n for n in laws if n not in single]
        asked = Case(
            model=self.model,
            records=self.model.records,
            candidates=[n for n in names if n not in left_out and n not in fixed],
            fixed=tuple(fixed),
            draw=draw_field,
            rule=replace(rule, blunder=np.inf),
            effort=replace(effort, tried=LIKE * effort.tried),
        )
        return self.ask(asked)

    def ask(self, question: Case) -> Case:
        """Return a question as it is asked of this model."""
        return replace(
            question,
            model=self.model,
            records=self.model.records,
            wording=self.wording,
            further=lambda: self.motions.further,
            floor=self.floor.percent,
            floor_is_least=not self.floor.repeated,
            numerical_error=self.floor.step_percent,
            idle=self.model.idle,
        )

    def signal_floors(self, least_noise: float) -> np.ndarray:
        """Return every signal's floor, (n_signals,) in its units.

        Less than the least noise, of how far it moves in the window in the middle, is not believed.
        """
        paths = [r.measured - np.nanmean(r.measured, axis=0) for r in self.model.records]
        return np.maximum(self.floor.signals, least_noise * self.model.usual_misses(paths))

    def times_floor(self, found: Mapping[str, Any], least_noise: float) -> np.ndarray:
        """Return how many times its floor the found model misses each signal, (n_signals,)."""
        model, last = self.model, found["model"]
        if not last:
            return np.zeros(len(self.floor.signals))
        values = np.array([[p["value"] for p in last["parameters"].values()]], float)
        paths = model.predict(model.records, last["effects"], values)[0]
        floors = self.signal_floors(least_noise)
        missed = np.array([model.usual_misses(model.misses(paths)), floors])
        return np.divide(*(of_quaternions(list(self.robot.measured), one) for one in missed))

    def weighing(self, some: np.ndarray) -> "RobotCase":
        """Return the case with some signals, (n_signals,) bool, counted as much as all others."""
        old = self.model
        units, rollout = old.units.weighing(some, self.floor.signals), old.rollout
        noise = old.units.noise * old.units.si
        windows, threads = rollout.windows, rollout.threads
        model = RobotModel(self.robot, self.logs, windows, noise, old.known, threads, units)
        model.effects, model.step = old.effects, old.step.scaled(old.units.si / units.si)
        return replace(self, model=model, floor=RobotFloor.of(model))

    def about(self, found: Mapping[str, Any]) -> "RobotCase":
        """Return the case with windows and floor by the model that was named.

        With what was missing predictions hold longer, and the step errs by less. Fits may start
        from that model, too, in the place of what inverse dynamics tell.
        """
        last, old = found["model"], self.model
        values = np.array([p["value"] for p in last["parameters"].values()], float)
        known = Known(tuple(old.effects[name] for name in last["effects"]), values)
        noise = old.units.noise * old.units.si
        case = _case(self.robot, self.logs, noise, old.rollout.threads, known)
        why = (
            f"First {' and '.join(old.effects[name].text for name in found['verdict'])} was named, "
            f"in windows of {self.length_s:.2g} s. By that model these are longer or noise leaves "
            "less in them, and it was asked once more; compare keeps to the first windows."
        )
        every, at = case.model.effects | case.of_single_parts, len(old.parameters)
        for effect in (e for e in every.values() if e.depends_on is None):
            effect.guess = None
        for effect in known.effects:
            if effect.name in every:
                every[effect.name].guess = values[at : at + len(effect.parameters)]
            at += len(effect.parameters)
        return replace(case, notes=(why, *case.notes))


def read_case(folder: Path, threads: int = 0) -> RobotCase:
    """Read a robot's folder, and refuse in one sentence what cannot be diagnosed."""
    robot = read_robot(folder)
    logs = read_logs(robot)
    noise = np.maximum(noise_of(robot, logs), LEAST_NOISE)
    return _case(robot, logs, noise, threads, Known.nominal(robot))


def _case(
    robot: RobotFile, logs: Sequence[Log], noise: np.ndarray, threads: int, known: Known
) -> RobotCase:
    """Cut windows as long as the known model predicts, and say what it would miss if it were right.

    Where it loses the trials, or where its step errs by more than the noise, it is tuned first.
    Where it still predicts worse than joints do that go on as they moved, windows and floor are by
    the file's model with friction and rotor inertia of every joint as inverse dynamics tell them,
    if that predicts better than those.
    """
    starts, hints = StartStates(robot, logs, noise), []
    model, floor, length_s, holds = _cut(starts, threads, known)
    sizes = sizes_of(robot, logs, starts)
    if not known.effects and not (holds and robot.length_s is None):
        hints += filter(None, [_drive_that_fits(model)])
    if not (holds or known.effects) and any(not p.frozen for p in model.parameters):
        some = Inquiry(model, model.records, 1.0).beginnings(1.0, LOOKED_AT)
        fit = some.fit((), some.nominal(()), TUNING)
        known = Known((), some.values((), fit.vector)[0])
        model, floor, length_s, _ = _cut(starts, threads, known)
    _refuse_divergence(robot, model)
    lacks = () if known.effects or hints or _predicts(model) else lacking(robot, sizes)
    guesses = [one.guess for one in lacks if one.guess is not None]
    if any(guess.any() for guess in guesses):
        guessed = Known(tuple(lacks), np.concatenate([Known.nominal(robot).values, *guesses]))
        other = _cut(starts, threads, guessed)
        if _predicts(other[0]):
            hints.append(
                f"By the model as it is, windows would be {length_s:.2g} s long and noise would "
                f"leave {floor.percent:.2g} % in them: they are cut, and noise is judged, by that "
                "with as much friction and rotor inertia in every joint as its torques show."
            )
            model, floor, length_s, _ = other
    sizes = replace(sizes, window_s=length_s)
    model.effects = {one.name: one for one in candidates(robot, sizes, parts_of(robot))}
    notes = [*hints, *_notes(robot, logs, model.rollout.windows, length_s)]
    notes += _note_on_step(model, floor)
    return RobotCase(robot, logs, model, starts, sizes, length_s, floor, tuple(notes))


def _cut(
    starts: StartStates, threads: int, known: Known
) -> tuple[RobotModel, RobotFloor, float, bool]:
    """Return model, floor, length of windows [s], and whether the known model can be judged by.

    One far from its floor does not lead: starts would take up what it lacks.
    """
    robot, logs, longest_s = starts.robot, starts.logs, _longest(starts.logs)
    length_s = robot.length_s or _length(starts, threads, known, longest_s)
    holds = length_s >= longest_s or robot.length_s is not None
    while True:
        windows = cut(robot, logs, starts, length_s)
        model = RobotModel(robot, logs, windows, starts.noise, known, threads)
        least_s = 2 * LEAST_SAMPLES * periods(logs)
        if robot.length_s or length_s < least_s or model.starts_are_put_right():
            break
        length_s /= 2
    read_step(model)
    floor = RobotFloor.of(model)
    if model.is_led and model.usual_miss(model.nominal_misses) > Rule.beyond * floor.percent:
        known = replace(known, leads=False)
        model = RobotModel(robot, logs, windows, starts.noise, known, threads)
        read_step(model)
        floor = RobotFloor.of(model)
    return model, floor, length_s, holds and floor.step_percent < floor.noise_percent


def _note_on_step(model: RobotModel, floor: RobotFloor) -> list[str]:
    """Say what the model's step errs by, where that is more than noise."""
    step_s, percent = model.rollout.robot.model.opt.timestep, floor.whole_step_percent
    if percent < floor.noise_percent:
        return []
    errs = f"The model's own step of {1e3 * step_s:.3g} ms makes it err by {percent:.2g} % of the "
    errs += "usual motion, more than noise"
    if model.step.left == 1:
        return [f"{errs}: a shorter timestep shows more."]
    if model.step.shift is None:
        return [f"{errs}. But the logs follow that step, as those of a simulation do."]
    return [f"{errs}. The logs follow a shorter step, so predictions are put right for that."]


def draw_field(inquiry: Inquiry, left: Unexplained) -> dict[str, Any] | None:
    """Return a fitted torque over what it depends on, as `unexplained.field` has it."""
    field = inquiry.model.effects[left.field or ""]
    if not isinstance(field, Field):
        return None
    torque = field.parameters[0].unit
    length = "rad" if torque == "N m" else "m"
    unit = {"position": length, "speed": f"{length}/s", "torque": torque, "time": "s"}
    within = " within a wave" if field.repeats else ""
    own = f" [{unit[field.of]}]" if field.of in unit else ""
    return {
        "acts_on": field.where.name.replace("_", " "),
        "axes": [f"{field.of.removeprefix('by_')}{within}{own}"],
        "unit": torque,
        "points": [[knot] for knot in field.knots],
        "values": field.table(strengths(inquiry, left)[None])[0].T.tolist(),
    }


def _longest(logs: Sequence[Log]) -> float:
    """Return how long windows may be, so that logs give enough of them [s]."""
    spans_s = [log.times_s[-1] - log.times_s[0] for log in logs]
    shortest_s = min(span_s for span_s in spans_s if span_s >= SHORT * np.median(spans_s))
    return max(min(LONGEST_S, sum(spans_s) / (2 * GROUPS), shortest_s / 2.5), 1e-9)


def _length(starts: StartStates, threads: int, known: Known, longest_s: float) -> float:
    """Return how long the known model's predictions hold, the median over some starts [s].

    Longer windows show more of a small effect, until an error that grows has lost the trial. Of a
    joint that hardly moves that is one beyond its noise.
    """
    robot, logs, noise = starts.robot, starts.logs, starts.noise
    wide = replace(robot, most_windows=LOOKED_AT)
    windows = cut(wide, logs, starts, longest_s)
    rollout = Rollout(robot, logs, windows, threads)
    times = [logs[w.log].times_s[w.first : w.end] - logs[w.log].times_s[w.first] for w in windows]
    found = rollout.simulate(range(len(windows)), times, known.effects, known.values[None])[0]
    signals = list(robot.measured)
    at = [k for k, signal in enumerate(signals) if signal.kind in ("position", "turn")]
    travel = np.nanstd(np.vstack([log.measured for log in logs]), axis=0)
    travel = np.maximum(of_quaternions(signals, travel), MOVES * noise)[at]
    lost_s = []
    for path, window, times_s in zip(found, windows, times, strict=True):
        missed = path[: len(times_s), at] - logs[window.log].measured[window.first : window.end, at]
        off = np.nanmax(np.nan_to_num(np.abs(missed), nan=np.inf) / travel, axis=1) > LOSES
        lost_s.append(times_s[np.argmax(off)] if off.any() else longest_s)
    return float(np.clip(np.median(lost_s), LEAST_SAMPLES * periods(logs), longest_s))


def _refuse_divergence(robot: RobotFile, model: RobotModel) -> None:
    """Refuse a model that diverges."""
    lost = np.array([np.isnan(one).all() for one in model.nominal_misses])
    if lost.mean() > 0.5:
        raise ValueError(
            f"{robot.model_path}: the model diverges in {lost.sum()} of {len(lost)} windows: its "
            f"step of {robot.model.opt.timestep:g} s is too long for it, or a unit is wrong"
        )


def _median(model: RobotModel, found: Sequence[np.ndarray]) -> float:
    """Return what is missed in the window in the middle, in usual motions; where lost, infinity."""
    lost = [np.full_like(one, np.inf) if np.isnan(one).all() else one for one in found]
    return model.usual_miss(lost) / 100


def _predicts(model: RobotModel) -> bool:
    """Tell whether the known model misses no more than joints that go on as they moved."""
    idle = model.misses(model.idle(model.records))
    return _median(model, model.nominal_misses) <= _median(model, idle)


def _drive_that_fits(model: RobotModel) -> str:
    """Say which drive times what, another sign or unit, predicts far better, if any does."""
    rollout, known, units = model.rollout, model.known, model.units
    robot, every = rollout.robot, len(rollout.windows)
    windows = [rollout.windows[k] for k in spread(np.arange(every), LOOKED_AT)]
    columns, noise = list(robot.drive.values()), units.noise * units.si

    def scaled(own: Sequence[int], factor: float) -> RobotModel:
        scale = np.where(np.isin(range(len(columns)), own), factor, 1.0)
        logs = [replace(log, drive=log.drive * scale) for log in rollout.logs]
        return RobotModel(robot, logs, windows, noise, known, rollout.threads, units)

    def raw(other: RobotModel) -> float:
        times_s = [record.times_s for record in other.records]
        of = range(len(windows)), times_s, known.effects, known.values[None]
        return _median(other, other.misses(other.rollout.simulate(*of)[0] / units.si))

    some = [[c] for c in range(len(columns))]
    some += [[*range(len(columns))]] * (len(columns) > 1)
    tried = [(raw(scaled(own, by)), own, by) for own in some for by in TURNED]
    _, own, by = min(tried, key=lambda one: one[0], default=(np.inf, (), 1.0))
    best, as_it_is = scaled(own, by), scaled((), 1.0)
    least, now = (_median(one, one.nominal_misses) for one in (best, as_it_is))
    idle = _median(as_it_is, as_it_is.misses(as_it_is.idle(as_it_is.records)))
    if not least < min(now / FITS, idle):
        return ""
    how = "of the other sign" if by == -1 else f"times {by:.4g}"
    return (
        f"With {' and '.join(columns[c].name for c in own)} {how} the model as it is errs by "
        f"{100 * least:.3g} % of the usual motion, not {100 * now:.3g}: look at its sign, scale "
        "and unit."
    )


def _notes(
    robot: RobotFile, logs: Sequence[Log], windows: Sequence[Window], length_s: float
) -> list[str]:
    holds = "about as long as a prediction holds and a start can be put right"
    chosen = "as robot.yaml says" if robot.length_s else holds
    notes = [
        f"The logs were cut into {len(windows)} windows of {length_s:.2g} s, {chosen}; each starts "
        "from its measured state."
    ]
    joints = [name_of_dof(robot.model, dof) for dof in range(robot.model.nv)]
    groups = [
        f"{one.name.replace('_', ' ')} ({', '.join(joints[dof] for dof in one.dofs)})"
        for one in parts_of(robot)["joint"]
        if len(one.dofs) > 1
    ]
    if groups:
        notes.append(f"Joints are looked at together first: {'; '.join(groups)}.")
    driven = {channel.actuator for channel in robot.drive}
    if idle := [n for a, n in enumerate(names_of(robot.model, "actuator")) if a not in driven]:
        notes.append(f"No column drives {', '.join(idle)}: controls that stay 0.")
    if not robot.repeats:
        notes.append(
            "No log repeats another, so the noise floor is what the sensors' noise and the start "
            "states leave of a perfect model. What else differs from run to run is not in it: "
            "repeat one motion three times and name the logs in repeats."
        )
    lacks = np.array([np.isnan(log.measured).mean(axis=0) for log in logs])
    if lacks.any():
        log, k = map(int, np.unravel_index(lacks.argmax(), lacks.shape))
        notes.append(
            f"Samples are missing, most in {logs[log].path.name}: {100 * lacks[log, k]:.2g} % of "
            f"{[*robot.measured][k].spoken}. What was not measured decides nothing."
        )
    left = [log.path.name for k, log in enumerate(logs) if k not in {w.log for w in windows}]
    if left and len(windows) < robot.most_windows:
        notes.append(f"No window could be cut from {', '.join(left)}: left out.")
    if (parts := len({w.part for w in windows})) > len(logs):
        few = "One log is" if len(logs) == 1 else f"{len(logs)} logs are"
        notes.append(
            f"{few} too few to hold out whole ones: each was cut, into {parts} parts in all. What "
            "stays the same throughout a log, such as its temperature or a calibration, is not put "
            "to the test."
        )
    return notes
