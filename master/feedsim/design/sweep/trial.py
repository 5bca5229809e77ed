"""A few runs of a study made before all the others: do they work, which figures have they, how long do they take?"""

from __future__ import annotations

import logging
import multiprocessing
import os
import re
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any

from feedsim import analysis
from feedsim.design.sweep.bundle import Bundle
from feedsim.design.sweep.design import Design, Outcome
from feedsim.foundation.errors import Finding, InputError, SimulationError
from feedsim.foundation.outputs import TemporaryFolder, defer_signals
from feedsim.scenario import Scenario
from feedsim.scenario.study import Study
from feedsim.simulation import judge, nc

TRIAL_RUN_COUNT = 6  # runs that work, the first of which does not count for the time
MAX_TRIAL_RUNS = 16
MAX_TRIAL_TIME = 20.0  # s after which no further run is begun


@dataclass(frozen=True)
class Trial:
    """Attributes:

    runs: that work, those which `seconds` are of.
    seconds: least and greatest time of a run [s].
    figures: their names.
    failed: run -> why it does not work.
    tried: number of all runs made.
    """

    runs: tuple[int, ...]
    seconds: tuple[float, float]
    figures: tuple[str, ...]
    failed: dict[int, str]
    tried: int


def spread(runs: int) -> Iterator[int]:
    """All of so many runs, those that are far from one another first: the middle, the quarters, the eighths ..."""
    indexes = set[int]()
    parts = 2
    while len(indexes) < runs:
        for i in range(1, parts, 2):
            if (run := runs * i // parts) not in indexes:
                indexes.add(run)
                yield run
        parts *= 2
        if parts > 4 * runs:  # what rounding has left out
            yield from (run for run in range(runs) if run not in indexes)
            return


def trial(study: Study, design: Design, fmus: Path | None = None) -> Trial:
    """Make some runs as a worker makes them, from the changes to the figures: planning is part of it, too.

    Raises:
        SimulationError: none of them works.
    """
    done: list[Outcome] = []
    failed: dict[int, str] = {}
    place = Bundle.of(study, fmus).open()
    begun = perf_counter()
    try:
        for run in islice(spread(design.runs), MAX_TRIAL_RUNS):
            if len(done) == TRIAL_RUN_COUNT or (done and perf_counter() - begun > MAX_TRIAL_TIME):
                break
            try:
                _check_run(study, design, run)
            except InputError as error:
                failed[run] = str(error)
                continue
            outcome = place.run(design.task(run))
            if outcome.figures is None:
                failed[run] = outcome.error or "failed"
            else:
                done.append(outcome)
    finally:
        place.close()
    if not done:
        raise SimulationError(_none_works(failed))
    timed = done[1:] or done  # the first one opens the archives, once for all
    seconds = [outcome.seconds for outcome in timed]
    figures = dict.fromkeys(name for outcome in done for name in outcome.figures or ())
    return Trial(
        tuple(outcome.run for outcome in timed),
        (min(seconds), max(seconds)),
        (*figures,),
        failed,
        len(done) + len(failed),
    )


def check(study: Study, design: Design, fmus: Path | None = None) -> tuple[int, tuple[Finding, ...], dict[int, str]]:
    """The first run, from the middle on, that can be made, without a step of it: its number, warnings, and the runs
    that cannot be made, with the reasons.

    Raises:
        InputError: none of those tried can be made.
    """
    failed: dict[int, str] = {}
    for run in islice(spread(design.runs), MAX_TRIAL_RUNS):
        try:
            subject, program = _check_run(study, design, run)
            return run, tuple(judge.check(subject, program, fmus=fmus)), failed
        except InputError as error:
            failed[run] = str(error)
    raise InputError(_none_works(failed))


def _check_run(study: Study, design: Design, run: int) -> tuple[Scenario, nc.Program]:
    subject = study.base.with_changes(design.changes(run))
    program = nc.plan(subject)
    analysis.check(subject, program)
    return subject, program


def _none_works(failed: dict[int, str]) -> str:
    run, why = next(iter(failed.items()))
    return f"none of the {len(failed)} runs tried is possible; run {run}: {why}"


# --- Dask's part of the engine: workers on this machine, or the scheduler of a cluster that the user has --------------


SCHEDULER_ANSWER_TIME = 10.0  # s that a scheduler has to answer
# [s] for the processes of this machine to find one another, however busy it is; who is late is lost
LOCAL_JOIN_TIME = 120.0
WORKER_JOIN_TIME = 30.0  # s that a scheduler without workers has to get one

# Threads of linear algebra would compete with the workers for the cores.
_ONE_THREAD = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
_QUIET = {
    "distributed.worker.profile.enabled": False,  # samples the stack 100 times a second
    "distributed.admin.tick.limit": "1 h",  # does not say that a run has held the interpreter
    "distributed.admin.low-level-log-length": 100,  # what Dask notes of each batch, some 10 kB, would reach 1000
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # A run that eats the memory costs its worker, not the study; none is held back for ever.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.comm.timeouts.connect": f"{LOCAL_JOIN_TIME} s",
    "distributed.nanny.pre-spawn-environ": {},  # it would stay in this process's environment
}


@contextmanager
def local(workers: int) -> Iterator[Any]:
    """A client of `workers` processes of this machine, which end with the block, whatever happens.

    Raises:
        InputError: the script that asks for it is just being imported by such a process.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(
            "a worker process has imported your script, and that starts the study once more; put what the script does "
            "under:  if __name__ == '__main__':"
        )
    import dask
    import distributed

    # Dask's own annotations have gaps.
    connected: Any = distributed.Client
    started: Any = distributed.LocalCluster

    with ExitStack() as stack:
        stack.enter_context(_mute_dask())
        folder = str(stack.enter_context(TemporaryFolder()))
        stack.enter_context(dask.config.set({**_QUIET, "temporary-directory": folder}))
        stack.enter_context(_environment(_ONE_THREAD))
        # Processes that are half started are ended by nobody: a signal waits until they can be.
        with defer_signals(), _without_interrupts():
            try:
                cluster = started(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # without pages, see _QUIET; None would take port 8787
                    silence_logs=logging.CRITICAL,
                    local_directory=folder,
                    env={**_ONE_THREAD, "TMPDIR": folder, "TMP": folder, "TEMP": folder},
                    scheduler_kwargs={"allowed_failures": 0},
                )
            except Exception as error:
                raise InputError(
                    f"{workers} worker processes cannot be started: {_cause(error)}; 0 workers make the runs in this "
                    "process; a script that runs a study needs its statements under:  if __name__ == '__main__':"
                ) from None
            stack.callback(_end, cluster)
            client = connected(cluster, set_as_default=False)
            stack.callback(client.close, timeout=1)
        yield client


@contextmanager
def remote(address: str, say: Callable[[str], None] | None = None) -> Iterator[Any]:
    """A client of the scheduler at `address`, which has one worker at the least.

    say: called when workers have to be waited for.

    Raises:
        InputError: no address, no scheduler answers there, or it has no workers.
    """
    _check_address(address)
    import dask
    import distributed

    connected: Any = distributed.Client

    with ExitStack() as stack:
        stack.enter_context(_mute_dask())
        stack.enter_context(dask.config.set({"distributed.comm.timeouts.connect": f"{SCHEDULER_ANSWER_TIME} s"}))
        try:
            client = connected(address, timeout=SCHEDULER_ANSWER_TIME, set_as_default=False)
        except Exception as error:
            raise InputError(
                f"no scheduler answers at {address}: {_cause(error)} (waited {SCHEDULER_ANSWER_TIME:g} s); an "
                f"address reads "
                "tcp://host:8786"
            ) from None
        stack.callback(client.close, timeout=1)
        try:
            if say is not None and not client.nthreads():
                say(f"waiting for workers of the scheduler at {address}, up to {WORKER_JOIN_TIME:g} s")
            client.wait_for_workers(1, timeout=WORKER_JOIN_TIME)
        except TimeoutError:
            raise InputError(
                f"the scheduler at {address} has no workers (waited {WORKER_JOIN_TIME:g} s); start some: dask "
                f"worker {address} "
                "--nthreads 1"
            ) from None
        yield client


def _check_address(address: str) -> None:
    """Dask takes half a minute to find out that there is no port, and then reports it."""
    match = re.fullmatch(r"(?:[a-z][a-z0-9+]*://)?(?:\[[0-9A-Fa-f:.%]+\]|[^\s:/\[\]]+):(\d+)/?", address)
    if match is None or not 0 < int(match[1]) < 1 << 16:
        raise InputError(f"{address!r} is no address of a scheduler; an address reads tcp://host:8786, with its port")


def _end(cluster: Any) -> None:
    """End the workers at once: what they are at is of no use any more, and a run cannot be asked to stop."""
    for nanny in list(cluster.workers.values()):
        process = getattr(getattr(nanny, "process", None), "process", None)
        nanny.auto_restart = False
        if process is not None and process.pid is not None:
            with suppress(Exception):  # it is being ended anyway
                os.kill(process.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    cluster.close(timeout=5)


@contextmanager
def _mute_dask() -> Iterator[None]:
    """Dask writes at length of what the engine deals with itself: workers that die, connections that close."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado.application", "asyncio")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _environment(values: Mapping[str, str]) -> Iterator[None]:
    """Environment of the processes started in the block; what is set already stays."""
    added = [name for name in values if name not in os.environ]
    os.environ.update({name: values[name] for name in added})
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Threads and processes started in the block do not see the terminal's Ctrl-C: only the client deals with it."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause(error: BaseException) -> str:
    """The innermost reason of an exception, in one line."""
    while (inner := error.__cause__ or error.__context__) is not None:
        error = inner
    return " ".join(str(error).split()) or type(error).__name__
