"""The engine of a study: tasks in, an outcome for each out, made by workers on this machine, on a cluster, or here.

>>> with open_engine(Bundle.of(study), workers=2) as engine:                    # doctest: +SKIP
...     for outcome in engine.map(tasks):                                       # doctest: +SKIP
...         print(outcome.run, outcome.figures or outcome.error)                # doctest: +SKIP
"""

from __future__ import annotations

import os
import queue
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Protocol

from feedsim.errors import InputError, SimulationError
from feedsim.sweep import cluster, same
from feedsim.sweep.batches import AIM, LONGEST, Batch, Batches
from feedsim.sweep.bundle import Work
from feedsim.sweep.task import Outcome, Task

LOST = 20.0  # s without the scheduler, after which a study is given up
ALONE = 60.0  # s without any worker, likewise
_LOOK = 1.0  # s between two looks at the cluster


class Engine(Protocol):
    """Makes runs.

    Attributes:
        workers: processes that make them; 0: this one.
        where: "in this process", "2 local processes", "tcp://..., 8 workers".
        warnings: sentences for the user.
    """

    workers: int
    where: str
    warnings: tuple[str, ...]

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """One outcome per task, in the order in which they come; tasks are taken as workers need them.

        An interrupt is raised after the outcomes that are there already.

        Raises:
            InputError: a worker cannot take part.
            SimulationError: the scheduler or all workers are lost.
        """


@contextmanager
def open_engine(bundle: Work, workers: int | None = None, scheduler: str | None = None) -> Iterator[Engine]:
    """An engine for the runs of `bundle`; its workers end with the block.

    Args:
        workers: processes on this machine; 0: runs are made in this process; default: one for each core it may use.
        scheduler: address of the Dask scheduler of a cluster, in place of local processes: "tcp://host:8786".

    Raises:
        InputError: the workers cannot be had, or have another version of feedsim.
    """
    if scheduler is not None and workers is not None:
        raise InputError("either a number of workers, or a scheduler, which has its own; not both")
    if workers is not None and workers < 0:
        raise InputError(f"workers: {workers} is outside the allowed range: at least 0")
    if workers == 0:
        yield Here(bundle)
        return
    if scheduler is None:
        count = workers or _cores()
        opened, where = cluster.local(count), f"{count} local process{'es'[: 2 * (count != 1)]}"
    else:
        opened, where = cluster.remote(scheduler), f"cluster at {scheduler}"
    with opened as client:
        engine = Crowd(client, bundle, where, own=scheduler is None)
        try:
            yield engine
        finally:
            engine.leave()


class Here:
    """Runs made in this process, one after the other."""

    workers = 0
    where = "this process"
    warnings: tuple[str, ...] = ()

    def __init__(self, bundle: Work) -> None:
        self._bundle = bundle

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        place = self._bundle.open()
        try:
            for task in tasks:
                try:
                    yield place.run(task)
                except MemoryError:
                    yield Outcome(task.run, None, "out of memory", 0.0)
        finally:
            place.close()


class Crowd:
    """Runs made by the workers of a Dask scheduler."""

    def __init__(self, client: Any, bundle: Work, where: str, *, own: bool) -> None:
        from feedsim.sweep import worker

        self._client = client
        self._digest = bundle.digest
        self._own = own  # a cluster of our own goes as a whole; another's has to be tidied
        self.where = where
        answers = client.run(eval, same.QUESTION, on_error="return")
        faults = [found for address, answer in answers.items() if (found := same.fault(address, answer, same.told()))]
        if faults:
            raise InputError.of("the workers cannot be used", faults)
        self.workers = len(answers)
        several = sum(threads > 1 for threads in client.nthreads().values())
        self.warnings = (
            *same.differences(answers),
            *([f"{several} of {len(answers)} workers have several threads, which take turns: a run needs a process of "
               "its own; start workers with --nthreads 1"] if several else []),
        )  # fmt: skip
        self._carrier = worker.Carrier(bundle, same.told())
        client.register_plugin(self._carrier)
        client.run(worker.prepare, self._digest)

    def map(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        flight = _Flight(self._client, self._digest, Batches(tasks), self.where)
        try:
            while (outcomes := flight.next()) is not None:
                yield from outcomes
        except (KeyboardInterrupt, SystemExit):
            yield from flight.landed()
            raise
        finally:
            flight.cancel()

    def leave(self) -> None:
        """Take away what was brought to workers that are not ours."""
        if not self._own and self._client.status == "running":
            with suppress(Exception):  # the scheduler may be gone
                self._client.unregister_worker_plugin(self._carrier.name)


class _Flight:
    """The batches of one study that are with the workers."""

    def __init__(self, client: Any, digest: str, batches: Batches, where: str) -> None:
        self._client = client
        self._digest = digest
        self._batches = batches
        self._where = where
        self._landed: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._of: dict[str, tuple[Any, Batch]] = {}
        self._name = f"feedsim-{uuid.uuid4().hex[:12]}"
        self._count = 0
        self._workers = 0
        self._looked = 0.0
        self._healthy = self._manned = time.monotonic()

    def next(self) -> list[Outcome] | None:
        """Outcomes of a batch that has come back; None when all have."""
        while True:
            self._look()
            while (batch := self._batches.next(max(1, self._workers))) is not None:
                self._submit(batch)
            if not self._of:
                return None
            with suppress(queue.Empty):
                return self._outcomes(self._landed.get(timeout=_LOOK))

    def landed(self) -> list[Outcome]:
        """Outcomes that have come back and were not fetched yet."""
        found: list[Outcome] = []
        with suppress(queue.Empty):
            while True:
                future = self._landed.get_nowait()
                if future.status == "finished":
                    found += self._outcomes(future)
        return found

    def cancel(self) -> None:
        futures = [future for future, _ in self._of.values()]
        self._of.clear()
        if futures and self._client.status == "running":
            with suppress(Exception):
                self._client.cancel(futures, force=True)
        for future in futures:
            future.release()

    def _submit(self, batch: Batch) -> None:
        from feedsim.sweep.worker import work_batch

        self._count += 1
        key = f"{self._name}-{self._count}"
        future = self._client.submit(
            work_batch, self._digest, batch.tasks, AIM * LONGEST, key=key, pure=False, retries=0,
            priority=10 if batch.suspect else 0,
        )  # fmt: skip
        self._of[key] = (future, batch)
        future.add_done_callback(self._landed.put)

    def _outcomes(self, future: Any) -> list[Outcome]:
        from distributed import KilledWorker

        if future.key not in self._of:
            return []
        _, batch = self._of.pop(future.key)
        try:
            done = future.result(timeout=LOST)
        except KilledWorker as error:
            self._looked = 0.0  # one worker less, for a while
            return self._batches.died(batch, error.allowed_failures + 1, "its worker process died")
        except (KeyboardInterrupt, SystemExit):
            self._of[future.key] = (future, batch)
            self._landed.put(future)
            raise
        except Exception as error:
            if future.status in ("cancelled", "lost") or self._client.status != "running":
                raise self._lost() from None
            raise SimulationError(
                f"{self._where}: a worker cannot make runs: {type(error).__name__}: {error}; what is done is kept"
            ) from error
        finally:
            future.release()
        if done.refused is not None:
            raise InputError(done.refused)
        if done.out_of_memory:
            return [*done.outcomes, *self._batches.died(batch, 1, "its worker ran out of memory", done.outcomes)]
        self._batches.done(batch, done.outcomes)
        return list(done.outcomes)

    def _look(self) -> None:
        """How many workers there are now, and whether the scheduler is.

        Raises:
            SimulationError: it is lost, or all workers are.
        """
        now = time.monotonic()
        if now - self._looked < _LOOK:
            return
        self._looked = now
        if self._client.status == "running":
            with suppress(Exception):
                self._workers = len(self._client.nthreads())
                self._healthy = time.monotonic()
        if self._workers:
            self._manned = now
        if self._client.status == "closed" or now - self._healthy > LOST:
            raise self._lost()
        if now - self._manned > ALONE:
            raise SimulationError(
                f"{self._where}: no worker is left (waited {ALONE:g} s); what is done is kept, and the study can be "
                "continued"
            )

    def _lost(self) -> SimulationError:
        return SimulationError(
            f"{self._where}: the scheduler is lost; what is done is kept, the study can be continued"
        )


def _cores() -> int:
    """Cores that this process may use."""
    with suppress(AttributeError):  # not on every system
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
