"""Fit from five starts to every answered set: do all end at the same loss?

python benchmarks/five_starts.py ../shared/data/casting [--sets einty]

For the model as it is, and for the model with the hidden effects where the library holds them: the
nominal parameters and four draws from all over their ranges, each the middle of an ensemble's first
members, as a diagnosis begins. The loss is that of the fit to whole casts.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from hydra import compose, initialize_config_dir

from robotcast.diagnosis.diagnose import floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry, fit_base
from robotcast.fitting.starts import hypercube
from robotcast.measurements.reader import read_measurement_set
from robotcast.workflow.diagnosing import case_of

ROOT = Path(__file__).resolve().parents[1]
STARTS, ALL_OVER, SEED = 5, 0.8, 0


def losses(measurements: Path, hidden: tuple[str, ...]) -> np.ndarray:
    """Return the loss that the model with these effects ends at, from every start."""
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=[f"measurements={measurements}"])
    case = case_of(config, read_measurement_set(measurements))
    inquiry = Inquiry(case.model, case.records, floor_and_noise(case)[1])
    nominal = inquiry.nominal(hidden)
    starts = hypercube(nominal, ALL_OVER, STARTS, SEED)
    starts[0] = nominal
    starts[:, len(case.model.parameters) :] = nominal[len(case.model.parameters) :]
    effort = replace(case.effort, refit=3)
    return np.array([fit_base(inquiry, hidden, effort, start).fit.loss for start in starts])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", default="", help="names of one letter, all by default")
    given = parser.parse_args()
    answers = yaml.safe_load((given.folder / "answers.yaml").read_text(encoding="utf-8"))
    print(
        "| set | effects | loss from five starts | largest over least |\n| --- | --- | --- | --- |"
    )
    for one in sorted(given.sets or answers):
        for hidden in dict.fromkeys(((), *(tuple(n) for n in answers[one]["accept"][:1]))):
            if set(hidden) & {"none", "unknown"}:
                continue
            ended = losses(given.folder / one, hidden)
            shown = ", ".join(f"{loss:.3f}" for loss in ended)
            ratio = ended.max() / ended.min()
            print(f"| {one} | {' + '.join(hidden) or 'none'} | {shown} | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()
