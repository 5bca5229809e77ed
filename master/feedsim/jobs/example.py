"""Examples that come along: which there are, and copies of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, overload

from feedsim.examples import Example, copy, examples
from feedsim.jobs.parameters import Argument, Option, job


@overload
def example() -> list[Example]: ...


@overload
def example(names: str | Iterable[str], to: str | Path = ".") -> list[Path]: ...


@job("list or copy scenarios, studies and machines to begin with", needs=())
def example(
    names: Annotated[
        str | Iterable[str] | None,
        Argument(
            "NAME",
            "what to copy, with the files that it names; without a name all are listed",
            many=True,
            complete="examples:names",
        ),
    ] = None,
    to: Annotated[
        str | Path, Option("DIR", "folder to copy into (default: the working folder); all, without a name")
    ] = ".",
) -> list[Path] | list[Example]:
    """Copy examples into the folder `to`, with all files that they name; returns the files written.

    The machines are synthetic, but for emps and sinumerik_840d, which were measured. Nothing is overwritten.

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
