"""What happens in a worker process: the bundle laid out once, batches of tasks worked, nothing left behind."""

from __future__ import annotations

import atexit
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin

from feedsim.cosim.unpacked import STORE
from feedsim.sweep import same
from feedsim.sweep.bundle import Place, Work
from feedsim.sweep.task import Outcome, Task


@dataclass(frozen=True)
class Done:
    """What comes back of a batch: outcomes of its first tasks.

    Attributes:
        out_of_memory: the next one has met a MemoryError.
        refused: why this worker cannot take part; None where it can.
    """

    outcomes: tuple[Outcome, ...]
    out_of_memory: bool = False
    refused: str | None = None


class Carrier(WorkerPlugin):
    """Brings the work to all workers, those that come later too. It is laid out when the first batch needs it."""

    def __init__(self, content: Work, asked: dict[str, str]) -> None:
        self.content = content
        self.asked = asked  # versions where the study is run from
        self.name = f"feedsim-{content.digest}"
        self.address, self.folder = "", Path()  # of the worker that it has come to

    def setup(self, worker: Any) -> None:
        self.address, self.folder = str(worker.address), Path(worker.local_directory)
        _carried[self.content.digest] = self

    def teardown(self, worker: Any) -> None:
        digest = self.content.digest
        _carried.pop(digest, None)
        # Called in the worker's event loop, which must not wait for a run to end.
        threading.Thread(target=_clear, args=(digest,), daemon=True).start()


_carried: dict[str, Carrier] = {}
_places: dict[str, Place] = {}
# FMPy changes the working folder of the process, and libraries need not bear threads: one run at a time.
_lock = threading.Lock()


def prepare(digest: str) -> None:
    """Lay the work out, so that the first run need not wait for it; not where another study has a run under way."""
    if _lock.acquire(blocking=False):
        try:
            _place(digest)
        finally:
            _lock.release()


def _clear(digest: str) -> None:
    with _lock:
        if digest not in _carried and (place := _places.pop(digest, None)) is not None:
            place.close()
            STORE.clear()


def work_batch(digest: str, tasks: tuple[Task, ...], seconds: float) -> Done:
    """Work `tasks` in their order, until all are done or `seconds` [s] are over; one at the least."""
    outcomes: list[Outcome] = []
    with _lock:
        carrier = _carried.get(digest)
        if carrier is None:
            return Done((), refused="a worker has not got what the study needs")
        if carrier.asked != same.told() and (fault := same.fault(carrier.address, same.told(), carrier.asked)):
            return Done((), refused=fault)
        place, begun = _place(digest), time.perf_counter()
        for task in tasks:
            try:
                outcomes.append(place.run(task))
            except MemoryError:
                return Done(tuple(outcomes), out_of_memory=True)
            if time.perf_counter() - begun >= seconds:
                break
    return Done(tuple(outcomes))


def _place(digest: str) -> Place:
    if digest not in _places:
        carrier = _carried[digest]
        _places[digest] = carrier.content.open(carrier.folder)
    return _places[digest]


@atexit.register
def _leave() -> None:
    for place in _places.values():
        place.close()
    _places.clear()
