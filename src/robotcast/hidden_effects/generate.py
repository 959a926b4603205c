"""Measuring the drawn cases: a set and a sealed answer each."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.casts.limits import PlanLimits
from robotcast.casts.plan import PlannedCast, plan_action
from robotcast.files import discard_unfinished
from robotcast.hidden_effects.actions import CastCounts, choose_actions
from robotcast.hidden_effects.case import Case
from robotcast.hidden_effects.layout import answer_path, sets_folder
from robotcast.hidden_effects.mechanisms import Parameters
from robotcast.hidden_effects.seal import seal, unseal
from robotcast.hidden_effects.shift import fit_parameters, see_casts, shift_percent
from robotcast.measurements.measurement_set import MeasurementSet, Trial
from robotcast.measurements.writer import write_measurement_set
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.rigs.virtual.rig import Eye, VirtualRig, measure_cast

RIG = "virtual (hidden effect benchmark)"
ASTRAY_M = 0.5


@dataclass(frozen=True)
class Bench:
    """What all cases share.

    Attributes
    ----------
    rigs : cable → its rig with nothing hidden.
    feasible : ndarray of shape (m, 6), the actions that cases are drawn from.
    counts, eye, limits : how many casts, how they are tracked and planned.
    shift_casts : casts over which a mechanism's shift is measured.
    """

    rigs: Mapping[str, VirtualRig]
    feasible: np.ndarray
    counts: CastCounts
    eye: Eye
    limits: PlanLimits
    shift_casts: int


def generate_cases(
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
    discard_unfinished(sets_folder(folder))
    missing = [case for case in cases if not _stands(case, folder, reports)]
    stood = len(cases) - len(missing)
    progress(stood, len(cases))
    with process_pool(workers) as pool:
        for done, case in enumerate(missing, stood + 1):
            measured, answer = measure_case(case, bench, pool)
            _seal_once(answer, answer_path(case.name, reports))
            write_measurement_set(measured, sets_folder(folder) / case.name)
            progress(done, len(cases), case.name)
    return len(missing)


def measure_case(case: Case, bench: Bench, pool: Executor) -> tuple[MeasurementSet, dict[str, Any]]:
    """Measure one case; return its set and its answer."""
    nominal = bench.rigs[case.cable]
    random = np.random.default_rng([case.seed, 1])
    chosen = choose_actions(bench.feasible, bench.counts, random)
    planned = [plan_action(a, r0_m=nominal.r0_m, limits=bench.limits) for _, a in chosen]
    parameters, shifts = _fitted(case, bench, planned, pool)
    rig, eye = case.rig(nominal, parameters), replace(bench.eye, noise_s=case.noise_s)
    track = partial(measure_cast, rig, eye)
    trials = pool.map(track, planned, range(len(chosen)), [action for action, _ in chosen])
    measured = MeasurementSet(
        cable=rig.cable,
        r0_m=rig.r0_m,
        period_s=eye.period_s,
        noise_m=eye.noise_m,
        trials=tuple(_led_astray(list(trials), case, bench.counts, random)),
        rig=RIG,
    )
    answer = {
        "drawn": case.as_dict(),
        "effects": [
            {"effect": name, "parameters": given, "shift_percent": shifts[name]}
            for name, given in parameters.items()
        ],
        "shift_percent": shifts[""],
        "casts": len(measured.trials),
    }
    return measured, answer


def _fitted(
    case: Case, bench: Bench, planned: Sequence[PlannedCast], pool: Executor
) -> tuple[dict[str, Parameters], dict[str, float]]:
    """Return parameters and shifts of what is hidden; the shift of all together under ""."""
    nominal, casts = bench.rigs[case.cable], planned[: bench.shift_casts]
    period_s = bench.eye.period_s
    parameters, shifts = fit_parameters(case, nominal, casts, period_s, pool)
    if len(shifts) < 2:
        return parameters, {**shifts, "": sum(shifts.values())}
    seen = [
        see_casts(case.rig(nominal, hidden), casts, period_s, pool) for hidden in ({}, parameters)
    ]
    return parameters, {**shifts, "": shift_percent(seen[0], seen[1], nominal.cable.length_m)}


def _led_astray(
    trials: list[Trial], case: Case, counts: CastCounts, random: np.random.Generator
) -> list[Trial]:
    """Let the tracker follow something else, half a metre away, in some casts without repeats."""
    once = np.arange(counts.repeated, counts.actions)
    for row in random.permutation(once)[: case.outliers]:
        heading = random.uniform(-np.pi, np.pi)
        away = ASTRAY_M * np.array([np.cos(heading), np.sin(heading)])
        trials[row] = replace(trials[row], waypoints_m=trials[row].waypoints_m + away)
    return trials


def _stands(case: Case, folder: Path, reports: Path) -> bool:
    answer, measured = answer_path(case.name, reports), sets_folder(folder) / case.name
    if answer.exists() and unseal(answer)["drawn"] != case.as_dict():
        raise _other(answer, "was drawn otherwise than this case is now")
    if measured.exists() and not answer.exists():
        raise _other(measured, "has no answer")
    return measured.exists()


def _seal_once(answer: dict[str, Any], path: Path) -> None:
    if not path.exists():
        seal(answer, path)
    elif unseal(path) != answer:
        raise _other(path, "was sealed for casts of another rig")


def _other(path: Path, what: str) -> ValueError:
    return ValueError(
        f"{path}: {what}; a case is never changed in place: remove the benchmark's folders, or "
        "draw into others (hidden_effects.folder, hidden_effects.reports)"
    )
