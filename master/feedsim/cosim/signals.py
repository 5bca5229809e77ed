"""Signals that end a program, held back where other people's code would swallow them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")


@contextmanager
def held() -> Iterator[None]:
    """Let interrupts and requests to end arrive behind the block, not in it.

    Their handlers raise exceptions, which a bare ``except:`` in a library takes for a fault of its own: the program
    would then go on as if nobody had asked it to end. For short blocks only. In other threads than the main one
    nothing is to be held: handlers run in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    numbers = [getattr(signal, name) for name in _ENDING if hasattr(signal, name)]  # Windows has no SIGHUP
    # What is ignored stays so; None is a handler that was not set from Python and could not be put back.
    former = {number: signal.getsignal(number) for number in numbers}
    former = {number: handler for number, handler in former.items() if handler not in (signal.SIG_IGN, None)}
    for number in former:
        signal.signal(number, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
        for number in arrived:
            signal.raise_signal(number)
