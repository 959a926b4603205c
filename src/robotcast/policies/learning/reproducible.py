"""Torch made to give the same bytes on any number of cores, and fast all the same."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import torch

ROWS_AT_ONCE = 1024  # what one core works on at a time: its intermediate results stay in cache


@contextmanager
def reproducible_torch(seed: int) -> Iterator[None]:
    """Make torch give the same bytes on any number of cores; its global state is put back.

    On one thread every sum on the CPU has one order, so `torch.use_deterministic_algorithms` has
    nothing to add; it would import torch's compiler, which takes seconds.
    """
    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)


def in_parts(function: Callable[[torch.Tensor], torch.Tensor], rows: torch.Tensor) -> torch.Tensor:
    """Apply a function to the rows (n, …) of a tensor, part by part, on as many cores as torch has.

    Parts are always cut alike and each is worked out by one thread, so the result has the same
    bits whatever the number of cores.
    """

    def one(part: torch.Tensor) -> torch.Tensor:
        with torch.inference_mode():  # holds for the thread that enters it
            return function(part)

    parts = rows.split(ROWS_AT_ONCE)
    workers = min(torch.get_num_threads(), len(parts))
    with reproducible_torch(0):
        if workers <= 1:
            return torch.cat([one(part) for part in parts])
        with ThreadPoolExecutor(workers) as pool:
            return torch.cat(list(pool.map(one, parts)))
