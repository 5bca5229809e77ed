"""Columns that are filled block by block: in memory while they are short, else in a file without a name.

The file's pages are read through a mapping, as arrays that behave like any other; the system takes them back when it
needs the memory, and :func:`release` at once. It has no name and vanishes with the last array that looks into it,
whatever becomes of the process.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import OutputError

Array = NDArray[np.float64]

# Beyond this size [bytes] a table is a file.
IN_MEMORY = 16 * 2**20
# Rows that are worked on at a time where a column may be long.
STRETCH = 1 << 16


class Table:
    """``columns`` x ``rows`` numbers, appended from the first row on.

    filled: rows so far.
    """

    def __init__(self, columns: int, rows: int, folder: Path | None = None) -> None:
        """folder: where the file goes if there is to be one; default: the system's folder for temporary files.

        OutputError: the file cannot be made.
        """
        self.rows, self.filled = rows, 0
        self._values: Array | None = None
        self._file: IO[bytes] | None = None
        self._folder = folder or Path(tempfile.gettempdir())
        self._count = columns
        if 8 * columns * rows <= IN_MEMORY:
            self._values = np.zeros((columns, rows))
            return
        try:
            self._file = tempfile.TemporaryFile(prefix="feedsim-", dir=self._folder, buffering=0)  # noqa: SIM115
            self._file.truncate(8 * columns * rows)
        except OSError as error:
            raise self._unusable(error) from error

    def append(self, block: Array) -> None:
        """The next rows: (columns, n). OutputError: the disk is full."""
        first, last = self.filled, self.filled + block.shape[1]
        if block.shape[0] != self._count or last > self.rows:
            raise ValueError(f"{block.shape} behind row {first} of {self._count} columns x {self.rows} rows")
        if self._values is not None:
            self._values[:, first:last] = block
        elif self._file is not None:
            # Written, not mapped: a full disk is then an error that can be shown, not the end of the process.
            try:
                for i, values in enumerate(block):
                    self._file.seek(8 * (i * self.rows + first))
                    remaining = np.ascontiguousarray(values).data.cast("B")
                    while remaining:
                        remaining = remaining[self._file.write(remaining) :]
            except OSError as error:
                raise self._unusable(error) from error
        self.filled = last

    def columns(self) -> list[Array]:
        """Every column's rows so far, read-only. Nothing can be appended afterwards."""
        if self._file is not None:
            mapped = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
            self._file.close()
            self._file = None
            self._values = np.frombuffer(mapped, dtype=np.float64).reshape(self._count, self.rows)
        assert self._values is not None
        self._values.setflags(write=False)
        self.rows = self.filled  # appending now is a fault
        return [values[: self.filled] for values in self._values]

    def _unusable(self, error: OSError) -> OutputError:
        return OutputError(
            f"{self._folder}: a temporary file of {8e-6 * self._count * self.rows:.4g} MB for what does not fit into "
            f"memory cannot be written: {error.strerror or error}"
        )


def release(*arrays: Array) -> None:
    """Give back the memory that the pages of mapped arrays have taken; they stay readable. Others are left alone."""
    for mapped in {id(mapping): mapping for array in arrays if (mapping := _mapping(array)) is not None}.values():
        if hasattr(mapped, "madvise"):  # not on Windows
            mapped.madvise(mmap.MADV_DONTNEED)


def stretches(*arrays: Array, rows: int = STRETCH) -> Iterator[tuple[Array, ...]]:
    """The same rows of several columns at a time, in their order, in memory that does not grow."""
    for first in range(0, len(arrays[0]), rows):
        yield tuple(array[first : first + rows] for array in arrays)
        release(*arrays)


def unchangeable(array: Array) -> bool:
    """Whether nobody can change the array, be it through another that shares its memory."""
    base: object = array
    while isinstance(base, np.ndarray):
        if base.flags.writeable:
            return False
        base = base.base
    return base is None or (isinstance(base, memoryview) and base.readonly)


def least_and_largest(values: Array) -> tuple[float, float]:
    """Of a column that may be long."""
    ends = [(float(part.min()), float(part.max())) for (part,) in stretches(values)]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _mapping(array: Array) -> mmap.mmap | None:
    base: object = array
    while isinstance(base, np.ndarray):
        base = base.base
    owner = base.obj if isinstance(base, memoryview) else base
    return owner if isinstance(owner, mmap.mmap) else None
