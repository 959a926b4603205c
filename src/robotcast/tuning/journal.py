"""What a search has asked and been told so far, kept on disk so that a killed search resumes.

An optimizer asks the same questions again when it is told the same answers; the journal gives
those it has and only the rest is simulated. The result is the same as of an unbroken run.
"""

import base64
import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.files import discard_unfinished, write_text
from robotcast.tuning.asking import Answer, Evaluate, Question


class Journal:
    """Answers questions from a file of past answers, one line each.

    Parameters
    ----------
    path : the file; its first line names what is evaluated. A file of something else is
        started afresh.
    subject : text that identifies data, simulator and settings.
    """

    def __init__(self, path: Path, subject: str, evaluate: Evaluate) -> None:
        self._path = path
        self._subject = subject
        self._evaluate = evaluate
        self._known = _read(path, subject)
        self._next = 0
        discard_unfinished(path.parent, path.name)
        self._write()

    def __call__(self, question: Question) -> Answer:
        """Answer a question, from the file where it has it."""
        asked = _plain_question(question)
        if self._next < len(self._known):
            if self._known[self._next]["question"] == asked:
                self._next += 1
                return _answer(self._known[self._next - 1]["answer"])
            self._known = self._known[: self._next]
            self._write()
        answer = self._evaluate(question)
        with self._path.open("a", encoding="utf-8") as file:
            entry = {"question": asked, "answer": _plain_answer(answer)}
            file.write(json.dumps(entry) + "\n")
            file.flush()
            os.fsync(file.fileno())
        return answer

    def close(self) -> None:
        """Remove the file: the search has ended."""
        self._path.unlink(missing_ok=True)

    def _write(self) -> None:
        entries = [{"subject": self._subject}, *self._known]
        write_text(self._path, "".join(json.dumps(entry) + "\n" for entry in entries))


def _read(path: Path, subject: str) -> list[dict[str, Any]]:
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


def _plain_question(question: Question) -> dict[str, Any]:
    return {
        "vectors": question.vectors.tolist(),
        "casts": None if question.casts is None else list(question.casts),
        "share": question.share,
        "with_misses": question.with_misses,
    }


def _plain_answer(answer: Answer) -> dict[str, Any]:
    return {
        "percent": answer.percent.tolist(),
        "diverged": answer.diverged.tolist(),
        "misses": None if answer.misses is None else _packed(answer.misses),
    }


def _answer(plain: dict[str, Any]) -> Answer:
    misses = plain["misses"]
    return Answer(
        np.array(plain["percent"]),
        np.array(plain["diverged"], dtype=int),
        None if misses is None else _unpacked(misses),
    )


def _packed(array: np.ndarray) -> dict[str, Any]:
    """Return an array as JSON can hold it, to the last bit."""
    data = zlib.compress(np.ascontiguousarray(array, dtype="<f8").tobytes(), level=1)
    return {"shape": list(array.shape), "data": base64.b64encode(data).decode("ascii")}


def _unpacked(plain: dict[str, Any]) -> np.ndarray:
    data = zlib.decompress(base64.b64decode(plain["data"]))
    return np.frombuffer(data, dtype="<f8").reshape(plain["shape"]).astype(float)
