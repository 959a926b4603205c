"""Cast further actions on the rig of a benchmark case, to tell two effects apart.

    python stages/hidden_cast.py measurements=data/hidden_effects/sets/case-001 \
        hidden_effects.actions=actions.csv output=DIR

`output` gets the case's casts and, after them, one cast of each row of actions.csv.
"""

from pathlib import Path

from grids import build_limits
from omegaconf import DictConfig
from stage import console, stage
from virtual_rig import rig_with_cable

from robotcast.casts.action_file import read_actions
from robotcast.hidden_effects.further import further_casts
from robotcast.hidden_effects.layout import answer_path
from robotcast.hidden_effects.seal import unseal
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.writer import write_measurement_set
from robotcast.processes import process_pool
from robotcast.rigs.virtual.rig import Eye


def hidden_cast(config: DictConfig) -> None:
    settings = config.hidden_effects
    for name, given in (
        ("measurements", config.measurements),
        ("output", config.output),
        ("hidden_effects.actions", settings.actions),
    ):
        if given is None:
            raise ValueError(f"{name}= must be given")
    folder = Path(config.measurements)
    answer = unseal(answer_path(folder.name, Path(settings.reports)))
    with process_pool(config.rig.workers) as pool:
        grown = further_casts(
            read_measurement_set(folder),
            answer,
            rig_with_cable(config, answer["drawn"]["cable"]),
            read_actions(Path(settings.actions)),
            Eye(**settings.eye),
            build_limits(config),
            pool,
        )
    write_measurement_set(grown, Path(config.output))
    console.print(f"{config.output}: {len(grown.trials)} casts")


if __name__ == "__main__":
    stage(hidden_cast)()
