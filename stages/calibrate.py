"""Print what the camera is calibrated with, and find its focal length from views of a board.

python stages/calibrate.py output=DIR                           # what to print
python stages/calibrate.py rig=ur5 rig.camera=0 output=DIR      # views of the printed board
"""

import time
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import yaml
from filmed_cable import build_tracker
from omegaconf import DictConfig
from stage import bar, console, require, stage

from robotcast.files import atomic_file, write_text
from robotcast.rigs.ur5.camera import Webcam, WebcamSettings
from robotcast.vision.fiducials import BORDER_MODULES, dictionary
from robotcast.vision.printed_board import DOTS_PER_M, PrintedBoard, calibrate_lens

VIEWS, EVERY_S, AT_MOST_S = 15, 1.0, 180.0


def calibrate(config: DictConfig) -> None:
    require(config, "output")
    folder, board = Path(config.output), PrintedBoard()
    if config.rig.get("camera") is None:
        _print(config, folder, board)
        return
    rig = config.rig
    camera = Webcam(WebcamSettings(str(rig.camera), rig.width, rig.height, rig.fps))
    try:
        pictures = _views(camera, board)
    finally:
        camera.close()
    lens = calibrate_lens(pictures, board)
    write_text(folder / "lens.yaml", yaml.safe_dump(asdict(lens), sort_keys=False))
    console.print(
        f"{folder / 'lens.yaml'}: focal length {lens.focal_widths:.4f} ± {lens.spread_widths:.4f} "
        f"image widths from {lens.views} views ({lens.reprojection_px:.2f} px); set it as "
        "nominal.focal_widths in conf/camera/overhead.yaml",
        markup=False,
    )


def _print(config: DictConfig, folder: Path, board: PrintedBoard) -> None:
    """Write the board and the casting board's markers, each with the place of its centre."""
    markers = build_tracker(config).fiducials
    side = round(markers.side_m * DOTS_PER_M)
    _write_picture(folder / "printed_board.png", board.picture())
    places = []
    for number, (x, y) in enumerate(markers.centres_m):
        black = cv2.aruco.generateImageMarker(dictionary(), number, side, borderBits=BORDER_MODULES)
        paper = np.pad(black, side // 6, constant_values=255)
        _write_picture(folder / f"marker_{number:02d}.png", paper)
        places.append({"marker": number, "x_m": round(x, 4), "y_m": round(y, 4)})
    write_text(folder / "places.yaml", yaml.safe_dump(places, sort_keys=False))
    console.print(
        f"{folder}: print every picture at 300 dots an inch (squares of 35 mm, markers of "
        f"{markers.side_m * 1e3:.0f} mm); lay the markers where places.yaml says, top towards +x"
    )


def _views(camera: Webcam, board: PrintedBoard) -> list[np.ndarray]:
    """Take a picture a second in which the board is seen, while somebody tilts and moves it."""
    pictures: list[np.ndarray] = []
    until = time.monotonic() + AT_MOST_S
    with bar("hold the printed board into the picture, tilted, elsewhere each time") as progress:
        while len(pictures) < VIEWS and time.monotonic() < until:
            picture = camera.picture()
            if board.corners(picture) is not None:
                pictures.append(picture)
            progress(len(pictures), VIEWS)
            time.sleep(EVERY_S)
    return pictures


def _write_picture(path: Path, picture: np.ndarray) -> None:
    with atomic_file(path) as temporary:
        cv2.imwrite(str(temporary), picture)


if __name__ == "__main__":
    stage(calibrate)()
