"""The engine of a study: tasks in, an outcome for each out, made by workers on this machine, on a cluster, or here.

>>> with open_engine(Bundle.of(study), workers=2) as engine:                    # doctest: +SKIP
...     for outcome in engine.map(tasks):                                       # doctest: +SKIP
...         print(outcome.run, outcome.figures or outcome.error)                # doctest: +SKIP
"""

from __future__ import annotations

import atexit
import logging
import os
import queue
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import islice
from math import ceil
from pathlib import Path
from typing import Any, Protocol

from distributed import WorkerPlugin, get_worker

from feedsim.design.sweep import provenance, trial
from feedsim.design.sweep.bundle import Bundle, Workplace
from feedsim.design.sweep.design import Outcome, Task
from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.foundation.installation import require_extras
from feedsim.simulation.cosim.unpacked import STORE

# --- Which tasks go to the workers together, and what becomes of those whose worker dies ------------------------------
# A batch takes about half a second: many short runs or one long one, so that handing over costs little; towards the
# end
# they get smaller, so that the workers end together. Tasks whose worker has died are run once more, one at a time,
# and at
# last with nothing else under way: the one that kills its worker is separated from those that were in its company.


AIM = 0.5  # s of work in a batch: handing one over costs some 10 ms, and as much progress as this may be lost
MAX_BATCH_DELAY = 2.0  # a batch that takes so many times longer than meant is handed back unfinished
MAX_BATCH_RUNS = 1000  # runs in a batch
BATCHES_PER_WORKER = 2  # batches per worker at a time, so that the next one is there when one ends
DEATHS = 3  # of its worker, the last one in nobody's company, after which a task is not tried again
MAX_WAITING_TASKS = 8  # tasks to be run in nobody's company, for which the others are made to wait


@dataclass(frozen=True, eq=False)
class Batch:
    """Tasks for one worker.

    Attributes:
        suspect: a single one that was there when a worker died.
        alone: it is run with nothing else under way.
    """

    tasks: tuple[Task, ...]
    suspect: bool = False
    alone: bool = False


@dataclass
class Batches:
    """The tasks of a study on their way, each of which comes to exactly one outcome.

    Attributes:
        tasks: those not looked at yet; read as far ahead as batches need.
    """

    tasks: Iterable[Task]
    _fresh: deque[Task] = field(default_factory=deque)
    _suspects: deque[Task] = field(default_factory=deque)
    _loners: deque[Task] = field(default_factory=deque)  # suspects to be run alone
    _is_clearing: bool = False  # the others wait until all loners have been run
    _deaths: dict[int, int] = field(default_factory=dict)  # run -> deaths of its worker
    _batches_out: set[Batch] = field(default_factory=set)
    _mean: float | None = None  # s per run, the latest counting most
    _is_exhausted: bool = False

    def __post_init__(self) -> None:
        self._rest = iter(self.tasks)

    def next(self, workers: int) -> Batch | None:
        """A batch to be handed over now to one of `workers`; None: they have enough, or there is no more."""
        if any(batch.alone for batch in self._batches_out):
            return None
        if self._is_clearing or len(self._loners) >= MAX_WAITING_TASKS:
            self._is_clearing = bool(self._loners)
            if self._is_clearing:
                return (
                    None
                    if self._batches_out
                    else self._sent(Batch((self._loners.popleft(),), suspect=True, alone=True))
                )
        if self._suspects or self._deaths:
            # One at a time per worker: few wait behind a task that kills, and are taken for one.
            if len(self._batches_out) >= workers:
                return None
            if self._suspects:
                return self._sent(Batch((self._suspects.popleft(),), suspect=True))
        elif len(self._batches_out) >= BATCHES_PER_WORKER * workers:
            return None
        batch = self._fresh_batch(workers)
        if batch is None and self._loners and not self._batches_out:
            self._is_clearing = True
            return self.next(workers)
        return batch

    def _fresh_batch(self, workers: int) -> Batch | None:
        size = 1 if self._mean is None else max(1, min(MAX_BATCH_RUNS, round(AIM / max(self._mean, 1e-6))))
        self._read(4 * size * workers)
        if not self._fresh:
            return None
        if self._is_exhausted:
            size = min(size, ceil(len(self._fresh) / (BATCHES_PER_WORKER * workers)))
        return self._sent(Batch(tuple(self._fresh.popleft() for _ in range(min(size, len(self._fresh))))))

    def _read(self, least: int) -> None:
        while not self._is_exhausted and len(self._fresh) < least:
            more = tuple(islice(self._rest, least - len(self._fresh)))
            self._fresh.extend(more)
            self._is_exhausted = not more

    def _sent(self, batch: Batch) -> Batch:
        self._batches_out.add(batch)
        return batch

    @property
    def waiting(self) -> bool:
        """Whether there are tasks that are to be handed over."""
        self._read(1)
        return bool(self._fresh or self._suspects or self._loners)

    @property
    def count_batches_out(self) -> int:
        """Batches handed over and not back yet."""
        return len(self._batches_out)

    def done(self, batch: Batch, outcomes: Sequence[Outcome]) -> None:
        """`batch` is back; the tasks without an outcome are handed over anew."""
        self._batches_out.remove(batch)
        self._count(outcomes)
        self._fresh.extendleft(reversed(batch.tasks[len(outcomes) :]))

    def refused(self, batch: Batch) -> None:
        """No run of `batch` was begun: it is handed over anew, as what it was."""
        self._batches_out.remove(batch)
        waiting = self._loners if batch.alone else self._suspects if batch.suspect else self._fresh
        waiting.extendleft(reversed(batch.tasks))

    def record_death(self, batch: Batch, deaths: int, how: str, outcomes: Sequence[Outcome] = ()) -> list[Outcome]:
        """The worker of `batch` has died `deaths` times over it, or failed as `how` says, after `outcomes`.

        Returns outcomes of the tasks that are given up.
        """
        self._batches_out.remove(batch)
        self._count(outcomes)
        given_up = []
        for task in batch.tasks[len(outcomes) :]:
            died = self._deaths.pop(task.run, 0) + deaths
            if batch.alone and died >= DEATHS:
                given_up.append(Outcome(task.run, None, f"given up: {how}, {died} times", 0.0))
            else:
                self._deaths[task.run] = died
                (self._loners if died >= DEATHS - 1 else self._suspects).append(task)
        return given_up

    def _count(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            self._deaths.pop(outcome.run, None)
        if outcomes:
            mean = sum(outcome.seconds for outcome in outcomes) / len(outcomes)
            self._mean = mean if self._mean is None else (self._mean + mean) / 2


SCHEDULER_LOSS_TIME = 20.0  # s without the scheduler, after which a study is given up
# [s] without any worker that can take part, likewise: on a busy machine one that died comes back slowly
WORKER_LOSS_TIME = 300.0
FETCH_TIME = 5.0  # s for a result to arrive; one that is lost with its worker is made again, and may take any time
_CLUSTER_POLL_INTERVAL = 1.0  # s between two looks at the cluster

_log = logging.getLogger(__name__)


class Engine(Protocol):
    """Makes runs.

    Attributes:
        workers: processes that make them; 0: this one.
        where: "in this process", "2 local processes", "tcp://..., 8 workers".
        warnings: what a user should know; more may come while runs are made.
    """

    workers: int
    where: str
    warnings: tuple[Finding, ...]

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """One outcome per task, in the order in which they come; tasks are taken as workers need them.

        An interrupt is raised after the outcomes that are there already.

        Raises:
            InputError: no worker can take part.
            SimulationError: the scheduler or all workers are lost.
        """


@contextmanager
def open_engine(
    bundle: Bundle, workers: int | None = None, scheduler: str | None = None, say: Callable[[str], None] | None = None
) -> Iterator[Engine]:
    """An engine for the runs of `bundle`; its workers end with the block.

    Args:
        workers: processes on this machine; 0: runs are made in this process; default: one for each core it may use.
        scheduler: address of the Dask scheduler of a cluster, in place of local processes: "tcp://host:8786".
        say: called with words when it takes longer: no worker is there yet.

    Raises:
        InputError: the workers cannot be had, or have another version of feedsim.
    """
    if scheduler is not None and workers is not None:
        raise InputError("either a number of workers, or a scheduler, which has its own; not both")
    if workers is not None and workers < 0:
        raise InputError(f"workers: {workers} is outside the allowed range: at least 0")
    if workers == 0:
        here = LocalEngine(bundle)
        try:
            yield here
        finally:
            here.leave()
        return
    require_extras("a study on several processes", "sweep")
    if scheduler is None:
        count = workers or _cores()
        opened, where = trial.local(count), f"{count} local process{'es'[: 2 * (count != 1)]}"
    else:
        opened, where = trial.remote(scheduler, say), f"cluster at {scheduler}"
    with opened as client:
        engine = Crowd(client, bundle, where, own=scheduler is None)
        try:
            yield engine
        finally:
            engine.leave()


class LocalEngine:
    """Runs made in this process, one after the other."""

    workers = 0
    where = "this process"
    warnings: tuple[Finding, ...] = ()

    def __init__(self, bundle: Bundle) -> None:
        self._bundle = bundle
        self._place: Workplace | None = None

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        if self._place is None:  # kept, as workers keep theirs: what a first run finds out serves all
            self._place = self._bundle.open()
        for task in tasks:
            try:
                yield self._place.run(task)
            except MemoryError:
                yield Outcome(task.run, None, "out of memory", 0.0)

    def leave(self) -> None:
        """Leave nothing behind."""
        if self._place is not None:
            self._place.close()
            self._place = None


@dataclass(frozen=True)
class _Sent:
    """A batch under way; `only`: the workers that it may go to, None: any."""

    future: Any
    batch: Batch
    only: frozenset[str] | None


class Crowd:
    """Runs made by the workers of a Dask scheduler."""

    def __init__(self, client: Any, bundle: Bundle, where: str, *, own: bool) -> None:

        self._client = client
        self.own = own  # a cluster of our own goes as a whole; another's has to be tidied
        self.where = where
        answers = client.run(eval, provenance.QUESTION, on_error="return")
        faults = [text for address, answer in answers.items() if (text := provenance.fault(address, answer))]
        if faults:
            raise InputError.of("the workers cannot be used", faults)
        self.workers = len(answers)
        several = sum(threads > 1 for threads in client.nthreads().values())
        self.warnings = provenance.differences(answers)
        if several:
            remedy = "start workers with --nthreads 1"
            self.warnings += (Finding(
                "workers-with-threads", "doubt",
                f"{several} of {len(answers)} workers have several threads, which take turns: a run needs a process of "
                f"its own; {remedy}",
                "", remedy,
            ),)  # fmt: skip
        self._carrier = Carrier(bundle, provenance.versions())
        client.register_plugin(self._carrier)
        client.run(prepare, self._carrier.key)
        self.refused: dict[str, str] = {}

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        flight = _Flight(self, self._client, self._carrier.key, Batches(tasks))
        try:
            while (outcomes := flight.next()) is not None:
                yield from outcomes
        except (KeyboardInterrupt, SystemExit):
            yield from flight.landed()
            raise
        finally:
            flight.cancel()

    def refuse(self, worker: str, why: str) -> None:
        """`worker`, an address, gets no more batches. The first one that cannot take part is reported as a warning."""
        if not self.refused:
            text = f"{why}; it is left out, as others will be, and the study goes on without it"
            _log.warning(text)
            self.warnings = (*self.warnings, Finding("worker-left-out", "doubt", text, worker))
        self.refused[worker] = why

    def leave(self) -> None:
        """Take away what was brought to workers that are not ours."""
        if not self.own and self._client.status == "running":
            with suppress(Exception):  # the scheduler may be gone
                self._client.unregister_worker_plugin(self._carrier.name)


class _Flight:
    """The batches of one study that are with the workers."""

    def __init__(self, crowd: Crowd, client: Any, key: str, batches: Batches) -> None:
        self._crowd = crowd
        self._client = client
        self._key = key
        self._batches = batches
        self._returned_batches: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._of: dict[str, _Sent] = {}
        self._name = f"feedsim-{uuid.uuid4().hex[:12]}"
        self._count = 0
        self._given_up: list[Outcome] = []
        self._worker_addresses: frozenset[str] = frozenset()  # addresses of the workers
        self._last_check = 0.0
        self._healthy = self._last_manned = time.monotonic()

    def next(self) -> list[Outcome] | None:
        """Outcomes of a batch that has come back; None when all have."""
        while True:
            self._check_cluster()
            if self._given_up:
                given_up, self._given_up = self._given_up, []
                return given_up
            fit = self._fit
            ready = bool(fit) or not self._crowd.refused  # else wait for a worker that can take part
            while ready and (batch := self._batches.next(max(1, len(fit)))) is not None:
                self._submit(batch)
            if not self._of and (ready or not self._batches.waiting):
                return None
            with suppress(queue.Empty):
                return self._outcomes(self._returned_batches.get(timeout=_CLUSTER_POLL_INTERVAL))

    def landed(self) -> list[Outcome]:
        """Outcomes that have come back and were not fetched yet."""
        outcomes: list[Outcome] = []
        with suppress(queue.Empty, InputError, SimulationError):  # what has called for them is to be raised
            for _ in range(self._returned_batches.qsize()):  # one that does not arrive comes again
                future = self._returned_batches.get_nowait()
                if future.status == "finished":
                    outcomes += self._outcomes(future)
        return outcomes

    def cancel(self) -> None:
        futures = [sent.future for sent in self._of.values()]
        self._of.clear()
        if futures and self._client.status == "running":
            with suppress(Exception):
                self._client.cancel(futures, force=True)
        for future in futures:
            future.release()

    @property
    def _fit(self) -> frozenset[str]:
        """The workers that can take part, as far as is known."""
        return self._worker_addresses - self._crowd.refused.keys()

    def _submit(self, batch: Batch) -> None:

        self._count += 1
        key = f"{self._name}-{self._count}"
        only = self._fit if self._crowd.refused else None
        future = self._client.submit(
            work_batch, self._key, batch.tasks, AIM * MAX_BATCH_DELAY, key=key, pure=False, retries=0,
            priority=10 if batch.suspect else 0, workers=None if only is None else sorted(only),
        )  # fmt: skip
        self._of[key] = _Sent(future, batch, only)
        future.add_done_callback(self._returned_batches.put)

    def _outcomes(self, future: Any) -> list[Outcome]:
        from distributed import KilledWorker

        if future.key not in self._of:
            return []
        sent = self._of.pop(future.key)
        batch = sent.batch
        try:
            done = future.result(timeout=FETCH_TIME)
        except KilledWorker as error:
            self._last_check = 0.0  # one worker less, for a while
            future.release()
            return self._batches.record_death(batch, error.allowed_failures + 1, "its worker process died")
        except (KeyboardInterrupt, SystemExit):
            self._of[future.key] = sent
            self._returned_batches.put(future)
            raise
        except Exception as error:
            running = self._client.status == "running"
            if running and isinstance(error, TimeoutError) and future.status not in ("cancelled", "error"):
                self._of[future.key] = sent
                future.add_done_callback(self._returned_batches.put)
                return []
            if not running or future.status in ("cancelled", "lost"):
                raise self._lost() from None
            future.release()
            self._find_refusing_workers()
            if not self._crowd.refused.keys().isdisjoint(self._worker_addresses if sent.only is None else sent.only):
                self._batches.refused(batch)  # it may have gone to one that cannot take part
                return []
            raise SimulationError(
                f"{self._crowd.where}: a worker cannot make runs: {type(error).__name__}: {error}; what is done is kept"
            ) from error
        future.release()
        if done.refused is not None:
            self._crowd.refuse(done.worker, done.refused)
            self._batches.refused(batch)
            return []
        if done.out_of_memory:
            return [
                *done.outcomes,
                *self._batches.record_death(batch, 1, "its worker ran out of memory", done.outcomes),
            ]
        self._batches.done(batch, done.outcomes)
        return list(done.outcomes)

    def _find_refusing_workers(self) -> None:
        """Find out which of the workers there are now cannot take part."""
        with suppress(Exception):  # the scheduler may be gone
            self._worker_addresses = frozenset(self._client.nthreads())
            asked = self._client.run(eval, provenance.QUESTION, workers=sorted(self._fit), on_error="return")
            for address, answer in asked.items():
                known = isinstance(answer, dict | ModuleNotFoundError)  # else the worker has gone meanwhile
                if known and (fault := provenance.fault(address, answer)):
                    self._crowd.refuse(address, fault)

    def _check_cluster(self) -> None:
        """Which workers there are now, and whether the scheduler is.

        Raises:
            InputError: for some time none of the workers has been one that can take part.
            SimulationError: the scheduler is lost, or all workers are.
        """
        now = time.monotonic()
        if now - self._last_check < _CLUSTER_POLL_INTERVAL:
            return
        self._last_check = now
        if self._client.status == "running":
            with suppress(Exception):
                self._worker_addresses = frozenset(self._client.nthreads())
                self._healthy = time.monotonic()
                self._take_back()
        if self._fit:
            self._last_manned = now
        if self._client.status == "closed" or now - self._healthy > SCHEDULER_LOSS_TIME:
            raise self._lost()
        if now - self._last_manned > (0.0 if self._crowd.own and self._worker_addresses else WORKER_LOSS_TIME):
            if self._worker_addresses:
                faults = [why for address, why in self._crowd.refused.items() if address in self._worker_addresses]
                raise InputError.of("no worker is left that can be used; what is done is kept", faults)
            raise SimulationError(
                f"{self._crowd.where}: no worker is left (waited {WORKER_LOSS_TIME:g} s); what is done is kept, "
                f"and the study can "
                "be continued"
            )

    def _take_back(self) -> None:
        """Batches meant for workers of which none is left: Dask would wait until one comes back."""
        for key, sent in [*self._of.items()]:
            if sent.only is not None and not sent.only & self._worker_addresses:
                del self._of[key]
                self._given_up += self._batches.record_death(sent.batch, 1, "its worker process died")
                self._client.cancel([sent.future], force=True)

    def _lost(self) -> SimulationError:
        return SimulationError(
            f"{self._crowd.where}: the scheduler is lost; what is done is kept, the study can be continued"
        )


def _cores() -> int:
    """Cores that this process may use."""
    with suppress(AttributeError):  # not on every system
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# --- What happens in a worker process: the bundle laid out once, batches of tasks worked, nothing left behind ---------


@dataclass(frozen=True)
class BatchResult:
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
        _carriers[self.key] = self

    def teardown(self, worker: Any) -> None:
        _carriers.pop(self.key, None)
        # Called in the worker's event loop, which must not wait for a run to end.
        threading.Thread(target=_clear_place, args=(self.content.digest,), daemon=True).start()


_carriers: dict[str, Carrier] = {}  # by their keys
_places: dict[str, Workplace] = {}  # by the digest of the work, for all carriers of it
# FMPy changes the working folder of the process, and libraries need not bear threads: one run at a time.
_lock = threading.Lock()


def prepare(key: str) -> None:
    """Lay the work out, so that the first run need not wait for it; not where another study has a run under way."""
    if _lock.acquire(blocking=False):
        try:
            if (carrier := _carriers.get(key)) is not None:
                _place(carrier)
        finally:
            _lock.release()


def _clear_place(digest: str) -> None:
    with _lock:
        if any(carrier.content.digest == digest for carrier in tuple(_carriers.values())):
            return
        if (place := _places.pop(digest, None)) is not None:
            place.close()
            STORE.clear()


def work_batch(key: str, tasks: tuple[Task, ...], seconds: float) -> BatchResult:
    """Work `tasks` in their order, until all are done or `seconds` [s] are over; one at the least. `key`: of the
    carrier that has brought what they need."""
    outcomes: list[Outcome] = []
    with _lock:
        carrier = _carriers.get(key)
        if carrier is None:
            address = str(get_worker().address)
            return BatchResult((), refused=f"worker {address}: has not got what the study needs", worker=address)
        own = provenance.versions()
        if carrier.asked != own and (fault := provenance.fault(carrier.address, own, carrier.asked)):
            return BatchResult((), refused=fault, worker=carrier.address)
        place, begun = _place(carrier), time.perf_counter()
        for task in tasks:
            try:
                outcomes.append(place.run(task))
            except MemoryError:
                return BatchResult(tuple(outcomes), out_of_memory=True)
            if time.perf_counter() - begun >= seconds:
                break
    return BatchResult(tuple(outcomes))


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
