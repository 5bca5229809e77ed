"""Make the runs of a study: what is not in the journal yet goes to the engine, what comes back into the journal; in the
end the table is made of it.
"""

from __future__ import annotations

import json
import logging
import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import Any, get_args

from feedsim.design.sweep import provenance
from feedsim.design.sweep.bundle import Bundle
from feedsim.design.sweep.design import Outcome, Task, design
from feedsim.design.sweep.engine import Engine, open_engine
from feedsim.design.sweep.table import RECORD, STEM, Format, Table, chosen, parquet, record_of, table_of, write_table
from feedsim.files.source import json_value
from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import FeedsimError, Finding, InputError, OutputError, SimulationError
from feedsim.foundation.outputs import BlockResource, claim_folder, defer_signals
from feedsim.scenario.study import Study
from feedsim.simulation.cosim import fmus_directory

# --- The journal of a study: a line of JSON for every run that is done, so that a study that was ended can go on ------
# The first line says what the runs belong to; where a study with more runs begins with the same ones, another line
# says
# how many they were, and one is added whenever they become more. Lines are only ever added. One that is torn, since
# the
# process or the machine ended in the middle of it, is dropped when the journal is opened again; its run is made
# again.


JOURNAL_NAME = "runs.jsonl"
_EXTENT = "runs"  # key of the lines that say how many
FORMAT = 2
SYNC = 1.0  # seconds after which what was written is on the disk at the latest


class Journal(BlockResource):
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
        self._claim.enter_context(claim_folder(directory))
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
            if not first.endswith(b"\n") and _encode_line(own).startswith(first):  # nothing, or never finished
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
            figures = {name: [_plain_number(value), unit] for name, (value, unit) in outcome.figures.items()}
        with defer_signals():  # a run that is written is counted, too
            self._write({
                "run": outcome.run, "figures": figures, "error": outcome.error, "seconds": outcome.seconds,
                "findings": [asdict(finding) for finding in outcome.warnings],
            })  # fmt: skip
            self._count(outcome)
        if time.monotonic() - self._synced >= SYNC:
            self.sync()
        return True

    def outcomes(self) -> Iterator[Outcome]:
        """The runs that are `done`, each once, in the order of the journal."""
        seen: set[int] = set()
        for outcome in read_journal(self.path, self.runs):
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
        line = memoryview(_encode_line(content))
        try:
            while line:  # a file that is not buffered may take a part
                line = line[self._file.write(line) :]
        except OSError as error:
            raise OutputError(
                f"{self.path} cannot be written: {error.strerror or error}; what is in it so far is kept"
            ) from error


def _encode_line(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace") + b"\n"


def read_journal(path: Path, runs: int) -> Iterator[Outcome]:
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
        findings = tuple(Finding(**entry) for entry in content["findings"])
        outcome = Outcome(content["run"], figures, content["error"], float(content["seconds"]), findings)
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
    return outcome if type(outcome.run) is int and 0 <= outcome.run < runs else None


def _plain_number(value: float) -> float | str:
    return float(value) if math.isfinite(value) else repr(float(value))


def _number(value: Any) -> float:
    if isinstance(value, str) and value not in ("nan", "inf", "-inf"):
        raise ValueError(value)
    return float(value)


_log = logging.getLogger(__name__)


class AllFailed(SimulationError):
    """All runs of a study have failed; `table` has their messages."""

    def __init__(self, message: str, table: Table) -> None:
        super().__init__(message)
        self.table = table


@dataclass(frozen=True)
class Progress:
    """How far a study is: runs done, those of them that failed, all, and those that were done before it was resumed."""

    done: int
    failed: int
    total: int
    resumed: int


def run(
    study: Study,
    directory: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    fmus: Path | None = None,
    progress: Callable[[Progress], None] | None = None,
    restart: bool = False,
    format: Format = "csv",
    command: Sequence[str] = (),
    say: Callable[[str], None] | None = None,
    discard: Callable[[], None] | None = None,
) -> Table:
    """Make the runs of `study` that `directory` does not have yet, and write its table.

    Args:
        workers, scheduler: as for :func:`~feedsim.design.sweep.engine.open_engine`.
        fmus: folder of the archives; default :func:`feedsim.simulation.cosim.fmus_directory`.
        progress: called after every run.
        restart: discard the runs that the folder has.
        format: of the table.
        command: that was given, for the record.
        say: called with words when something takes longer.
        discard: called when a restart has discarded the runs; takes away what else was made of them.

    The folder holds the journal (runs.jsonl), the table and study.json, which says what it comes from. An interrupt, a
    request to end (SystemExit) or a lost scheduler leaves a table of the runs that are done, and is raised again.
    One run more than the table has is made: the scenario without changes, whose figures study.json holds as nominal.

    Raises:
        InputError: a file is missing, or the folder belongs to another state of the study.
        AllFailed: all runs failed, the first with this message; the table is written.
        SimulationError: the workers are lost.
        OutputError: a result cannot be written.
    """
    if format == "parquet":
        parquet()  # a missing package should not be found out after the runs
    folder = fmus or fmus_directory()
    planned = design(study)
    parts = provenance.parts(study, planned, folder)
    record = provenance.describe_study(study, planned, parts)
    head = {name: record[name] for name in ("study", "fingerprint", "parts")}
    first = provenance.first_runs(study, planned)
    with Journal(directory, head, planned.runs, restart=restart, first=first) as journal:
        if restart:
            for name in (*(f"{STEM}.{kind}" for kind in get_args(Format)), RECORD):
                _remove(directory / name)
            if discard is not None:
                discard()
        begun = provenance.now()
        before = record_of(directory)
        if before.get("fingerprint") != record["fingerprint"]:  # of another study
            before = {}
        sessions = _sessions(before, journal.resumed)
        where, processes = "", 0
        made_by: Engine | None = None
        checked = False
        nominal = _nominal(before)

        def note(ended: str | None, **more: Any) -> None:
            made = len(journal.done) - journal.resumed
            own = {"began": begun, "ended": ended, "runs": made if ended else None, "command": [*command]}
            _write_record(directory / RECORD, {
                **record, "format": format, "done": len(journal.done), "failed": journal.failed,
                "partial": len(journal.done) < planned.runs, "resumed": journal.resumed, "began": begun,
                "ended": ended, "sessions": [*sessions, own] if made or not ended or not sessions else sessions,
                "nominal": nominal, "place": _place(study, directory, fmus),
                "workers": where, "processes": processes, **provenance.circumstances(command),
                "findings": [asdict(finding) for finding in (*study.warnings, *(made_by.warnings if made_by else ()))],
                **more,
            })  # fmt: skip

        def write() -> Table:
            journal.sync()
            reported = Counter(finding.marked for outcome in journal.outcomes() for finding in outcome.warnings)
            table = table_of(planned, journal.done, journal.outcomes(), study.figures, record)
            write_table(table, directory / f"{STEM}.{format}")
            note(provenance.now(), **{"warnings of runs": dict(reported.most_common(20))})
            return table

        def tell() -> None:
            if progress is not None:
                progress(Progress(len(journal.done), journal.failed, planned.runs, journal.resumed))

        tell()
        try:
            if len(journal.done) < planned.runs:
                bundle = Bundle.of(study, folder)
                with open_engine(bundle, workers=workers, scheduler=scheduler, say=say) as engine:
                    made_by, where, processes = engine, engine.where, max(engine.workers, 1)
                    note(None)  # also of a session that is killed the record shows
                    unchanged = [] if nominal else [Task(planned.runs, ())]
                    for outcome in engine.map(chain(planned.tasks(journal.missing()), unchanged)):
                        if outcome.run == planned.runs:
                            result = outcome.figures or {}
                            nominal = {name: value for name, (value, _) in result.items() if isfinite(value)}
                            continue
                        journal.add(outcome)
                        if outcome.figures is not None and not checked:
                            chosen([*outcome.figures], study.figures)  # better now than when all runs are made
                            checked = True
                        tell()
        except (KeyboardInterrupt, SystemExit, FeedsimError) as error:
            if journal.done:
                try:
                    write()
                except FeedsimError as fault:
                    if not isinstance(error, FeedsimError):  # most likely this very fault
                        _log.warning("no table of the runs that are done: %s", fault)
            raise
        if journal.failed == planned.runs:
            one = min(journal.outcomes(), key=lambda outcome: outcome.run)
            raise AllFailed(f"all {planned.runs} runs failed; run {one.run}: {one.error}", write())
        return write()


def _nominal(before: Mapping[str, Any]) -> dict[str, float]:
    """Figures of the scenario without changes that this same study left in a folder; empty where there are none."""
    try:
        return dict(before["nominal"])
    except (ValueError, KeyError, TypeError):
        return {}


def _sessions(before: Mapping[str, Any], resumed: int) -> list[dict[str, Any]]:
    """The sessions in which the `resumed` runs were made, as the record of the last one shows."""
    try:
        reported = [dict(entry) for entry in before["sessions"]] if resumed else []
        for item in reported:
            if item["runs"] is None:  # it was killed
                item["runs"] = resumed - sum(other["runs"] or 0 for other in reported)
    except (ValueError, KeyError, TypeError):
        return []
    return reported


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path} cannot be removed: {error.strerror or error}") from error


def _place(study: Study, directory: Path, fmus: Path | None) -> dict[str, Any]:
    """Where a run can be made once more from: paths as from the study's folder."""

    def seen(path: Path) -> str:
        try:
            return os.path.relpath(path, directory)
        except ValueError:  # on another drive
            return str(path.absolute())

    return {
        "file": seen(study.file), "overrides": [*study.overrides], "runs": study.sampling.runs,
        "fmus": None if fmus is None else seen(fmus),
    }  # fmt: skip


def _write_record(path: Path, content: Mapping[str, Any]) -> None:
    with written_whole(path) as file:
        file.write(
            json.dumps(content, indent=2, ensure_ascii=False, default=str).encode("utf-8", "backslashreplace") + b"\n"
        )
