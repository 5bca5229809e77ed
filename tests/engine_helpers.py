"""Work that misbehaves on demand, for the engine's tests: what a run does stands in its one change.

Worker processes import it.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from feedsim.design.sweep.design import Outcome, Task
from feedsim.scenario import Change


@dataclass(frozen=True)
class Chores:
    """`notes`: a folder where each run leaves a file per attempt; "" for none."""

    name: str
    notes: str = ""

    @property
    def digest(self) -> str:
        return hashlib.sha256(f"{self.name} {self.notes}".encode()).hexdigest()

    def open(self, within: Path | None = None) -> Chore:
        return Chore(self)


class Chore:
    def __init__(self, chores: Chores) -> None:
        self.chores = chores

    def run(self, task: Task) -> Outcome:
        begun = time.perf_counter()
        attempts = self._noted(task.run)
        for change in task.changes:
            if change.key == "sleep":
                time.sleep(change.data)
            elif change.key == "kill" or (change.key == "kill once" and attempts == 1):
                os.kill(os.getpid(), signal.SIGKILL)
            elif change.key == "segfault":
                ctypes.string_at(0)
            elif change.key == "exhaust" or (change.key == "exhaust once" and attempts == 1):
                raise MemoryError
        return Outcome(task.run, {"square": (float(task.run) ** 2, "1")}, None, time.perf_counter() - begun)

    def _noted(self, run: int) -> int:
        if not self.chores.notes:
            return 1
        folder = Path(self.chores.notes)
        (folder / f"{run}-{os.getpid()}-{time.monotonic_ns()}").touch()
        return len(list(folder.glob(f"{run}-*")))

    def close(self) -> None:
        pass


def chore(run: int, does: str = "sleep", data: float = 0.0) -> Task:
    return Task(run, (Change(does, str(data), data),))
