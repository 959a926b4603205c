"""The question that a folder with robot.yaml asks: its model, windows, candidates and noise.

It is asked for groups of joints first, then within the group that is named, and for single joints.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.diagnosis.decision import Unexplained, strengths
from robotcast.diagnosis.diagnose import Case, Tell, diagnose, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.library import library_at
from robotcast.diagnosis.model import Axis, Wording
from robotcast.diagnosis.report import unexplained
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.robots.effect import RobotEffect
from robotcast.robots.effects import Field
from robotcast.robots.library import alone, candidates, parts_of, refuse_unknown
from robotcast.robots.logs import Log, periods, read_logs
from robotcast.robots.names import name_of_dof, names_of, to_si
from robotcast.robots.next_motions import Motions, motions
from robotcast.robots.robot_file import RobotFile, read_robot
from robotcast.robots.robot_model import RobotFloor, RobotModel, of_quaternions, tuned_parameters
from robotcast.robots.rollout import Rollout
from robotcast.robots.sizes import Sizes, sizes_of
from robotcast.robots.windows import GROUPS, LEAST_SAMPLES, StartStates, Window, cut, noise_of
from robotcast.running import Progress, silent

LOSES = 0.5  # of how far a joint moves in a log: predictions that err by more have lost the trial
MOVES = 20.0  # times the noise: what moves less stands still
FAR_OFF = 2.0  # times the usual motion, from which a unit may be wrong
LONGEST_S = 2.0
SHORT = 0.5  # of a usual log: what is shorter does not shorten the windows
LEAST_NOISE = 1e-9  # of a joint that never moves
LOOKED_INTO = 20  # effects of single joints and links that are tried at once
LIKE = 2  # times as many sets are tried as of a cable: mass, inertia and armature are alike
LOOKED_AT = 24  # starts from which the length of windows is judged


@dataclass(frozen=True)
class RobotCase:
    """A robot's model beside its logs, ready to be diagnosed.

    Attributes
    ----------
    notes : what to know of the data, a sentence each.
    """

    robot: RobotFile
    model: RobotModel
    starts: StartStates
    sizes: Sizes
    length_s: float
    floor: RobotFloor
    notes: tuple[str, ...]

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
        left_out, single = {*exclude, *self.robot.exclude}, self.of_single_parts
        every = self.model.effects | single
        laws = [n for n, e in every.items() if e.depends_on is None]
        refuse_unknown(f"{self.robot.path}: exclude", self.robot.exclude, laws)
        refuse_unknown("exclude", exclude, laws)
        refuse_unknown("effects", fixed, [*every])
        self.model.effects.update({n: single[n] for n in (*left_out, *fixed) if n in single})
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
        )

    def times_floor(self, found: Mapping[str, Any]) -> np.ndarray:
        """Return how many times its floor the found model misses each signal, (n_signals,)."""
        model, last = self.model, found["model"]
        if not last:
            return np.zeros(len(self.floor.signals))
        values = np.array([[p["value"] for p in last["parameters"].values()]], float)
        paths = model.predict(model.records, last["effects"], values)[0]
        missed = np.array([model.usual_misses(model.misses(paths)), self.floor.signals])
        return np.divide(*(of_quaternions(list(self.robot.measured), one) for one in missed))

    def weighing(self, some: np.ndarray) -> "RobotCase":
        """Return the case with some signals, (n_signals,) bool, counted as much as all others."""
        old = self.model
        units, rollout = old.units.weighing(some, self.floor.signals), old.rollout
        noise = old.units.noise * old.units.si
        windows, threads = rollout.windows, rollout.threads
        model = RobotModel(self.robot, rollout.logs, windows, noise, (), threads, units)
        model.effects = old.effects
        return replace(self, model=model, floor=RobotFloor.of(model))


def read_case(folder: Path, threads: int = 0) -> RobotCase:
    """Read a robot's folder, and refuse in one sentence what cannot be diagnosed."""
    robot = read_robot(folder)
    logs = read_logs(robot)
    noise = np.maximum(noise_of(robot, logs), LEAST_NOISE)
    starts = StartStates(robot, logs, noise)
    length_s = robot.length_s or _length(robot, logs, starts, noise, threads)
    while True:
        windows = cut(robot, logs, starts, length_s)
        model = RobotModel(robot, logs, windows, noise, (), threads)
        least_s = 2 * LEAST_SAMPLES * periods(logs)
        if robot.length_s or length_s < least_s or model.starts_are_put_right():
            break
        length_s /= 2
    sizes = replace(sizes_of(robot, logs, starts), window_s=length_s)
    model.effects = {one.name: one for one in candidates(robot, sizes, parts_of(robot))}
    missed = _nominal_miss(robot, model)
    floor = RobotFloor.of(model)
    notes = _notes(robot, logs, windows, length_s)
    if missed > FAR_OFF:
        notes.insert(
            0,
            f"Within {length_s:.2g} s the model as it is errs by {missed:.0f} times the usual "
            "motion: look whether a unit, a sign or a column in robot.yaml is wrong.",
        )
    if floor.step_percent > np.sqrt(0.5) * floor.percent:
        notes.append(
            f"The model's own step of {1e3 * robot.model.opt.timestep:.3g} ms makes it err by "
            f"{float(f'{floor.step_percent:.2g}'):g} % of the usual motion, more than noise: a "
            "shorter timestep shows more."
        )
    return RobotCase(robot, model, starts, sizes, length_s, floor, tuple(notes))


def draw_field(inquiry: Inquiry, left: Unexplained) -> dict[str, Any] | None:
    """Return a fitted torque over what it depends on, as `unexplained.field` has it."""
    field = inquiry.model.effects[left.field or ""]
    if not isinstance(field, Field):
        return None
    torque = field.parameters[0].unit
    length = "rad" if torque == "N m" else "m"
    unit = {"position": length, "speed": f"{length}/s", "torque": torque, "time": "s", "log": ""}
    within = " within a wave" if field.repeats else ""
    return {
        "acts_on": field.where.name.replace("_", " "),
        "axes": [f"{field.of}{within} [{unit[field.of]}]"],
        "unit": torque,
        "points": [[knot] for knot in field.knots],
        "values": field.table(strengths(inquiry, left)[None])[0].T.tolist(),
    }


def _length(
    robot: RobotFile, logs: Sequence[Log], starts: StartStates, noise: np.ndarray, threads: int
) -> float:
    """Return how long the nominal model's predictions hold, the median over some starts [s].

    Longer windows show more of a small effect, until an error that grows has lost the trial. Of a
    joint that hardly moves that is one beyond its noise.
    """
    spans_s = [log.times_s[-1] - log.times_s[0] for log in logs]
    shortest_s = min(span_s for span_s in spans_s if span_s >= SHORT * np.median(spans_s))
    longest_s = max(min(LONGEST_S, sum(spans_s) / (2 * GROUPS), shortest_s / 2.5), 1e-9)
    wide = replace(robot, most_windows=LOOKED_AT)
    windows = cut(wide, logs, starts, longest_s)
    rollout = Rollout(robot, logs, windows, threads)
    times = [logs[w.log].times_s[w.first : w.end] - logs[w.log].times_s[w.first] for w in windows]
    nominal = np.array([[p.nominal for p in tuned_parameters(robot)]])
    found = rollout.simulate(range(len(windows)), times, (), nominal)[0]
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


def _nominal_miss(robot: RobotFile, model: RobotModel) -> float:
    """Return what the nominal model misses, in usual motions; refuse one that diverges."""
    found = model.nominal_misses
    lost = np.array([np.isnan(one).all() for one in found])
    if lost.mean() > 0.5:
        raise ValueError(
            f"{robot.model_path}: the model diverges in {lost.sum()} of {len(lost)} windows: its "
            f"step of {robot.model.opt.timestep:g} s is too long for it, or a unit is wrong"
        )
    return model.usual_miss(found) / 100


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


def diagnose_by_joint(
    case: RobotCase, question: Case, tell: Tell, progress: Progress = silent
) -> dict[str, Any]:
    """Diagnose a robot, groups of joints first; then, where something is missing, single joints.

    Where an effect of a whole group is named, it competes with those of its joints and their
    special cases: it is as simple as one of them, and stays where all joints have it. What else was
    named is tried beside them. For as long as more is missing and named, of the effects of all
    single joints and links those are tried beside it that the slopes promise most of, and fields of
    single joints. Where the whole is at its floor and some signals are not, they are looked at so.
    """
    found, ask = diagnose(question, tell, progress), partial(_ask_again, [], tell, progress)
    effects, single = case.model.effects, _of_single_joints(case, question)
    laws = [n for n, e in single.items() if e.depends_on is None]
    named = [n for n in found["verdict"] if n in effects]
    if own := [n for n in laws if any(single[n].is_part_of(effects[name]) for name in named)]:
        effects.update({n: single[n] for n in laws})
        why = f"First, of a group: {' + '.join(named)}. Then its joints were told apart."
        cases = Inquiry(case.model, question.records, 1.0).special_cases
        own += [one for n in own for one in cases(n, laws)]
        asked = replace(question, candidates=list(dict.fromkeys([*named, *own])))
        found = ask(asked, found, why)
    while laws and _unfinished(question, found):
        effects.update(single)
        named = [n for n in found["verdict"] if n in effects]
        why = f"Too little was explained by {' + '.join(named) or 'what all joints may lack'}"
        found = _look_at(case, question, found, laws, why, ask)
        if found["code"] != "named" or len(found["verdict"]) <= len(named):
            break
    some, standing = _standing_out(case, question, found)
    if some.any() and not some.all():
        effects.update(single)
        why = f"{standing}: that counts here as much as all other signals together"
        weighed, laws = case.weighing(some), [*laws, *question.candidates]
        question, ask = weighed.ask(question), partial(ask, weighed=True)
        found = _look_at(weighed, question, found, laws, why, ask)
        some, standing = _standing_out(case, question, found)
    if some.any() and not found["unexplained"]:
        left = unexplained(Inquiry(case.model, question.records, 1.0), Unexplained(), draw_field)
        sentence = f"{found['sentence']} But {standing}."
        found = {**found, "unexplained": left, "sentence": sentence}
        tell(found)
    return found


def _of_single_joints(case: RobotCase, question: Case) -> dict[str, RobotEffect]:
    """Return effects and fields of single joints, links and drives, but of what was left out."""
    effects, tried = case.model.effects, question.candidates
    left_out = [
        e
        for n, e in effects.items()
        if n not in tried and e.depends_on is None
        if not any(effects[other].is_part_of(e) for other in tried)
    ]
    others = {n: e for n, e in case.of_single_parts.items() if n not in effects}
    return {n: e for n, e in others.items() if not any(map(e.is_part_of, left_out))}


def _look_at(
    case: RobotCase,
    question: Case,
    found: dict[str, Any],
    laws: Sequence[str],
    why: str,
    ask: Callable[[Case, dict[str, Any], str], dict[str, Any]],
) -> dict[str, Any]:
    """Try what promises most of some effects beside those that are named."""
    effects = case.model.effects
    named = [n for n in found["verdict"] if n in effects]
    others = [n for n in laws if n not in named]
    if not others or len(named) == question.rule.most_effects:
        return found
    parts = [n for n in others if any(effects[n].is_part_of(effects[name]) for name in named)]
    promising = _promising(case, question, found, named, others)
    promising += [n for n in parts if n not in promising]
    why += (
        f", so of {len(others)} effects of single joints and links {len(promising)} were tried: "
        "those that promise most, their special cases, and what a named group may come down to."
    )
    comparisons = len(named) + len(others)
    asked = replace(question, candidates=[*named, *promising], comparisons=comparisons)
    return ask(asked, found, why)


def _standing_out(
    case: RobotCase, question: Case, found: Mapping[str, Any]
) -> tuple[np.ndarray, str]:
    """Return which signals (n_signals,) are above their floor, more than is honest; and say so.

    Of many signals at their floor, one that is not would hardly be seen.
    """
    rule, code, times = question.rule, found["code"], case.times_floor(found)
    least = rule.beyond if code == "named" and question.floor_is_least else rule.at_floor
    some = (times > least) & (code in ("none", "named"))
    pairs = zip(case.wording.axes, times, some, strict=True)
    told = " and ".join(f"{axis.name} at {by:.1f}" for axis, by, own in pairs if own)
    return some, f"{told.replace(' at ', ' is at ', 1)} times what {case.wording.floor}"


def _unfinished(question: Case, found: dict[str, Any]) -> bool:
    """Tell whether a diagnosis leaves more than noise in the window in the middle, or says so.

    That is asked of a named effect, too, which the verdict lets leave more.
    """
    if not found["conclusive"] or found["unexplained"] or found["code"] not in ("none", "named"):
        return found["conclusive"]
    left, floor = found["ladder"][-1]["heldout_typical_error_percent"], found["noise_floor_percent"]
    return left > question.rule.at_floor * floor


def _ask_again(
    said: list[str],
    tell: Tell,
    progress: Progress,
    question: Case,
    found: dict[str, Any],
    why: str,
    weighed: bool = False,
) -> dict[str, Any]:
    """Return another diagnosis if it names something else, or what is missing where nothing did.

    Where signals are `weighed` otherwise, it stands where the whole named nothing, else it must
    keep what that named. It is `said` why each one that stands was asked for.
    """
    again = diagnose(question, tell, progress)
    other = {*again["verdict"]} != {*found["verdict"]}
    was, now = ((one["unexplained"] or {}).get("explains", False) for one in (found, again))
    clearer = again["code"] == "unknown" and found["code"] != "named" and (other or now > was)
    better = again["code"] == "named" and other
    if weighed:
        clearer = found["code"] == "none"
        better = better and {*found["verdict"]} < {*again["verdict"]}
    if clearer or better:
        said.append(why)
        found = {**again, "notes": [*said, *again["notes"]]}
    tell(found)
    return found


def _promising(
    case: RobotCase,
    question: Case,
    found: dict[str, Any],
    named: Sequence[str],
    others: Sequence[str],
) -> list[str]:
    """Return which of the others promise most beside the model found, then their special cases."""
    effort, acting, own = question.effort, (*question.fixed, *named), case.model.parameters
    early = Inquiry(case.model, question.records, floor_and_noise(question)[1]).beginnings(
        effort.early, effort.some
    )
    known = (found["model"] or found["base"])["parameters"]
    names = [p.name for p in own]
    names += [f"{e}.{p.name}" for e in acting for p in case.model.effects[e].parameters]
    tuned = [
        float(p.to_unit(np.asarray(known[name]["value"] if name in known else p.nominal)))
        for name, p in zip(names, early.parameters(acting), strict=True)
    ]
    begun = early.fit(acting, np.array(tuned), 0)
    some = library_at(early, acting, others, begun).best(1, LOOKED_INTO, acting)
    best = [effects[-1] for effects in some]
    cases = (one for name in best for one in early.special_cases(name, others))
    return list(dict.fromkeys([*best, *cases]))
