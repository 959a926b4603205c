"""Tuning a simulator to measured casts: search, errors, certainty, revision and its live page."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig

from robotcast.build import build_effects, build_simulator, fingerprint
from robotcast.files import source_digest
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.errors import noise_floor, prediction_errors
from robotcast.measurements.measurement_set import Cable, MeasurementSet, Trial, split_by_action
from robotcast.reporting.revisions_page import TuningProgress, revisions_page
from robotcast.running import write_page
from robotcast.simulators.simulator import Simulator
from robotcast.stage import bar, measured_set, output_folder, unfinished_file
from robotcast.tuning.objective import LEAST_NOISE_PERCENT, WaypointError, full_vectors
from robotcast.tuning.search import (
    Batch,
    Journal,
    Objective,
    Optimizer,
    Problem,
    SearchResult,
    search,
)
from robotcast.tuning.tuned import (
    LEDGER,
    Tuned,
    certainty,
    certainty_casts,
    keep_revision,
    read_revisions,
    revision_of,
    split_identity,
    trial_data,
    write_predictions,
    write_trace,
    write_tuned,
)

ROOMS = ("casts", "effects", "fitting", "measurements", "simulators", "tuning")


def open_journal(
    config: DictConfig,
    output: Path,
    parameters: Sequence[Parameter],
    cable: Cable,
    trials: Sequence[Trial],
    objective: Objective,
) -> Journal:
    """Return the journal of the search whose result goes to `output`.

    It belongs to everything that the objective and the search depend on, the code as well:
    responses of another simulator must not be taken for this one's. It lies beside DVC's outputs,
    which a rerun would delete.
    """
    parts = {name: config[name] for name in ("simulator", "optimizer", "effects")}
    arrays = [array for trial in trials for array in trial_data(trial)]
    subject = fingerprint(config, parts, parameters, cable, source_digest(*ROOMS), *arrays)
    return Journal(unfinished_file(config, output, ".jsonl"), subject, objective)


def search_with_bar(
    title: str,
    optimizer: Optimizer,
    problem: Problem,
    journal: Journal,
    budget: int,
    look: Callable[[Sequence[Batch]], None] = lambda trace: None,
) -> SearchResult:
    """Let the optimizer search, `look` at the trace after every batch, and show the best so far."""
    with bar(title) as progress:

        def follow(trace: Sequence[Batch]) -> None:
            look(trace)
            casts, best = sum(batch.casts for batch in trace), trace[-1].best_percent
            progress(casts, budget, f"casts, best {best:.2f} %")

        return search(optimizer, problem, journal, budget, follow)


def tune_simulator(config: DictConfig) -> tuple[Path, Tuned]:
    """Tune the configured simulator, write the tuned folder and return it."""
    measured = measured_set(config.paths.measurements)
    cable, floor_percent = measured.cable, noise_floor(measured).waypoint_percent
    tuning, test = _split(config, measured)
    simulator = build_simulator(config, cable, build_effects(config.effects))
    folder = output_folder(config.paths.tuned, config.paths.measurements)
    shown = TuningProgress(
        cable=cable.name,
        rig=measured.rig,
        split=split_identity(tuning, test),
        simulator=config.simulator.name,
        optimizer=config.optimizer.name,
        effects=tuple(config.effects),
        noise_floor_percent=floor_percent,
    )

    def look(trace: Sequence[Batch], finished: bool = False) -> None:
        """Write the page beside the tuned folders, live while one is tuned."""
        revisions = read_revisions(folder.parent / LEDGER)
        page = revisions_page(revisions, replace(shown, trace=trace, finished=finished))
        write_page(folder.parent / "revisions.html", page)

    look(())
    objective = WaypointError(simulator, tuning.trials, cable.length_m)
    problem = Problem(
        parameters=objective.free,
        start=np.array([p.to_unit(np.asarray(p.nominal)) for p in objective.free]),
        casts=len(tuning.trials),
        noise_percent=max(floor_percent or 0.0, LEAST_NOISE_PERCENT),
    )
    journal = open_journal(config, folder, simulator.parameters, cable, tuning.trials, objective)
    optimizer, budget = instantiate(config.optimizer.search), config.optimizer.budget_casts
    title = f"tune {config.simulator.name} with {config.optimizer.name}"
    found = search_with_bar(title, optimizer, problem, journal, budget, look)
    known = None  # where the budget is for a look, less than what certainty costs
    if certainty_casts(problem) <= budget:
        groups = np.unique([t.action_id for t in tuning.trials], return_inverse=True)[1]
        known = certainty(objective, problem, found.vector, groups)
    vector = full_vectors(simulator.parameters, found.vector)
    predicted = {
        name: (part.trials, simulator.simulate(part.trials, vector).waypoints_m[0])
        for name, part in (("tune", tuning), ("test", test))
    }
    tuned = replace(_tuned(config, measured, found, simulator, predicted), certainty=known)
    write_trace(folder, found.trace)
    write_predictions(folder, predicted)
    write_tuned(folder, tuned)
    promised_percent = promised_error(config)
    keep_revision(folder, revision_of(tuned, tuning, test, floor_percent, promised_percent))
    look(found.trace, finished=True)
    journal.close()
    return folder, tuned


def _split(config: DictConfig, measured: MeasurementSet) -> tuple[MeasurementSet, MeasurementSet]:
    """Return the casts to tune to, as many as the optimizer is given, and those to test with."""
    sizes = config.scale.tune
    tuning, test = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    casts = sizes[config.simulator.name].casts  # of every optimizer, or by optimizer, else all
    if not isinstance(casts, int):
        casts = casts.get(config.optimizer.name, sizes.tune_casts)
    return tuning.spread(casts), test


def _tuned(
    config: DictConfig,
    measured: MeasurementSet,
    found: SearchResult,
    simulator: Simulator,
    predicted: Mapping[str, tuple[Sequence[Trial], np.ndarray]],
) -> Tuned:
    """Return what a search found, with how far its predictions (n_casts, k, 2) [m] are off."""
    vector = full_vectors(simulator.parameters, found.vector)[0]
    return Tuned(
        simulator=config.simulator.name,
        optimizer=config.optimizer.name,
        effects=tuple(config.effects),
        seed=config.optimizer.seed,
        rig=measured.rig,
        cable=measured.cable,
        r0_m=measured.r0_m,
        period_s=measured.period_s,
        parameters=simulator.parameters,
        values=dict(zip((p.name for p in simulator.parameters), vector, strict=True)),
        errors={
            name: prediction_errors(waypoints_m, trials, measured.cable.length_m)
            for name, (trials, waypoints_m) in predicted.items()
        },
        certainty=None,
        improved=found.improved,
        simulated_casts=found.casts,
        diverged_casts=sum(batch.diverged for batch in found.trace),
    )


def promised_error(config: DictConfig) -> float | None:
    """Return the held-out error in % that a diagnosis of the set reached with these effects."""
    path = Path(config.paths.diagnosis) / "diagnosis.json"
    if not path.exists() or not config.effects:
        return None
    diagnosis = json.loads(path.read_text(encoding="utf-8"))
    if Path(diagnosis["measurements"]).resolve() != Path(config.paths.measurements).resolve():
        return None
    ladder = {frozenset(rung.get("effects") or ()): rung for rung in diagnosis.get("ladder") or ()}
    rung = ladder.get(frozenset(config.effects), {})
    return rung.get("heldout_waypoint_error_percent")
