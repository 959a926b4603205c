"""Every optimizer finds known parameters within one budget, and one that is killed resumes."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

from robotcast.tuning.bayesian_optimization import BayesianOptimization
from robotcast.tuning.differential_evolution import DifferentialEvolution
from robotcast.tuning.gauss_newton import GaussNewton
from robotcast.tuning.search import Journal, Optimizer, Query, SearchResult, search
from tests.tuning.bowl import CASTS, PROBLEM, TRUE, Bowl

ENSEMBLE = {"members": 16, "updates": 3, "few": 2, "some": 3, "share": 0.65}
NEWTON = GaussNewton(**ENSEMBLE, early_iterations=3, iterations=6, attempts=1, seed=4)
BAYESIAN = BayesianOptimization(initial=8, batch=3, nearest=30, components=4, seed=4)
EVOLUTION = DifferentialEvolution(population=15, seed=4)
OPTIMIZERS: dict[str, tuple[Optimizer, int, float]] = {
    "de": (EVOLUTION, 15 * 41 * CASTS, 0.01),
    "gn": (NEWTON, 3000, 1e-4),
    "bo": (BAYESIAN, (8 + 5 * 3) * CASTS, 1e-2),
}
NAMES = list(OPTIMIZERS)


def run(name: str, evaluate, budget: int | None = None) -> SearchResult:
    optimizer, most, _ = OPTIMIZERS[name]
    return search(optimizer, PROBLEM, evaluate, budget or most)


@cache
def unbroken(name: str) -> tuple[SearchResult, int]:
    """Return what an optimizer comes to, and how many queries that takes."""
    bowl = Bowl()
    return run(name, bowl), bowl.asked


@pytest.mark.parametrize("name", NAMES)
def test_a_known_minimum_is_found_within_the_budget(name: str) -> None:
    _, budget, tolerance = OPTIMIZERS[name]
    found, _ = unbroken(name)
    np.testing.assert_allclose(found.vector, TRUE, atol=tolerance)
    assert found.casts <= budget
    best = [batch.best_percent for batch in found.trace]
    assert best == sorted(best, reverse=True)
    assert best[-1] == found.percent
    assert found.improved


@pytest.mark.parametrize("name", ["de", "bo"])
def test_a_smaller_budget_ends_the_same_search_earlier(name: str) -> None:
    whole, _ = unbroken(name)
    paid = sum(batch.casts for batch in whole.trace[:3])
    assert run(name, Bowl(), paid).trace == whole.trace[:3]
    assert run(name, Bowl(), paid - 1).trace == whole.trace[:2]


@pytest.mark.parametrize("noise_percent", [0.3, 1e-9])  # 1e-9: every beginning looks hopeless
@pytest.mark.parametrize("budget", [150, 200, 250, 300, 400, 600])
def test_gauss_newton_finishes_within_a_small_budget(budget: int, noise_percent: float) -> None:
    patient = replace(NEWTON, members=48, attempts=3)
    found = search(patient, replace(PROBLEM, noise_percent=noise_percent), Bowl(), budget)
    assert found.casts <= budget
    np.testing.assert_allclose(found.vector, TRUE, atol=0.02)


@pytest.mark.parametrize(
    ("name", "dies_at"), [("de", 0), ("de", 1), ("de", 4), ("gn", 1), ("gn", 4), ("bo", 4)]
)
def test_a_killed_search_resumes_to_the_same_result(
    tmp_path: Path, name: str, dies_at: int
) -> None:
    whole, asked = unbroken(name)
    path = tmp_path / "journal.jsonl"
    with pytest.raises(KeyboardInterrupt):
        run(name, Journal(path, "bowl", Bowl(dies_at)))
    with path.open("a") as file:
        file.write('{"vectors": [[0.1')  # killed while writing
    again = Bowl()
    resumed = run(name, Journal(path, "bowl", again))
    assert again.asked == asked - dies_at
    np.testing.assert_array_equal(resumed.vector, whole.vector)
    assert resumed.trace == whole.trace


@pytest.mark.parametrize("name", NAMES)
def test_vectors_that_diverge_cost_a_penalty_and_are_counted(name: str) -> None:
    found = run(name, Bowl(cliff=0.4))
    assert sum(batch.diverged for batch in found.trace) > 0
    assert found.vector[0] <= 0.4
    assert found.percent < 3.0


@pytest.mark.parametrize("name", NAMES)
def test_a_budget_too_small_for_the_first_batch_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="the budget is 1"):
        run(name, Bowl(), 1)


def test_gauss_newton_begins_again_only_far_above_the_noise() -> None:
    def casts(noise_percent: float, attempts: int) -> int:
        short = replace(NEWTON, early_iterations=1, iterations=1, attempts=attempts)
        problem = replace(PROBLEM, noise_percent=noise_percent)
        return search(short, problem, Bowl(), 10_000).casts

    assert casts(5.0, 3) == casts(5.0, 1)
    assert casts(1e-9, 3) > 2 * casts(1e-9, 1)


def test_bayesian_optimization_ends_where_nothing_is_left_to_find() -> None:
    found = search(BAYESIAN, PROBLEM, Bowl(), 10_000)
    assert found.casts < 5_000
    np.testing.assert_allclose(found.vector, TRUE, atol=1e-4)


def test_a_journal_of_another_subject_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    search(EVOLUTION, PROBLEM, Journal(path, "one cable", Bowl()), 900)
    other = Bowl()
    search(EVOLUTION, PROBLEM, Journal(path, "another cable", other), 900)
    assert other.asked == 10


def test_a_journal_clears_what_its_own_killed_writer_left(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    own, other = (tmp_path / f".{name}.jsonl.1234.tmp.jsonl" for name in ("journal", "other"))
    own.touch()
    other.touch()
    Journal(path, "bowl", Bowl()).close()
    assert list(tmp_path.iterdir()) == [other]


def test_a_journal_gives_responses_back_to_the_last_bit(tmp_path: Path) -> None:
    path, query = tmp_path / "journal.jsonl", Query(np.eye(3), (1, 4), 0.5, True)
    told = Journal(path, "bowl", Bowl())(query)
    kept = Journal(path, "bowl", Bowl(dies_at=0))(query)
    np.testing.assert_array_equal(kept.percent, told.percent)
    np.testing.assert_array_equal(kept.diverged, told.diverged)
    np.testing.assert_array_equal(kept.residuals, told.residuals)


def test_an_answer_to_another_question_is_not_taken_from_the_journal(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    Journal(path, "bowl", Bowl())(Query(np.full((1, 3), 0.1)))
    evaluate = Bowl()
    response = Journal(path, "bowl", evaluate)(Query(np.full((1, 3), 0.2)))
    assert evaluate.asked == 1
    np.testing.assert_array_equal(response.percent, Bowl()(Query(np.full((1, 3), 0.2))).percent)
    assert len(path.read_text().splitlines()) == 5


def test_only_vectors_tried_on_all_casts_can_be_the_best() -> None:
    class Partial:
        def minimise(self, problem, objective, budget_casts) -> None:
            objective(Query(problem.start[None]))
            objective(Query(TRUE[None], casts=(0, 1)))

    found = search(Partial(), PROBLEM, Bowl(), 100)
    np.testing.assert_array_equal(found.vector, PROBLEM.start)
    assert not found.improved
    assert [batch.casts for batch in found.trace] == [CASTS, 2]


def test_bayesian_optimization_asks_the_same_whatever_the_threads() -> None:
    before, asked = torch.get_num_threads(), []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        try:
            asked.append(run("bo", Bowl(), 14 * CASTS).vector)
            assert torch.get_num_threads() == threads
        finally:
            torch.set_num_threads(before)
    np.testing.assert_array_equal(*asked)
