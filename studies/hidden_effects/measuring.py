"""Measuring the drawn cases: how far what is hidden moves the paths, a set and a sealed answer."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.action import Action
from robotcast.casts.curves import PlanLimits
from robotcast.casts.plan import PlannedCast, plan_action
from robotcast.files import discard_unfinished, seal, unseal
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import write_measurement_set
from robotcast.processes import process_pool
from robotcast.rigs.virtual.hiding import Parameters, Shift
from robotcast.rigs.virtual.rig import Eye, VirtualRig, measure_cast
from robotcast.running import Progress, silent
from studies.hidden_effects.cases import Case, answer_path, choose_actions

RIG = "virtual (hidden effect benchmark)"
ASTRAY_M = 0.5


@dataclass(frozen=True)
class Bench:
    """What all cases share."""

    rigs: Mapping[str, VirtualRig]  # by cable, with nothing hidden
    feasible: np.ndarray  # (m, 6), the actions that cases are drawn from
    counts: Mapping[str, Any]  # how many casts, as `choose_actions` takes them
    eye: Eye  # how casts are tracked
    limits: PlanLimits
    shift_casts: int  # over which a mechanism's shift is measured


def measure_cases(
    cases: Sequence[Case],
    bench: Bench,
    folder: Path,
    reports: Path,
    workers: int,
    progress: Progress = silent,
) -> int:
    """Measure the cases that `folder` does not hold yet; return how many those were.

    A finished case is never measured again. One whose answer, in `reports`, was drawn or came
    out otherwise is refused: what was said of it was said of other casts.
    """
    sets = folder / "sets"
    discard_unfinished(sets)
    missing = [case for case in cases if not _stands(case, sets / case.name, reports)]
    stood = len(cases) - len(missing)
    progress(stood, len(cases))
    with process_pool(workers) as pool:
        for done, case in enumerate(missing, stood + 1):
            measured, answer = measure_case(case, bench, pool)
            path = answer_path(case.name, reports)
            if not path.exists():
                seal(answer, path)
            elif unseal(path) != answer:
                raise _other(path, "was sealed for casts of another rig")
            write_measurement_set(measured, sets / case.name)
            progress(done, len(cases), case.name)
    return len(missing)


def measure_case(case: Case, bench: Bench, pool: Executor) -> tuple[MeasurementSet, dict[str, Any]]:
    """Measure one case; return its set and its answer."""
    nominal = bench.rigs[case.cable]
    random = np.random.default_rng([case.seed, 1])
    chosen = choose_actions(bench.feasible, random, **bench.counts)
    planned = [plan_action(a, r0_m=nominal.r0_m, limits=bench.limits) for _, a in chosen]
    parameters, shifts = _fitted(case, bench, planned[: bench.shift_casts], pool)
    rig, eye = case.rig(nominal, parameters), replace(bench.eye, noise_s=case.noise_s)
    track = partial(measure_cast, rig, eye)
    trials = list(pool.map(track, planned, range(len(chosen)), [action for action, _ in chosen]))
    once = np.arange(bench.counts["repeated"], bench.counts["actions"])
    for row in random.permutation(once)[: case.outliers]:
        heading = random.uniform(-np.pi, np.pi)  # where the tracker follows something else
        away = ASTRAY_M * np.array([np.cos(heading), np.sin(heading)])
        trials[row] = replace(trials[row], waypoints_m=trials[row].waypoints_m + away)
    measured = MeasurementSet(rig.cable, rig.r0_m, eye.period_s, eye.noise_m, tuple(trials), RIG)
    answer = {
        "drawn": asdict(case),
        "effects": [
            {"effect": name, "parameters": given, "shift_percent": shifts[name]}
            for name, given in parameters.items()
        ],
        "shift_percent": shifts[""],
        "casts": len(trials),
    }
    return measured, answer


def further_casts(
    measured: MeasurementSet,
    answer: Mapping[str, Any],
    nominal: VirtualRig,
    actions: Sequence[Action],
    eye: Eye,
    limits: PlanLimits,
    pool: Executor,
) -> MeasurementSet:
    """Return the set of a case with one cast of each of `actions` added, what it hides at work.

    `nominal` is the rig of the case's cable with nothing hidden.
    """
    case = Case(**answer["drawn"])
    rig = case.rig(nominal, {one["effect"]: one["parameters"] for one in answer["effects"]})
    track = partial(measure_cast, rig, replace(eye, noise_s=case.noise_s))
    first = 1 + max(trial.trial for trial in measured.trials)
    named = 1 + max(trial.action_id for trial in measured.trials)
    ids = {action: named + n for n, action in enumerate(dict.fromkeys(actions))}
    planned = [plan_action(action, r0_m=rig.r0_m, limits=limits) for action in actions]
    numbers = range(first, first + len(actions))
    added = pool.map(track, planned, numbers, [ids[action] for action in actions])
    return replace(measured, trials=(*measured.trials, *added))


def _fitted(
    case: Case, bench: Bench, casts: Sequence[PlannedCast], pool: Executor
) -> tuple[dict[str, Parameters], dict[str, float]]:
    """Find the size of everything hidden in a case, one mechanism at a time.

    Returns the parameters of each mechanism and how far it alone moves the paths [% of cable
    length], below `case.wanted_percent` where its largest size moves them no farther; all together
    under "".
    """
    shift = Shift(case.rig(bench.rigs[case.cable], {}), casts, bench.eye.period_s, pool)
    found = {n: shift.sized(n, place, case.wanted_percent) for n, place in case.hidden.items()}
    parameters = {name: given for name, (given, _) in found.items()}
    shifts = {name: percent for name, (_, percent) in found.items()}
    together = shift.percent(parameters) if len(shifts) > 1 else sum(shifts.values())
    return parameters, {**shifts, "": together}


def _stands(case: Case, measured: Path, reports: Path) -> bool:
    answer = answer_path(case.name, reports)
    if answer.exists() and unseal(answer)["drawn"] != asdict(case):
        raise _other(answer, "was drawn otherwise than this case is now")
    if measured.exists() and not answer.exists():
        raise _other(measured, "has no answer")
    return measured.exists()


def _other(path: Path, what: str) -> ValueError:
    return ValueError(
        f"{path}: {what}; a case is never changed in place: remove the benchmark's folders, or "
        "draw into others (hidden_effects.folder, hidden_effects.reports)"
    )
