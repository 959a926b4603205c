"""Write tables, figures and the HTML page from whatever results there are."""

from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from stage import console, output_folder, stage

from robotcast.reporting.report import RunFacts, write_report
from robotcast.reporting.results import read_results


def report(config: DictConfig) -> None:
    scale = config.scale
    grid = " × ".join(str(count) for count in scale.generate.grid.values())
    facts = RunFacts(
        scale=HydraConfig.get().runtime.choices["scale"],
        seed=config.seed,
        sizes=(
            (
                "Collected",
                f"at most {scale.collect.casts} actions and {scale.collect.repeats} repeats, "
                f"filmed at {scale.camera.width} × {scale.camera.height} pixels",
            ),
            (
                "Tuned",
                f"on at most {scale.tune.tune_casts} casts, tested on {scale.tune.test_casts}",
            ),
            ("Generated", f"grid of {grid} actions, less those that the arm cannot do"),
            ("Trained", f"at most {scale.train.passes} passes"),
            (
                "Evaluated",
                f"{scale.evaluate.targets} targets × {scale.evaluate.repeats} casts",
            ),
        ),
    )
    folder = output_folder(config.paths.reports)
    written = write_report(read_results(Path(config.paths.results)), facts, folder)
    console.print(f"{folder}: {len(written)} files, open {written[-1]}")


if __name__ == "__main__":
    stage(report)()
