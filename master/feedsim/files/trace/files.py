"""Files that are written whole or not at all, and what is no regular file."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

import numpy as np

from feedsim.files.trace.cells import TIME_NAMES, header_line, lines_of, read_finite_table
from feedsim.files.trace.trace import Trace, first_not_finite, stretches
from feedsim.foundation import units
from feedsim.foundation.errors import InputError, OutputError
from feedsim.foundation.outputs import defer_signals, lock_file


@contextmanager
def written_whole(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to that takes its name when the block ends well; otherwise nothing is left and an old file stays.

    A symbolic link stays: what it leads to is replaced. A pipe or a character device (/dev/stdout, /dev/null) is never
    replaced: what was written goes into it when the block ends well.

    The folder must exist. OutputError: it does not, the file cannot be written, or `path` is a folder, a socket or a
    disk.
    """
    try:
        if is_stream(path):
            buffer = BytesIO()
            yield buffer
            _write_into(path, buffer.getvalue())
            return
        target = Path(os.path.realpath(path))
        file = None
        try:
            with defer_signals():  # what is made is known, and removed
                file = _open_temporary_file(target)
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.name == "nt":  # it does not move what is open; elsewhere the lock goes with the name
                file.close()
            Path(file.name).chmod(0o666 & ~_umask())
            Path(file.name).replace(target)
            file.close()
        except BaseException:
            if file is not None:
                with suppress(OSError):  # on a full disk what is still to be written fails once more
                    file.close()
                with suppress(OSError):
                    Path(file.name).unlink()
            raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}") from error


def _open_temporary_file(target: Path) -> IO[bytes]:
    """A file beside `target`, locked as long as it is open; what processes that have gone have left there is removed.

    OSError: it cannot be made.
    """
    prefix, suffix = f".{target.name}.", ".feedsim"
    with suppress(OSError):  # of folders that cannot be listed
        for other in target.parent.iterdir():
            if other.name.startswith(prefix) and other.name.endswith(suffix):
                _remove_orphan(other)
    while True:
        file: IO[bytes] = NamedTemporaryFile(dir=target.parent, prefix=prefix, suffix=suffix, delete=False)  # noqa: SIM115
        if lock_file(file.fileno()) is not False and Path(file.name).exists():
            return file
        file.close()  # taken for one that has been left


def _remove_orphan(path: Path) -> None:
    """Remove a file that nobody has locked."""
    with suppress(OSError), path.open("r+b") as file:
        if lock_file(file.fileno()):
            if os.name == "nt":  # it does not remove what is open
                file.close()
            path.unlink()


def is_stream(path: Path) -> bool:
    """Whether `path` takes what is written but holds no file. OSError: it is neither a stream nor a file."""
    if _descriptor(path) is not None:
        return True
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    for what, is_one in (("a folder", stat.S_ISDIR), ("a socket", stat.S_ISSOCK), ("a disk", stat.S_ISBLK)):
        if is_one(mode):
            raise OSError(22, f"it is {what}")
    return not stat.S_ISREG(mode)


def _descriptor(path: Path) -> int | None:
    """Number of the open file of this process that `path` stands for: 1 for /dev/stdout."""
    for _ in range(40):  # as many links as Linux follows
        if path.name.isdigit() and os.path.realpath(path.parent) in ("/dev/fd", f"/proc/{os.getpid()}/fd"):
            return int(path.name)
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None


def _write_into(path: Path, content: bytes) -> None:
    number = _descriptor(path)
    # An open file is shared, not opened again: into one behind a shell's ">" both would write from its start.
    if number is None:
        stream: IO[bytes] = path.open("wb")
    else:
        if sys.stdout is not None:
            sys.stdout.flush()
        stream = os.fdopen(os.dup(number), "wb")
    with stream:
        stream.write(content)


def _umask() -> int:
    """The process's umask; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


# --- CSV files of traces: a header of `name [unit]`, then numbers -----------------------------------------------------
# What feedsim writes: commas, decimal points, LF, `time [s]` first, every number in its shortest form that reads back
# the same. What it reads besides: semicolons or tabs, decimal commas with them, a byte-order mark, UTF-16, quotes,
# uneven time, the time in another unit or another column. What is not clear is refused with its line, never guessed.


ROWS = 1 << 12  # that are written at a time


def read_csv(
    path: str | Path, *, columns: Iterable[str] | None = None, time: str | None = None, time_unit: str | None = None
) -> Trace:
    """Read a trace.

    columns    names (without unit) to read; default all but the time. Others may hold anything.
    time       name of the time column; default "time" or "t" in any case, else a first column whose unit is a time
    time_unit  unit of the time where the header does not give it; default s

    Units of columns stay as written; the time is converted to s. Raises InputError with file and line.

    >>> import feedsim as fs
    >>> fs.read_trace("log.csv").names
    ('Z.x_s', 'Z.x_a', 'Z.n_a', 'Z.i_q')
    """
    path = Path(path)
    table = read_finite_table(path)
    at = table.axis(time, TIME_NAMES, "s")
    others = [i for i in range(len(table.names)) if i != at]
    wanted = others if columns is None else [table.index(name) for name in columns]
    values = table.values([at, *wanted])
    seconds = values[at] * table.factor(at, "s", "time column", time_unit or "s")
    if (wrong := np.flatnonzero(np.diff(seconds) <= 0)).size:
        row = int(wrong[0]) + 1
        raise InputError(
            f"{path}:{table.lines[row]}: time {values[at][row]:.9g} follows {values[at][row - 1]:.9g}; it must increase"
        )
    chosen = {table.names[i]: values[i] for i in wanted}
    try:
        return Trace(seconds, chosen, {table.names[i]: table.units[i] for i in wanted})
    except InputError as error:
        raise InputError(f"{table.head}: {error}") from None


read_trace = read_csv  # its name in `import feedsim`


def read_signals(
    path: str | Path,
    columns: Mapping[str, tuple[str, str | None]],
    unit: str,
    *,
    time: tuple[str, str | None] = ("time", None),
    between: tuple[float, float] | None = None,
    fewest: int = 2,
) -> Trace:
    """Signals of one dimension over time from a recording.

    columns  signal -> (column name, unit or None for that of the header)
    unit     SI unit of the signals
    time     (column name, unit or None); without any unit: s
    between  part to read, first and last recorded time [s]
    fewest   rows that are needed

    Returns a trace with a column per signal, over the time as recorded. Raises InputError: what read_csv() refuses, a
    unit that is missing, contradicts the header or is of another dimension, too few rows in the part.
    """
    path = Path(path)
    time_name, time_unit = time
    names = dict.fromkeys(name for name, _ in columns.values())
    trace = read_csv(path, columns=names, time=time_name, time_unit=time_unit)
    whole = trace
    if between is not None:
        trace = trace.between(*between)
    if len(trace) < fewest:
        part = f" between {between[0]:.9g} and {between[1]:.9g} s" if between else ""
        raise InputError(
            f"{path}: {len(trace)} row{'s'[: len(trace) != 1]}{part}; at least {fewest} are needed "
            f"(the file runs from {whole.time[0]:.9g} to {whole.time[-1]:.9g} s)"
        )
    values = {}
    for signal, (name, column) in columns.items():
        known = trace.unit(name)
        if column and known and units.unit(column).factor != units.unit(known).factor:
            raise InputError(f"{path}:1: column {name!r} is in {known} by its header, in {column} by the scenario")
        if not (given := column or known):
            example = {"m": "mm"}.get(unit, unit)
            raise InputError(
                f"{path}:1: column {name!r} has no unit; write '{name} [{example}]' in the header or give the unit"
            )
        try:
            factor = units.factor(given, unit)
        except InputError as error:
            raise InputError(f"{path}:1: column {name!r}: {error}") from None
        values[signal] = trace[name] * float(factor)
    return Trace(trace.time, values, dict.fromkeys(values, unit))


def write_csv(path: str | Path, trace: Trace) -> None:
    """Write a trace, whole or not at all. OutputError: a value is not finite, or the file cannot be written."""
    path = Path(path)
    for name, values in trace.columns.items():
        if (row := first_not_finite(values)) is not None:
            raise OutputError(f"{path} is not written: {name} is {values[row]} at {trace.time[row]:.9g} s")
    with written_whole(path) as file:
        file.write(header_line(trace))
        for columns in stretches(trace.time, *trace.columns.values(), rows=ROWS):
            file.write(lines_of(columns))
