"""What commands say while they work and in the end: a progress bar, warnings, what has been made."""

from __future__ import annotations

import io
import json
import math
import os
import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, TextIO
from unicodedata import category

from feedsim.foundation.errors import WRONG, Note, ranked, severity
from feedsim.jobs.parameters import Watch

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
            self._bar.set_description(visible(what), refresh=not before)
            if before:
                self._bar.initial = self._bar.n = before
                self._bar.refresh()
        if note:
            self._bar.set_postfix_str(visible(note), refresh=False)
        self._bar.update(done - self._bar.n)

    def _aside(self) -> AbstractContextManager[Any]:
        """A block that prints beside the bar."""
        return nullcontext() if self._bar is None else self._bar.external_write_mode(file=_plain_error())

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
            wrapper = io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=lines)
            setattr(sys, name, Shown(wrapper))


def _plain_error() -> Any:
    """Standard error for a progress bar, which moves the cursor."""
    return sys.stderr.stream if isinstance(sys.stderr, Shown) else sys.stderr


@contextmanager
def watching(quiet: bool) -> Iterator[TerminalWatch]:
    """Who watches a job for the person at the terminal: with a progress bar, unless `quiet` or where nobody looks."""
    if quiet or not sys.stderr.isatty():
        yield TerminalWatch(None, quiet)
        return
    from tqdm import tqdm

    tqdm.monitor_interval = 0  # its thread would keep a process from being forked (foundation/parallel.py)
    with tqdm(unit_scale=True, leave=False, file=_plain_error()) as bar:
        yield TerminalWatch(bar, quiet)


COLOURS = {"red": 31, "yellow": 33}
_WHEN = {"colour": "auto"}


def choose_colour(when: str) -> None:
    """Colour what is printed from now on: "always", "never", or "" and "auto" where a terminal shows it."""
    _WHEN["colour"] = when or "auto"


class Painted(str):
    """Text with the colours of this program, which Shown lets pass."""

    def __str__(self) -> str:
        return self


class Shown:
    """A stream that obeys no control character of what is printed to it: text comes from files of other people.

    Line feeds and tabs stay. All that commands print goes through here, tracebacks included; tqdm writes past it.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        if not (isinstance(text, Painted) or text.isprintable()):
            text = "\n".join("\t".join(map(visible, line.split("\t"))) for line in text.split("\n"))
        return self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def shown_streams() -> Iterator[None]:
    """Standard output and error as Shown for the block; what they have become in it otherwise stays, such as None."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, Shown):
            setattr(sys, name, Shown(stream))
            try:
                with shown_streams():
                    yield
            finally:
                if isinstance(getattr(sys, name), Shown):
                    setattr(sys, name, stream)
            return
    yield


def visible(line: str) -> str:
    """As the terminal may show it: names come from files, and control characters in them are not obeyed."""
    return "".join(
        c if c.isprintable() or category(c) == "Zs" else c.encode("unicode_escape").decode("ascii") for c in line
    )


def painted(text: str, colour: str, stream: Any) -> str:
    """The text in a colour where a stream is a terminal that shows some, and NO_COLOR (no-color.org) is not set."""
    text = "\n".join(visible(line) for line in text.split("\n"))
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb" or not stream.isatty()
    if not colour or _WHEN["colour"] == "never" or (plain and _WHEN["colour"] == "auto"):
        return text
    return Painted(f"\x1b[{COLOURS[colour]}m{text}\x1b[0m")


def warn(warnings: Iterable[str]) -> None:
    """Say on standard error what the user should know before believing the results; what is wrong first."""
    for name in ranked(warnings):
        kind, colour = {"wrong": (WRONG, "red"), "doubt": ("warning: ", "yellow"), "note": ("note: ", "")}[
            severity(name)
        ]
        print(painted(f"feedsim: {kind}{name}", colour, sys.stderr), file=sys.stderr)


def finish(result: Any, out: Any, options: Namespace) -> int:
    """Print what a job returned, and return the exit code.

    Findings go to standard error. What is wrong is the first line of the output besides, which may be all that is read.
    """
    from feedsim.jobs.result import Result

    if not hasattr(result, "findings"):  # a schema, names of files, a script: what the command is for
        print(*_plain_lines(result), sep="\n")
        return 0
    quiet = bool(options.quiet or options.json is True)
    findings = ranked(result.findings_shown(quiet) if isinstance(result, Result) else result.findings)
    warn(findings)
    code = getattr(result, "exit_code", 0)
    try:
        if options.json is True:
            print(json_of(result, out))
        elif not options.quiet:
            both = sys.stdout is not None and sys.stdout.isatty() and sys.stderr.isatty()  # it stands there already
            wrong = [WRONG + finding for finding in findings[:1] if severity(finding) == "wrong" and not both]
            for line in (*(painted(text, "red", sys.stdout) for text in wrong), *_lines(result, options.verbose, out)):
                print(line)
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        if not hasattr(result, "exit_code"):
            raise
        sys.stdout = None  # who read has gone, or the disk is full; the verdict still counts
    return code or int(bool(options.strict) and any(severity(text) == "wrong" for text in result.findings))


def _lines(result: Any, verbose: bool, out: Any) -> Iterator[str]:
    """What a result says, and where it was written."""
    from feedsim.jobs.result import Result

    own = isinstance(result, Result)
    yield from map(visible, result.lines_shown(verbose) if own else result.answers)
    if (place := getattr(result, "place", None) or out) is not None:
        if own and (step := _next_step(Path(place))):
            yield from map(visible, (f"Next: {step['words']}:", f"  {step['command']}"))
        yield visible(f"-> {Path(place) / result.main_file if own else place}")


def _next_step(folder: Path) -> dict[str, str]:
    """What the summary of a result says to do next; {} where it says nothing."""
    try:
        content = json.loads((folder / "summary.json").read_bytes())
    except (OSError, ValueError):
        return {}
    return content.get("next", {}) if isinstance(content, dict) else {}


def _plain_lines(result: Any) -> list[str]:
    if isinstance(result, Mapping):
        return [json.dumps(result, indent=2)]
    if isinstance(result, str):
        return [result]
    if not result:
        return ["all there already"]
    if isinstance(result[0], Path):
        return [visible(str(path)) for path in result]
    from feedsim.jobs.examples import table

    return table(result)


def json_of(result: Any, out: Any) -> str:
    """A result as JSON: its summary.json where that was written, else kind, answer, findings and figures."""
    if (place := getattr(result, "place", None) or out) is not None and (Path(place) / "summary.json").is_file():
        return (Path(place) / "summary.json").read_text(encoding="utf-8").rstrip("\n")
    if (own := getattr(result, "json", None)) is not None:
        return str(own).rstrip("\n")
    figures = {
        name: {"value": figure.value if math.isfinite(figure.value) else None, "unit": figure.unit}
        for name, figure in getattr(result, "figures", {}).items()
    }
    entries = [{"severity": severity(text), "text": str(text)} for text in ranked(result.findings)]
    content = {"kind": result.kind, "answer": [*result.answers], "findings": entries, "figures": figures}
    return json.dumps(content | ({"files": [str(out)]} if out is not None else {}), indent=2, ensure_ascii=False)


# --- What `feedsim` alone says: the four things a person may want, with the command for each --------------------------


START_TEXT = """feedsim simulates the feed drives of a machine tool: control, friction and structure.

See it work
  feedsim example xz_circle z_positioning      copies two scenarios into this folder
  feedsim run xz_circle.yaml                   a circle, why it is not round, and a report

Find out why a measured circle is not round
  feedsim example ballbar log                  copies sample records, synthetic ones
  feedsim circle records/ballbar/before_ccw.csv records/ballbar/before_cw.csv --axes X,Y

Rebuild a machine from its records
  feedsim identify drive records/log/log.csv --columns records/log/columns.yaml --axes Z --out results/my_machine
  feedsim replay records/log/log.csv --columns records/log/columns.yaml --axes Z --machine results/my_machine

Try a change before it is made
  feedsim run xz_circle.yaml --set machine.axes.X.drive.K_v="5 (m/min)/mm" --out results/faster
  feedsim diff results/xz_circle results/faster

feedsim --help lists all commands, feedsim COMMAND --help the options of one; feedsim docs opens the tutorials.
"""
