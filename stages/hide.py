"""Draw what the virtual rig hides on one cable, and seal it: `report` alone opens it.

python stages/hide.py cable=cable2 output=DIR   # one file a cable
"""

from pathlib import Path

import yaml
from omegaconf import DictConfig

from robotcast.build import CONFIGURATION, action_space, build, build_rig
from robotcast.casts.plan import plan_action
from robotcast.processes import process_pool
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.sealed import seal
from robotcast.rigs.virtual.hiding import draw_hidden
from robotcast.stage import require, stage, tell

PARAMETERS = Path("params.yaml")  # `hidden` may be a word there, which DVC cannot pass on
NOTHING = {"effects": []}


def hide(config: DictConfig) -> None:
    require(config, "output")
    chosen = yaml.safe_load(PARAMETERS.read_text(encoding="utf-8"))["hidden"]
    if chosen != "none" and not (isinstance(chosen, dict) and set(chosen) == {"seed"}):
        raise ValueError(f"{PARAMETERS}: hidden must be none or {{ seed: N }}, is {chosen}")
    answers = {p.stem: NOTHING for p in (CONFIGURATION / "cable").glob("*.yaml")}
    if chosen != "none" and "hide" in config.rig:
        rig, (grid, r0_m, limits, envelope) = build_rig(config), action_space(config, "collected")
        feasible, _ = feasible_actions(grid, r0_m, limits, envelope)
        actions = choose_casts(feasible, config.rig.hide.casts, 0, config.seed)
        planned = [plan_action(action, r0_m=r0_m, limits=limits) for _, action in actions]
        with process_pool(config.rig.workers) as pool:
            answers[config.cable.name] = draw_hidden(
                rig, planned, pool, int(chosen["seed"]), **build(config.rig.hide.draw)
            )
    for cable, answer in answers.items():
        seal(answer, Path(config.output) / f"{cable}.sealed")
    tell(f"{config.output}: what the cables' rigs hide is sealed")


if __name__ == "__main__":
    stage(hide)()
