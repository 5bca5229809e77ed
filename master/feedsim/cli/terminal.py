"""What commands say while they work and in the end: a progress bar, warnings, what has been made."""

from __future__ import annotations

import io
import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from feedsim.cli.options import arguments
from feedsim.findings import WRONG, Note, ranked, severity
from feedsim.jobs.watch import Watch

if TYPE_CHECKING:
    from feedsim.scenario import Coupling, Machine

T = TypeVar("T")
STANDARD_OUTPUT = "standard output"  # what an error calls it


class TerminalWatch(Watch):
    """Shows what a job reports: a progress bar, and sentences on standard error."""

    def __init__(self, bar: Any, quiet: bool) -> None:
        """bar: of tqdm; None where nobody looks."""
        self._bar, self._quiet = bar, quiet
        self._what: str | None = None
        self.command = ("feedsim", *sys.argv[1:])  # not where it is installed: records are sent to others
        self.done, self.total = 0, 0

    def progress(self, what: str, done: int, total: int, before: int = 0, note: str = "") -> None:
        """How many of its steps are done, of how many. before: done earlier, which do not count for the rate."""
        self.done, self.total = done, total
        if self._bar is None:
            return
        if what != self._what:
            self._what = what
            self._bar.reset(total)
            self._bar.set_description(what, refresh=not before)
            if before:
                self._bar.initial = self._bar.n = before
                self._bar.refresh()
        if note:
            self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(done - self._bar.n)

    def _aside(self) -> AbstractContextManager[Any]:
        """A block that prints beside the bar."""
        return nullcontext() if self._bar is None else self._bar.external_write_mode(file=sys.stderr)

    def announce(self, sentence: str) -> None:
        """Whose programs the job executes."""
        with self._aside():
            print(f"feedsim: {sentence}", file=sys.stderr)

    def note(self, sentence: str) -> None:
        """What the job will replace."""
        with self._aside():
            warn([Note(sentence)])

    def warn(self, findings: Iterable[str]) -> None:
        """What is the matter with the files that the job begins with."""
        with self._aside():
            warn(findings)

    def say(self, sentence: str) -> None:
        """What takes longer, and why."""
        if not self._quiet:
            self.announce(sentence)


class _Standard(io.FileIO):
    """Standard output or error. That nobody hears what is said on the latter is no reason to end."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            if self.fileno() == 2:
                return len(data)
            error.filename = STANDARD_OUTPUT
            raise


def prepare_streams() -> None:
    """Make of the standard streams what can be printed to, whatever they are: closed, full, of few characters.

    What cannot be shown comes as an escape. A closed stream is one whose reader has gone: what is printed is lost.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # else the next file that is opened has the number, and what prints to that writes into it
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is None or isinstance(stream, io.TextIOWrapper):
            buffer = io.BufferedWriter(_Standard(number, "w", closefd=False))
            lines = number == 2 or stream is None or stream.line_buffering
            encoding = stream.encoding if stream is not None else "utf-8"
            setattr(sys, name, io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=lines))


@contextmanager
def watching(quiet: bool, unit: str = "", *, shortened: bool = False) -> Iterator[TerminalWatch]:
    """Who watches a job for the person at the terminal: with a progress bar, unless `quiet` or where nobody looks.

    unit: what the bar counts; shortened: in large numbers (12.3k).
    """
    if quiet or not sys.stderr.isatty():
        yield TerminalWatch(None, quiet)
        return
    from tqdm import tqdm

    with tqdm(unit=unit, unit_scale=shortened, leave=False) as bar:
        yield TerminalWatch(bar, quiet)


def call(job: Callable[..., T], options: Namespace, unit: str = "", *, shortened: bool = False, **read: Any) -> T:
    """What a job makes of the options of its command, with its progress shown.

    read: arguments that the command has read from its options itself. unit, shortened: as of :func:`watching`.
    """
    with watching(getattr(options, "quiet", False), unit, shortened=shortened) as watch:
        return job(**arguments(job, options) | read, watch=watch)


COLOURS = {"red": 31, "yellow": 33}


def visible(line: str) -> str:
    """As the terminal may show it: names come from files, and control characters in them are not obeyed."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line)


def painted(text: str, colour: str, stream: Any) -> str:
    """The text in a colour where a stream is a terminal that shows some, and NO_COLOR (no-color.org) is not set."""
    text = "\n".join(visible(line) for line in text.split("\n"))
    plain = not colour or bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    return text if plain or not stream.isatty() else f"\x1b[{COLOURS[colour]}m{text}\x1b[0m"


def warn(warnings: Iterable[str]) -> None:
    """Say on standard error what the user should know before believing the results; what is wrong first."""
    for name in ranked(warnings):
        kind, colour = {"wrong": (WRONG, "red"), "doubt": ("warning: ", "yellow"), "note": ("note: ", "")}[
            severity(name)
        ]
        print(painted(f"feedsim: {kind}{name}", colour, sys.stderr), file=sys.stderr)


def announce(
    machine: Machine, fmus: Path | None, named: Callable[[str], str] = str, coupling: Coupling | None = None
) -> None:
    """Say on standard error, ahead of a run, whose programs are executed besides the shipped ones; `named`: what is to
    be said for a sentence; `coupling`: of the run, where a scenario has it."""
    from feedsim import cosim

    for sentence in cosim.executed(machine, fmus, coupling):
        print(f"feedsim: {named(sentence)}", file=sys.stderr)


def finish(quiet: bool, warnings: Iterable[str], *lines: str) -> None:
    """How a command ends: with its warnings, and with what it has made unless it is to be quiet.

    What is wrong is the first line of the output besides, which may be all that is kept.
    """
    warnings = ranked(warnings)
    warn(warnings)
    if not quiet:
        wrong = [
            painted(WRONG + warning, "red", sys.stdout) for warning in warnings[:1] if severity(warning) == "wrong"
        ]
        print(*wrong, *lines, sep="\n")
