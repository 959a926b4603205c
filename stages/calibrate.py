"""Print what the camera is calibrated with, and find its focal length from views of a board.

python stages/calibrate.py output=DIR                           # what to print
python stages/calibrate.py rig=ur5 rig.camera=0 output=DIR      # views of the printed board
"""

from contextlib import closing
from dataclasses import asdict
from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import build
from robotcast.files import write_yaml
from robotcast.rigs.ur5.camera import Webcam, WebcamSettings
from robotcast.stage import require, stage, tell
from robotcast.vision.calibration import calibrate_lens
from robotcast.workflow.commissioning import views, write_prints


def calibrate(config: DictConfig) -> None:
    require(config, "output")
    folder, rig = Path(config.output), config.rig
    if rig.get("camera") is None:
        return write_prints(folder, build(config.camera.fiducials))
    settings = WebcamSettings(str(rig.camera), rig.width, rig.height, rig.fps)
    with closing(Webcam(settings)) as camera:
        pictures = views(camera)
    lens = calibrate_lens(pictures)
    write_yaml(folder / "lens.yaml", asdict(lens))
    tell(
        f"{folder / 'lens.yaml'}: focal length {lens.focal_widths:.4f} ± {lens.spread_widths:.4f} "
        f"image widths from {lens.views} views ({lens.reprojection_px:.2f} px); set it as "
        "nominal.focal_widths in conf/camera/overhead.yaml"
    )


if __name__ == "__main__":
    stage(calibrate)()
