"""The journal of a study: a line of JSON for every run that is done, so that a study that was ended can go on.

The first line says what the runs belong to; where a study with more runs begins with the same ones, another line says
how many they were, and one is added whenever they become more. Lines are only ever added. One that is torn, since the
process or the machine ended in the middle of it, is dropped when the journal is opened again; its run is made again.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from feedsim.errors import InputError, OutputError
from feedsim.files.regular import json_value
from feedsim.owned import Closing, claimed
from feedsim.signals import held
from feedsim.sweep.design import Outcome

JOURNAL_NAME = "runs.jsonl"
_EXTENT = "runs"  # key of the lines that say how many
FORMAT = 1
SYNC = 1.0  # seconds after which what was written is on the disk at the latest


class Journal(Closing):
    """The journal of a folder, open for adding; a context manager.

    Attributes:
        done: runs that are in it.
        resumed: how many of them were in it when it was opened.
        failed: how many runs in it failed.
        damaged: lines, from 1, that could not be read and count as not written.
    """

    def __init__(
        self,
        directory: Path,
        head: Mapping[str, Any],
        runs: int,
        *,
        restart: bool = False,
        first: Callable[[int], str] | None = None,
    ) -> None:
        """Open the journal in `directory`, which is made where it is missing.

        head: what the runs belong to; `head["parts"]` maps what can differ to its fingerprint. runs: of the study.
        restart: begin anew, whatever is there.
        first: number of runs -> what shows the first so many of them from others, where the study with fewer runs
            consists of just those; its journal is then gone on with.

        Raises:
            InputError: the journal is that of another study, or of more runs.
            OutputError: it cannot be written, or another process has claimed the folder.
        """
        self.path = directory / JOURNAL_NAME
        self.runs = runs
        self.done: set[int] = set()
        self.failed = 0
        self.damaged: tuple[int, ...] = ()
        self._claim = ExitStack()
        self._claim.enter_context(claimed(directory))
        try:
            self._file = self.path.open("ab", buffering=0)
            self._synced = time.monotonic()
            if restart:
                self._file.truncate(0)
            self._begin(head, first)
        except BaseException as error:
            self._claim.close()
            if isinstance(error, OSError):
                raise OutputError(f"{self.path} cannot be written: {error.strerror or error}") from error
            raise
        self.resumed = len(self.done)

    def _begin(self, head: Mapping[str, Any], first_runs: Callable[[int], str] | None) -> None:
        """Check the journal against `head`, drop what is torn, take in the runs that are done."""
        with self.path.open("rb") as file:
            first = file.readline()
            own = {"format": FORMAT, **head}
            if not first.endswith(b"\n") and _encoded(own).startswith(first):  # nothing, or never finished
                self._file.truncate(0)
                self._write(own)
                self._extend(None, first_runs)
                self.sync()
                return
            _same_study(self.path, _line(first) if first.endswith(b"\n") else None, head)
            damaged, end, extent = [], file.tell(), None
            for number, line in enumerate(file, start=2):
                if not line.endswith(b"\n"):
                    break
                end += len(line)
                content = _line(line)
                if isinstance(content, dict) and type(content.get(_EXTENT)) is int:
                    extent = content
                    continue
                outcome = _outcome(content, self.runs)
                if outcome is None:
                    damaged.append(number)
                elif outcome.run not in self.done:
                    self._count(outcome)
        self.damaged = tuple(damaged)
        self._check_extent(extent, head, first_runs)
        self._file.truncate(end)
        self._extend(extent, first_runs)

    def _check_extent(
        self, extent: Mapping[str, Any] | None, head: Mapping[str, Any], first_runs: Callable[[int], str] | None
    ) -> None:
        """InputError where the journal's runs are more than the study's, or are not its first ones."""
        if extent is None or first_runs is None:
            return
        known = extent[_EXTENT]
        if known > self.runs:
            raise InputError(
                f"{self.path}: has the study with {known} runs, the first {self.runs} of which are asked for; take "
                f"{known} runs or more, or another folder with --out"
            )
        if first_runs(known) != extent.get("first"):
            raise InputError(_other_study(self.path, head, "parameters and sampling"))

    def _extend(self, extent: Mapping[str, Any] | None, first_runs: Callable[[int], str] | None) -> None:
        if first_runs is not None and (extent is None or extent[_EXTENT] < self.runs):
            self._write({_EXTENT: self.runs, "first": first_runs(self.runs)})

    def add(self, outcome: Outcome) -> bool:
        """Add a run, unless it is there already. OutputError: it cannot be written."""
        if outcome.run in self.done:
            return False
        figures = None
        if outcome.figures is not None:
            figures = {name: [_plain(value), unit] for name, (value, unit) in outcome.figures.items()}
        with held():  # a run that is written is counted, too
            self._write({
                "run": outcome.run, "figures": figures, "error": outcome.error, "seconds": outcome.seconds,
                "warnings": list(outcome.warnings),
            })  # fmt: skip
            self._count(outcome)
        if time.monotonic() - self._synced >= SYNC:
            self.sync()
        return True

    def outcomes(self) -> Iterator[Outcome]:
        """The runs that are `done`, each once, in the order of the journal."""
        seen: set[int] = set()
        for outcome in read(self.path, self.runs):
            if outcome.run in self.done and outcome.run not in seen:
                seen.add(outcome.run)
                yield outcome

    def missing(self) -> Iterator[int]:
        """Runs that are not done, in order."""
        return (run for run in range(self.runs) if run not in self.done)

    def sync(self) -> None:
        """Have what was written on the disk."""
        with suppress(OSError):  # not every file system can
            os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def close(self) -> None:
        """Close the journal; another process may go on with it."""
        self.sync()
        self._file.close()
        self._claim.close()

    def _count(self, outcome: Outcome) -> None:
        self.done.add(outcome.run)
        self.failed += outcome.figures is None

    def _write(self, content: Mapping[str, Any]) -> None:
        line = memoryview(_encoded(content))
        try:
            while line:  # a file that is not buffered may take a part
                line = line[self._file.write(line) :]
        except OSError as error:
            raise OutputError(
                f"{self.path} cannot be written: {error.strerror or error}; what is in it so far is kept"
            ) from error


def _encoded(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace") + b"\n"


def read(path: Path, runs: int) -> Iterator[Outcome]:
    """What a journal's lines show, without those that cannot be read."""
    with path.open("rb") as file:
        file.readline()
        for line in file:
            outcome = _outcome(_line(line), runs) if line.endswith(b"\n") else None
            if outcome is not None:
                yield outcome


def _same_study(path: Path, result: Any, head: Mapping[str, Any]) -> None:
    if not isinstance(result, dict) or result.get("format") != FORMAT or not isinstance(result.get("parts"), dict):
        raise InputError(f"{path}:1: not the journal of a study, or of another version of feedsim; {_ANEW}")
    if result.get("fingerprint") == head["fingerprint"]:
        return
    parts, own = result["parts"], head["parts"]
    other = [name for name in own if parts.get(name) != own[name]] or ["study"]
    raise InputError(_other_study(path, result, ", ".join(other)))


def _other_study(path: Path, result: Mapping[str, Any], what: str) -> str:
    return (
        f"{path}: its runs belong to another state of the study; what differs: {what} (begun as "
        f"{result.get('study')!r}); {_ANEW}"
    )


_ANEW = "choose another folder with --out, or begin anew with --restart, which discards them"


def _line(line: bytes) -> Any:
    try:
        return json_value(line, "")
    except InputError:
        return None


def _outcome(content: Any, runs: int) -> Outcome | None:
    """A line as an outcome; None where it is none."""
    try:
        figures = content["figures"]
        if figures is not None:
            figures = {str(name): (_number(value), str(unit)) for name, (value, unit) in figures.items()}
        outcome = Outcome(
            content["run"], figures, content["error"], float(content["seconds"]), tuple(content["warnings"])
        )
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
    return outcome if type(outcome.run) is int and 0 <= outcome.run < runs else None


def _plain(value: float) -> float | str:
    return float(value) if math.isfinite(value) else repr(float(value))


def _number(value: Any) -> float:
    if isinstance(value, str) and value not in ("nan", "inf", "-inf"):
        raise ValueError(value)
    return float(value)
