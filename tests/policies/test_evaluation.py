import numpy as np
import pytest

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.measurements.measurement_set import Cable
from robotcast.policies.choosing.choice import choose_actions, with_spread
from robotcast.policies.evaluating.evaluation import (
    Executed,
    Subject,
    executed_table,
    predicted_table,
)

CABLE = Cable("made up", 0.6, 0.03, 0.01, 0.02)
TARGETS = np.array([[0.8, -0.5], [1.0, -0.3]])
COLUMNS = [
    *("kind", "rig", "cable", "policy", "dataset", "target", "target_x", "target_y", "repeat"),
    *ACTION_COLUMNS,
    *("predicted_x", "predicted_y", "spread_x", "spread_y", "x", "y", "error_m", "error_percent"),
]


@pytest.fixture
def executed_rows(world):
    choices = choose_actions(world, world.actions(300), TARGETS)
    ends = np.stack([TARGETS + np.array([0.03, 0.04]), TARGETS - np.array([0.06, 0.0])], axis=1)
    ends[1, 0] = np.nan
    executed = Executed(ends, {(1, 0): "hidden"})
    choices = with_spread(world, choices)
    return executed_table(Subject("virtual", CABLE, "nn", "mixed"), choices, executed)


def test_every_cast_is_a_row_with_the_agreed_columns(executed_rows) -> None:
    assert executed_rows.columns == COLUMNS
    assert executed_rows.select("target", "repeat").rows() == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert set(executed_rows["kind"]) == {"executed"}


def test_the_error_is_the_distance_from_the_target_in_percent_of_length(executed_rows) -> None:
    errors = executed_rows["error_m"].to_list()
    assert errors[:2] == pytest.approx([0.05, 0.06])
    assert executed_rows["error_percent"].to_list()[:2] == pytest.approx([100 / 12, 10.0])


def test_a_lost_cast_has_no_endpoint_and_no_error(executed_rows) -> None:
    lost = executed_rows.row(2, named=True)
    assert [lost[c] for c in ("x", "y", "error_m", "error_percent")] == [None] * 4
    assert lost["predicted_x"] is not None


def test_recorded_casts_judge_the_forward_model_only(world) -> None:
    measured = world.measured(8, 0)
    rows = predicted_table(Subject("recorded", CABLE, "nn", "real"), world, measured)
    assert rows.columns == COLUMNS
    assert set(rows["kind"]) == {"predicted"}
    assert rows["error_m"].to_numpy() == pytest.approx(np.zeros(8), abs=1e-9)


def test_a_choice_and_its_mirror_image_are_as_sure(world) -> None:
    targets = np.array([[0.8, -0.5], [0.8, 0.5]])
    right, left = with_spread(world, choose_actions(world, world.actions(300), targets))
    assert right.action == left.action.mirrored()
    assert right.spread_m == pytest.approx(left.spread_m)
    assert right.spread_m == pytest.approx(np.array([0.02, 0.01]) / right.action.vmax_m_s)
