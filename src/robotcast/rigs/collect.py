"""Collecting casts into a session: only what is missing, side by side, whatever fails."""

import itertools
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import yaml

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, PlannedCast, plan_action
from robotcast.files import atomic_folder, write_text
from robotcast.processes import process_pool
from robotcast.progress import Progress, silent
from robotcast.rigs.rig import CastNotUsed, Rig, RigStopped
from robotcast.sessions.session import (
    REQUEST_FILE,
    CastRequest,
    exclusive,
    missing_requests,
    number_requests,
    open_session,
    write_request,
)

Plan = Callable[..., PlannedCast]
Planner = Callable[[Action], PlannedCast]
Describe = Callable[[CastRequest, Path], str]


@dataclass(frozen=True)
class Collected:
    """What a call of `collect_casts` did.

    Attributes
    ----------
    stood : casts that were finished before.
    added : casts that were executed now.
    failed : why a cast failed, by its number.
    """

    stood: int
    added: int
    failed: dict[int, str]


def collect_casts(
    rig: Rig,
    actions: Sequence[tuple[int, Action]],
    folder: Path,
    limits: PlanLimits,
    progress: Progress = silent,
    *,
    plan: Plan = plan_action,
    describe: Describe | None = None,
) -> Collected:
    """Execute the casts of `actions` that the session in `folder` does not hold yet.

    Parameters
    ----------
    actions : (action_id, action); an action that is listed again is repeated.
    plan : makes the motion of an action; a function of a module, so that workers find it.
    describe : what `progress` shall say of a cast that was just finished.

    Raises `RigStopped` when the rig stopped: what is finished stays, a further call goes on.
    """
    planner = partial(plan, r0_m=rig.r0_m, limits=limits)
    requests = number_requests(actions)
    with exclusive(folder):
        session = open_session(
            folder, rig=rig.name, cable=rig.cable, r0_m=rig.r0_m, facts=rig.facts()
        )
        missing = missing_requests(session, requests)
        stood = len(requests) - len(missing)
        failed: dict[int, str] = {}
        progress(stood, len(requests))
        with closing(_outcomes(rig, missing, folder, planner)) as outcomes:
            for done, (request, reason) in enumerate(outcomes, 1):
                if reason:
                    failed[request.number] = reason
                _note_failure(folder, request, reason)
                said = describe(request, folder) if describe and not reason else ""
                progress(stood + done, len(requests), _state(request, said, len(failed)))
    return Collected(stood, len(missing) - len(failed), dict(sorted(failed.items())))


def _outcomes(
    rig: Rig, requests: list[CastRequest], folder: Path, planner: Planner
) -> Generator[tuple[CastRequest, str], None, None]:
    """Execute the requests; yield each with "" or with why it failed, as they finish."""
    workers = min(rig.workers, len(requests))
    if workers <= 1:
        yield from ((request, _execute(rig, request, folder, planner)) for request in requests)
        return
    with process_pool(workers, partial(_begin_worker, rig, folder, planner)) as pool:
        running = {pool.submit(_execute_in_worker, request): request for request in requests}
        yield from ((running[future], future.result()) for future in as_completed(running))


def _execute(rig: Rig, request: CastRequest, folder: Path, planner: Planner) -> str:
    try:
        planned = planner(request.action)
        with atomic_folder(folder / request.folder_name) as unfinished:
            write_request(request, unfinished)
            try:
                rig.cast(planned, request.number, unfinished)
            except CastNotUsed as error:
                _set_aside(unfinished, folder, request, str(error))
                raise
    except RigStopped as stop:
        _note_failure(folder, request, str(stop))
        raise
    except ValueError as error:
        return str(error)
    return ""


def _set_aside(unfinished: Path, folder: Path, request: CastRequest, reason: str) -> None:
    """Keep what was recorded of a cast that is not to be used, under a name that nobody reads."""
    if all(entry.name == REQUEST_FILE for entry in unfinished.iterdir()):
        return
    write_text(unfinished / "unused.yaml", yaml.safe_dump({"reason": reason}))
    place = next(
        path
        for attempt in itertools.count(1)
        if not (path := folder / f"unused_{request.number:05d}_{attempt}").exists()
    )
    unfinished.rename(place)


def _state(request: CastRequest, said: str, failed: int) -> str:
    parts = (f"cast {request.number}", said, f"{failed} failed" if failed else "")
    return ", ".join(part for part in parts if part)


def _note_failure(folder: Path, request: CastRequest, reason: str) -> None:
    path = folder / f"failed_{request.number:05d}.yaml"
    if reason:
        write_text(path, yaml.safe_dump({"number": request.number, "reason": reason}))
    else:
        path.unlink(missing_ok=True)


_in_worker: tuple[Rig, Path, Planner]


def _begin_worker(rig: Rig, folder: Path, planner: Planner) -> None:
    global _in_worker
    _in_worker = (rig, folder, planner)


def _execute_in_worker(request: CastRequest) -> str:
    rig, folder, planner = _in_worker
    return _execute(rig, request, folder, planner)
