"""Compare a tuned simulator with measured casts: how far off is it, when, where, for which?

python stages/compare.py measurements=DIR output=DIR [tuned=DIR]
"""

import json

from omegaconf import DictConfig

from robotcast.files import write_text
from robotcast.reporting.comparison_page import comparison_page
from robotcast.running import write_page
from robotcast.stage import output_folder, require, stage, tell
from robotcast.workflow.comparing import compare_model


def compare(config: DictConfig) -> None:
    require(config, "measurements", "output")
    folder = output_folder(config.output)
    facts, found = compare_model(config)
    plain = {**facts, **found.as_dict()}
    write_text(folder / "comparison.json", json.dumps(plain, ensure_ascii=False, allow_nan=False))
    write_page(folder / "index.html", comparison_page(plain))
    floor = found.repeats.sample_percent
    noise = "unknown" if floor is None else f"{floor:.2f} %"
    tell(
        f"{folder}: {found.waypoint_error_percent:.2f} % average waypoint, "
        f"{found.final_error_percent:.2f} % median final error, noise floor {noise}, "
        f"{found.error_unit.removeprefix('% ')}; open {folder / 'index.html'}"
    )
    for finding in found.findings:
        tell(f"- {finding.sentence}")


if __name__ == "__main__":
    stage(compare)()
