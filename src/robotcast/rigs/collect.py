"""Collecting casts into a session: only what is missing, side by side, whatever fails."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from robotcast import sessions
from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, PlannedCast, plan_action
from robotcast.files import atomic_folder, write_yaml
from robotcast.processes import process_pool
from robotcast.rigs import CastNotUsed, Rig, RigStopped
from robotcast.running import Progress, silent

Plan = Callable[..., PlannedCast]

REPEATS_OF_ONE = 3
FIRST_EXTRA_ID = 5_000  # of actions outside the grid, which numbers its own from 0


def choose_casts(
    actions: np.ndarray, casts: int, repeats: int, seed: int
) -> list[tuple[int, Action]]:
    """Choose up to `casts` of the feasible actions (m, 6) at random, by row.

    Further `repeats` casts repeat the first of the chosen actions, three times each. The choice
    for fewer casts is contained in the choice for more.
    """
    order = np.random.default_rng(seed).permutation(len(actions))[:casts]
    again = np.repeat(order, REPEATS_OF_ONE)[:repeats]
    return [(int(row), Action.from_array(actions[row])) for row in (*order, *again)]


def number_extra_actions(
    actions: Sequence[Action], casts: Sequence[sessions.CastRequest]
) -> list[tuple[int, Action]]:
    """Give actions that are of no grid the ids under which a session of `casts` may hold them.

    An action that the session was asked for before keeps its id, so that a call that was cut
    off can go on; one that stands there twice is cast twice.
    """
    known = {c.action: c.action_id for c in casts if c.action_id >= FIRST_EXTRA_ID}
    new = itertools.count(max(known.values(), default=FIRST_EXTRA_ID - 1) + 1)
    for action in actions:
        if action not in known:
            known[action] = next(new)
    return [(known[action], action) for action in actions]


@dataclass(frozen=True)
class Collected:
    """What a call of `collect_casts` did."""

    stood: int  # casts that were finished before
    added: int
    failed: dict[int, str]  # why a cast failed, by its number


def collect_casts(
    rig: Rig,
    actions: Sequence[tuple[int, Action]],
    folder: Path,
    limits: PlanLimits,
    progress: Progress = silent,
    *,
    plan: Plan = plan_action,
    describe: Callable[[sessions.CastRequest, Path], str] | None = None,
) -> Collected:
    """Execute the casts of `actions` that the session in `folder` does not hold yet.

    An action (action_id, action) that is listed again is repeated. `plan` makes its motion, a
    function of a module, so that workers find it; `describe` tells `progress` of a finished cast.
    Raises `RigStopped` when the rig stopped: what is finished stays, a further call goes on.
    """
    planner = partial(plan, r0_m=rig.r0_m, limits=limits)
    execute = partial(_execute, rig=rig, folder=folder, planner=planner)
    requests = sessions.number_requests(actions)
    with sessions.exclusive(folder):
        session = sessions.open_session(
            folder, rig=rig.name, cable=rig.cable, r0_m=rig.r0_m, facts=rig.facts()
        )
        missing = sessions.missing_requests(session, requests)
        stood = len(requests) - len(missing)
        failed: dict[int, str] = {}
        progress(stood, len(requests))
        with process_pool(min(rig.workers, len(missing))) as pool:
            outcomes = pool.map(execute, missing)
            for done, (request, reason) in enumerate(zip(missing, outcomes, strict=True), 1):
                if reason:
                    failed[request.number] = reason
                _note_failure(folder, request, reason)
                note = describe(request, folder) if describe and not reason else ""
                failures = f"{len(failed)} failed" if failed else ""
                parts = (f"cast {request.number}", note, failures)
                progress(stood + done, len(requests), ", ".join(filter(None, parts)))
    return Collected(stood, len(missing) - len(failed), dict(sorted(failed.items())))


def _execute(request: sessions.CastRequest, *, rig: Rig, folder: Path, planner: Plan) -> str:
    try:
        planned = planner(request.action)
        with atomic_folder(folder / request.folder_name) as unfinished:
            sessions.write_record(request, unfinished)
            try:
                rig.cast(planned, request.number, unfinished)
            except CastNotUsed as error:
                _set_aside(unfinished, folder, request.number, str(error))
                raise
    except RigStopped as stop:
        _note_failure(folder, request, str(stop))
        raise
    except ValueError as error:
        return str(error)
    return ""


def _set_aside(unfinished: Path, folder: Path, number: int, reason: str) -> None:
    """Keep what was recorded of a cast that is not to be used, under a name that nobody reads."""
    if all(entry.name == sessions.REQUEST_FILE for entry in unfinished.iterdir()):
        return
    write_yaml(unfinished / "unused.yaml", {"reason": reason})
    names = (folder / f"unused_{number:05d}_{attempt}" for attempt in itertools.count(1))
    unfinished.rename(next(path for path in names if not path.exists()))


def _note_failure(folder: Path, request: sessions.CastRequest, reason: str) -> None:
    path = folder / f"failed_{request.number:05d}.yaml"
    if reason:
        write_yaml(path, {"number": request.number, "reason": reason})
    else:
        path.unlink(missing_ok=True)
