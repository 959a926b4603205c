"""Tune made-up models, whose parameters are known, with one optimizer: how near does it come?

python stages/sim2sim.py simulator=segmented optimizer=gn sim2sim.casts=20
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import numpy as np
from grids import build_limits, feasible_grid
from hydra.utils import instantiate
from omegaconf import DictConfig, open_dict
from stage import bar, console, output_folder, stage
from unfinished import open_journal

from robotcast.casts.plan import PlannedCast, plan_actions
from robotcast.measurements.measurement_set import Cable
from robotcast.sim2sim.made_up import Filming, MadeUp, make_up, stream
from robotcast.sim2sim.outcome import Outcome, told_within_percent, write_outcomes
from robotcast.simulators.simulator import Simulator
from robotcast.tuning.asking import Problem, Question
from robotcast.tuning.certainty import certainty
from robotcast.tuning.journal import Journal
from robotcast.tuning.objective import WaypointError, full_vectors
from robotcast.tuning.search import Batch, Found, search


def sim2sim(config: DictConfig) -> None:
    settings, cable = config.sim2sim, _cable(config)
    if settings.casts > settings.most_casts:
        raise ValueError(
            f"sim2sim.casts={settings.casts}: only {settings.most_casts} are simulated for each "
            "model; raise sim2sim.most_casts"
        )
    simulator = _simulator(config, cable)
    cell = f"{config.simulator.name}-{config.optimizer.name}-{settings.casts}"
    path = output_folder(settings.folder) / f"{cell}.csv"
    journals: list[Journal] = []
    outcomes: list[Outcome] = []
    for number, model in enumerate(_models(config, simulator)):
        for start in range(settings.starts):
            objective = WaypointError(simulator, model.tuning, cable.length_m)
            journal = open_journal(
                config,
                path.with_name(f"{cell}-{number}-{start}"),
                simulator.parameters,
                cable,
                model.tuning,
                objective,
            )
            journals.append(journal)
            problem = Problem(
                objective.free,
                stream(settings.seed, number, "start", start).random(len(objective.free)),
                len(model.tuning),
                settings.shown_percent,
            )
            found = _tuned(config, problem, journal, number, start)
            outcomes += _outcomes(config, cable, simulator, model, found, (number, start))
    write_outcomes(path, outcomes)
    for journal in journals:
        journal.close()
    _say(outcomes, cell)


def _cable(config: DictConfig) -> Cable:
    """Return the configured cable as its owner would measure it."""
    return Cable(**{field.name: config.cable[field.name] for field in fields(Cable)})


def _simulator(config: DictConfig, cable: Cable) -> Simulator:
    """Return the simulator, with what its owner would weigh held."""
    changed = config.copy()
    with open_dict(changed):
        for name in config.simulator.get("weighed", ()):
            changed.simulator.model.parameters[name].frozen = True
    return instantiate(changed.simulator.model, cable=cable, effects=[])


def _models(config: DictConfig, simulator: Simulator) -> Iterator[MadeUp]:
    """Draw the models, each with casts of its own; however many are tuned to, they are the same."""
    settings = config.sim2sim
    with bar("feasible actions") as progress:
        feasible = feasible_grid(config, progress, grid="collected")
    for number in range(settings.models):
        order = stream(settings.seed, number, "casts").permutation(len(feasible))
        drawn = order[: settings.test_casts + settings.most_casts]
        actions = feasible[np.roll(drawn, -settings.test_casts)]  # those to judge on come last
        casts: list[PlannedCast] = plan_actions(
            actions, r0_m=config.casts.r0_m, limits=build_limits(config)
        )
        model = make_up(
            simulator,
            casts,
            settings.most_casts,
            Filming(settings.period_s, settings.settle_s),
            margin=settings.margin,
            rng=stream(settings.seed, number, "model"),
        )
        yield replace(model, tuning=model.tuning[: settings.casts])


def _tuned(
    config: DictConfig, problem: Problem, journal: Journal, number: int, start: int
) -> Found:
    settings = config.sim2sim
    per_cast = settings.budget_per_cast[config.simulator.name][config.optimizer.name]
    budget = per_cast * settings.casts
    seed = config.optimizer.seed + 1000 * number + 10 * start  # searches may count on from it
    title = f"model {number + 1}, start {start + 1}, {config.optimizer.name}"
    with bar(title) as progress:

        def look(trace: Sequence[Batch]) -> None:
            casts = sum(batch.casts for batch in trace)
            progress(casts, budget, f"casts, best {trace[-1].best_percent:.3f} %")

        optimizer = instantiate(config.optimizer.search, seed=seed)
        return search(optimizer, problem, journal, budget, look)


def _outcomes(
    config: DictConfig,
    cable: Cable,
    simulator: Simulator,
    model: MadeUp,
    found: Found,
    numbers: tuple[int, int],
) -> list[Outcome]:
    objective = WaypointError(simulator, model.tuning, cable.length_m)
    judged = WaypointError(simulator, model.test, cable.length_m)
    casts = len(model.tuning)
    problem = Problem(objective.free, model.vector, casts, config.sim2sim.shown_percent)
    known = certainty(objective, problem, model.vector, np.arange(casts))
    free = np.array([not p.frozen for p in simulator.parameters])
    both = np.array([model.vector, found.vector])
    true, values = full_vectors(simulator.parameters, both)[:, free]
    return [
        Outcome(
            simulator=config.simulator.name,
            optimizer=config.optimizer.name,
            casts=casts,
            model=numbers[0],
            start=numbers[1],
            parameter=parameter.name,
            unit=parameter.unit,
            true=float(here),
            found=float(value),
            told_within_percent=float(told),
            tuning_percent=found.percent,
            test_percent=float(judged(Question(found.vector[None])).percent[0]),
            simulated_casts=found.casts,
            diverged_casts=sum(batch.diverged for batch in found.trace),
        )
        for parameter, here, value, told in zip(
            objective.free,
            true,
            values,
            told_within_percent(objective.free, true, known),
            strict=True,
        )
    ]


def _say(outcomes: list[Outcome], cell: str) -> None:
    for outcome in outcomes:
        console.print(
            f"{cell}, model {outcome.model}, start {outcome.start}: {outcome.parameter} "
            f"{outcome.found:.4g} for {outcome.true:.4g} {outcome.unit}, "
            f"{outcome.error_percent:.2g} % off",
            markup=False,
        )


if __name__ == "__main__":
    stage(sim2sim)()
