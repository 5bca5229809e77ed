"""Write the results of a friction compensation into a directory, whole or not at all."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

from feedsim.analysis.compensation import Compensation
from feedsim.report.compensate.page import page
from feedsim.report.compensate.plots import pictures_of
from feedsim.report.compensate.summary import summary, table_csv
from feedsim.report.parts import to_json
from feedsim.report.results import REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.style import remarked
from feedsim.trace import write_csv

RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE = "result.csv", "uncompensated.csv", "feedforward.csv", "compensation.csv"
FILES = (RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE, REPORT, SUMMARY)


def check_compensation_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the results can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(directory, FILES, inputs)


def write_compensation(
    compensation: Compensation, files: Mapping[str, Path], directory: Path | str
) -> tuple[Path, ...]:
    """Write the runs with (result.csv) and without compensation, feedforward.csv, compensation.csv (where there is a
    table), summary.json, report.html and figures; returns the paths.

    files: axis -> file that its compensation's friction comes from. Files of an earlier run are replaced. Raises
    OutputError.
    """
    machine = compensation.scenario.machine
    with remarked("\n".join(textwrap.wrap(f"{machine.name}. {machine.note}".strip(), 150)[:2])):
        pictures = pictures_of(compensation)

    def fill(fresh: Path, names: Sequence[str]) -> None:
        write_csv(fresh / RESULT, compensation.after.trace)
        write_csv(fresh / UNCOMPENSATED, compensation.before.trace)
        write_csv(fresh / FEEDFORWARD, compensation.feedforward)
        if compensation.table:
            write_text(fresh / TABLE, table_csv(compensation))
        write_text(fresh / REPORT, page(compensation, dict(files), pictures))
        write_text(fresh / SUMMARY, to_json(summary(compensation, files, names)))

    files_written = [name for name in FILES if name != TABLE or compensation.table]
    return write_results(directory, files_written, pictures, fill)
