"""What a process is just at, in memory that another process reads: whose call it is, and in which control cycle.

A process that executes programs of other makers (worker.py) has a mark; elsewhere there is none, and nothing is noted.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

SIZE = 4096
_HEAD = 40  # bytes of the numbers
# in place of an operation: a call that `text` describes; code of our own, which takes its time; a process that cannot
# go on, as `text` says
DESCRIBED_CALL, OWN_CODE, SPOILED = -1, -2, -3


class Mark:
    """A note in a file that two processes have in their memory.

    Attributes:
        numbers: (5,) control cycle, operation in it (or DESCRIBED_CALL, or OWN_CODE), two of the native loop, notes so
            far. The native loop writes the first four itself (exchange_run_marked).
    """

    def __init__(self, path: Path, closed: bool = False) -> None:
        """path: the file, SIZE bytes long; it is made where it is missing. closed: leave no descriptor open by which
        another program could write into it; in a process that does nothing beside."""
        self.path = path
        if not path.exists():
            path.write_bytes(bytes(SIZE))
        with path.open("r+b") as file:
            own = os.dup(file.fileno())
            os.close(own)
            self._memory = mmap.mmap(file.fileno(), SIZE)  # keeps a copy of the descriptor, with the lowest free number
        if closed:
            with Path(os.devnull).open("r+b") as nothing:
                os.dup2(nothing.fileno(), own, inheritable=False)
        self.numbers = np.frombuffer(self._memory, dtype=np.int64, count=5)

    def at(self, text: str, what: int = DESCRIBED_CALL) -> None:
        """Note what comes next."""
        content = text.encode("utf-8", "replace")[: SIZE - _HEAD - 1]
        self._memory[_HEAD : _HEAD + len(content) + 1] = content + b"\0"
        self.numbers[1] = what
        self.numbers[4] += 1

    def back(self) -> None:
        """Note that the call has come back."""
        self.numbers[1] = OWN_CODE
        self.numbers[4] += 1

    @property
    def text(self) -> str:
        """What :meth:`at` has noted last."""
        return bytes(self._memory[_HEAD:]).partition(b"\0")[0].decode("utf-8", "replace")

    def state(self) -> tuple[int, ...]:
        """The numbers: where they stay as they are, a call has not come back."""
        return tuple(int(number) for number in self.numbers)


class Watched:
    """The mark of this process, and who needs to know which operations its numbers stand for.

    spent: whether another process is to do what comes next.
    """

    def __init__(self) -> None:
        self.mark: Mark | None = None
        self.spent = False
        self.process = os.getpid()

    def describe(self, T_c: float, operations: Sequence[tuple[str, str, float]]) -> None:
        """Say what the operations of a cycle are: unit, what it is at, when in the cycle [s]."""

    def deliver(self, result: Any) -> None:
        """Hand over what was asked for, ahead of the units' last calls, in which one may end the process."""


_here: Watched | None = None


def watched() -> Watched | None:
    """Of this process; None: nobody watches."""
    return _here


def watch(here: Watched | None) -> None:
    """Have this process watched."""
    global _here
    _here = here


def deliver(result: Any) -> None:
    """Hand over a result with `notes` or `warnings` to a process that watches, where there is one."""
    if _here is not None:
        _here.deliver(result)


@contextmanager
def calling(text: str) -> Iterator[None]:
    """A block that calls another program; `text` says which and for what, where somebody watches."""
    mark = None if _here is None else _here.mark
    if mark is None:
        yield
        return
    mark.at(text)
    try:
        yield
    finally:
        mark.back()
