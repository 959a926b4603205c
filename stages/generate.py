"""Generate D_sim for one cable with its tuned simulator."""

from functools import partial
from pathlib import Path

import polars as pl
import yaml
from effects import build_effects
from grids import build_limits, feasible_grid
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage

from robotcast.casts.action import ACTION_COLUMNS
from robotcast.casts.plan import plan_actions
from robotcast.files import atomic_file, write_text
from robotcast.simulators.generation import Generated, generate_casts
from robotcast.tuning.tuned import read_effects, read_values, vector_of


def generate(config: DictConfig) -> None:
    cable, values = read_values(Path(config.paths.tuned))
    effects = build_effects(read_effects(Path(config.paths.tuned)))
    simulator = instantiate(config.simulator.model, cable=cable, effects=list(effects))
    with bar("grid of actions") as progress:
        actions = feasible_grid(config, progress, grid="generated")
    with bar(f"generate {config.cable.name}") as progress:
        generated = generate_casts(
            simulator,
            vector_of(simulator.parameters, values),
            actions,
            partial(plan_actions, r0_m=config.casts.r0_m, limits=build_limits(config)),
            settle_s=config.simulator.settle_s,
            progress=progress,
        )
    folder = output_folder(config.paths.simulated)
    _write(folder, generated, config, [effect.name for effect in effects])
    lost = int(generated.diverged.sum())
    console.print(f"{folder}: {len(actions) - lost} casts, {lost} diverged and were left out")


def _write(folder: Path, generated: Generated, config: DictConfig, effects: list[str]) -> None:
    kept = ~generated.diverged
    columns = dict(zip(ACTION_COLUMNS, generated.actions[kept].T, strict=True))
    x, y = generated.endpoints_m[kept].T
    with atomic_file(folder / "casts.parquet") as temporary:
        pl.DataFrame({**columns, "x": x, "y": y}).write_parquet(temporary)
    facts = {
        "simulator": config.simulator.name,
        "optimizer": config.optimizer.name,
        "effects": effects,
        "casts": int(kept.sum()),
        "diverged": int((~kept).sum()),
    }
    write_text(folder / "generation.yaml", yaml.safe_dump(facts, sort_keys=False))


if __name__ == "__main__":
    stage(generate)()
