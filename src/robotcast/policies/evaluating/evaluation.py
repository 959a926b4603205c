"""How far casts end from their targets (paper, "Physical Experiments")."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.plan import PlanLimits, PlannedCast, plan_action
from robotcast.measurements.measurement_set import Cable, MeasurementSet
from robotcast.policies.choosing.choice import Choice
from robotcast.policies.learning.forward_model import UncertainPredictor
from robotcast.progress import Progress, silent
from robotcast.rigs.collect import Plan, collect_casts
from robotcast.rigs.rig import Rig
from robotcast.sessions import CastRequest, Session, number_requests, read_session
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
    """What a rig did with a policy's choices.

    Attributes
    ----------
    ends_m : ndarray of shape (n_choices, repeats, 2); NaN where a cast failed or was not tracked.
    lost : why, by the cast's place (target, repeat).
    """

    ends_m: np.ndarray
    lost: Mapping[tuple[int, int], str]


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
    `settings`: a killed evaluation goes on where it was, another policy or another rig starts
    a new session, and no cast is ever replaced.

    Parameters
    ----------
    settings : what else decides what the rig does, as text.
    plan : makes the motion of an action.
    """
    actions = [
        (_FIRST_TARGET_ID + target, choice.action)
        for _ in range(repeats)
        for target, choice in enumerate(choices)
    ]
    requests = number_requests(actions)
    told = settings + yaml.safe_dump(rig.facts())
    folder = sessions / _fingerprint(requests, told)
    tracked: dict[int, np.ndarray | str] = {}

    def miss(request: CastRequest, folder: Path) -> str:
        end = tracked[request.number] = _tracked_rest(request, read_session(folder))
        target = request.action_id - _FIRST_TARGET_ID
        if isinstance(end, str):
            return f"target {target}, not tracked"
        away_m = np.linalg.norm(end - choices[target].target_m)
        return f"target {target}, {away_m * 100:.1f} cm off"

    failed = collect_casts(
        _RestOnly(rig), actions, folder, limits, progress, plan=plan, describe=miss
    ).failed
    session = read_session(folder)
    ends_m = np.full((len(choices), repeats, 2), np.nan)
    lost = {}
    for place, request in enumerate(requests):
        repeat, target = divmod(place, len(choices))
        end = failed.get(request.number) or tracked.get(request.number)
        if end is None:  # from an evaluation that was killed
            end = _tracked_rest(request, session)
        if isinstance(end, str):
            lost[target, repeat] = end
        else:
            ends_m[target, repeat] = end
    return Executed(ends_m, lost)


def _tracked_rest(request: CastRequest, session: Session) -> np.ndarray | str:
    """Return where a cast came to rest, (2,) [m], or why nobody knows."""
    try:
        return track_rest(session.cast_folder(request), session)
    except ValueError as error:
        return str(error)


def executed_table(subject: Subject, choices: Sequence[Choice], executed: Executed) -> pl.DataFrame:
    """Return evaluation.csv for executed casts; a lost cast has no endpoint and no error.

    `spread_x`, `spread_y` are the standard deviations that the model expects about
    `predicted_x`, `predicted_y` [m].
    """
    rows = []
    for target, (choice, ends) in enumerate(zip(choices, executed.ends_m, strict=True)):
        for repeat, end in enumerate(ends):
            action = choice.action.as_array()
            rows.append(
                _row(
                    subject,
                    ("executed", target, repeat),
                    choice.target_m,
                    action,
                    (choice.predicted_m, choice.spread_m),
                    end,
                    end - choice.target_m,
                )
            )
    return pl.DataFrame(rows).with_columns(pl.col(pl.Float64).fill_nan(None))


def predicted_table(
    subject: Subject, model: UncertainPredictor, held_out: MeasurementSet
) -> pl.DataFrame:
    """Return evaluation.csv for recorded casts, which cannot be executed again.

    Each held-out cast stands for a target: where it ended. The error is how far the forward
    model's endpoint for its action lies from there, so choosing an action is not tested.
    """
    actions = np.stack([t.action.as_array() for t in held_out.trials])
    rows = []
    said = zip(model.predict(actions), model.spread(actions), strict=True)
    for trial, action, (predicted, spread) in zip(held_out.trials, actions, said, strict=True):
        end = trial.endpoint_m
        place = ("predicted", trial.trial, 0)
        rows.append(_row(subject, place, end, action, (predicted, spread), end, predicted - end))
    return pl.DataFrame(rows)


def _row(
    subject: Subject,
    place: tuple[str, int, int],
    target: np.ndarray,
    action: np.ndarray,
    said: tuple[np.ndarray, np.ndarray],
    end: np.ndarray,
    away: np.ndarray,
) -> dict[str, Any]:
    kind, number, repeat = place
    predicted, spread = said
    error_m = float(np.linalg.norm(away))
    return {
        "kind": kind,
        "rig": subject.rig,
        "cable": subject.cable.name,
        "policy": subject.policy,
        "dataset": subject.dataset,
        "target": number,
        "target_x": float(target[0]),
        "target_y": float(target[1]),
        "repeat": repeat,
        **dict(zip(ACTION_COLUMNS, action.tolist(), strict=True)),
        "predicted_x": float(predicted[0]),
        "predicted_y": float(predicted[1]),
        "spread_x": float(spread[0]),
        "spread_y": float(spread[1]),
        "x": float(end[0]),
        "y": float(end[1]),
        "error_m": error_m,
        "error_percent": 100 * error_m / subject.cable.length_m,
    }


def _fingerprint(requests: Sequence[CastRequest], settings: str) -> str:
    """Name a session after its casts (without how often each is repeated) and `settings`."""
    actions = {request.action_id: request.action.as_array().tobytes() for request in requests}
    content = b"".join(actions[i] for i in sorted(actions)) + settings.encode()
    return hashlib.sha256(content).hexdigest()[:12]


@dataclass(frozen=True)
class _RestOnly:
    """A rig that films only where its casts come to rest."""

    rig: Rig

    @property
    def name(self) -> str:
        return self.rig.name

    @property
    def cable(self) -> Cable:
        return self.rig.cable

    @property
    def r0_m(self) -> float:
        return self.rig.r0_m

    @property
    def workers(self) -> int:
        return self.rig.workers

    def facts(self) -> dict[str, Any]:
        return self.rig.facts()

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = True
    ) -> None:
        self.rig.cast(planned, number, folder, rest_only=True)
