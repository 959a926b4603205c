"""What bounds of effects are made of: how large things usually are on a robot's logs."""

from pathlib import Path

import mujoco
import numpy as np

from robotcast.robots.robot_case import read_case
from tests.robots.made_up_robot import ARM, SLIDER, write_folder


def test_a_stop_that_is_hit_now_and_then_makes_no_usual_torque(tmp_path: Path) -> None:
    stops = SLIDER.replace('range="-3 3"', 'range="-0.1 0.1"')
    hits = read_case(write_folder(tmp_path, stops)).sizes.torque
    (tmp_path / "robot.xml").write_text(SLIDER, encoding="utf-8")
    np.testing.assert_allclose(hits, read_case(tmp_path).sizes.torque, rtol=0.1)


def test_what_stands_still_is_no_stiffer_than_what_moves(tmp_path: Path) -> None:
    light = 'pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"'
    still = f'<body><joint name="target" type="slide" axis="0 1 1e-4"/><inertial {light}/></body>'
    xml = SLIDER.replace("</worldbody>", f"{still}</worldbody>")
    sizes = read_case(write_folder(tmp_path, xml, noise=1e-7)).sizes
    moving, resting = sizes.torque / sizes.speed / sizes.inertia
    assert resting < 10 * moving


def test_what_holds_a_joint_may_be_as_large_as_what_drives_it(tmp_path: Path) -> None:
    def stick(model: mujoco.MjModel) -> None:
        model.dof_frictionloss[0] = 20.0

    case = read_case(write_folder(tmp_path, change=stick))
    pushed = np.concatenate([log.drive for log in case.model.rollout.logs])
    np.testing.assert_allclose(case.sizes.driven, np.sqrt((pushed**2).mean()), rtol=0.1)
    torque = case.model.effects["dry_friction_axis"].parameters[0]
    assert torque.upper > np.abs(pushed).max()


def test_no_encoder_is_so_late_that_most_of_a_window_is_measured(tmp_path: Path) -> None:
    case = read_case(write_folder(tmp_path, ARM, logs=3, windows={"length_s": 0.2}))
    assert case.model.effects["encoder_latency_elbow"].parameters[0].upper == 0.05
