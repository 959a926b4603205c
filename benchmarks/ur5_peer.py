"""The UR5 rig's promises, in figures: the genuine ur_rtde client against the loopback controller.

    python benchmarks/ur5_peer.py --casts 30 --faults 10 --actions 2000

Prints what was seen: casts that became a measurement set; faults after which something moved;
random and malicious actions that reached the arm; missed deadlines; the camera's offset. With
--host, only streams to the controller there (URSim) and counts missed deadlines.
"""

import argparse
import hashlib
import itertools
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # for tests/
# ruff: noqa: E402

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.rigs import RigStopped
from robotcast.rigs.collect import Collected, collect_casts
from robotcast.rigs.envelope import are_feasible, broken_rules
from robotcast.rigs.ur5.arm import Arm, RobotLog, ServoSettings, WatchSettings
from robotcast.rigs.ur5.motion import JointMotion, WholeMotion, refuse_unsafe, sway
from robotcast.sessions import read_session
from robotcast.vision.tracker import track_session
from tests.rigs.peer.controller import Settings
from tests.rigs.peer.lab import CAST_ENVELOPE, GRIPPER, HOME_RAD, RESET_ENVELOPE, scene, ur5_rig
from tests.rigs.peer.process import ROBOT_FAULTS, running_peer
from tests.rigs.small_rig import R0_M

HOME = np.array(HOME_RAD)
PATIENT = Settings(HOME_RAD, patience_s=3.0)
HASTY = replace(PATIENT, haste=3.0)
SESSION_FAULTS = (*ROBOT_FAULTS, "camera gone", "cable crooked", "not confirmed")
LIMITS = PlanLimits()
CYCLE_S = 0.008


def arm_at(host: str, watchdog_hz: float, **watch: float) -> Arm:
    return Arm(host, GRIPPER, ServoSettings(watchdog_hz=watchdog_hz), WatchSettings(**watch))


def draw_action(random: np.random.Generator) -> Action:
    """An action that can be planned, though the envelope may refuse it."""
    side = random.choice([-1.0, 1.0])
    while True:
        numbers = random.uniform([0.25, 0.55, -0.9, 0.55, 0.0, 1.0], [0.9, 0.75, -0.2, 0.8, 1, 1.6])
        action = Action.from_array(numbers * [side, 1, side, 1, side, 1])
        try:
            plan_action(action, r0_m=R0_M, limits=LIMITS)
        except ValueError:
            continue
        return action


def draw_allowed(random: np.random.Generator, count: int) -> list[Action]:
    """Actions that the envelope allows too."""
    drawn: list[Action] = []
    while len(drawn) < count:
        action = draw_action(random)
        if are_feasible(action.as_array()[None], R0_M, LIMITS, CAST_ENVELOPE)[0]:
            drawn.append(action)
    return drawn


def casts(count: int, seed: int) -> None:
    """Collect casts, track them, read the set."""
    filmed, random = scene(), np.random.default_rng(seed)
    chosen = list(enumerate(draw_allowed(random, count)))
    with running_peer(HASTY, filmed) as peer, tempfile.TemporaryDirectory() as tmp:
        rig, folder = ur5_rig(peer, filmed), Path(tmp)
        collected = collect_casts(rig, chosen, folder / "session", LIMITS)
        rig.close()
        tracked = track_session(read_session(folder / "session"))
        write_measurement_set(tracked.measurement_set(folder), folder / "set")
        measured = read_measurement_set(folder / "set")
    print(f"casts: {collected.added} of {count} cast, {len(measured.trials)} in a valid set")
    for number, reason in (collected.failed | dict(tracked.lost)).items():
        print(f"  cast {number}: {reason}")


def faults(times: int, seed: int) -> None:
    """Have every fault at random moments of a motion; count what was commanded after it."""
    random = np.random.default_rng(seed)
    for fault in ROBOT_FAULTS:
        stopped = late = 0
        for _ in range(times):
            with running_peer(PATIENT) as peer:
                arm, after_s = arm_at(peer.host, 2.0, stale_s=4.0), float(random.uniform(0.1, 3.0))
                motion, log = sway(HOME, arm.period_s), RobotLog()

                def begin(peer=peer, fault=fault, after_s=after_s, log=log) -> None:
                    if len(log.states) == 1:
                        peer.break_in(fault, after_s)

                try:
                    arm.follow(motion, log, begin)
                except RigStopped:
                    stopped += 1
                seen = peer.log()
                # an arm drifts off over some cycles, a stop is known with the next package
                grace_s = (40 if fault == "off its path" else 2) * CYCLE_S
                after_s = seen.faults[-1][0] + grace_s + 1e-6
                late += sum(t_s > after_s for t_s, _ in seen.commands)
                arm.close()
        print(
            f"faults: {fault}: {stopped} of {times} stopped, {late} motion commands after it",
            flush=True,
        )


def session_faults(times: int, seed: int) -> None:
    """Have every fault at random moments of a session; count what moved and what was lost."""
    random, filmed = np.random.default_rng(seed), scene(fps=15.0)
    drawn = draw_allowed(random, len(SESSION_FAULTS) + 1)
    with running_peer(HASTY, filmed) as peer, tempfile.TemporaryDirectory() as tmp:
        folder = Path(tmp) / "session"

        def collect(wanted: int, **changes: Any) -> Collected:
            peer.place(HOME)
            rig = ur5_rig(peer, filmed, **changes)
            try:
                return collect_casts(rig, list(enumerate(drawn[:wanted])), folder, LIMITS)
            finally:
                rig.close()

        collect(1)
        for wanted, fault in enumerate(SESSION_FAULTS, 2):
            stopped = late = 0
            before = _digests(folder)
            for _ in range(times):
                refused = random.integers(3) if fault == "not confirmed" else -1
                answers = (asked != refused for asked in itertools.count())
                if fault == "cable crooked":
                    peer.break_now(fault)
                elif fault != "not confirmed":
                    peer.break_in(fault, float(random.uniform(0.5, 8.0)))
                try:
                    collect(wanted, confirm=lambda _text, a=answers: next(a))
                except RigStopped:
                    stopped += 1
                seen = len(peer.log().commands)
                time.sleep(0.5)
                late += len(peer.log().commands) - seen
                peer.mend()
            kept = before.items() <= _digests(folder).items()
            rerun = collect(wanted)
            print(
                f"sessions: {fault}: {stopped} of {times} stopped, {late} motion commands after "
                f"it, finished casts {'kept' if kept else 'LOST'}; the rerun cast {rerun.added} "
                f"and left {rerun.stood}",
                flush=True,
            )


def _digests(folder: Path) -> dict[str, str]:
    """Return what every file of the finished casts holds."""
    return {
        str(path): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("cast_*/*"))
    }


def actions(count: int, executed: int, seed: int) -> None:
    """Try random actions, a quarter of them malicious; execute some of those that pass."""
    random, seen = np.random.default_rng(seed), Counter[str]()
    with running_peer(HASTY) as peer:
        rig = ur5_rig(peer, scene())
        arm = arm_at(peer.host, 0.5, stale_s=15.0)
        for number in range(count):
            malicious = number % 4 == 0
            name, live = ("malicious" if malicious else "ordinary"), HOME
            action = draw_action(random)
            try:
                if malicious:
                    action, live = _spoilt(action, random)
                whole = rig.planned_motion(plan_action(action, r0_m=R0_M, limits=LIMITS), HOME)
                refuse_unsafe(whole, live, rig.limits)
            except ValueError:
                seen[f"{name} refused"] += 1
                continue
            seen[f"{name} allowed"] += 1
            if malicious:
                print(f"  allowed though malicious: {action}, arm at {live}")
            if seen["executed"] < executed:
                seen["executed"] += 1
                motion = _and_back(whole, arm.period_s)
                arm.follow(motion, RobotLog())
        log = peer.log()
        arm.close()
    broken = (
        broken_rules(np.array(log.t_s), np.array(log.joints), RESET_ENVELOPE) if executed else []
    )
    print(f"actions: {dict(seen)}")
    print(f"  envelope broken in the peer's log of {len(log.t_s)} cycles: {len(broken)}")
    for rule in broken:
        print(f"    {rule}")


def _and_back(whole: WholeMotion, period_s: float) -> JointMotion:
    """Return reset and cast, and a smooth way home in 2 s."""
    joints = np.concatenate([whole.reset.joints_rad, whole.cast.joints_rad])
    back = np.linspace(0, 1, 250)[:, None]
    blend = back**3 * (10 - 15 * back + 6 * back**2)
    path = np.concatenate([joints, joints[-1] + blend * (HOME - joints[-1])])
    return JointMotion(np.arange(len(path)) * period_s, path)


def _spoilt(action: Action, random: np.random.Generator) -> tuple[Action, np.ndarray]:
    """Return an action that nobody may execute, or one for an arm that stands elsewhere."""
    numbers, live = action.as_array(), HOME.copy()
    place, sign = random.integers(6), random.choice([-1.0, 1.0])
    kind = random.integers(4)
    if kind == 0:
        numbers[place] = np.nan
    elif kind == 1:
        numbers[place] = sign * np.inf
    elif kind == 2:
        numbers[place] = 20 * sign * max(abs(numbers[place]), 0.5)
    else:
        live[place] += sign * random.uniform(0.05, 3.0)
    return Action.from_array(numbers), live


def deadlines(host: str | None, patience_s: float = 0.0) -> None:
    """Stream for some seconds to a controller that waits for nobody; count missed deadlines."""
    if host is not None:
        if not host.startswith("127."):
            raise SystemExit("--host: the swaying is not checked; only a simulator on this machine")
        _stream_to(host)
        return
    with running_peer(replace(PATIENT, patience_s=patience_s)) as peer:
        _stream_to(peer.host)


def _stream_to(host: str) -> None:
    arm = arm_at(host, 10.0)
    log, start = RobotLog(), arm.live().joints_rad
    motion = sway(start, arm.period_s)
    begun = time.monotonic()
    try:
        arm.follow(motion, log)
        ended = "to its end"
    except RigStopped as stop:
        ended = f"until: {stop}"
    print(
        f"deadlines: {log.missed} of {log.cycles} missed at {1 / arm.period_s:.0f} Hz "
        f"in {time.monotonic() - begun:.1f} s, {ended}"
    )
    arm.close()


def offsets(delay_s: float, times: int) -> None:
    """Film the swaying arm with a known delay; print the offsets found."""
    filmed, found = scene(), []
    for _ in range(times):
        with running_peer(PATIENT, filmed, delay_s) as peer:
            rig = ur5_rig(peer, filmed)
            found.append(rig.open_session().camera_offset_s * 1e3)
            rig.close()
    print(
        f"offset: {delay_s * 1e3:.0f} ms delay found as {', '.join(f'{f:.1f}' for f in found)} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--casts", type=int, default=0)
    parser.add_argument("--faults", type=int, default=0)
    parser.add_argument("--session-faults", type=int, default=0)
    parser.add_argument("--actions", type=int, default=0)
    parser.add_argument("--executed", type=int, default=20)
    parser.add_argument("--offsets", type=int, default=0)
    parser.add_argument("--deadlines", action="store_true")
    parser.add_argument("--host")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    if asked.host or asked.deadlines:
        deadlines(asked.host)
    if asked.offsets:
        offsets(0.04, asked.offsets)
    if asked.actions:
        actions(asked.actions, asked.executed, asked.seed)
    if asked.faults:
        faults(asked.faults, asked.seed)
    if asked.session_faults:
        session_faults(asked.session_faults, asked.seed)
    if asked.casts:
        casts(asked.casts, asked.seed)


if __name__ == "__main__":
    main()
