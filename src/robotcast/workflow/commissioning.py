"""Before a UR5 casts: what is printed for its camera, views of the board, motions drawn."""

import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.files import atomic_file, write_text, write_yaml
from robotcast.reporting.style import BLUE, CYCLE, GREY, VERMILION, board_axes, style, svg
from robotcast.rigs import Rig
from robotcast.rigs.envelope import Envelope
from robotcast.rigs.kinematics import JOINTS, Gripper, link_points
from robotcast.rigs.ur5.camera import Webcam
from robotcast.rigs.ur5.motion import WholeMotion
from robotcast.rigs.ur5.rig import Ur5Rig
from robotcast.stage import bar, tell, warn
from robotcast.vision.calibration import DOTS_PER_M, board_corners, printed_board
from robotcast.vision.camera import BORDER_MODULES, FiducialBoard, dictionary

VIEWS, EVERY_S, AT_MOST_S = 15, 1.0, 180.0


def write_prints(folder: Path, markers: FiducialBoard) -> None:
    """Write the board and the casting board's markers, each with the place of its centre."""
    side = round(markers.side_m * DOTS_PER_M)
    _write_picture(folder / "printed_board.png", printed_board())
    places = []
    for number, (x, y) in enumerate(markers.centres_m):
        black = cv2.aruco.generateImageMarker(dictionary(), number, side, borderBits=BORDER_MODULES)
        paper = np.pad(black, side // 6, constant_values=255)
        _write_picture(folder / f"marker_{number:02d}.png", paper)
        places.append({"marker": number, "x_m": round(x, 4), "y_m": round(y, 4)})
    write_yaml(folder / "places.yaml", places)
    tell(
        f"{folder}: print every picture at 300 dots an inch (squares of 35 mm, markers of "
        f"{markers.side_m * 1e3:.0f} mm); lay the markers where places.yaml says, top towards +x"
    )


def views(camera: Webcam) -> list[np.ndarray]:
    """Take a picture a second in which the board is seen, while somebody tilts and moves it."""
    pictures: list[np.ndarray] = []
    until = time.monotonic() + AT_MOST_S
    with bar("hold the printed board into the picture, tilted, elsewhere each time") as progress:
        while len(pictures) < VIEWS and time.monotonic() < until:
            picture = camera.picture()
            if board_corners(picture) is not None:
                pictures.append(picture)
            progress(len(pictures), VIEWS)
            time.sleep(EVERY_S)
    return pictures


def _write_picture(path: Path, picture: np.ndarray) -> None:
    with atomic_file(path) as temporary:
        cv2.imwrite(str(temporary), picture)


def show_dry_run(rig: Rig, limits: PlanLimits, actions: Sequence[Action], folder: Path) -> None:
    """Plot the whole motion of every action from home, or say why it is refused; move nothing."""
    if not isinstance(rig, Ur5Rig):
        raise ValueError("rig.dry_run=true is for rig=ur5")
    home, drawn = rig.home_rad(), 0
    for number, action in enumerate(actions):
        try:
            whole = rig.planned_motion(plan_action(action, r0_m=rig.r0_m, limits=limits), home)
        except ValueError as error:
            warn(f"action {number}: {error}")
            continue
        drawing = motion_svg(whole, rig.gripper, rig.limits.cast)
        write_text(folder / "dry_run" / f"action_{number:05d}.svg", drawing)
        drawn += 1
    refused = len(actions) - drawn
    tell(f"{folder / 'dry_run'}: {drawn} motions drawn, {refused} refused, nothing moved")


def motion_svg(whole: WholeMotion, gripper: Gripper, envelope: Envelope) -> str:
    """Return the held end over the board and the joints in time, reset and cast in a row."""
    parts = (("reset", whole.reset, BLUE), ("cast", whole.cast, VERMILION))
    with style():
        figure = Figure(figsize=(7.2, 6.4))
        axes = figure.subplot_mosaic([["board", "height"], ["joints", "joints"]])
        begin_s = 0.0
        for name, motion, colour in parts:
            held = link_points(motion.joints_rad, gripper)[:, -1]
            t_s = begin_s + motion.t_s
            axes["board"].plot(held[:, 1], held[:, 0], color=colour, label=name)
            axes["height"].plot(t_s, held[:, 2], color=colour)
            for angles, joint, shade in zip(motion.joints_rad.T, JOINTS, CYCLE, strict=False):
                label = joint if name == "reset" else None
                axes["joints"].plot(t_s, np.degrees(angles), color=shade, label=label)
            begin_s = float(t_s[-1])
        (x_low, x_high), (y_low, y_high) = envelope.box.x_m, envelope.box.y_m
        corners = [(y_low, x_low), (y_low, x_high), (y_high, x_high), (y_high, x_low)]
        axes["board"].plot(*np.array([*corners, corners[0]]).T, color=GREY, linewidth=0.8)
        board_axes(axes["board"])
        axes["board"].legend()
        axes["height"].set(xlabel="time [s]", ylabel="height of the held end [m]")
        axes["joints"].set(xlabel="time [s]", ylabel="joint angle [°]")
        axes["joints"].axvline(float(whole.reset.t_s[-1]), color=GREY, linewidth=0.8)
        axes["joints"].legend(ncols=6)
    return svg(figure)
