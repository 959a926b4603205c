"""Drawing what the UR5 would do: rig.dry_run=true."""

from pathlib import Path

from grids import build_limits
from omegaconf import DictConfig
from stage import console

from robotcast.casts.action import Action
from robotcast.casts.plan import plan_action
from robotcast.files import atomic_file
from robotcast.reporting.motion import motion_svg
from robotcast.rigs.rig import Rig
from robotcast.rigs.ur5.rig import Ur5Rig


def show_dry_run(config: DictConfig, rig: Rig, actions: list[Action], folder: Path) -> None:
    """Plot the whole motion of every action from home, or say why it is refused; move nothing."""
    if not isinstance(rig, Ur5Rig):
        raise ValueError("rig.dry_run=true is for rig=ur5")
    home, drawn, refused = rig.home_rad(), 0, 0
    for number, action in enumerate(actions):
        try:
            planned = plan_action(action, r0_m=rig.r0_m, limits=build_limits(config))
            whole = rig.planned_motion(planned, home)
        except ValueError as error:
            refused += 1
            console.print(f"action {number}: {error}", style="yellow", markup=False)
            continue
        path = folder / "dry_run" / f"action_{number:05d}.svg"
        with atomic_file(path) as temporary:
            temporary.write_bytes(motion_svg(whole, rig.gripper, rig.limits.cast))
        drawn += 1
    console.print(f"{folder / 'dry_run'}: {drawn} motions drawn, {refused} refused, nothing moved")
