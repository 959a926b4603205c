"""The journals of searches under way, kept beside DVC's outputs, which a rerun would delete."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig, OmegaConf
from stage import unfinished_file

from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.source import source_digest
from robotcast.tuning.asking import Evaluate
from robotcast.tuning.journal import Journal

ROOMS = ("casts", "effects", "fitting", "measurements", "simulators", "tuning")


def open_journal(
    config: DictConfig,
    output: Path,
    parameters: Sequence[Parameter],
    cable: Cable,
    trials: Sequence[Trial],
    evaluate: Evaluate,
) -> Journal:
    """Return the journal of the search whose result goes to `output`."""
    path = unfinished_file(config, output, ".jsonl")
    return Journal(path, _subject(config, parameters, cable, trials), evaluate)


def _subject(
    config: DictConfig, parameters: Sequence[Parameter], cable: Cable, trials: Sequence[Trial]
) -> str:
    """Return a fingerprint of everything that the objective and the search depend on.

    That holds the code as well: answers of another simulator must not be taken for this one's.
    """
    text = OmegaConf.to_yaml(
        OmegaConf.create(
            {
                "simulator": config.simulator,
                "optimizer": config.optimizer,
                "effects": list(config.effects),
            },
            parent=config,
        ),
        resolve=True,
    )
    digest = hashlib.sha256(f"{text}{parameters}{cable}{source_digest(*ROOMS)}".encode())
    for trial in trials:
        for array in (trial.tool.t_s, trial.tool.pose, trial.waypoints_s, trial.waypoints_m):
            digest.update(array.tobytes())
    return digest.hexdigest()
