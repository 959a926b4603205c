"""What the camera over the board tells before a cast: where it stands, where the end lies."""

from dataclasses import dataclass

import numpy as np

from robotcast.rigs.rig import RigStopped
from robotcast.rigs.ur5_robot.webcam import Webcam
from robotcast.vision.calibration import calibrate
from robotcast.vision.camera import Camera
from robotcast.vision.detector import EndpointDetector
from robotcast.vision.facts import TrackerFacts


@dataclass(frozen=True)
class Sight:
    """An open camera, and what a tracker knows of what it sees."""

    camera: Webcam
    facts: TrackerFacts

    def calibrated(self, picture: np.ndarray) -> Camera:
        """Return the camera as the markers in its picture tell it."""
        try:
            return calibrate(picture, self.facts, self.camera.settings.source).camera
        except ValueError as error:
            raise RigStopped(str(error)) from None

    def end_lies_at(self, place_m: np.ndarray, within_m: float) -> bool:
        """Tell whether the cable's free end lies at a place (2,) of the board now."""
        picture = self.camera.picture()
        camera = self.calibrated(picture)
        found = EndpointDetector(camera, self.facts, picture).detect(picture)
        return found is not None and bool(np.linalg.norm(found.xy_m - place_m) <= within_m)
