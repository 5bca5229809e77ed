"""What a job runs: a scenario file, an SSP file with archives of its own, or a scenario that is loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from feedsim import scenario
from feedsim.files.source import is_ssp, is_study
from feedsim.foundation.arguments import Changes, settings, spelt
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import File
from feedsim.scenario import Scenario
from feedsim.simulation import nc
from feedsim.simulation.nc import Program


def load(file: File, set: Changes = None) -> Scenario:
    """A scenario file, checked, with changes such as ``{"machine.axes.Z.friction.F_C": "1.8 N.m"}``. Raises InputError.

    >>> import feedsim as fs
    >>> fs.load("xz_circle.yaml", {"motions.0.radius": "20 mm"}).motions[0].radius
    0.02
    """
    return scenario.load(file, settings(set))


def on_machine(machine: File | None, changes: Changes) -> list[str]:
    """Changes with the machine ahead that is chosen for a scenario or an NC program."""
    return [*([f"machine={machine}"] if machine is not None else []), *settings(changes)]


@dataclass(frozen=True, eq=False)
class Opened:
    """A scenario with its planned motions, ready to be run.

    fmus: folder of the archives; None: those that come along. warnings: what makes of a run's warnings all that is to
    be said: what the archives' own are called in an SSP file, and what that lacks. named: makes a sentence on archives
    speak of the file. changes: as texts.
    """

    plan: Scenario
    program: Program
    fmus: Path | None
    changes: list[str]
    warnings: Callable[[Iterable[str]], tuple[str, ...]] = tuple
    named: Callable[[str], str] = str


@contextmanager
def opened(given: File | Scenario, changes: Changes = None, fmus: File | None = None) -> Iterator[Opened]:
    """Read and plan what is given; the archives of an SSP file are there as long as the block lasts.

    Raises InputError: a faulty file, a study, changes of a scenario that is loaded, archives beside those of an SSP.
    """
    texts = settings(changes)
    archives = None if fmus is None else Path(fmus)
    if isinstance(given, Scenario):
        if texts:
            raise InputError(
                f"{spelt('set')}: changes are for a file; a scenario that is loaded has its own (feedsim.load)"
            )
        yield Opened(given, nc.plan(given), archives, texts)
        return
    file = Path(given)
    if not is_ssp(file):
        if is_study(file):
            raise InputError(f"{file}: is a study of many runs: feedsim sweep {file}")
        plan = scenario.load(file, texts)
        yield Opened(plan, nc.plan(plan), archives, texts)
        return
    if archives is not None:
        raise InputError(f"{spelt('fmus')} {fmus}: {file} has its own archives; leave the option out")
    from feedsim.simulation import ssp  # not for runs of scenario files

    with ssp.opened(file, texts) as result:
        yield Opened(result.scenario, result.program, result.fmus, texts, result.told, result.named)
