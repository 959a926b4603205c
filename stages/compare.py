"""Compare a model with what was measured: how far off is it, when, where, for which?

python stages/compare.py measurements=DIR output=DIR [tuned=DIR]
python stages/compare.py model=mjcf robot=FOLDER output=DIR [effects=[…]]
"""

import json

from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.comparison_page import comparison_page
from robotcast.running import write_page
from robotcast.stage import output_folder, require, stage, tell
from robotcast.workflow.comparing import compare_model
from robotcast.workflow.diagnosing_robot import compare_robot


def compare(config: DictConfig) -> None:
    of_robot = config.model == "mjcf"
    require(config, "robot" if of_robot else "measurements", "output")
    folder = output_folder(config.output, config.measurements)
    found = (compare_robot if of_robot else compare_model)(config)
    write_text(folder / "comparison.json", json.dumps(found, ensure_ascii=False, allow_nan=False))
    write_page(folder / "index.html", comparison_page(found))
    final, noise = (
        "unknown" if found[name] is None else f"{found[name]:.2f} %"
        for name in ("final_error_percent", "noise_floor_percent")
    )
    tell(
        f"{folder}: {found['waypoint_error_percent']:.2f} % average {found['words']['sample']}, "
        f"median final error {final}, noise floor {noise}, "
        f"{found['error_unit'].removeprefix('% ')}; open {folder / 'index.html'}"
    )
    for finding in found["slices"]:
        tell(f"- {finding['sentence']}")


if __name__ == "__main__":
    stage(compare)()
