"""A search whose journal survives a kill, with its progress on the terminal."""

from collections.abc import Callable, Sequence
from pathlib import Path

from omegaconf import DictConfig

from robotcast.build import fingerprint
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable, Trial
from robotcast.source import source_digest
from robotcast.stage import bar, unfinished_file
from robotcast.tuning.journal import Journal
from robotcast.tuning.search import Batch, Objective, Optimizer, Problem, SearchResult, search

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
    arrays = (
        array
        for trial in trials
        for array in (trial.tool.t_s, trial.tool.pose, trial.waypoints_s, trial.waypoints_m)
    )
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
