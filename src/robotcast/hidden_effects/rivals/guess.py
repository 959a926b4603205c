"""Naming an effect at random."""

import zlib
from collections.abc import Sequence

import numpy as np


def random_guess(case: str, candidates: Sequence[str], seed: int) -> str:
    """Return one of the candidates, each as likely; the same for the same case and seed."""
    random = np.random.default_rng([seed, zlib.crc32(case.encode())])
    return sorted(candidates)[random.integers(len(candidates))]
