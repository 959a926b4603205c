"""Learn which physical effect a simulator lacks on a set of measured casts.

python stages/diagnose.py measurements=DIR output=DIR [effects=[…]] [exclude=[…]]
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.stage import require, stage, tell
from robotcast.workflow.diagnosing import diagnose_set


def diagnose(config: DictConfig) -> None:
    require(config, "measurements", "output")
    folder, found = diagnose_set(config)
    tell(f"{folder}: {found['sentence']}")
    for note in found["notes"]:
        tell(f"- {note}")
    tell(f"open {folder / 'index.html'}")
    if (sealed := Path(config.measurements) / "answer.sealed").is_file():
        tell(f"what was hidden: python -m studies.hidden_effects.answer {sealed}")


if __name__ == "__main__":
    stage(diagnose)()
