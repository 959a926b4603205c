"""Draw what the virtual rig hides on one cable, and seal it: `report` alone opens it.

python stages/hide.py cable=cable2 output=FILE
"""

from pathlib import Path
from typing import Any

import yaml
from omegaconf import DictConfig

from robotcast.build import action_space, build_rig
from robotcast.casts.plan import plan_action
from robotcast.processes import process_pool
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.hiding import draw_hidden, seal
from robotcast.stage import require, stage, tell

PARAMETERS = Path("params.yaml")  # `hidden` may be a word there, which DVC cannot pass on


def hide(config: DictConfig) -> None:
    require(config, "output")
    chosen = yaml.safe_load(PARAMETERS.read_text(encoding="utf-8"))["hidden"]
    seed = chosen.get("seed") if isinstance(chosen, dict) else None
    if not isinstance(chosen, dict) and chosen != "none":
        raise ValueError(f"params.yaml: hidden must be none or {{seed: N}}, is {chosen}")
    answer: dict[str, Any] = {"effects": []}
    if seed is not None and "hide" in config.rig and config.loop == config.cable.name:
        rig, settings = build_rig(config), config.rig.hide
        grid, r0_m, limits, envelope = action_space(config, "collected")
        feasible, _ = feasible_actions(grid, r0_m, limits, envelope)
        actions = choose_casts(feasible, settings.casts, 0, config.seed)
        planned = [plan_action(action, r0_m=r0_m, limits=limits) for _, action in actions]
        with process_pool(config.rig.workers) as pool:
            answer = draw_hidden(
                rig, settings.effects, planned, settings.moves_percent, int(seed), pool
            )
    seal(answer, Path(config.output))
    tell(f"{config.output}: {'something' if answer['effects'] else 'nothing'} is hidden")


if __name__ == "__main__":
    stage(hide)()
