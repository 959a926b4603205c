"""Draw what the virtual rig hides on one cable, and seal it for `report`: cable=NAME output=DIR"""

from pathlib import Path

import yaml
from omegaconf import DictConfig

from robotcast.build import CONFIGURATION, action_space, build, build_rig
from robotcast.casts.plan import plan_action
from robotcast.files import seal
from robotcast.processes import process_pool
from robotcast.rigs.collect import choose_casts
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.hiding import draw_hidden
from robotcast.stage import require, stage, tell

PARAMETERS = Path("params.yaml")  # `hidden` may be a word there, which DVC cannot pass on


def hide(config: DictConfig) -> None:
    require(config, "output")
    chosen = yaml.safe_load(PARAMETERS.read_text("utf-8"))["hidden"]
    if chosen != "none" and not (isinstance(chosen, dict) and set(chosen) == {"seed"}):
        raise ValueError(f"{PARAMETERS}: hidden must be none or {{ seed: N }}, is {chosen}")
    answers = {p.stem: {"effects": []} for p in (CONFIGURATION / "cable").glob("*.yaml")}
    if chosen != "none" and "hide" in config.rig:
        rig, space, given = build_rig(config), action_space(config, "collected"), config.rig.hide
        casts = choose_casts(feasible_actions(*space), given.casts, 0, config.seed)
        planned = [plan_action(action, r0_m=space[1], limits=space[2]) for _, action in casts]
        with process_pool(config.rig.workers) as pool:
            answer = draw_hidden(rig, planned, pool, int(chosen["seed"]), **build(given.draw))
        answers[config.cable.name] = answer
    for cable, answer in answers.items():
        seal(answer, Path(config.output) / f"{cable}.sealed")
    tell(f"{config.output}: what the cables' rigs hide is sealed")


if __name__ == "__main__":
    stage(hide)()
