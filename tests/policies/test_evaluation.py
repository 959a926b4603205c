"""Tables of evaluated casts, and a policy's choices cast on the virtual rig."""

import re
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.plan import PlanLimits
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.choosing import Choice, choose_actions, with_spread
from robotcast.policies.evaluation import (
    Executed,
    Subject,
    execute_choices,
    executed_table,
    predicted_table,
)
from robotcast.rigs import Rig
from tests.good_casts import plan_cast
from tests.rigs.small_rig import small_rig

LIMITS = PlanLimits()
REPEATS = 2

CABLE = Cable("made up", 0.6, 0.03, 0.01, 0.02)
TARGETS = np.array([[0.8, -0.5], [1.0, -0.3]])
COLUMNS = [
    *("kind", "rig", "cable", "policy", "dataset", "target", "target_x", "target_y", "repeat"),
    *ACTION_COLUMNS,
    *("predicted_x", "predicted_y", "spread_x", "spread_y", "x", "y", "error_m", "error_percent"),
]


def test_every_cast_is_a_row_with_its_distance_from_the_target_and_a_lost_one_without(world):
    choices = with_spread(world, choose_actions(world, world.actions(300), TARGETS))
    ends = np.stack([TARGETS + np.array([0.03, 0.04]), TARGETS - np.array([0.06, 0.0])], axis=1)
    ends[1, 0] = np.nan
    executed = Executed(ends, {(1, 0): "hidden"})
    rows = executed_table(Subject("virtual", CABLE, "nn", "mixed"), choices, executed)
    assert rows.columns == COLUMNS
    assert rows.select("target", "repeat").rows() == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert set(rows["kind"]) == {"executed"}
    assert rows["error_m"].to_list()[:2] == pytest.approx([0.05, 0.06])
    assert rows["error_percent"].to_list()[:2] == pytest.approx([100 / 12, 10.0])
    lost = rows.row(2, named=True)
    assert [lost[c] for c in ("x", "y", "error_m", "error_percent")] == [None] * 4
    assert lost["predicted_x"] is not None


def test_recorded_casts_judge_the_forward_model_only(world) -> None:
    measured = world.measured(8, 0)
    rows = predicted_table(Subject("recorded", CABLE, "nn", "real"), world, measured)
    assert rows.columns == COLUMNS
    assert set(rows["kind"]) == {"predicted"}
    assert rows["error_m"].to_numpy() == pytest.approx(np.zeros(8), abs=1e-9)


def on_rig(test):
    return pytest.mark.slow(pytest.mark.rig(test))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return small_rig(640, 360)


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


@on_rig
def test_the_tracked_rest_is_where_the_cable_came_to_rest(executed, sessions) -> None:
    assert not executed.lost
    truths = [pl.read_csv(p / "truth.csv").select("x", "y").row(-1) for p in casts_of(sessions)]
    ends = executed.ends_m.transpose(1, 0, 2).reshape(-1, 2)
    assert np.linalg.norm(ends - np.array(truths), axis=1).max() < 0.004


@on_rig
def test_repeats_of_a_choice_scatter_little_but_differ(executed) -> None:
    apart = np.linalg.norm(executed.ends_m[:, 0] - executed.ends_m[:, 1], axis=1)
    assert (apart > 0).all()
    assert (apart < 0.15).all()


@on_rig
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


@on_rig
def test_other_settings_start_another_session(executed, rig, choices, sessions) -> None:
    execute_choices(rig, choices[:1], 1, sessions, "second", LIMITS)
    assert len(list(sessions.iterdir())) == 2
