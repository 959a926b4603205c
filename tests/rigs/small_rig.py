"""A virtual rig with a small picture, for tests."""

from robotcast.measurements.measurement_set import Cable
from robotcast.rigs.kinematics import Gripper
from robotcast.rigs.virtual.cable import ArmDynamics, CableTruth, CastNoise, packaged_scatter
from robotcast.rigs.virtual.picture import PictureSettings
from robotcast.rigs.virtual.rig import VirtualRig
from robotcast.vision.camera import Camera
from robotcast.vision.facts import FiducialBoard, TrackerFacts

R0_M = 0.6
CABLE = Cable("cable1", 0.63, 0.008, 0.0045, 0.02)
TRUTH = CableTruth(
    friction=0.35,
    bending_stiffness_n_m2=4e-4,
    bending_damping_s=0.12,
    hysteresis_n_m=3e-5,
    tightest_bend_m=0.014,
    endpoint_radius_m=0.015,
)


def small_rig(
    width: int,
    height: int,
    *,
    fps: float,
    marker_m: float,
    noise_grey: float,
    truth: CableTruth,
    gripper: Gripper,
) -> VirtualRig:
    """Return the rig with markers of `marker_m`, filmed with this size, rate and noise."""
    fiducials = FiducialBoard.along_edges(
        1.55, 2.45, side_m=marker_m, margin_m=0.07, spacing_m=0.35
    )
    picture = PictureSettings(
        fiducials=fiducials,
        board_length_m=1.55,
        board_width_m=2.45,
        fps=fps,
        exposure_s=0.004,
        noise_grey=noise_grey,
        vignetting=0.12,
        board_bgr=(150.0, 85.0, 35.0),
        endpoint_bgr=(150.0, 30.0, 240.0),
        cable_bgr=(205.0, 210.0, 215.0),
    )
    tracker = TrackerFacts(
        period_s=0.1,
        exposure_s=picture.exposure_s,
        focal_widths=0.7,
        endpoint_radius_m=truth.endpoint_radius_m,
        endpoint_height_m=CABLE.radius_m,
        endpoint_bgr=picture.endpoint_bgr,
        board_bgr=picture.board_bgr,
        fiducials=fiducials,
    )
    return VirtualRig(
        cable=CABLE,
        truth=truth,
        r0_m=R0_M,
        arm=ArmDynamics(),
        noise=CastNoise(),
        scatter=packaged_scatter("cable1"),
        gripper=gripper,
        camera=Camera.overhead(width, height, focal_widths=0.7, position_m=(0.8, 0.0, 2.2)),
        picture=picture,
        tracker=tracker,
    )
