"""Everything that a worker needs for the runs of a study, as bytes: it may have no file system in common with us.

A bundle is known by the SHA-256 of its content, and laid out once per worker process.
"""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.scenario import Base, Study
    from feedsim.sweep.task import Outcome, Task

_UNITS = ("plant", "controller", "friction")
_NATIVE = {"win32": "exchange.dll", "darwin": "exchange.dylib"}.get(sys.platform, "exchange.so")


class Place(Protocol):
    """Where runs are made."""

    def run(self, task: Task) -> Outcome:
        """Make a run. Raises MemoryError alone; all else that goes wrong is told in the outcome."""

    def close(self) -> None:
        """Leave nothing behind."""


class Work(Protocol):
    """What an engine has to know of a bundle."""

    @property
    def digest(self) -> str:
        """What it is known by."""

    def open(self, within: Path | None = None) -> Place:
        """Lay it out in a folder of its own in `within`, None: where the system keeps what is temporary."""


@dataclass(frozen=True)
class Bundle:
    """What all runs of a study share.

    Attributes:
        base: the scenario, as :meth:`feedsim.scenario.Base.to_json` writes it.
        files: the data files that it, or a run's changes, name -> their content.
        fmus: file name -> content of the archives.
        native: content of the native cycle loop, and what it was built for (:func:`this_platform`); None without one.
    """

    base: str
    files: Mapping[str, bytes]
    fmus: Mapping[str, bytes]
    native: tuple[bytes, str] | None = None

    @classmethod
    def of(cls, study: Study, fmus: Path | None = None) -> Bundle:
        """Collect what the runs of `study` need.

        Args:
            fmus: folder of the archives; default :func:`feedsim.cosim.fmus_directory`.

        Raises:
            InputError: a file is missing.
        """
        return cls.of_base(study.base, study.files, fmus)

    @classmethod
    def of_base(cls, base: Base, files: Iterable[Path], fmus: Path | None = None) -> Bundle:
        """The same for runs of a scenario, with the data files that they may read."""
        from feedsim.cosim import fmus_directory

        fmus = fmus or fmus_directory()
        archives = {f"{unit}.fmu": fmus / f"{unit}.fmu" for unit in _UNITS}
        for file in archives.values():
            if not file.is_file():
                raise InputError(
                    f"{file}: no such file; `make fmus` builds the archives, FEEDSIM_FMUS names their folder"
                )
        native = fmus / _NATIVE
        return cls(
            base=base.to_json(),
            files={str(file): _content(file) for file in sorted(set(files))},
            fmus={name: _content(file) for name, file in archives.items()},
            native=(_content(native), this_platform()) if native.is_file() else None,
        )

    @cached_property
    def digest(self) -> str:
        found = hashlib.sha256()
        parts = [("base", self.base.encode()), *self.files.items(), *self.fmus.items()]
        if self.native is not None:
            parts.append((self.native[1], self.native[0]))
        for name, content in parts:
            found.update(f"{len(name)} {name} {len(content)}\n".encode())
            found.update(content)
        return found.hexdigest()

    def open(self, within: Path | None = None) -> Place:
        from feedsim.scenario import Base
        from feedsim.sweep.work import Workplace

        fmus = dict(self.fmus)
        if self.native is not None and self.native[1] == this_platform():
            fmus[_NATIVE] = self.native[0]
        return Workplace(Base.from_json(self.base), self.files, fmus, within)


def this_platform() -> str:
    """What a shared library has to be built for to be loaded here."""
    return f"{sys.platform}-{platform.machine().lower()}"


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
