"""Make the runs of a study: what is not in the journal yet goes to the engine, what comes back into the journal; in the
end the table is made of it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.cosim import fmus_directory
from feedsim.errors import SimulationError
from feedsim.scenario import Study
from feedsim.sweep import provenance
from feedsim.sweep.bundle import Bundle
from feedsim.sweep.design import design
from feedsim.sweep.engine import open_engine
from feedsim.sweep.journal import Journal
from feedsim.sweep.table import Table, chosen, table_of
from feedsim.sweep.table_files import RECORD, STEM, Format, parquet, write_table
from feedsim.trace.files import written_whole


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
) -> Table:
    """Make the runs of `study` that `directory` does not have yet, and write its table.

    Args:
        workers, scheduler: as for :func:`~feedsim.sweep.engine.open_engine`.
        fmus: folder of the archives; default :func:`feedsim.cosim.fmus_directory`.
        progress: called after every run.
        restart: discard the runs that the folder has.
        format: of the table.
        command: that was given, for the record.

    The folder holds the journal (runs.jsonl), the table and study.json, which says what it comes from. An interrupt
    leaves a table of the runs that are done, and is raised again.

    Raises:
        InputError: a file is missing, or the folder belongs to another state of the study.
        SimulationError: all runs failed, the first with this message.
        OutputError: a result cannot be written.
    """
    if format == "parquet":
        parquet()  # a missing package should not be found out after the runs
    folder = fmus or fmus_directory()
    planned = design(study)
    parts = provenance.parts(study, planned, folder)
    record = provenance.described(study, planned, parts)
    head = {name: record[name] for name in ("study", "fingerprint", "parts")}
    with Journal(directory, head, planned.runs, restart=restart) as journal:
        begun = provenance.now()
        where, processes = "", 0
        checked = False

        def write() -> Table:
            journal.sync()
            told = Counter(text for outcome in journal.outcomes() for text in outcome.warnings)
            table = table_of(planned, journal.done, journal.outcomes(), study.figures, record)
            write_table(table, directory / f"{STEM}.{format}")
            _write_record(directory / RECORD, {
                **record, "format": format, "done": len(journal.done), "failed": journal.failed,
                "partial": table.partial, "resumed": journal.resumed, "began": begun, "ended": provenance.now(),
                "workers": where, "processes": processes, **provenance.circumstances(command),
                "warnings": [*study.warnings], "warnings of runs": dict(told.most_common(20)),
            })  # fmt: skip
            return table

        def tell() -> None:
            if progress is not None:
                progress(Progress(len(journal.done), journal.failed, planned.runs, journal.resumed))

        tell()
        try:
            if len(journal.done) < planned.runs:
                with open_engine(Bundle.of(study, folder), workers=workers, scheduler=scheduler) as engine:
                    where, processes = engine.where, max(engine.workers, 1)
                    for outcome in engine.map(planned.tasks(journal.missing())):
                        journal.add(outcome)
                        if outcome.figures is not None and not checked:
                            chosen([*outcome.figures], study.figures)  # better now than when all runs are made
                            checked = True
                        tell()
        except KeyboardInterrupt:
            if journal.done:
                write()
            raise
        if journal.failed == planned.runs:
            first = min(journal.outcomes(), key=lambda outcome: outcome.run)
            write()
            raise SimulationError(f"all {planned.runs} runs failed; run {first.run}: {first.error}")
        return write()


def _write_record(path: Path, content: Mapping[str, Any]) -> None:
    with written_whole(path) as file:
        file.write(json.dumps(content, indent=2, ensure_ascii=False, default=str).encode() + b"\n")
