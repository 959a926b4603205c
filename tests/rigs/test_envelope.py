from dataclasses import replace

import numpy as np
import pytest

from robotcast.build import build
from robotcast.casts.action import Action
from robotcast.casts.curves import plan_curves
from robotcast.casts.plan import ActionGrid, PlanLimits, plan_action
from robotcast.casts.reset import ResetSettings, plan_reset
from robotcast.rigs.envelope import (
    Envelope,
    ToolBox,
    are_feasible,
    broken_rules,
    feasible_actions,
)
from robotcast.rigs.kinematics import (
    GRIPPER,
    joint_path,
    joints_pointing_down,
    tilted_joint_path,
)
from tests.good_casts import plan_cast
from tests.stages import configured

CONFIG = configured().casts
LIMITS: PlanLimits = build(CONFIG["limits"])
PAPER_COUNTS = dict(theta1=15, theta2=15, r2=15, alpha=10, vmax=2)
TURN = 2 * np.pi
ENVELOPE = Envelope(
    joint_min_rad=(-TURN,) * 6,
    joint_max_rad=(TURN,) * 6,
    joint_speed_rad_s=(np.pi,) * 6,
    joint_acceleration_rad_s2=(40.0,) * 6,
    tool_speed_m_s=2.5,
    clearance_m=0.01,
    box=ToolBox(x_m=(0.0, 1.55), y_m=(-1.225, 1.225), z_m=(0.01, 0.05), r_min_m=0.5),
    gripper=GRIPPER,
)
ANYWHERE = replace(ENVELOPE, box=ToolBox((-2, 2), (-2, 2), (-2, 2), 0.0))
HOME = joints_pointing_down(np.array([0.6, 0.0, 0.0]))


def still(joints, n: int = 5) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(n) * 0.008, np.tile(np.asarray(joints, dtype=float), (n, 1))


def swept(joint: int, distance_rad: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    t_s = np.arange(0, seconds, 0.008)
    s = t_s / t_s[-1]
    joints = np.tile(HOME, (len(t_s), 1))
    joints[:, joint] += distance_rad * s**3 * (10 - 15 * s + 6 * s**2)
    return t_s, joints


def rules(t_s, joints, envelope=ENVELOPE) -> set[str]:
    return {broken.rule for broken in broken_rules(t_s, joints, envelope)}


def test_standing_still_at_r0_breaks_nothing():
    assert broken_rules(*still(HOME), ENVELOPE) == []


def test_a_gentle_cast_breaks_nothing_and_a_violent_one_the_speed_of_the_base():
    limits = PlanLimits()
    gentle = plan_cast(0.7, -0.7, 0.7, 0.5, 1.2, r0_m=0.6, limits=limits)
    assert broken_rules(gentle.tool.t_s, joint_path(gentle.tool), ENVELOPE) == []
    violent = plan_cast(1.1, -1.1, 0.55, 0.5, 2.5, r0_m=0.6, limits=limits)
    broken = broken_rules(violent.tool.t_s, joint_path(violent.tool), ENVELOPE)
    assert {(b.rule, b.part) for b in broken} == {("joint speed", "base")}
    assert abs(broken[0].value) > np.pi
    assert broken[0].limit == pytest.approx(np.copysign(np.pi, broken[0].value))
    assert "joint speed (base)" in str(broken[0])


def test_speed_and_acceleration_are_those_of_the_quintic():
    peak_speed, peak_acceleration = 1.875 * 1.0 / 0.5, 5.7735 * 1.0 / 0.25
    slow = replace(ENVELOPE, joint_speed_rad_s=(0.1,) * 6, joint_acceleration_rad_s2=(0.1,) * 6)
    found = {b.rule: abs(b.value) for b in broken_rules(*swept(5, 1.0, 0.504), slow)}
    assert found["joint speed"] == pytest.approx(peak_speed, rel=0.01)
    assert found["joint acceleration"] == pytest.approx(peak_acceleration, rel=0.03)


def test_a_motion_that_does_not_start_or_end_at_rest_breaks_the_acceleration():
    t_s = np.arange(50) * 0.008
    joints = np.tile(HOME, (50, 1))
    joints[:, 0] += 1.0 * t_s
    broken = [b for b in broken_rules(t_s, joints, ENVELOPE) if b.rule == "joint acceleration"]
    assert broken and broken[0].t_s in (t_s[0], t_s[-1])


def test_a_jump_between_two_samples_breaks_speed_and_acceleration():
    t_s, joints = still(HOME, 10)
    joints[5:, 3] += 0.2
    assert {"joint speed", "joint acceleration"} <= rules(t_s, joints)


def test_joint_positions_have_limits():
    turned = HOME + np.array([0, 0, 0, 0, 0, TURN + 2.0])
    broken = broken_rules(*still(turned), ENVELOPE)
    assert [(b.rule, b.part) for b in broken] == [("joint position", "wrist 3")]


@pytest.mark.parametrize(
    ("box", "rule", "part"),
    [
        (ToolBox((0.7, 1.5), (-1, 1), (0, 1), 0.0), "tool box", "x"),
        (ToolBox((0.0, 1.5), (0.1, 1), (0, 1), 0.0), "tool box", "y"),
        (ToolBox((0.0, 1.5), (-1, 1), (0.1, 1), 0.0), "tool box", "z"),
        (ToolBox((0.0, 1.5), (-1, 1), (0, 1), 0.65), "tool keep-out", "radius"),
    ],
)
def test_the_held_end_stays_in_its_box(box, rule, part):
    broken = broken_rules(*still(HOME), replace(ENVELOPE, box=box))
    assert [(b.rule, b.part) for b in broken] == [(rule, part)]


def test_the_held_end_has_a_speed_limit():
    assert rules(*swept(0, 1.0, 0.8), replace(ENVELOPE, tool_speed_m_s=1.0)) == {"tool speed"}


def test_reaching_under_the_board_is_a_collision_with_it():
    low = joints_pointing_down(np.array([0.6, 0, 0]), replace(GRIPPER, held_height_m=0.001))
    assert rules(*still(low), ANYWHERE) == {"board collision"}


def test_a_folded_arm_collides_with_itself_or_the_base():
    folded = np.array([0.0, -np.pi / 2, 2.9, -np.pi / 2, np.pi / 2, 0.0])
    assert "self collision" in rules(*still(folded), ANYWHERE)
    reaching_back = np.array([0.0, -0.32, -2.53, -1.81, 2.0, 0.0])
    assert "base collision" in rules(*still(reaching_back), ANYWHERE)


def test_the_arm_stretched_upwards_is_clear_of_everything():
    assert rules(*still([0, -np.pi / 2, 0, -np.pi / 2, 0, 0]), ANYWHERE) == set()


@pytest.mark.parametrize(
    ("t_s", "joints", "message"),
    [
        (*still([np.nan, 0, 0, 0, 0, 0]), "joint angles are not finite at sample 0"),
        (np.array([0, np.inf]), np.zeros((2, 6)), "times are not finite at sample 1"),
        (np.array([0.0, 0.0]), np.zeros((2, 6)), "times must increase"),
        (np.array([0.0]), np.zeros((1, 6)), "n ≥ 2"),
        (np.array([0.0, 1.0]), np.zeros((2, 5)), r"joints \(n, 6\)"),
    ],
)
def test_what_cannot_be_checked_is_refused(t_s, joints, message):
    with pytest.raises(ValueError, match=message):
        broken_rules(t_s, joints, ENVELOPE)


def test_an_envelope_with_a_hole_is_refused():
    with pytest.raises(ValueError, match="joint_speed_rad_s must be six finite numbers"):
        replace(ENVELOPE, joint_speed_rad_s=(np.pi,) * 5)
    with pytest.raises(ValueError, match="joint_acceleration_rad_s2 must be six finite"):
        replace(ENVELOPE, joint_acceleration_rad_s2=(np.nan,) * 6)
    with pytest.raises(ValueError, match="z_m must be"):
        ToolBox((0, 1), (0, 1), (1, 0), 0.5)
    with pytest.raises(ValueError, match="r_min_m must be zero or positive, got nan"):
        ToolBox((0, 1), (0, 1), (0, 1), np.nan)
    with pytest.raises(ValueError, match="clearance_m must be positive and finite, got nan"):
        replace(ENVELOPE, clearance_m=np.nan)
    with pytest.raises(ValueError, match="joint_speed_rad_s must be positive and finite, got 0"):
        replace(ENVELOPE, joint_speed_rad_s=(np.pi, np.pi, 0.0, np.pi, np.pi, np.pi))


def test_of_many_actions_each_is_told_as_its_motion_and_the_mirror_image_alone():
    low, high = [0.3, 0, -1.2, 0.55, 0, 1.2], [1.1, 0, -0.3, 0.85, 1.8, 2.5]
    actions = np.random.default_rng(0).uniform(low, high, (12, 6))
    actions[:, 1] = np.nan
    curves = plan_curves(actions, 0.6, PlanLimits())
    t_s = np.arange(0, curves.end_s.max() + 0.01, 0.004)
    images = (joints_pointing_down(curves.poses_at(t_s) * i) for i in ([1, 1, 1], [1, -1, -1]))
    alone = [not any(rules(t_s, motion) for motion in both) for both in zip(*images, strict=True)]
    assert any(alone) and not all(alone)
    assert are_feasible(actions, 0.6, PlanLimits(), ENVELOPE).tolist() == alone


def test_what_the_arm_does_not_reach_is_not_feasible():
    actions = np.array([[0.7, np.nan, -0.7, r2, 0.5, 1.2] for r2 in (0.7, 1.1)])
    assert are_feasible(actions, 0.6, PlanLimits(), ANYWHERE).tolist() == [True, False]


def envelope(name: str = "envelope") -> Envelope:
    return build(CONFIG[name])


def grid(name: str, counts: dict[str, int] | None = None) -> ActionGrid:
    configured: ActionGrid = build(CONFIG.grids[name])
    return replace(configured, counts=counts) if counts else configured


def feasible(actions: ActionGrid) -> np.ndarray:
    return feasible_actions(actions, CONFIG["r0_m"], LIMITS, envelope())


def test_the_collected_grid_leaves_about_as_many_casts_as_the_papers():
    assert grid("collected").size == 1000
    assert 450 <= len(feasible(grid("collected"))) <= 600


@pytest.mark.slow
def test_the_generated_grid_leaves_as_many_casts_as_its_config_says():
    generated = grid("generated", PAPER_COUNTS)
    assert generated.size == 67_500
    assert len(feasible(generated)) == 37_262


def test_a_policy_chooses_among_actions_like_those_that_are_collected():
    names = ("collected", "generated", "candidates")
    grids = [grid(name, PAPER_COUNTS) for name in names]
    assert grids[0] == grids[1] == grids[2]


def test_what_stays_breaks_no_rule_and_neither_does_its_mirror_image():
    for row in feasible(grid("collected"))[::40]:
        for action in (Action.from_array(row), Action.from_array(row).mirrored()):
            cast = plan_action(action, r0_m=CONFIG["r0_m"], limits=LIMITS)
            joints = joint_path(cast.tool, envelope().gripper)
            assert broken_rules(cast.tool.t_s, joints, envelope()) == []


def test_asking_for_some_actions_tells_the_same_as_filtering_the_grid():
    some = grid("collected", dict(theta1=3, theta2=3, r2=3, alpha=2, vmax=2))
    kept, candidates = feasible(some), some.curves(CONFIG["r0_m"], LIMITS).actions
    shuffled = candidates[np.random.default_rng(0).permutation(len(candidates))]
    told = [are_feasible(a, CONFIG["r0_m"], LIMITS, envelope()) for a in np.split(shuffled, 4)]
    assert {a.tobytes() for a in shuffled[np.concatenate(told)]} == {a.tobytes() for a in kept}


def test_progress_is_reported_to_the_end():
    seen = []
    small = grid("collected", dict.fromkeys(PAPER_COUNTS, 2))
    feasible_actions(
        small, 0.6, LIMITS, envelope(), lambda done, total, note="": seen.append((done, total))
    )
    assert seen[-1] == (32, 32)


@pytest.mark.parametrize("start", [(0.6, 0, 0), (0.435, -0.548, 0.3)])
def test_the_configured_reset_keeps_to_the_configured_envelope(start):
    settings: ResetSettings = build(CONFIG.reset)
    for length_m in (0.63, 0.65):
        motion = plan_reset(np.array(start), length_m, r0_m=0.6, settings=settings)
        joints = tilted_joint_path(motion.position_m, motion.pitch_rad, motion.yaw_rad)
        assert broken_rules(motion.t_s, joints, envelope("reset_envelope")) == []
