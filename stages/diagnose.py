"""Learn which physical effect a simulator lacks on a set of measured casts.

python stages/diagnose.py measurements=DIR output=DIR [effects=[…]] [exclude=[…]]
python stages/diagnose.py model=mjcf robot=FOLDER output=DIR [effects=[…]] [exclude=[…]]
"""

from pathlib import Path

from omegaconf import DictConfig

from robotcast.reporting.diagnosis_page import figures_told
from robotcast.stage import require, stage, tell
from robotcast.workflow.diagnosing import diagnose_set
from robotcast.workflow.diagnosing_robot import diagnose_robot


def diagnose(config: DictConfig) -> None:
    of_robot = config.model == "mjcf"
    require(config, "robot" if of_robot else "measurements", "output")
    folder, found = (diagnose_robot if of_robot else diagnose_set)(config)
    tell(f"{folder}: {found['sentence']}")
    for note in (*figures_told(found), *found["notes"]):
        tell(f"- {note}")
    tell(f"open {folder / 'index.html'}")
    if not of_robot and (sealed := Path(config.measurements) / "answer.sealed").is_file():
        tell(f"what was hidden: python -m studies.hidden_effects.answer {sealed}")


if __name__ == "__main__":
    stage(diagnose)()
