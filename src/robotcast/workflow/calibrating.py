"""What is printed for the camera's calibration, and pictures of the printed board."""

import time
from pathlib import Path

import cv2
import numpy as np
import yaml

from robotcast.files import atomic_file, write_text
from robotcast.rigs.ur5.camera import Webcam
from robotcast.stage import bar, tell
from robotcast.vision.calibration import DOTS_PER_M, PrintedBoard
from robotcast.vision.fiducials import BORDER_MODULES, FiducialBoard, dictionary

VIEWS, EVERY_S, AT_MOST_S = 15, 1.0, 180.0


def write_prints(folder: Path, board: PrintedBoard, markers: FiducialBoard) -> None:
    """Write the board and the casting board's markers, each with the place of its centre."""
    side = round(markers.side_m * DOTS_PER_M)
    _write_picture(folder / "printed_board.png", board.picture())
    places = []
    for number, (x, y) in enumerate(markers.centres_m):
        black = cv2.aruco.generateImageMarker(dictionary(), number, side, borderBits=BORDER_MODULES)
        paper = np.pad(black, side // 6, constant_values=255)
        _write_picture(folder / f"marker_{number:02d}.png", paper)
        places.append({"marker": number, "x_m": round(x, 4), "y_m": round(y, 4)})
    write_text(folder / "places.yaml", yaml.safe_dump(places, sort_keys=False))
    tell(
        f"{folder}: print every picture at 300 dots an inch (squares of 35 mm, markers of "
        f"{markers.side_m * 1e3:.0f} mm); lay the markers where places.yaml says, top towards +x"
    )


def views(camera: Webcam, board: PrintedBoard) -> list[np.ndarray]:
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
