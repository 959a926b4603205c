"""What a search has evaluated so far, kept on disk so that a killed search resumes.

A search with a fixed seed asks for the same vectors again; the journal answers those it has
seen and only the rest is simulated. The result is the same as of an unbroken run.
"""

import json
import os
from pathlib import Path

import numpy as np

from robotcast.files import write_text
from robotcast.tuning.objective import Objective, Scores


class Journal:
    """Answers an objective from a file of past answers, one line a batch.

    Parameters
    ----------
    path : the file; its first line names what is evaluated. A file of something else is
        started afresh.
    subject : text that identifies data, simulator and settings.
    """

    def __init__(self, path: Path, subject: str, objective: Objective) -> None:
        self._path = path
        self._objective = objective
        self._known = _read(path, subject)
        self._next = 0
        lines = [json.dumps({"subject": subject}), *(json.dumps(entry) for entry in self._known)]
        write_text(path, "\n".join(lines) + "\n")

    def __call__(self, unit_vectors: np.ndarray) -> Scores:
        """Score unit vectors (n_vectors, n_free), from the file where it has them."""
        vectors = unit_vectors.tolist()
        if self._next < len(self._known) and self._known[self._next]["vectors"] == vectors:
            entry = self._known[self._next]
            self._next += 1
            return Scores(np.array(entry["percent"]), np.array(entry["diverged"], dtype=int))
        scores = self._objective(unit_vectors)
        entry = {
            "vectors": vectors,
            "percent": scores.percent.tolist(),
            "diverged": scores.diverged.tolist(),
        }
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
            file.flush()
            os.fsync(file.fileno())
        return scores

    def close(self) -> None:
        """Remove the file: the search has ended."""
        self._path.unlink(missing_ok=True)


def _read(path: Path, subject: str) -> list[dict]:
    """Return the whole entries of a journal of `subject`; a torn last line is left out."""
    if not path.exists():
        return []
    entries = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            entries.append(json.loads(line))
        except json.JSONDecodeError:
            break
    return entries[1:] if entries and entries[0] == {"subject": subject} else []
