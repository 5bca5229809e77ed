"""The rows of a run while it goes on: what is left of it if it fails, is interrupted or is killed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from feedsim.errors import OutputError
from feedsim.trace import Trace
from feedsim.trace.csv import heading, lines_of
from feedsim.trace.trace import first_not_finite

PARTIAL = "result.partial.csv"


class Partial:
    """result.partial.csv in a directory: called with the rows of a run, a stretch at a time (``cosim.run(sink=...)``).

    A context: behind it the file is there if the block failed, unless there was no row, and gone if it ended well. That
    of another run is replaced with the first row, no sooner: a run that never begins takes nothing away.

    rows, time: what it holds so far, up to time [s].
    """

    def __init__(self, directory: Path | str, result: str) -> None:
        """result: name of the file that this is a part of, for messages."""
        self._directory, self._result = Path(directory), result
        self.path = self._directory / PARTIAL
        self.rows, self.time = 0, 0.0
        self._file: IO[bytes] | None = None

    def __call__(self, part: Trace) -> None:
        """Append rows. OutputError: a value is not finite, or the file cannot be written."""
        for name, values in part.columns.items():
            if (row := first_not_finite(values)) is not None:
                raise OutputError(
                    f"{self._directory / self._result} is not written: {name} is {values[row]} at "
                    f"{part.time[row]:.9g} s"
                )
        try:
            if self._file is None:
                self._directory.mkdir(parents=True, exist_ok=True)
                self.path.unlink(missing_ok=True)  # of another run
                self._file = self.path.open("xb")
                self._file.write(heading(part))
            self._file.write(lines_of([part.time, *part.columns.values()]))
            self._file.flush()
        except OSError as error:
            raise self._unusable(error) from error
        self.rows += len(part)
        self.time = float(part.time[-1])

    @property
    def scratch(self) -> Path:
        """An existing folder on the same disk, for what a run needs a file for."""
        folder = self._directory.absolute()
        return next(path for path in (folder, *folder.parents) if path.is_dir())

    @property
    def has_rows(self) -> bool:
        """Whether the file is there, with rows."""
        return self.rows > 0 and self.path.exists()

    def finished(self) -> None:
        """Close the file, its bytes being on the disk. OutputError."""
        if self._file is None:
            return
        try:
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._unusable(error) from error
        self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
            if kind is None and self.rows:
                self.path.unlink(missing_ok=True)

    def _unusable(self, error: OSError) -> OutputError:
        return OutputError(f"{self.path} cannot be written: {error.strerror or error}")
