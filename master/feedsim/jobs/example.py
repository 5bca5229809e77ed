"""Examples that come along: which there are, and copies of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import overload

from feedsim.examples import Example, copy, examples


@overload
def example() -> list[Example]: ...


@overload
def example(names: str | Iterable[str], to: str | Path = ".") -> list[Path]: ...


def example(names: str | Iterable[str] | None = None, to: str | Path = ".") -> list[Path] | list[Example]:
    """Copy examples into the folder `to`, with all files that they name; returns the files written.

    Without names: all examples that there are. A file that is there with the same content stays.

    >>> import feedsim as fs
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     len(fs.example("xz_circle", folder))
    7
    >>> "z_stop" in [each.name for each in fs.example()]
    True

    Raises:
        InputError: there is no such example.
        OutputError: a file is there with another content, or cannot be written. Nothing is written then.
    """
    return examples() if names is None else copy(names, to)
