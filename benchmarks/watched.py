"""A command of feedsim as it is, in a process of its own, with the time of its parts and the memory that it takes.

``python watched.py FILE TIMES run SCENARIO ...`` makes that command TIMES times and writes a JSON file: per time the
seconds of every part, without those of parts within it, and the process's memory. The time is the main thread's: of
rows, which another thread writes while the loop works, what it waits for. Libraries are loaded where they are needed
first, and are a part of their own.
"""

from __future__ import annotations

import builtins
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

POLL = 0.02  # s between two looks at the memory of a process


# --- from outside ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Watched:
    """What a process has told and taken.

    Attributes:
        whole: from the start of the process to its end, by the clock of who waits for it [s].
        parts: seconds of the parts, for each time that the command was made.
        peak: highest resident memory [MB], pages of files included. None where the system does not tell.
        anonymous: highest memory that no file backs, of looks 20 ms apart [MB]. None likewise.
    """

    whole: float
    parts: list[dict[str, float]]
    peak: float | None
    anonymous: float | None


def watched(words: Sequence[str], times: int = 1) -> Watched:
    """Make the command ``feedsim WORDS...`` in a process of its own and wait for its end."""
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        told = Path(folder) / "told.json"
        begun = time.perf_counter()
        with (Path(folder) / "stderr").open("w+", encoding="utf-8") as complaints:
            command = [sys.executable, __file__, str(told), str(times), *words]
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=complaints)
            highest: list[float] = []
            ended = threading.Event()
            looker = threading.Thread(target=_look, args=(process.pid, ended, highest))
            looker.start()
            process.wait()
            whole = time.perf_counter() - begun
            ended.set()
            looker.join()
            if process.returncode:
                complaints.seek(0)
                raise SystemExit(f"feedsim {' '.join(words)}: {complaints.read().strip()}")
        content = json.loads(told.read_text(encoding="utf-8"))
    return Watched(whole, content["parts"], content["peak"], max(highest, default=None))


def _look(process: int, ended: threading.Event, found: list[float]) -> None:
    while not ended.wait(POLL):
        if (now := memory("RssAnon", process)) is not None:
            found.append(now)


def memory(what: str, process: int | None = None) -> float | None:
    """A line of a process's status, of this one unless told [MB]; None where there is none.

    "VmHWM" is the highest resident memory: a process's resource usage would begin with its parent's.
    """
    status = Path(f"/proc/{process or os.getpid()}/status")
    with suppress(OSError):
        for line in status.read_text(encoding="utf-8").splitlines():
            if line.startswith(f"{what}:"):
                return float(line.split()[1]) * 1024 / 1e6
    return None


# --- from inside -----------------------------------------------------------------------------------------------------


class Clock:
    """Time by part. The time of a part within another one belongs to the inner one alone."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self._now = ["libraries"]
        self._since = time.perf_counter()

    def turn(self) -> None:
        """What has passed since the last turn belongs to the part at work."""
        now = time.perf_counter()
        self.spent[self._now[-1]] = self.spent.get(self._now[-1], 0.0) + now - self._since
        self._since = now

    def timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def wrapper(*arguments: Any, **named: Any) -> Any:
            if threading.current_thread() is not threading.main_thread():
                return call(*arguments, **named)
            self.turn()
            self._now.append(part)
            try:
                return call(*arguments, **named)
            finally:
                self.turn()
                self._now.pop()

        return wrapper

    def fetch(self) -> dict[str, float]:
        """Parts since the last time."""
        self.turn()
        spent, self.spent = self.spent, {}
        return spent

    def now_rest(self) -> None:
        """From here on time that no part takes is the command's rest."""
        self.turn()
        self._now = ["rest"]


def main() -> int:
    told, times, *words = sys.argv[1:]
    clock = Clock()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, ahead of numpy
    from feedsim import analysis, scenario
    from feedsim.cli import main as command
    from feedsim.jobs.result import Result
    from feedsim.report.page import Partial
    from feedsim.simulation import cosim, nc
    from feedsim.simulation.cosim.system import System
    from feedsim.simulation.judge import judge_run  # noqa: F401, timed below

    of_runs = sys.modules["feedsim.simulation.judge"]
    for home, name, part in (
        (scenario, "load", "read"), (nc, "plan", "plan"), (System, "__init__", "open"),
        (System, "initialise", "initialise"), (of_runs, "pose_use", "pose"), (Partial, "__call__", "rows"),
        (Partial, "catch_up", "rows"),
        (analysis, "evaluate", "evaluate"), (Result, "save", "report"), (builtins, "__import__", "libraries"),
    ):  # fmt: skip
        setattr(home, name, clock.timed(part, getattr(home, name)))
    simulate = clock.timed("trace", cosim.run)

    def run(*arguments: Any, **named: Any) -> Any:
        found = simulate(*arguments, **named)
        clock.spent["loop"] = found.wall_time
        clock.spent["trace"] -= found.wall_time
        return found

    cosim.run = run
    clock.now_rest()
    parts = []
    for _ in range(int(times)):
        if code := command(words):
            return code
        parts.append(clock.fetch())
    Path(told).write_text(json.dumps({"parts": parts, "peak": memory("VmHWM")}), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
