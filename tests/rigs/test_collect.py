import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, PlannedCast
from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.collect import choose_casts, collect_casts, number_extra_actions
from robotcast.sessions import exclusive, read_session
from tests.good_casts import CABLE
from tests.stages import ROOT

LIMITS = PlanLimits()
ACTIONS = np.array(
    [[theta1, 0.62, -0.4, 0.7, 0.2, 1.5] for theta1 in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]
)


@dataclass(frozen=True)
class NoteRig:
    """The simplest rig: it notes down what it was told."""

    workers: int = 1
    fails_at: int | None = None
    takes_s: float = 0.0
    name: str = "note"
    cable: Cable = CABLE
    r0_m: float = 0.6

    def facts(self) -> dict[str, Any]:
        return {"vision": {"period_s": 0.1}}

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        time.sleep(self.takes_s)
        (folder / "note.txt").write_text(f"{number} {planned.action}")
        if number == self.fails_at:
            raise ValueError("the cable came loose")


def asked(*rows: int) -> list[tuple[int, Action]]:
    return [(row, Action.from_array(ACTIONS[row])) for row in rows]


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_a_session_says_who_cast_what(tmp_path):
    rig = NoteRig()
    done = collect_casts(rig, asked(2, 0, 2), tmp_path / "s", LIMITS)
    session = read_session(tmp_path / "s")
    assert (done.stood, done.added, done.failed) == (0, 3, {})
    assert (session.rig, session.cable, session.r0_m) == ("note", rig.cable, 0.6)
    assert session.facts == rig.facts()
    assert [(c.number, c.action_id) for c in session.casts] == [(0, 0), (2, 2), (10002, 2)]
    assert session.casts[1].action == session.casts[2].action == Action.from_array(ACTIONS[2])


def test_more_casts_are_added_to_those_that_stand(tmp_path):
    collect_casts(NoteRig(), asked(0, 1, 1), tmp_path, LIMITS)
    before = contents(tmp_path)
    done = collect_casts(NoteRig(), asked(3, 1, 0, 1, 1), tmp_path, LIMITS)
    assert (done.stood, done.added) == (3, 2)
    after = contents(tmp_path)
    assert before.items() <= after.items()
    assert {c.number for c in read_session(tmp_path).casts} == {0, 1, 10001, 3, 20001}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_cast_that_fails_is_reported_and_the_others_go_on(tmp_path, workers):
    rig = NoteRig(workers=workers, fails_at=1)
    done = collect_casts(rig, asked(0, 1, 2), tmp_path, LIMITS)
    assert (done.added, done.failed) == (2, {1: "the cable came loose"})
    assert "came loose" in (tmp_path / "failed_00001.yaml").read_text()
    assert [c.number for c in read_session(tmp_path).casts] == [0, 2]
    again = collect_casts(NoteRig(), asked(0, 1, 2), tmp_path, LIMITS)
    assert (again.stood, again.added, again.failed) == (2, 1, {})
    assert not (tmp_path / "failed_00001.yaml").exists()


def test_workers_leave_the_same_session_as_one_process(tmp_path):
    for workers in (1, 3):
        rig = NoteRig(workers=workers)
        collect_casts(rig, asked(*range(6)), tmp_path / str(workers), LIMITS)
    assert contents(tmp_path / "1") == contents(tmp_path / "3")


def test_leftovers_of_a_killed_collector_go(tmp_path):
    collect_casts(NoteRig(), asked(0), tmp_path, LIMITS)
    leftover = tmp_path / ".cast_00001.4711.tmp"
    leftover.mkdir()
    (leftover / "video.mp4").write_text("half a vid")
    collect_casts(NoteRig(), asked(0, 1), tmp_path, LIMITS)
    assert not leftover.exists()


def test_another_action_under_a_finished_number_is_refused(tmp_path):
    collect_casts(NoteRig(), asked(0, 1), tmp_path, LIMITS)
    other = [(1, Action.from_array(ACTIONS[4]))]
    with pytest.raises(ValueError, match=r"cast_00001: holds another action.*never replaced"):
        collect_casts(NoteRig(), other, tmp_path, LIMITS)


def test_a_session_keeps_its_rig_and_its_cable(tmp_path):
    collect_casts(NoteRig(), asked(0), tmp_path, LIMITS)
    heavier = replace(CABLE, mass_kg=0.05)
    with pytest.raises(ValueError, match="begun with another cable"):
        collect_casts(NoteRig(cable=heavier), asked(0), tmp_path, LIMITS)


def test_two_collectors_do_not_share_a_session(tmp_path):
    with exclusive(tmp_path), pytest.raises(ValueError, match="another process is collecting"):
        collect_casts(NoteRig(), asked(0), tmp_path, LIMITS)


def test_the_choice_for_fewer_casts_is_part_of_the_choice_for_more():
    few, many = choose_casts(ACTIONS, 3, 4, seed=1), choose_casts(ACTIONS, 600, 4, seed=1)
    assert {i for i, _ in few} < {i for i, _ in many} == set(range(6))
    assert [i for i, _ in few[3:]] == [i for i, _ in many[6:]] == [few[0][0]] * 3 + [few[1][0]]
    assert choose_casts(ACTIONS, 3, 4, seed=2) != few


def test_an_interrupted_collector_casts_no_more_and_goes_on_when_called_again(tmp_path):
    def interrupt(done: int, total: int, note: str = "") -> None:
        if done:
            raise KeyboardInterrupt

    rig, wanted = NoteRig(workers=2, takes_s=0.2), asked(*range(6), *range(6), *range(6))
    with pytest.raises(KeyboardInterrupt):
        collect_casts(rig, wanted, tmp_path, LIMITS, interrupt)
    stood = len(read_session(tmp_path).casts)
    assert 1 <= stood < 12
    time.sleep(1.0)
    assert len(read_session(tmp_path).casts) == stood
    done = collect_casts(replace(rig, takes_s=0.0), wanted, tmp_path, LIMITS)
    assert (done.stood, done.added) == (stood, 18 - stood)


@pytest.mark.slow
@pytest.mark.rig
def test_a_collector_killed_at_any_moment_loses_no_cast_and_repeats_none(tmp_path):
    def collect(folder: Path) -> subprocess.Popen[bytes]:
        sizes = "scale.collect={casts: 2, repeats: 1}", "scale.camera={width: 320, height: 180}"
        command = [sys.executable, "stages/collect.py", *sizes, f"paths.sessions={folder}"]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        return subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.DEVNULL)

    began = time.monotonic()
    assert collect(tmp_path / "undisturbed").wait() == 0
    undisturbed_s = time.monotonic() - began
    chance, finished = random.Random(0), {}
    for _ in range(3):
        process = collect(tmp_path / "killed")
        time.sleep(chance.uniform(0.6, 0.95) * undisturbed_s)
        process.send_signal(signal.SIGKILL)
        process.wait()
        casts = sorted((tmp_path / "killed").glob("cast_*"))
        stands = {cast: cast.stat().st_ino for cast in casts}
        assert finished.items() <= stands.items()
        finished = stands
    assert collect(tmp_path / "killed").wait() == 0
    assert contents(tmp_path / "killed") == contents(tmp_path / "undisturbed")


@pytest.mark.slow
@pytest.mark.rig
def test_an_interrupt_at_the_terminal_ends_the_command_in_one_line(tmp_path):
    sizes = "scale.collect={casts: 30, repeats: 1}", "scale.camera={width: 320, height: 180}"
    with subprocess.Popen(
        [sys.executable, "stages/collect.py", *sizes, f"paths.sessions={tmp_path}"],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    ) as process:
        until = time.monotonic() + 120.0
        while not list(tmp_path.glob("cast_*")):
            assert time.monotonic() < until
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate()
    assert process.returncode == 130
    assert "collect: interrupted" in said and "Traceback" not in said
    assert 1 <= len(read_session(tmp_path).casts) < 15


def test_actions_of_a_file_are_added_to_a_session_and_never_cast_twice_by_chance(tmp_path):
    rig, folder = NoteRig(), tmp_path / "s"
    collect_casts(rig, asked(0, 1), folder, LIMITS)
    given = [Action.from_array(row) for row in (ACTIONS[1], ACTIONS[3], ACTIONS[1])]

    def collect(actions: list[Action]) -> int:
        chosen = number_extra_actions(actions, read_session(folder).casts)
        return collect_casts(rig, chosen, folder, LIMITS).added

    assert collect(given) == 3
    assert collect(given) == 0
    assert collect([given[1], Action.from_array(ACTIONS[4])]) == 1
    ids = [cast.action_id for cast in read_session(folder).casts]
    assert ids == [0, 1, 5000, 5001, 5002, 5000]
