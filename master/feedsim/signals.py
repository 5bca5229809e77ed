"""Signals that end a program: none is lost, and none stops what has to come to its end.

May use: nothing. Start reading at end_program(); held() is for a few steps that belong together.

A handler of Python raises wherever the main thread is at work. In a callback from C, in that of a weak reference, in
``__del__`` and in a library with a bare ``except:`` the exception vanishes. An exception that is on its way lives; so
one that is dead while the program is still at work has vanished, and the signal is sent once more. While a module is
imported none is raised: there libraries make another exception of it, "import failed".
"""

from __future__ import annotations

import _thread
import atexit
import os
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType
from typing import Any

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))  # Windows
LOOK = 0.02  # s between two looks at whether an exception lives


class Ended(KeyboardInterrupt, SystemExit):
    """A signal asks the program to end; whoever lets an interrupt or an exit pass lets this one pass."""


def end_program(program: Callable[[], object]) -> None:
    """Let signals unwind the stack of `program`, which is called next, and end the process with 128 + their number.

    The first one raises Ended, behind an import. Further ones find the program on its way out and do not disturb that.
    Behind `program` nothing is raised: what is registered with atexit comes to its end first. A signal that is ignored
    stays so (nohup).
    """
    arrived: list[int] = []
    raised: list[weakref.ref[Ended]] = []
    dead: list[weakref.ref[Ended]] = []
    main, shown, hook = threading.main_thread().ident or 0, sys.unraisablehook, sys.excepthook

    def end(number: int, frame: FrameType | None) -> None:
        arrived.append(number)
        if len(arrived) == 1:  # a plain thread: those of threading wait for locks that this one may have
            with suppress(RuntimeError):
                _thread.start_new_thread(watch, ())
        while frame is not None and frame.f_code is not program.__code__:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                return
            frame = frame.f_back
        if frame is None or len(dead) < len(raised):
            return
        ended = Ended(128 + arrived[0])
        raised.append(weakref.ref(ended, dead.append))
        try:
            raise ended
        finally:
            del ended  # its traceback would keep it alive by this frame

    def watch() -> None:
        while True:
            time.sleep(LOOK)
            if len(dead) < len(raised):
                continue
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, arrived[0])  # ends what it waits for, too
            else:
                _thread.interrupt_main(signal.Signals(arrived[0]))

    def show(unraisable: Any) -> None:
        if unraisable.exc_type is not Ended:
            shown(unraisable)

    def tell(*error: Any) -> None:
        if not arrived:  # else it is most likely what a library has made of Ended
            hook(*error)

    def leave() -> None:
        if arrived:
            for stream in (sys.stdout, sys.stderr):
                with suppress(Exception):
                    stream.flush()
            os._exit(128 + arrived[0])
        for number in taken:  # nothing is left to be done
            signal.signal(number, signal.SIG_DFL)

    taken = [number for number in ENDING if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    sys.unraisablehook, sys.excepthook = show, tell
    atexit.register(leave)  # the first, so that it is called last
    for number in taken:
        signal.signal(number, end)


@contextmanager
def held() -> Iterator[None]:
    """Let interrupts and requests to end arrive behind the block, not in it.

    For short blocks: steps of which all are done or none, and calls of what would swallow the exception of a handler.
    In other threads than the main one nothing is to be held: handlers run in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    with ExitStack() as last:
        last.callback(lambda: [*map(signal.raise_signal, arrived)])
        # What is ignored stays so; None is a handler that was not set from Python and could not be put back.
        for number in ENDING:
            if (handler := signal.getsignal(number)) not in (signal.SIG_IGN, None):
                last.callback(signal.signal, number, handler)
                signal.signal(number, lambda number, _: arrived.append(number))
        yield
