"""Make the runs of a study: what is not in the journal yet goes to the engine, what comes back into the journal; in the
end the table is made of it."""

from __future__ import annotations

import json
import logging
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import Any, get_args

from feedsim.cosim import fmus_directory
from feedsim.errors import FeedsimError, OutputError, SimulationError
from feedsim.scenario.study import Study
from feedsim.sweep import provenance
from feedsim.sweep.bundle import Bundle
from feedsim.sweep.design import Task, design
from feedsim.sweep.engine import Engine, open_engine
from feedsim.sweep.journal import Journal
from feedsim.sweep.table import RECORD, STEM, Format, Table, chosen, parquet, record_of, table_of, write_table
from feedsim.trace.files import written_whole

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
        workers, scheduler: as for :func:`~feedsim.sweep.engine.open_engine`.
        fmus: folder of the archives; default :func:`feedsim.cosim.fmus_directory`.
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
    record = provenance.described(study, planned, parts)
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
                "warnings": [*study.warnings, *(made_by.warnings if made_by else ())], **more,
            })  # fmt: skip

        def write() -> Table:
            journal.sync()
            reported = Counter(text for outcome in journal.outcomes() for text in outcome.warnings)
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
