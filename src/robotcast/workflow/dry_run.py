"""Drawing what the UR5 would do: rig.dry_run=true."""

from collections.abc import Sequence
from pathlib import Path

from robotcast.casts.action import Action
from robotcast.casts.plan import PlanLimits, plan_action
from robotcast.files import atomic_file
from robotcast.reporting.figures import motion_svg
from robotcast.rigs.rig import Rig
from robotcast.rigs.ur5.rig import Ur5Rig
from robotcast.stage import tell, warn


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
        with atomic_file(folder / "dry_run" / f"action_{number:05d}.svg") as temporary:
            temporary.write_bytes(motion_svg(whole, rig.gripper, rig.limits.cast))
        drawn += 1
    refused = len(actions) - drawn
    tell(f"{folder / 'dry_run'}: {drawn} motions drawn, {refused} refused, nothing moved")
