"""Tests in a process of their own: what crashes there is a failed test, not the end of all of them."""

import functools
import os
import signal
import traceback
import warnings
from collections.abc import Callable
from typing import ParamSpec

import pytest

P = ParamSpec("P")
PASSED, FAILED, SKIPPED = 0, 1, 77


def _run(test: Callable[P, None], pipe: int, *arguments: P.args, **named: P.kwargs) -> int:
    try:
        test(*arguments, **named)
    except pytest.skip.Exception as reason:
        os.write(pipe, str(reason).encode())
        return SKIPPED
    except BaseException:
        os.write(pipe, traceback.format_exc().encode()[-60000:])
        return FAILED
    return PASSED


def apart(test: Callable[P, None]) -> Callable[P, None]:
    """Run the test in a fork of this process; where there is no fork (Windows), as it stands."""
    if not hasattr(os, "fork"):
        return test

    @functools.wraps(test)
    def run(*arguments: P.args, **named: P.kwargs) -> None:
        reading, writing = os.pipe()
        with warnings.catch_warnings():
            # Newer Pythons warn where other threads run. The child calls nothing that those could hold a lock of.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            status = FAILED
            try:
                os.close(reading)
                status = _run(test, writing, *arguments, **named)
            finally:
                os._exit(status)
        os.close(writing)
        with os.fdopen(reading, "rb") as stream:
            told = stream.read().decode(errors="replace")
        _, ended = os.waitpid(child, 0)
        if os.WIFSIGNALED(ended):
            pytest.fail(f"crashed: {signal.Signals(os.WTERMSIG(ended)).name} {told}", pytrace=False)
        if os.WEXITSTATUS(ended) == SKIPPED:
            pytest.skip(told)
        if os.WEXITSTATUS(ended) != PASSED:
            pytest.fail(told, pytrace=False)

    return run
