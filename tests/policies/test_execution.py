"""A policy's choices cast on the virtual rig."""

import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hydra import compose, initialize_config_dir

from robotcast.build import build_rig
from robotcast.casts.plan import PlanLimits, plan_cast
from robotcast.policies.choosing.choice import Choice
from robotcast.policies.evaluating.evaluation import Executed, execute_choices
from robotcast.rigs.rig import Rig

pytestmark = [pytest.mark.slow, pytest.mark.rig]

ROOT = Path(__file__).resolve().parents[2]
LIMITS = PlanLimits()
REPEATS = 2


@pytest.fixture(scope="module")
def rig() -> Rig:
    """The configured virtual rig with a small picture."""
    sizes = ["scale.camera.width=640", "scale.camera.height=360", "rig.workers=1"]
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=sizes)
    return build_rig(config)


@pytest.fixture(scope="module")
def choices() -> list[Choice]:
    plans = [
        plan_cast(0.3, -0.2, 0.7, 0.3, 1.4, r0_m=0.6, limits=LIMITS),
        plan_cast(0.5, -0.4, 0.65, 0.2, 1.4, r0_m=0.6, limits=LIMITS),
    ]
    return [Choice(np.array([1.0, -0.1]), plan.action, np.array([1.0, -0.1])) for plan in plans]


@pytest.fixture(scope="module")
def sessions(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("sessions")


@pytest.fixture(scope="module")
def executed(rig, choices, sessions) -> Executed:
    return execute_choices(rig, choices, REPEATS, sessions, "first", LIMITS)


def casts_of(sessions: Path) -> list[Path]:
    return sorted(sessions.glob("*/cast_*"))


def test_the_tracked_rest_is_where_the_cable_came_to_rest(executed, sessions) -> None:
    assert not executed.lost
    truths = [pl.read_csv(p / "truth.csv").select("x", "y").row(-1) for p in casts_of(sessions)]
    ends = executed.ends_m.transpose(1, 0, 2).reshape(-1, 2)
    assert np.linalg.norm(ends - np.array(truths), axis=1).max() < 0.004


def test_repeats_of_a_choice_scatter_little_but_differ(executed) -> None:
    apart = np.linalg.norm(executed.ends_m[:, 0] - executed.ends_m[:, 1], axis=1)
    assert (apart > 0).all()
    assert (apart < 0.15).all()


def test_a_killed_evaluation_goes_on_and_ends_the_same(executed, rig, choices, sessions) -> None:
    finished = casts_of(sessions)
    before = {p: p.stat().st_mtime_ns for p in finished[1:]}
    shutil.rmtree(finished[0])
    said: list[str] = []

    def progress(done: int, total: int, note: str = "") -> None:
        said.append(note)

    again = execute_choices(rig, choices, REPEATS, sessions, "first", LIMITS, progress)
    assert re.fullmatch(r"cast 9\d{3}, target \d, \d+\.\d cm off", said[-1])
    assert np.array_equal(again.ends_m, executed.ends_m)
    assert {p: p.stat().st_mtime_ns for p in finished[1:]} == before


def test_other_settings_start_another_session(executed, rig, choices, sessions) -> None:
    execute_choices(rig, choices[:1], 1, sessions, "second", LIMITS)
    assert len(list(sessions.iterdir())) == 2
