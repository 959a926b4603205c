"""Searches find known parameters, and a killed search ends where an unbroken one does."""

from pathlib import Path

import numpy as np
import pytest

from robotcast.fitting.parameter import Parameter
from robotcast.progress import silent
from robotcast.tuning.differential_evolution import DifferentialEvolution
from robotcast.tuning.journal import Journal
from robotcast.tuning.objective import Scores, full_vectors

TRUE = np.array([0.3, 0.7, 0.5])
SEARCH = DifferentialEvolution(population=15, generations=40, seed=4)


class Bowl:
    """A smooth objective with its minimum at `TRUE`; dies at call `dies_at`."""

    def __init__(self, dies_at: int = -1) -> None:
        self.calls = 0
        self._dies_at = dies_at

    def __call__(self, unit_vectors: np.ndarray) -> Scores:
        if self.calls == self._dies_at:
            raise KeyboardInterrupt
        self.calls += 1
        percent = ((unit_vectors - TRUE) ** 2).sum(axis=1)
        return Scores(percent, np.zeros(len(unit_vectors), dtype=int))


def test_differential_evolution_finds_a_known_minimum() -> None:
    found = SEARCH.run(Bowl(), np.full(3, 0.5), silent)
    np.testing.assert_allclose(found.unit_vector, TRUE, atol=0.01)
    best = [batch.best_percent for batch in found.trace]
    assert best == sorted(best, reverse=True)
    assert len(best) == SEARCH.generations + 1


@pytest.mark.parametrize("dies_at", [1, 7, 30])
def test_a_killed_search_resumes_to_the_same_result(tmp_path: Path, dies_at: int) -> None:
    unbroken = SEARCH.run(Bowl(), np.full(3, 0.5), silent)
    path = tmp_path / "journal.jsonl"
    with pytest.raises(KeyboardInterrupt):
        SEARCH.run(Journal(path, "bowl", Bowl(dies_at)), np.full(3, 0.5), silent)
    with path.open("a") as file:
        file.write('{"vectors": [[0.1')  # killed while writing
    again = Bowl()
    resumed = SEARCH.run(Journal(path, "bowl", again), np.full(3, 0.5), silent)
    assert again.calls == SEARCH.generations + 1 - dies_at
    np.testing.assert_array_equal(resumed.unit_vector, unbroken.unit_vector)
    assert resumed.trace == unbroken.trace


def test_a_journal_of_another_subject_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    SEARCH.run(Journal(path, "one cable", Bowl()), np.full(3, 0.5), silent)
    other = Bowl()
    SEARCH.run(Journal(path, "another cable", other), np.full(3, 0.5), silent)
    assert other.calls == SEARCH.generations + 1


def test_frozen_parameters_keep_their_value() -> None:
    parameters = (
        Parameter("a", "1", 0.0, 2.0, 1.5, frozen=True),
        Parameter("b", "1", 0.01, 1.0, 0.1, scale="log"),
    )
    np.testing.assert_allclose(full_vectors(parameters, np.array([[0.5]])), [[1.5, 0.1]])


def test_a_parameter_outside_its_bounds_is_refused() -> None:
    with pytest.raises(ValueError, match="lower ≤ nominal ≤ upper"):
        Parameter("mu", "1", 0.1, 0.5, 0.6)
