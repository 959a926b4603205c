"""Draw the hidden-effect benchmark: measure every case that is missing and seal its answer."""

from fnmatch import fnmatch
from pathlib import Path

from grids import build_limits, feasible_grid, plain_config
from omegaconf import DictConfig
from stage import bar, console, stage
from virtual_rig import rig_with_cable

from robotcast.hidden_effects.actions import CastCounts
from robotcast.hidden_effects.draw import Composition, Control, Strength, draw_cases
from robotcast.hidden_effects.generate import Bench, generate_cases
from robotcast.rigs.virtual.rig import Eye


def hidden_draw(config: DictConfig) -> None:
    settings = config.hidden_effects
    composition = build_composition(settings)
    cases = draw_cases(composition, settings.seed)
    cases = [case for case in cases if fnmatch(case.name, settings.cases)]
    with bar("feasible actions") as progress:
        feasible = feasible_grid(config, progress, grid="collected")
    bench = Bench(
        rigs={name: rig_with_cable(config, name) for name in sorted({c.cable for c in cases})},
        feasible=feasible,
        counts=CastCounts(**settings.counts),
        eye=Eye(**settings.eye),
        limits=build_limits(config),
        shift_casts=settings.shift_casts,
    )
    folder, reports = Path(settings.folder), Path(settings.reports)
    with bar("hidden effects") as progress:
        measured = generate_cases(cases, bench, folder, reports, config.rig.workers, progress)
    console.print(f"{folder}: {measured} of {len(cases)} cases measured, the others stood")


def build_composition(settings: DictConfig) -> Composition:
    """Return what the benchmark is made of."""
    plain = plain_config(settings.composition)
    controls = tuple(Control(**one) for one in plain.pop("controls"))
    strengths = tuple(Strength(**one) for one in plain.pop("strengths"))
    return Composition(**plain, controls=controls, strengths=strengths)


if __name__ == "__main__":
    stage(hidden_draw)()
