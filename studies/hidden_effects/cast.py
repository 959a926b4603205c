"""Cast further actions on the rig of a benchmark case, to tell two effects apart.

    python -m studies.hidden_effects.cast measurements=data/hidden_effects/sets/case-001 \
        hidden_effects.actions=actions.csv output=DIR

`output` gets the case's casts and, after them, one cast of each row of actions.csv.
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import build, build_rig, with_cable
from robotcast.casts.table import read_actions
from robotcast.files import unseal
from robotcast.measurements.reader import read_measurement_set, write_measurement_set
from robotcast.processes import process_pool
from robotcast.rigs.virtual.rig import Eye
from robotcast.stage import require, stage, tell
from studies.hidden_effects.cases import answer_path
from studies.hidden_effects.measuring import further_casts


def cast(config: DictConfig) -> None:
    settings = config.hidden_effects
    require(config, "measurements", "output")
    if settings.actions is None:
        raise ValueError("hidden_effects.actions= must be given")
    folder = Path(config.measurements)
    answer = unseal(answer_path(folder.name, Path(settings.reports)))
    with process_pool(config.rig.workers) as pool:
        grown = further_casts(
            read_measurement_set(folder),
            answer,
            build_rig(with_cable(config, answer["drawn"]["cable"])),
            read_actions(Path(settings.actions)),
            Eye(**settings.eye),
            build(config.casts.limits),
            pool,
        )
    write_measurement_set(grown, Path(config.output))
    tell(f"{config.output}: {len(grown.trials)} casts")


if __name__ == "__main__":
    stage(cast)()
