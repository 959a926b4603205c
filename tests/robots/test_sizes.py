"""What bounds of effects are made of: how large things usually are on a robot's logs."""

from pathlib import Path

import numpy as np

from robotcast.robots.robot_case import read_case
from tests.robots.made_up_robot import SLIDER, write_folder


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
