"""What a job returns that makes one file for other programs: an archive, an SSP file, a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.errors import OutputError
from feedsim.jobs.parameters import File
from feedsim.outputs import check_file, forced, replacing
from feedsim.trace.files import written_whole

if TYPE_CHECKING:
    from feedsim.analysis import Figure


@dataclass(frozen=True)
class Kind:
    """A kind of such files: what messages call it, and how one of feedsim's own is known, which may be replaced."""

    name: str
    what: str
    ours: Callable[[Path], bool]
    makes_folder: bool = False

    def check_folder(self, out: File | None) -> None:
        """Raise OutputError where there is no folder for the file; None: it stays in memory."""
        if out is not None and not self.makes_folder and not Path(out).absolute().parent.is_dir():
            raise OutputError(f"{out} cannot be written: no such folder: {Path(out).parent}")

    @contextmanager
    def checked(self, out: File | None, inputs: Sequence[Path], *, force: bool) -> Iterator[Path | None]:
        """A block that makes the file `out`; None: it stays in memory.

        inputs: files that are read; none of them is replaced. force: a file that feedsim did not write may be.
        Raises OutputError: the file cannot be written there.
        """
        if out is None:
            yield None
            return
        path = Path(out)
        with replacing(force or forced()):
            self.check_folder(path)
            check_file(path, inputs, ours=self.ours, what=self.what)
            yield path


@dataclass(frozen=True, eq=False, repr=False)
class Made:
    """A file that a job has made. It is in memory, and :meth:`save` writes it.

    Attributes:
        content: of the file.
        answers: what it holds, in sentences.
        findings: what is to be known before it is used.
        figures: name -> number with unit and meaning.
        inputs: files that it rests on; saving never replaces one of them.
        name: that it has in :meth:`files`.

    >>> import feedsim as fs
    >>> made = fs.export("machines/test_centre")
    >>> isinstance(made, fs.Made), made.size == len(made.content), list(made.files())
    (True, True, ['machine.fmu'])
    """

    of: Kind
    name: str
    content: bytes
    answers: Sequence[str]
    findings: Sequence[str] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    inputs: Sequence[Path] = ()

    @property
    def kind(self) -> str:
        """Of the result, such as "pack"."""
        return self.of.name

    @property
    def size(self) -> int:
        """Of the file [bytes]."""
        return len(self.content)

    def files(self) -> Mapping[str, bytes]:
        """Name -> content."""
        return {self.name: self.content}

    def save(self, path: File, *, force: bool = False) -> Path:
        """Write the file, whole or not at all; returns its path. In a folder it is called as in :meth:`files`.

        force: a file may be replaced that feedsim did not write. Raises OutputError.
        """
        where = Path(path) / self.name if Path(path).is_dir() else Path(path)
        with self.of.checked(where, self.inputs, force=force):
            if self.of.makes_folder:
                with suppress(OSError):  # writing says what is wrong
                    where.absolute().parent.mkdir(parents=True, exist_ok=True)
            with written_whole(where) as file:
                file.write(self.content)
        return where

    def __repr__(self) -> str:
        return f"Result of {self.kind}: {self.answers[0]}"
