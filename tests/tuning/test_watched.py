import numpy as np

from robotcast.progress import silent
from robotcast.tuning.differential_evolution import DifferentialEvolution
from robotcast.tuning.objective import Scores
from robotcast.tuning.watched import Watched


def bowl(vectors: np.ndarray) -> Scores:
    return Scores(((vectors - 0.4) ** 2).sum(axis=1), np.zeros(len(vectors), dtype=int))


def test_looking_on_shows_the_trace_as_it_grows_and_changes_no_result() -> None:
    search, seen = DifferentialEvolution(population=8, generations=4), []
    start = np.array([0.9, 0.1])
    found = search.run(Watched(bowl, seen.append), start, silent)
    assert seen[-1] == found.trace
    assert [len(trace) for trace in seen] == [1, 2, 3, 4, 5]
    unwatched = search.run(bowl, start, silent)
    np.testing.assert_array_equal(found.unit_vector, unwatched.unit_vector)
