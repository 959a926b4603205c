"""Tune one simulator's parameters to one cable's casts with one optimizer."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from effects import build_effects
from hydra.utils import instantiate
from omegaconf import DictConfig
from stage import bar, console, output_folder, stage
from unfinished import open_journal

from robotcast.files import write_text
from robotcast.measurements.errors import prediction_errors
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.noise_floor import noise_floor
from robotcast.measurements.reader import read_measurement_set
from robotcast.measurements.split import split_by_action
from robotcast.reporting.revisions_page import Tuning, revisions_page
from robotcast.tuning.asking import Problem
from robotcast.tuning.certainty import Certainty, certainty, certainty_casts
from robotcast.tuning.journal import Journal
from robotcast.tuning.objective import LEAST_NOISE_PERCENT, WaypointError, full_vectors
from robotcast.tuning.revisions import (
    LEDGER,
    keep_revision,
    predicted_error,
    read_revisions,
    revision_of,
    split_identity,
)
from robotcast.tuning.search import Batch, Found, search
from robotcast.tuning.tuned import Tuned, write_predictions, write_trace, write_tuned


def tune(config: DictConfig) -> None:
    measured = read_measurement_set(Path(config.paths.measurements))
    tuning, test = _split(config, measured)
    effects = build_effects(config.effects)
    simulator = instantiate(config.simulator.model, cable=measured.cable, effects=list(effects))
    folder, floor_percent = (
        output_folder(config.paths.tuned),
        noise_floor(measured).waypoint_percent,
    )
    page = _RevisionsPage(
        folder.parent,
        Tuning(
            cable=measured.cable.name,
            rig=measured.rig,
            split=split_identity(tuning, test),
            simulator=config.simulator.name,
            optimizer=config.optimizer.name,
            effects=tuple(config.effects),
            noise_floor_percent=floor_percent,
        ),
    )
    objective = WaypointError(simulator, tuning.trials, measured.cable.length_m)
    journal = open_journal(
        config, folder, simulator.parameters, tuning.cable, tuning.trials, objective
    )
    problem = Problem(
        parameters=objective.free,
        start=np.array([p.to_unit(np.asarray(p.nominal)) for p in objective.free]),
        casts=len(tuning.trials),
        noise_percent=max(floor_percent or 0.0, LEAST_NOISE_PERCENT),
    )
    found = _found(config, problem, journal, page)
    vector = full_vectors(simulator.parameters, found.vector)
    predicted = {
        name: (part.trials, simulator.simulate(part.trials, vector).waypoints_m[0])
        for name, part in (("tune", tuning), ("test", test))
    }
    tuned = Tuned(
        simulator=config.simulator.name,
        optimizer=config.optimizer.name,
        effects=tuple(config.effects),
        seed=config.optimizer.seed,
        rig=measured.rig,
        cable=measured.cable,
        r0_m=measured.r0_m,
        period_s=measured.period_s,
        parameters=simulator.parameters,
        values=dict(zip((p.name for p in simulator.parameters), vector[0], strict=True)),
        errors={
            name: prediction_errors(waypoints_m, trials, measured.cable.length_m)
            for name, (trials, waypoints_m) in predicted.items()
        },
        certainty=_certainty(config, objective, problem, found, tuning),
        improved=found.improved,
        simulated_casts=found.casts,
        diverged_casts=sum(batch.diverged for batch in found.trace),
    )
    write_trace(folder, found.trace)
    write_predictions(folder, predicted)
    write_tuned(folder, tuned)
    revision = revision_of(tuned, tuning, test, predicted["test"][1], floor_percent)
    keep_revision(folder, replace(revision, predicted_waypoint_error_percent=_promised(config)))
    page.show(found.trace, finished=True)
    journal.close()
    _say(tuned, folder)


def _split(config: DictConfig, measured: MeasurementSet) -> tuple[MeasurementSet, MeasurementSet]:
    """Return the casts to tune to and those to judge on, which share no action."""
    sizes = config.scale.tune
    tuning, test = split_by_action(measured, sizes.tune_casts, sizes.test_casts, config.seed)
    return tuning.spread(sizes[config.simulator.name].casts), test


def _found(config: DictConfig, problem: Problem, journal: Journal, page: "_RevisionsPage") -> Found:
    """Let the optimizer search; show how it goes on the terminal and on the page."""
    budget = config.optimizer.budget_casts
    with bar(f"tune {config.simulator.name} with {config.optimizer.name}") as progress:

        def look(trace: Sequence[Batch]) -> None:
            page.show(trace)
            casts = sum(batch.casts for batch in trace)
            progress(casts, budget, f"casts, best {trace[-1].best_percent:.2f} %")

        return search(instantiate(config.optimizer.search), problem, journal, budget, look)


def _certainty(
    config: DictConfig,
    objective: WaypointError,
    problem: Problem,
    found: Found,
    tuning: MeasurementSet,
) -> Certainty | None:
    """Say how well the casts tell the parameters; a budget too small for it is for a look."""
    if certainty_casts(problem) > config.optimizer.budget_casts:
        return None
    groups = np.unique([t.action_id for t in tuning.trials], return_inverse=True)[1]
    return certainty(objective, problem, found.vector, groups)


class _RevisionsPage:
    """The page beside the tuned folders that shows every revision, live while one is tuned."""

    def __init__(self, folder: Path, tuning: Tuning) -> None:
        self._folder = folder
        self._tuning = tuning
        self.show(())

    def show(self, trace: Sequence[Batch], finished: bool = False) -> None:
        tuning = replace(self._tuning, trace=trace, finished=finished)
        revisions = read_revisions(self._folder / LEDGER)
        write_text(self._folder / "revisions.html", revisions_page(revisions, tuning))


def _promised(config: DictConfig) -> float | None:
    """Return the error that a diagnosis of this very set promised for these effects."""
    path = Path(config.paths.diagnosis) / "diagnosis.json"
    if not path.exists():
        return None
    diagnosis = json.loads(path.read_text(encoding="utf-8"))
    diagnosed = Path(diagnosis["measurements"]).resolve()
    same = diagnosed == Path(config.paths.measurements).resolve()
    return predicted_error(diagnosis, config.effects) if same else None


def _say(tuned: Tuned, folder: Path) -> None:
    test = tuned.errors["test"]
    console.print(
        f"{folder}: test casts {test.waypoint_percent:.2f} % average waypoint, "
        f"{test.final_percent:.2f} % median final error, of cable length"
    )
    if tuned.diverged_casts:
        console.print(f"{tuned.diverged_casts} of {tuned.simulated_casts} simulated casts diverged")
    for warning in tuned.warnings():
        console.print(warning, style="yellow", markup=False)


if __name__ == "__main__":
    stage(tune)()
