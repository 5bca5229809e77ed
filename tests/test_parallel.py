"""Work in several processes: the results, errors and reports of one process, whatever the number of cores."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import partial

import pytest

from feedsim.foundation import parallel
from feedsim.foundation.errors import InputError
from feedsim.foundation.parallel import in_parallel, in_threads

forks = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a process of a single thread, whatever other tests have started in this one."""
    monkeypatch.setattr(threading, "active_count", lambda: 1)


def squared(k: int, say: Callable[..., None]) -> tuple[int, int]:
    say("squaring", k)
    if k == 3:
        raise InputError("no 3", ["no 3", "nor 4"])
    return k * k, os.getpid()


@pytest.fixture(params=[1, 2, 5])
def cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(parallel, "cores", lambda: request.param)
    return int(request.param)


@forks
@pytest.mark.usefixtures("alone")
def test_results_and_reports_are_those_of_one_process(cores: int) -> None:
    said: list[tuple[object, ...]] = []
    results = in_parallel([partial(squared, k) for k in (7, 5, 6)], lambda *words: said.append(words))
    assert [square for square, _ in results] == [49, 25, 36]
    assert sorted(said) == [("squaring", 5), ("squaring", 6), ("squaring", 7)]
    processes = {process for _, process in results}
    assert len(processes) == min(cores, 3)
    assert (os.getpid() in processes) == (cores == 1)


def test_the_first_error_in_order_is_raised_whole(cores: int) -> None:
    with pytest.raises(InputError) as raised:
        in_parallel([partial(squared, k) for k in (1, 3, 3, 2)])
    assert raised.value.problems == ("no 3", "nor 4")


@forks
@pytest.mark.usefixtures("alone")
def test_a_task_that_is_worked_beside_others_starts_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "cores", lambda: 2)

    def outer(_: Callable[..., None]) -> set[int]:
        return {process for _, process in in_parallel([partial(squared, k) for k in (1, 2)])} | {os.getpid()}

    assert [len(processes) for processes in in_parallel([outer, outer])] == [1, 1]


def test_a_process_with_threads_is_not_forked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "cores", lambda: 2)
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        assert {process for _, process in in_parallel([partial(squared, k) for k in (1, 2)])} == {os.getpid()}
    finally:
        over.set()
        thread.join()


@forks
@pytest.mark.usefixtures("alone")
def test_a_process_that_is_killed_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "cores", lambda: 2)

    def killed(_: Callable[..., None]) -> None:
        os.kill(os.getpid(), 9)

    with pytest.raises(RuntimeError, match="1 of 2 tasks were not done"):
        in_parallel([killed, partial(squared, 2)])


def test_threads_have_the_results_of_one(cores: int) -> None:
    """In the order of the values; the error is that of the first one in this order, and all have been worked."""
    worked: list[int] = []

    def tripled(k: int) -> int:
        worked.append(k)
        if k > 5:
            raise InputError(f"no {k}")
        return 3 * k

    assert in_threads(tripled, [4, 1, 5]) == [12, 3, 15]
    worked.clear()
    with pytest.raises(InputError, match="no 8"):
        in_threads(tripled, [1, 8, 2, 7])
    assert sorted(worked) == [1, 2, 7, 8]


@forks
@pytest.mark.usefixtures("alone")
def test_processes_side_by_side_start_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "cores", lambda: 2)

    def threads(_: Callable[..., None]) -> set[int]:
        return set(in_threads(lambda _: threading.get_ident(), [1, 2, 3]))

    assert [len(own) for own in in_parallel([threads, threads])] == [1, 1]
