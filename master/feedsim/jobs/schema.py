"""What files must look like, for editors."""

from __future__ import annotations

from typing import Annotated, Any, get_args

from feedsim.arguments import spelt
from feedsim.errors import InputError
from feedsim.jobs.parameters import Argument, job
from feedsim.scenario.schema import Kind as FileKind
from feedsim.scenario.schema import json_schema


@job("print the JSON Schema of a kind of file, for editors", needs=())
def schema(
    kind: Annotated[
        FileKind, Argument("", "", choices=("scenario", "machine", "structure", "columns", "tolerances", "study"))
    ] = "scenario",
) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of files that people write.

    Raises InputError: there is no such kind.

    >>> import feedsim as fs
    >>> fs.schema("study")["title"]
    'feedsim study file'
    """
    if kind not in get_args(FileKind):
        raise InputError(f"{spelt('kind')} is {kind!r}; allowed: {', '.join(get_args(FileKind))}")
    return json_schema(kind)
