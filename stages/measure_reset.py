"""Simulate resets after casts and keep how they scatter the start: the virtual rig draws from it.

Not part of the pipeline; rerun it for a cable whose `truth` or reset has changed.
"""

import numpy as np
from omegaconf import DictConfig

from robotcast.build import action_space, build, build_rig
from robotcast.casts.plan import plan_action
from robotcast.files import atomic_file
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.arm import StartScatter, packaged_path
from robotcast.rigs.virtual.rig import measure_resets
from robotcast.stage import bar, stage, tell

RESETS = 20
STRAIGHT = StartScatter(np.array([0.0, 1.0]), np.zeros((3, 2)))  # along +x, before any reset


def measure_reset(config: DictConfig) -> None:
    rig = build_rig(config, scatter=STRAIGHT)
    space = action_space(config, "collected")
    chosen = choose_casts(feasible_actions(*space)[0], RESETS, 0, config.seed)
    casts = [plan_action(action, r0_m=rig.r0_m, limits=space[2]) for _, action in chosen]
    with bar(f"resets of {rig.cable.name}") as progress:
        scatter = measure_resets(rig, casts, build(config.casts.reset), progress)
    path = packaged_path(rig.cable.name)
    with atomic_file(path) as temporary:
        scatter.table().write_csv(temporary, float_precision=6)
    spread = scatter.headings_rad.std(axis=0, ddof=1) * 1e3
    shown = ", ".join(f"{value:.1f}" for value in spread)
    tell(f"{path.name}: headings scatter by {shown} mrad from the hand to the free end")


if __name__ == "__main__":
    stage(measure_reset)()
