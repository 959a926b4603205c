"""Searches that call their objective, turned round so that they can be asked and told."""

from collections.abc import Callable
from queue import Queue
from threading import Thread

from robotcast.tuning.asking import Answer, Evaluate, Question


class Called:
    """A search that is a function of its objective, such as those of SciPy.

    The function runs in a thread of its own that waits for each answer: it and its caller never
    run at the same time.

    Parameters
    ----------
    run : calls the objective it is given as often as it likes, and returns when it is done.
    """

    def __init__(self, run: Callable[[Evaluate], None]) -> None:
        self._questions: Queue[Question | BaseException | None] = Queue(1)
        self._answers: Queue[Answer | None] = Queue(1)
        self._thread = Thread(target=self._body, args=(run,), daemon=True)

    def ask(self) -> Question | None:
        """Return the next question, None when the function has returned."""
        if self._thread.ident is None:
            self._thread.start()
        question = self._questions.get()
        if isinstance(question, BaseException):
            raise question
        return question

    def tell(self, answer: Answer) -> None:
        """Hand the function the answer that it waits for."""
        self._answers.put(answer)

    def close(self) -> None:
        """Let the function end at the question that it waits for."""
        if self._thread.is_alive():
            self._answers.put(None)
            self._thread.join()

    def _body(self, run: Callable[[Evaluate], None]) -> None:
        try:
            run(self._evaluate)
            self._questions.put(None)
        except _Closed:
            pass
        except BaseException as error:
            self._questions.put(error)

    def _evaluate(self, question: Question) -> Answer:
        self._questions.put(question)
        answer = self._answers.get()
        if answer is None:
            raise _Closed
        return answer


class _Closed(Exception):
    """Nobody waits for the rest of the search."""
