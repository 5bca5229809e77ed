"""A recording as a CSV trace with units in its header."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from feedsim import trace
from feedsim.arguments import listed, spelt
from feedsim.errors import InputError
from feedsim.jobs.made import Kind, Made
from feedsim.jobs.parameters import Argument, File, Force, Option, job, out_file
from feedsim.outputs import check_file, unchanged
from feedsim.owned import TemporaryFolder


@job("turn a record of any kind into a CSV trace", needs=())
def convert(
    file: Annotated[File, Argument("FILE", "CSV, MAT, or another record (docs/traces.md)")],
    out: Annotated[File | None, out_file("FILE.csv", "the table to write")] = None,
    *,
    column: Annotated[
        str | Sequence[str],
        Option("VARIABLE=NAME:UNIT", "one column; the first must be time; none: all", many=True),
    ] = (),
    force: Force = False,
) -> Made:
    """Turn a recording into a CSV trace: all of its signals, or some of its columns, over its time.

    Command line:
        feedsim tools convert record.mat --column t=time:s --column qg=Z.x_s:m -o reference.csv

    Raises:
        InputError: a faulty file, a text of another form, a variable that is not there, a value that is not finite.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> made = fs.convert("log.csv", column="time=time:s, Z.x_a=Z.x_a:mm")
    >>> made.content.splitlines()[0]
    b'time [s],Z.x_a [mm]'
    """
    path = Path(file)
    columns = [_column(text) for text in listed(column)]
    if out is not None:
        check_file(Path(out), [path], ours=lambda there: True)  # an input is refused before it is read
    with TemporaryFolder() as folder:
        recording = trace.read_recording(path)
        written = trace.convert(recording, columns, folder / "converted.csv")
        content = (folder / "converted.csv").read_bytes()
    kind = Kind("convert", "table", unchanged(content))
    answer = f"{len(written.columns) + 1} columns from {path}"
    made = Made(kind, f"{path.stem}.csv", content, [answer], recording.notes, inputs=[path])
    if out is not None:
        made.save(out, force=force)
    return made


def _column(text: str) -> tuple[str, str, str]:
    """VARIABLE=NAME:UNIT in its parts."""
    variable, equals, rest = text.partition("=")
    name, colon, unit = rest.rpartition(":")
    if not (equals and colon and variable and name and unit):
        raise InputError(f"{spelt('column')} {text}: VARIABLE=NAME:UNIT is needed, e.g. qg=Z.x_s:m")
    return variable, name, unit
