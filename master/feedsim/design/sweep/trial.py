"""A few runs of a study made before all the others: do they work, which figures have they, how long do they take?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from time import perf_counter

from feedsim import analysis
from feedsim.design.sweep.bundle import Bundle
from feedsim.design.sweep.design import Design, Outcome
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.scenario import Scenario
from feedsim.scenario.study import Study
from feedsim.simulation import judge, nc

ENOUGH = 6  # runs that work, the first of which does not count for the time
TRIES = 16
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
        for run in islice(spread(design.runs), TRIES):
            if len(done) == ENOUGH or (done and perf_counter() - begun > MAX_TRIAL_TIME):
                break
            try:
                _checked(study, design, run)
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


def check(study: Study, design: Design, fmus: Path | None = None) -> tuple[int, tuple[str, ...], dict[int, str]]:
    """The first run, from the middle on, that can be made, without a step of it: its number, warnings, and the runs
    that cannot be made, with the reasons.

    Raises:
        InputError: none of those tried can be made.
    """
    failed: dict[int, str] = {}
    for run in islice(spread(design.runs), TRIES):
        try:
            subject, program = _checked(study, design, run)
            return run, tuple(judge.check(subject, program, fmus=fmus)), failed
        except InputError as error:
            failed[run] = str(error)
    raise InputError(_none_works(failed))


def _checked(study: Study, design: Design, run: int) -> tuple[Scenario, nc.Program]:
    subject = study.base.with_changes(design.changes(run))
    program = nc.plan(subject)
    analysis.check(subject, program)
    return subject, program


def _none_works(failed: dict[int, str]) -> str:
    run, why = next(iter(failed.items()))
    return f"none of the {len(failed)} runs tried is possible; run {run}: {why}"
