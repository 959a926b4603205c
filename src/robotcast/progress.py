"""How long work reports where it stands; stages turn it into a bar."""

from typing import Protocol


class Progress(Protocol):
    """Called with the units done so far, the total, and a few words on the state."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


def silent(done: int, total: int, note: str = "") -> None:
    """Report nothing."""
