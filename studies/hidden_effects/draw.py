"""Draw the hidden-effect benchmark: measure every case that is missing and seal its answer.

python -m studies.hidden_effects.draw [--config-name few]
"""

from fnmatch import fnmatch
from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import action_space, build, build_rig, with_cable
from robotcast.rigs.envelope import feasible_actions
from robotcast.rigs.virtual.rig import Eye
from robotcast.stage import bar, stage, tell
from studies.hidden_effects.cases import draw_cases
from studies.hidden_effects.measuring import Bench, measure_cases


def draw(config: DictConfig) -> None:
    settings = config.hidden_effects
    cases = draw_cases(build(settings.composition), settings.seed)
    cases = [case for case in cases if fnmatch(case.name, settings.cases)]
    space = action_space(config, "collected")
    with bar("feasible actions") as progress:
        feasible = feasible_actions(*space, progress)
    cables = sorted({case.cable for case in cases})
    bench = Bench(
        rigs={cable: build_rig(with_cable(config, cable)) for cable in cables},
        feasible=feasible,
        counts=build(settings.counts),
        eye=Eye(**settings.eye),
        limits=space[2],
        shift_casts=settings.shift_casts,
    )
    folder, reports = Path(settings.folder), Path(settings.reports)
    with bar("hidden effects") as progress:
        measured = measure_cases(cases, bench, folder, reports, config.rig.workers, progress)
    tell(f"{folder}: {measured} of {len(cases)} cases measured, the others stood")


if __name__ == "__main__":
    stage(draw)()
