from pathlib import Path

import numpy as np
import pytest
import yaml

from robotcast.casts.action import Action
from robotcast.casts.grid import ActionGrid, GridCounts
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.rigs.envelope import (
    Envelope,
    FilterReport,
    ToolBox,
    are_feasible,
    broken_rules,
    feasible_actions,
)
from robotcast.rigs.kinematics import Gripper, joint_path, tilted_joint_path

CONFIG = yaml.safe_load((Path(__file__).parents[2] / "conf/casts/arcs.yaml").read_text())
LIMITS = PlanLimits(**CONFIG["limits"])
PAPER_COUNTS = GridCounts(theta1=15, theta2=15, r2=15, alpha=10, vmax=2)


def envelope(box: str = "box") -> Envelope:
    numbers = dict(CONFIG["envelope"])
    boxes = {name: ToolBox(**numbers.pop(name)) for name in ("box", "reset_box")}
    gripper = Gripper(**numbers.pop("gripper"))
    return Envelope(**numbers, box=boxes[box], gripper=gripper)


def grid(name: str, counts: GridCounts | None = None) -> ActionGrid:
    numbers = dict(CONFIG["grids"][name])
    given = numbers.pop("counts")
    return ActionGrid(**numbers, counts=counts or GridCounts(**given))


def feasible(actions: ActionGrid) -> tuple[np.ndarray, FilterReport]:
    return feasible_actions(actions, CONFIG["r0_m"], LIMITS, envelope())


def test_the_collected_grid_leaves_about_as_many_casts_as_the_papers():
    actions, report = feasible(grid("collected"))
    assert report.candidates == 1000
    assert len(actions) == report.feasible
    assert 450 <= report.feasible <= 600


@pytest.mark.slow
def test_the_generated_grid_leaves_as_many_casts_as_its_config_says():
    _, report = feasible(grid("generated", PAPER_COUNTS))
    assert report.candidates == 67_500
    assert report.feasible == 37_262


def test_a_policy_chooses_among_actions_like_those_that_are_collected():
    grids = [dict(CONFIG["grids"][name]) for name in ("collected", "generated", "candidates")]
    for one in grids:
        one.pop("counts")
    assert grids[0] == grids[1] == grids[2]


def test_what_stays_breaks_no_rule_and_neither_does_its_mirror_image():
    actions, _ = feasible(grid("collected"))
    for row in actions[::40]:
        for action in (Action.from_array(row), Action.from_array(row).mirrored()):
            cast = plan_action(action, r0_m=CONFIG["r0_m"], limits=LIMITS)
            joints = joint_path(cast.tool, envelope().gripper)
            assert broken_rules(cast.tool.t_s, joints, envelope()) == []


def test_asking_for_some_actions_tells_the_same_as_filtering_the_grid():
    some = grid("collected", GridCounts(3, 3, 3, 2, 2))
    kept, _ = feasible(some)
    candidates = some.candidates(CONFIG["r0_m"], LIMITS)
    shuffled = candidates[np.random.default_rng(0).permutation(len(candidates))]
    told = [are_feasible(a, CONFIG["r0_m"], LIMITS, envelope()) for a in np.split(shuffled, 4)]
    assert {a.tobytes() for a in shuffled[np.concatenate(told)]} == {a.tobytes() for a in kept}


def test_what_falls_is_counted_under_its_rules():
    tight = grid("collected", GridCounts(2, 2, 2, 2, 2))
    actions, report = feasible(tight)
    fallen = report.candidates - report.feasible
    assert len(actions) == report.feasible < report.candidates
    assert max(report.broken.values()) <= fallen <= sum(report.broken.values())
    assert report.broken["joint speed"] > 0


def test_progress_is_reported_to_the_end():
    seen = []
    small = grid("collected", GridCounts(2, 2, 2, 2, 2))
    feasible_actions(
        small, 0.6, LIMITS, envelope(), lambda done, total, note="": seen.append((done, total))
    )
    assert seen[-1] == (32, 32)


def test_the_configured_reset_keeps_to_the_configured_envelope():
    settings = ResetSettings(**CONFIG["reset"])
    for length_m in (0.63, 0.65):
        motion = plan_reset(np.array([0.6, 0, 0]), length_m, r0_m=0.6, settings=settings)
        joints = tilted_joint_path(motion.position_m, motion.pitch_rad, motion.yaw_rad)
        assert broken_rules(motion.t_s, joints, envelope("reset_box")) == []
