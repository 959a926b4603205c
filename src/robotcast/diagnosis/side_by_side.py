"""Small questions asked of a model side by side: alone, none of them keeps all cores at work."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Asked = TypeVar("Asked")
Answer = TypeVar("Answer")


def side_by_side(ask: Callable[[Asked], Answer], questions: Sequence[Asked]) -> Iterator[Answer]:
    """Yield the answer to every question, in their order, as many asked at a time as cores."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        yield from pool.map(ask, questions)
