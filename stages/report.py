"""Write tables, figures and the HTML page from whatever results there are."""

from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from robotcast.files import unseal
from robotcast.reporting.report import RunFacts, read_loop, write_report
from robotcast.reporting.results import read_results
from robotcast.stage import output_folder, stage, tell


def report(config: DictConfig) -> None:
    collect, camera, tune, generate, train, evaluate = (
        config.scale[name]
        for name in ("collect", "camera", "tune", "generate", "train", "evaluate")
    )
    collected = f"at most {collect.casts} actions and {collect.repeats} repeats"
    tuned = f"on at most {tune.tune_casts} casts, tested on {tune.test_casts}"
    grid = " × ".join(str(count) for count in generate.grid.values())
    sizes = (
        ("Collected", f"{collected}, filmed at {camera.width} × {camera.height} pixels"),
        ("Tuned", tuned),
        ("Generated", f"grid of {grid} actions, less those that the arm cannot do"),
        ("Trained", f"at most {train.passes} passes"),
        ("Evaluated", f"{evaluate.targets} targets × {evaluate.repeats} casts"),
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
