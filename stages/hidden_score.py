"""Open the sealed answers of the hidden-effect benchmark and score the diagnoses."""

from pathlib import Path

from omegaconf import DictConfig
from stage import console, output_folder, stage

from robotcast.hidden_effects.layout import results_folder
from robotcast.hidden_effects.outcome import read_outcomes
from robotcast.hidden_effects.report import write_results
from robotcast.hidden_effects.score import criteria
from robotcast.hidden_effects.tables import criteria_rows


def hidden_score(config: DictConfig) -> None:
    reports = Path(config.hidden_effects.reports)
    outcomes = read_outcomes(reports)
    written = write_results(outcomes, output_folder(str(results_folder(reports))))
    for line in criteria_rows(outcomes)[1:]:
        console.print(": ".join([line[0], ", ".join(line[1:])]), markup=False)
    missed = [one.name for one in criteria(outcomes) if one.met is False]
    console.print(f"{written[0].parent}: {len(written)} files, {len(missed)} criteria not met")


if __name__ == "__main__":
    stage(hidden_score)()
