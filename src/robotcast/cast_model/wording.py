"""What diagnosis calls the things of a cast."""

from robotcast.diagnosis.wording import Axis, Wording

CAST_WORDING = Wording(
    trial="cast",
    trials="casts",
    sample="waypoint",
    samples="waypoints",
    mover="the free end",
    axes=(
        Axis("x", "m", "far from the robot", "near the robot"),
        Axis("y", "m", "on the left", "on the right"),
    ),
    factor_units={
        "theta1": "rad",
        "r1": "m",
        "theta2": "rad",
        "r2": "m",
        "alpha": "rad",
        "vmax": "m/s",
    },
)
