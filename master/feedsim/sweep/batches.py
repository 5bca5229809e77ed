"""Which tasks go to the workers together, and what becomes of those whose worker dies.

A batch takes about half a second: many short runs or one long one, so that handing over costs little; towards the end
they get smaller, so that the workers end together. Tasks whose worker has died are run once more, one at a time, and at
last with nothing else under way: the one that kills its worker is separated from those that were in its company.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import ceil

from feedsim.sweep.design import Outcome, Task

AIM = 0.5  # s of work in a batch: handing one over costs some 10 ms, and as much progress as this may be lost
MAX_BATCH_DELAY = 2.0  # a batch that takes so many times longer than meant is handed back unfinished
MAX_BATCH_RUNS = 1000  # runs in a batch
DEEP = 2  # batches per worker at a time, so that the next one is there when one ends
DEATHS = 3  # of its worker, the last one in nobody's company, after which a task is not tried again
WAITING = 8  # tasks to be run in nobody's company, for which the others are made to wait


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
    _clearing: bool = False  # the others wait until all loners have been run
    _deaths: dict[int, int] = field(default_factory=dict)  # run -> deaths of its worker
    _flying: set[Batch] = field(default_factory=set)
    _mean: float | None = None  # s per run, the latest counting most
    _exhausted: bool = False

    def __post_init__(self) -> None:
        self._rest = iter(self.tasks)

    def next(self, workers: int) -> Batch | None:
        """A batch to be handed over now to one of `workers`; None: they have enough, or there is no more."""
        if any(batch.alone for batch in self._flying):
            return None
        if self._clearing or len(self._loners) >= WAITING:
            self._clearing = bool(self._loners)
            if self._clearing:
                return None if self._flying else self._sent(Batch((self._loners.popleft(),), suspect=True, alone=True))
        if self._suspects or self._deaths:
            # One at a time per worker: few wait behind a task that kills, and are taken for one.
            if len(self._flying) >= workers:
                return None
            if self._suspects:
                return self._sent(Batch((self._suspects.popleft(),), suspect=True))
        elif len(self._flying) >= DEEP * workers:
            return None
        batch = self._fresh_batch(workers)
        if batch is None and self._loners and not self._flying:
            self._clearing = True
            return self.next(workers)
        return batch

    def _fresh_batch(self, workers: int) -> Batch | None:
        size = 1 if self._mean is None else max(1, min(MAX_BATCH_RUNS, round(AIM / max(self._mean, 1e-6))))
        self._read(4 * size * workers)
        if not self._fresh:
            return None
        if self._exhausted:
            size = min(size, ceil(len(self._fresh) / (DEEP * workers)))
        return self._sent(Batch(tuple(self._fresh.popleft() for _ in range(min(size, len(self._fresh))))))

    def _read(self, least: int) -> None:
        while not self._exhausted and len(self._fresh) < least:
            more = tuple(islice(self._rest, least - len(self._fresh)))
            self._fresh.extend(more)
            self._exhausted = not more

    def _sent(self, batch: Batch) -> Batch:
        self._flying.add(batch)
        return batch

    @property
    def waiting(self) -> bool:
        """Whether there are tasks that are to be handed over."""
        self._read(1)
        return bool(self._fresh or self._suspects or self._loners)

    @property
    def flying(self) -> int:
        """Batches handed over and not back yet."""
        return len(self._flying)

    def done(self, batch: Batch, outcomes: Sequence[Outcome]) -> None:
        """`batch` is back; the tasks without an outcome are handed over anew."""
        self._flying.remove(batch)
        self._count(outcomes)
        self._fresh.extendleft(reversed(batch.tasks[len(outcomes) :]))

    def refused(self, batch: Batch) -> None:
        """No run of `batch` was begun: it is handed over anew, as what it was."""
        self._flying.remove(batch)
        waiting = self._loners if batch.alone else self._suspects if batch.suspect else self._fresh
        waiting.extendleft(reversed(batch.tasks))

    def died(self, batch: Batch, deaths: int, how: str, outcomes: Sequence[Outcome] = ()) -> list[Outcome]:
        """The worker of `batch` has died `deaths` times over it, or failed as `how` says, after `outcomes`.

        Returns outcomes of the tasks that are given up.
        """
        self._flying.remove(batch)
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
