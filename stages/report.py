"""Write tables, figures and the HTML page from whatever results there are."""

from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from robotcast.files import unseal
from robotcast.reporting.report import RunFacts, read_loop, write_report
from robotcast.reporting.results import read_results
from robotcast.stage import output_folder, stage, tell


def report(config: DictConfig) -> None:
    scale = config.scale
    collected = f"at most {scale.collect.casts} actions and {scale.collect.repeats} repeats"
    filmed = f"filmed at {scale.camera.width} × {scale.camera.height} pixels"
    grid = " × ".join(str(count) for count in scale.generate.grid.values())
    sizes = (
        ("Collected", f"{collected}, {filmed}"),
        ("Tuned", f"on at most {scale.tune.tune_casts} casts, tested on {scale.tune.test_casts}"),
        ("Generated", f"grid of {grid} actions, less those that the arm cannot do"),
        ("Trained", f"at most {scale.train.passes} passes"),
        ("Evaluated", f"{scale.evaluate.targets} targets × {scale.evaluate.repeats} casts"),
    )
    facts = RunFacts(HydraConfig.get().runtime.choices["scale"], config.seed, sizes)
    folder = output_folder(config.paths.reports)
    data = Path(config.paths.results)
    results, sealed = read_results(data), config.hidden
    loop = read_loop(data / "loop", results, unseal(Path(sealed)) if sealed else None)
    written = write_report(results, facts, folder, loop)
    tell(f"{folder}: {len(written)} files, open {written[-1]}")


if __name__ == "__main__":
    stage(report)()
