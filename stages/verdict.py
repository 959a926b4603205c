"""Print the effects that a diagnosis named, with commas between; none for the base model.

python stages/verdict.py output=DIR [studies.better_model.model=base]
"""

import json
from pathlib import Path

from omegaconf import DictConfig
from stage import require, stage

NO_EFFECT = ("none", "unknown")


def verdict(config: DictConfig) -> None:
    require(config, "output")
    if config.studies.better_model.model == "base":
        return
    said = json.loads((Path(config.output) / "diagnosis.json").read_text(encoding="utf-8"))
    print(",".join(name for name in said["verdict"] if name not in NO_EFFECT))


if __name__ == "__main__":
    stage(verdict)()
