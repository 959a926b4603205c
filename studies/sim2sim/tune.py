"""Tune invented models, whose parameters are known, with one optimizer: how near does it come?

python -m studies.sim2sim.tune simulator=segmented optimizer=bo sim2sim.parameters=paper
"""

import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import polars as pl
from hydra.utils import instantiate
from omegaconf import DictConfig, open_dict

from robotcast.build import CONFIGURATION, action_space, build, build_simulator
from robotcast.casts.plan import PlannedCast, plan_actions
from robotcast.files import write_text
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Trial
from robotcast.rigs.envelope import feasible_actions
from robotcast.simulators.simulator import SimulatedCast, Simulator
from robotcast.stage import bar, output_folder, stage, tell
from robotcast.tuning.objective import WaypointError, full_vectors
from robotcast.tuning.search import Problem, Query, SearchResult
from robotcast.tuning.tuned import Certainty, certainty
from robotcast.workflow.tuning import open_journal, search_with_bar

KEY = ("simulator", "parameters", "optimizer", "casts", "model", "start")  # of a tuning
DRAWS = 50  # of a model, until one diverges on no cast


def tune(config: DictConfig) -> None:
    settings, optimizer_name = config.sim2sim, config.optimizer.name
    if settings.casts > settings.most_casts:
        raise ValueError(
            f"sim2sim.casts={settings.casts}: only {settings.most_casts} are simulated for each "
            "model; raise sim2sim.most_casts"
        )
    cable = build(config.weighed_cable)
    _hold(config)
    simulator: Simulator = build_simulator(config, cable)
    names = (config.simulator.name, settings.parameters, optimizer_name, settings.casts)
    cell = "-".join(map(str, names))
    path = output_folder(settings.folder) / f"{cell}.csv"
    budget = settings.budget_per_cast[names[0]][names[1]][optimizer_name] * settings.casts
    code, journals, rows = commit(), [], list[dict[str, Any]]()
    for number, (vector, tuning, test) in enumerate(_models(config, simulator)):
        objective, judged = (WaypointError(simulator, t, cable.length_m) for t in (tuning, test))
        problem = Problem(objective.free, vector, settings.casts, settings.shown_percent)
        known = certainty(objective, problem, vector, np.arange(settings.casts))
        for start in range(settings.starts):
            output = path.with_name(f"{cell}-{number}-{start}")
            journal = open_journal(config, output, simulator.parameters, cable, tuning, objective)
            journals.append(journal)
            begin = stream(settings.seed, number, "start", start).random(len(objective.free))
            problem = replace(problem, start=begin)
            seed = config.optimizer.seed + 1000 * number + 10 * start  # searches may count on
            optimizer = instantiate(config.optimizer.search, seed=seed)
            title = f"model {number + 1}, start {start + 1}, {optimizer_name}"
            found = search_with_bar(title, optimizer, problem, journal, budget)
            test_percent = float(judged(Query(found.vector[None])).percent[0])
            tuning_of = dict(zip(KEY, (*names, number, start), strict=True))
            parameters = _outcomes(objective.free, vector, found, known, test_percent)
            rows += [{**tuning_of, **parameter, "commit": code} for parameter in parameters]
    write_text(path, pl.DataFrame(rows).write_csv())
    for journal in journals:
        journal.close()
    for row in rows:
        error = 100 * abs(row["found"] - row["true"]) / abs(row["true"])
        tell(
            f"{cell}, model {row['model']}, start {row['start']}: {row['parameter']} "
            f"{row['found']:.4g} for {row['true']:.4g} {row['unit']}, {error:.2g} % off"
        )


def _hold(config: DictConfig) -> None:
    """Hold the parameters that are not tuned at their nominal values.

    The paper's are tuned alone; of ours, those that a cable's owner would weigh are held.
    """
    parameters, settings = config.simulator.model.parameters, config.sim2sim
    if settings.parameters not in ("paper", "ours"):
        raise ValueError(f"sim2sim.parameters={settings.parameters}: expected paper or ours")
    held = set(config.simulator.weighed)
    if settings.parameters == "paper":
        held = set(parameters) - set(settings.paper[config.simulator.name])
    with open_dict(config):
        for name in held:
            parameters[name].frozen = True


def commit() -> str:
    """Return the commit of the code, with a + where it was changed since; "" without git."""
    command = ["git", "describe", "--always", "--abbrev=7", "--exclude=*", "--dirty=+"]
    return subprocess.run(command, cwd=CONFIGURATION, capture_output=True, text=True).stdout.strip()


def stream(
    seed: int, number: int, purpose: Literal["model", "casts", "start"], start: int = 0
) -> np.random.Generator:
    """Return random numbers of model `number` that no other purpose shares.

    A search whose start came from the numbers that the model is made of would know the answer.
    """
    tag = {"model": 1, "casts": 2, "start": 3}[purpose]
    return np.random.default_rng([seed, number, tag, start])


def _models(
    config: DictConfig, simulator: Simulator
) -> Iterator[tuple[np.ndarray, tuple[Trial, ...], tuple[Trial, ...]]]:
    """Draw models: free parameters (n_free,) in [0, 1], casts to tune to, and casts to judge on.

    However many casts are tuned to, the models are the same.
    """
    settings, space = config.sim2sim, action_space(config, "collected")
    with bar("feasible actions") as progress:
        feasible = feasible_actions(*space, progress)
    for number in range(settings.models):
        order = stream(settings.seed, number, "casts").permutation(len(feasible))
        drawn = order[: settings.test_casts + settings.most_casts]
        actions = feasible[np.roll(drawn, -settings.test_casts)]  # those to judge on come last
        casts = plan_actions(actions, r0_m=config.casts.r0_m, limits=space[2])
        random = stream(settings.seed, number, "model")
        vector, trials = _invent(simulator, casts, settings, random)
        yield vector, trials[: settings.casts], trials[settings.most_casts :]


def _invent(
    simulator: Simulator,
    casts: Sequence[PlannedCast],
    settings: DictConfig,
    random: np.random.Generator,
) -> tuple[np.ndarray, tuple[Trial, ...]]:
    """Draw the free parameters of a simulator, `margin` of every range clear at both ends.

    Returns them and the casts that it simulates, seen every `period_s` until `settle_s` after
    the tool stops. Raises ValueError when every draw diverges on some cast.
    """
    free = sum(not p.frozen for p in simulator.parameters)
    asked = [
        SimulatedCast(c.tool, np.arange(0.0, c.end_s + settings.settle_s, settings.period_s))
        for c in casts
    ]
    for _ in range(DRAWS):
        vector = random.uniform(settings.margin, 1 - settings.margin, free)
        found = simulator.simulate(asked, full_vectors(simulator.parameters, vector))
        if not found.diverged.any():
            seen = enumerate(zip(casts, asked, found.waypoints_m[0], strict=True))
            return vector, tuple(
                Trial(n, n, c.action, c.tool, one.waypoints_s, path[: len(one.waypoints_s)])
                for n, (c, one, path) in seen
            )
    raise ValueError(f"{DRAWS} draws of the {simulator.name} simulator all diverged on some cast")


def _outcomes(
    parameters: Sequence[Parameter],
    vector: np.ndarray,
    found: SearchResult,
    known: Certainty,
    test_percent: float,
) -> Iterator[dict[str, Any]]:
    """Yield a row a parameter.

    `told_within_percent` is half the interval that casts with a little noise leave it at the true
    model, in % of its value: small where the casts tell the parameter at all. Errors are average
    waypoint errors, % of cable length.
    """
    true_and_found = full_vectors(parameters, np.array([vector, found.vector]))
    for parameter, (true, value) in zip(parameters, true_and_found.T.tolist(), strict=True):
        ends = np.array(known.intervals[parameter.name])
        yield {
            "parameter": parameter.name,
            "unit": parameter.unit,
            "true": true,
            "found": value,
            "told_within_percent": float(100 * np.abs(ends - true).max() / abs(true)),
            "tuning_percent": found.percent,
            "test_percent": test_percent,
            "simulated_casts": found.casts,
            "diverged_casts": sum(batch.diverged for batch in found.trace),
        }


if __name__ == "__main__":
    stage(tune)()
