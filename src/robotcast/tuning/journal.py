"""What a search has asked and been told so far, kept on disk so that a killed search resumes.

An optimizer asks the same queries again when it is told the same responses; the journal gives
those it has and only the rest is simulated. The result is the same as of an unbroken run.
"""

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.files import discard_unfinished, write_text
from robotcast.tuning.search import Objective, Query, Response


class Journal:
    """Answers queries from a file of past responses; one of another `subject` is started afresh.

    Its first line names the subject: data, simulator and settings. Two lines follow for each
    query, itself and its response, in JSON, which keeps numbers to the last bit.
    """

    def __init__(self, path: Path, subject: str, objective: Objective) -> None:
        self._path, self._objective, self._next = path, objective, 0
        self._subject = json.dumps({"subject": subject})
        self._known = _read(path, self._subject)
        discard_unfinished(path.parent, path.name)
        self._write()

    def __call__(self, query: Query) -> Response:
        """Answer a query, from the file where it has it."""
        asked = _line(query)
        if self._next < len(self._known):
            if self._known[self._next][0] == asked:
                self._next += 1
                return _response(self._known[self._next - 1][1])
            self._known = self._known[: self._next]
            self._write()
        response = self._objective(query)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(f"{asked}\n{_line(response)}\n")
            file.flush()
            os.fsync(file.fileno())
        return response

    def close(self) -> None:
        """Remove the file: the search has ended."""
        self._path.unlink(missing_ok=True)

    def _write(self) -> None:
        lines = [self._subject, *(line for pair in self._known for line in pair)]
        write_text(self._path, "\n".join(lines) + "\n")


def _read(path: Path, subject: str) -> list[tuple[str, str]]:
    """Return the queries and responses of a journal of `subject`, without a torn end."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []
    return list(zip(lines[1::2], lines[2::2], strict=False)) if lines[:1] == [subject] else []


def _line(entry: Query | Response) -> str:
    return json.dumps(asdict(entry), default=np.ndarray.tolist)


def _response(line: str) -> Response:
    arrays: dict[str, Any] = {k: v and np.array(v) for k, v in json.loads(line).items()}
    return Response(**arrays)
