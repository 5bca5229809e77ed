"""Who watches a job: hears how far it is, and what is to be known before it begins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from feedsim.scenario import Coupling, Machine


class Watch:
    """Nobody: every word is lost. The command line has one that shows them.

    command: the command line that was given, for records; empty in Python.

    >>> Watch().progress("reading", 1, 3)
    """

    command: Sequence[str] = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def progress(self, what: str, done: int, total: int, before: int = 0, note: str = "") -> None:
        """`done` of `total` steps of `what`; before: steps that an earlier call of the job has done."""

    def of(self, what: str) -> Callable[[int, int], None]:
        """The same for work that reports (done, total) and not what it is."""
        return lambda done, total: self.progress(what, done, total)

    def announce(self, sentence: str) -> None:
        """Whose programs the job executes besides those of feedsim."""

    def note(self, sentence: str) -> None:
        """What the job will replace."""

    def warn(self, findings: Iterable[str]) -> None:
        """What is the matter with the files that the job begins with."""

    def say(self, sentence: str) -> None:
        """What takes longer, and why."""


NO_WATCH = Watch()


def announce(watch: Watch, machine: Machine, fmus: Path | None, coupling: Coupling | None = None) -> None:
    """Announce the programs that a run of the machine executes besides those of feedsim.

    coupling: of the run, where a scenario has it.
    """
    from feedsim import cosim

    for sentence in cosim.executed(machine, fmus, coupling):
        watch.announce(sentence)


def announce_archive(watch: Watch, path: Path | None, who: str) -> None:
    """The same of one archive that a user names, for the part that it plays; None: a shipped one."""
    from feedsim import cosim

    for sentence in cosim.executing(path, who) if path is not None else ():
        watch.announce(sentence)
