"""How far casts end from their targets (paper, "Physical Experiments")."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import action_factors
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.files import digest
from robotcast.measurements.measurement_set import Cable, MeasurementSet
from robotcast.policies.choosing import Choice
from robotcast.policies.forward_model import ForwardModel
from robotcast.rigs import Rig
from robotcast.rigs.collect import Plan, collect_casts
from robotcast.running import Progress, silent
from robotcast.sessions import CastRequest, number_requests, read_session
from robotcast.vision.tracker import track_rest

# Evaluated casts are numbered apart from collected ones, so that a virtual rig draws them
# another chance; every policy's casts at one target draw the same.
_FIRST_TARGET_ID = 9_000


@dataclass(frozen=True)
class Subject:
    """What was tested: the names that every row of evaluation.csv carries."""

    rig: str
    cable: Cable
    policy: str
    dataset: str


@dataclass(frozen=True)
class Executed:
    """Where casts ended, NaN where one is lost."""

    ends_m: np.ndarray  # (n_choices, repeats, 2)
    lost: Mapping[tuple[int, int], str]  # why, by its place


def execute_choices(
    rig: Rig,
    choices: Sequence[Choice],
    repeats: int,
    sessions: Path,
    settings: str,
    limits: PlanLimits,
    progress: Progress = silent,
    *,
    plan: Plan = plan_action,
) -> Executed:
    """Execute every choice `repeats` times and track where the free end comes to rest.

    The casts lie in a session of their own under `sessions`, named after the chosen actions and
    `settings`, all else that decides what the rig does: a killed evaluation goes on where it was,
    another policy or another rig starts a new session, and no cast is ever replaced.
    """
    actions = [(n, choice.action) for n, choice in enumerate(choices, _FIRST_TARGET_ID)] * repeats
    chosen = (choice.action.as_array() for choice in choices)
    folder = sessions / digest(*chosen, settings, yaml.safe_dump(rig.facts()))[:12]

    @cache
    def rest(request: CastRequest) -> np.ndarray | str:
        session = read_session(folder)
        try:
            return track_rest(session.cast_folder(request), session)
        except ValueError as error:
            return str(error)

    def describe(request: CastRequest, _: Path) -> str:
        target, end = request.action_id - _FIRST_TARGET_ID, rest(request)
        if isinstance(end, str):
            return f"target {target}, not tracked"
        away_m = np.linalg.norm(end - choices[target].target_m)
        return f"target {target}, {away_m * 100:.1f} cm off"

    same = {n: getattr(rig, n) for n in ("name", "cable", "r0_m", "workers", "facts")}
    filmed: Any = SimpleNamespace(**same, cast=partial(rig.cast, rest_only=True))  # the rest alone
    done = collect_casts(filmed, actions, folder, limits, progress, plan=plan, describe=describe)
    ends_m = np.full((len(choices), repeats, 2), np.nan)
    lost = {}
    for place, request in enumerate(number_requests(actions)):
        repeat, target = divmod(place, len(choices))
        end = done.failed.get(request.number) or rest(request)
        (lost if isinstance(end, str) else ends_m)[target, repeat] = end
    return Executed(ends_m, lost)


def executed_table(subject: Subject, choices: Sequence[Choice], executed: Executed) -> pl.DataFrame:
    """Return evaluation.csv for executed casts; a lost cast has no endpoint and no error."""
    return _table(subject, "executed", range(len(choices)), choices, executed.ends_m)


def predicted_table(
    subject: Subject, model: ForwardModel, held_out: MeasurementSet
) -> pl.DataFrame:
    """Return evaluation.csv for recorded casts, which cannot be executed again.

    Each held-out cast stands for a target: where it ended. The error is how far the forward
    model's endpoint for its action lies from there, so choosing an action is not tested.
    """
    trials = held_out.rested.trials
    actions = np.stack([t.action.as_array() for t in trials])
    said = zip(trials, model.predict(actions), model.spread(actions), strict=True)
    choices = [Choice(t.endpoint_m, t.action, end_m, spread_m) for t, end_m, spread_m in said]
    ends_m = np.stack([t.endpoint_m for t in trials])[:, None]
    return _table(subject, "predicted", [t.trial for t in trials], choices, ends_m)


def _table(
    subject: Subject,
    kind: str,
    targets: Sequence[int],
    choices: Sequence[Choice],
    ends_m: np.ndarray,
) -> pl.DataFrame:
    rows, names = [], {"kind": kind, **vars(subject), "cable": subject.cable.name}
    for target, choice, repeated_m in zip(targets, choices, ends_m, strict=True):
        aimed = {"target": target, **_xy("target_", choice.target_m)}
        chosen = action_factors(choice.action.as_array())
        expected = _xy("predicted_", choice.predicted_m) | _xy("spread_", choice.spread_m)
        for repeat, end_m in enumerate(repeated_m):
            reached_m = end_m if kind == "executed" else choice.predicted_m
            error_m = float(np.linalg.norm(reached_m - choice.target_m))
            errors = {"error_m": error_m, "error_percent": 100 * error_m / subject.cable.length_m}
            came = {**expected, **_xy("", end_m), **errors}
            rows.append({**names, **aimed, "repeat": repeat, **chosen, **came})
    return pl.DataFrame(rows).with_columns(pl.col(pl.Float64).fill_nan(None))


def _xy(prefix: str, point_m: np.ndarray) -> dict[str, float]:
    return {f"{prefix}x": float(point_m[0]), f"{prefix}y": float(point_m[1])}
