"""Work sent to other processes comes back as if it had been done here."""

import os

import pytest

from robotcast.processes import elsewhere


def pid_and(number: int) -> tuple[int, int]:
    return os.getpid(), number * number


def refuse(number: int) -> int:
    raise ValueError(f"no {number} in {os.getpid()}")


def test_one_thread_works_here_and_more_work_elsewhere() -> None:
    here = list(elsewhere.answers(pid_and, [1, 2, 3], 1))
    there = list(elsewhere.answers(pid_and, list(range(8)), 2))
    assert {pid for pid, _ in here} == {os.getpid()}
    assert [number for _, number in there] == [n * n for n in range(8)]
    assert os.getpid() not in {pid for pid, _ in there}
    assert len({pid for pid, _ in there}) <= 2


def test_the_processes_stay_for_the_next_work() -> None:
    first = {pid for pid, _ in elsewhere.answers(pid_and, list(range(8)), 2)}
    again = {pid for pid, _ in elsewhere.answers(pid_and, list(range(8)), 2)}
    assert len(first | again) <= 2


def test_an_error_is_raised_where_it_can_be_seen() -> None:
    with pytest.raises(ValueError, match=f"no 1 in {os.getpid()}"):
        list(elsewhere.answers(refuse, [1], 2))


def test_what_no_process_can_be_sent_is_done_here() -> None:
    def inner(number: int) -> tuple[int, int]:
        return pid_and(number)

    assert list(elsewhere.answers(inner, [3], 2)) == [(os.getpid(), 9)]


def test_calls_side_by_side_cut_their_work_into_fewer_parts() -> None:
    with elsewhere.shared(4) as alone, elsewhere.shared(4) as second:
        assert (alone, second) == (4, 2)
    with elsewhere.shared(4) as again:
        assert again == 4
