"""What happens in a worker process: the bundle laid out once, batches of tasks worked, nothing left behind."""

from __future__ import annotations

import atexit
import threading
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import WorkerPlugin, get_worker

from feedsim.cosim.unpacked import STORE
from feedsim.sweep import provenance
from feedsim.sweep.bundle import Bundle, Workplace
from feedsim.sweep.design import Outcome, Task


@dataclass(frozen=True)
class Done:
    """What comes back of a batch: outcomes of its first tasks.

    Attributes:
        out_of_memory: the next one has met a MemoryError.
        refused: why this worker cannot take part; None where it can.
        worker: its address, where it refuses.
    """

    outcomes: tuple[Outcome, ...]
    out_of_memory: bool = False
    refused: str | None = None
    worker: str = ""


class Carrier(WorkerPlugin):
    """Brings the work to all workers, those that come later too. It is laid out when the first batch needs it.

    Each engine has one of its own, also where several make the same study: what one takes away, the others keep.

    Attributes:
        key: what its batches ask for.
    """

    def __init__(self, content: Bundle, asked: dict[str, str]) -> None:
        self.content = content
        self.asked = asked  # versions where the study is run from
        self.key = f"{content.digest}-{uuid.uuid4().hex}"
        self.name = f"feedsim-{self.key}"
        self.address, self.folder = "", Path()  # of the worker that it has come to

    def setup(self, worker: Any) -> None:
        self.address, self.folder = str(worker.address), Path(worker.local_directory)
        _carried[self.key] = self

    def teardown(self, worker: Any) -> None:
        _carried.pop(self.key, None)
        # Called in the worker's event loop, which must not wait for a run to end.
        threading.Thread(target=_clear, args=(self.content.digest,), daemon=True).start()


_carried: dict[str, Carrier] = {}  # by their keys
_places: dict[str, Workplace] = {}  # by the digest of the work, for all carriers of it
# FMPy changes the working folder of the process, and libraries need not bear threads: one run at a time.
_lock = threading.Lock()


def prepare(key: str) -> None:
    """Lay the work out, so that the first run need not wait for it; not where another study has a run under way."""
    if _lock.acquire(blocking=False):
        try:
            if (carrier := _carried.get(key)) is not None:
                _place(carrier)
        finally:
            _lock.release()


def _clear(digest: str) -> None:
    with _lock:
        if any(carrier.content.digest == digest for carrier in tuple(_carried.values())):
            return
        if (place := _places.pop(digest, None)) is not None:
            place.close()
            STORE.clear()


def work_batch(key: str, tasks: tuple[Task, ...], seconds: float) -> Done:
    """Work `tasks` in their order, until all are done or `seconds` [s] are over; one at the least. `key`: of the
    carrier that has brought what they need."""
    outcomes: list[Outcome] = []
    with _lock:
        carrier = _carried.get(key)
        if carrier is None:
            address = str(get_worker().address)
            return Done((), refused=f"worker {address}: has not got what the study needs", worker=address)
        own = provenance.versions()
        if carrier.asked != own and (fault := provenance.fault(carrier.address, own, carrier.asked)):
            return Done((), refused=fault, worker=carrier.address)
        place, begun = _place(carrier), time.perf_counter()
        for task in tasks:
            try:
                outcomes.append(place.run(task))
            except MemoryError:
                return Done(tuple(outcomes), out_of_memory=True)
            if time.perf_counter() - begun >= seconds:
                break
    return Done(tuple(outcomes))


def _place(carrier: Carrier) -> Workplace:
    digest = carrier.content.digest
    if digest not in _places:
        _places[digest] = carrier.content.open(carrier.folder)
    return _places[digest]


@atexit.register
def _leave() -> None:
    for place in _places.values():
        place.close()
    _places.clear()
