"""What files must look like, for editors."""

from __future__ import annotations

from typing import Any, get_args

from feedsim.arguments import spelt
from feedsim.errors import InputError
from feedsim.scenario.schema import Kind, json_schema


def schema(kind: Kind = "scenario") -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of files that people write.

    Args:
        kind: "scenario", "machine", "structure", "columns" (the mapping of a recording), "tolerances" or "study".

    Raises InputError: there is no such kind.

    >>> import feedsim as fs
    >>> fs.schema("study")["title"]
    'feedsim study file'
    """
    if kind not in get_args(Kind):
        raise InputError(f"{spelt('kind')} is {kind!r}; allowed: {', '.join(get_args(Kind))}")
    return json_schema(kind)
