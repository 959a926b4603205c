"""Measuring casts of the virtual rig without a video: the camera is a noisy look at the end."""

from dataclasses import dataclass

import numpy as np

from robotcast.casts.plan import PlannedCast
from robotcast.casts.tool_motion import ToolMotion
from robotcast.measurements.measurement_set import Trial
from robotcast.rigs.virtual.chance import generator
from robotcast.rigs.virtual.drive import Motion
from robotcast.rigs.virtual.hidden.effect import Seeing
from robotcast.rigs.virtual.rig import VirtualRig


@dataclass(frozen=True)
class Eye:
    """How the free end is tracked.

    Attributes
    ----------
    period_s : from one waypoint to the next.
    noise_m : standard deviation of one tracked coordinate.
    noise_s : by how much that grows with the end's speed [m per m/s], as blurred frames do.
    """

    period_s: float = 0.1
    noise_m: float = 0.001
    noise_s: float = 0.0


def measure_cast(
    rig: VirtualRig, eye: Eye, planned: PlannedCast, number: int, action_id: int
) -> Trial:
    """Simulate cast `number`, log its tool and track its free end until it rests."""
    truth = rig.simulate_truth(planned, number)
    stamps = waypoint_times(truth.cable, eye.period_s)
    places = seen_places(rig, truth.cable, stamps)
    speeds = _speeds(truth.cable, stamps)
    random = generator(rig.seed, number, "track")
    spread = (eye.noise_m + eye.noise_s * speeds)[:, None]
    return Trial(
        trial=number,
        action_id=action_id,
        action=planned.action,
        tool=rig.log_tool(truth.tool, number),
        waypoints_s=stamps,
        waypoints_m=places + spread * random.standard_normal(places.shape),
    )


def waypoint_times(cable: Motion, period_s: float) -> np.ndarray:
    """Return the stamps (k,) of the waypoints of a motion."""
    return np.arange(int(cable.t_s[-1] / period_s + 1e-9) + 1) * period_s


def seen_places(rig: VirtualRig, cable: Motion, stamp_s: np.ndarray) -> np.ndarray:
    """Return where the rig's camera puts the free end in waypoints so stamped, (k, 2)."""
    looks = [effect for effect in rig.hidden if isinstance(effect, Seeing)]
    for look in looks:
        stamp_s = look.seen_s(stamp_s)
    places = ToolMotion(cable.t_s, cable.end_m).at(stamp_s)[:, :2]
    for look in looks:
        places = look.seen_m(places)
    return places


def _speeds(cable: Motion, t_s: np.ndarray) -> np.ndarray:
    speeds = np.linalg.norm(np.gradient(cable.end_m[:, :2], cable.t_s, axis=0), axis=1)
    return np.interp(t_s, cable.t_s, speeds)
