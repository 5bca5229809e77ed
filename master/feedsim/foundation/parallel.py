"""Independent work in as many processes or threads as there are cores, with the results of one.

May use: nothing. Start reading at in_parallel(), and at in_threads() for work that is mostly native.

Processes are forked: they begin with all that this one has loaded, which takes milliseconds. What they compute is what
this process would, bit for bit. Where forking is not safe (other systems than Linux, a process with several threads) or
no core is free for it, the work is done here, one task after the other.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

S = TypeVar("S")
T = TypeVar("T")
Reporter = Callable[..., None]

_state = {"forked": False}  # whether this process is one of those that work side by side


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def may_fork() -> bool:
    """Whether tasks are worked side by side here."""
    alone = sys.platform == "linux" and threading.active_count() == 1
    return alone and not _state["forked"] and cores() > 1


def in_parallel(tasks: Sequence[Callable[[Reporter], T]], say: Reporter = lambda *_: None) -> list[T]:
    """The result of every task, in their order; the error of the first one that raises.

    Args:
        tasks: each is given what it may report to. What it changes of this process's objects may be lost; its result
            and its reports can be pickled.
        say: hears what tasks report.
    """
    count = min(cores(), len(tasks))
    if count < 2 or not may_fork():
        return [task(say) for task in tasks]
    import multiprocessing
    from multiprocessing.connection import Connection, wait

    context = multiprocessing.get_context("fork")
    ends: dict[Connection, Any] = {}
    results: dict[int, tuple[bool, Any]] = {}
    try:
        for first in range(count):
            here, there = context.Pipe(duplex=False)
            process = context.Process(target=_run_tasks, args=(tasks, first, count, there), daemon=True)
            process.start()
            there.close()
            ends[here] = process
        while ends:
            for end in wait(list(ends)):
                assert isinstance(end, Connection)
                try:
                    number, content = end.recv()
                except EOFError:
                    ends.pop(end).join()
                    continue
                if number is None:
                    say(*content)
                else:
                    results[number] = content
    finally:
        for process in ends.values():
            process.terminate()
        for process in ends.values():
            process.join()
    if missing := [k for k in range(len(tasks)) if k not in results]:
        raise RuntimeError(f"{len(missing)} of {len(tasks)} tasks were not done: their process has ended")
    for done, value in (results[k] for k in range(len(tasks))):
        if not done:
            raise value
    return [results[k][1] for k in range(len(tasks))]


def _run_tasks(tasks: Sequence[Callable[[Reporter], Any]], first: int, step: int, there: Any) -> None:
    """Every `step`-th task from the `first` one on, in a process of its own."""
    _state["forked"] = True
    for k in range(first, len(tasks), step):
        try:
            content = True, tasks[k](lambda *words: there.send((None, words)))
        except Exception as error:
            content = False, error
        there.send((k, content))
    there.close()


def in_threads(of: Callable[[S], T], values: Sequence[S]) -> list[T]:
    """The result of every value, in their order; the error of the first one that raises, behind the last of them.

    of: spends its time in native code that lets other threads go on; may be called by several threads at once.
    """
    count = 1 if _state["forked"] else min(cores(), len(values))
    if count < 2:
        done = [_result_or_error(of, value) for value in values]
    else:
        with ThreadPoolExecutor(count) as threads:
            done = list(threads.map(lambda value: _result_or_error(of, value), values))
    for _, error in done:
        if error is not None:
            raise error
    return [result for results, _ in done for result in results]


def _result_or_error(of: Callable[[S], T], value: S) -> tuple[list[T], Exception | None]:
    """The result, or the error."""
    try:
        return [of(value)], None
    except Exception as error:
        return [], error
