"""What a command opens, lists, executes or loads, as Python's audit hooks tell it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Event -> the argument that names the path.
PATHS = {"open": 0, "os.listdir": 0, "os.scandir": 0, "ctypes.dlopen": 0, "os.rename": 1, "os.remove": 0, "os.mkdir": 0}
NEVER = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "socket.connect", "urllib.Request")
_watching: list[list[tuple[str, str]]] = []
_installed: list[bool] = []


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watching:
        return
    if event in PATHS:
        path = arguments[PATHS[event]]
        if isinstance(path, bytes):
            path = os.fsdecode(path)
        if isinstance(path, (str, os.PathLike)):
            _watching[-1].append((event, os.path.abspath(path)))  # noqa: PTH100 (links are not to be followed)
    elif event in NEVER:
        _watching[-1].append((event, str(arguments)))


@contextmanager
def watched() -> Iterator[list[tuple[str, str]]]:
    """(event, path) of what happens in the block; a hook cannot be taken away again, so that one serves all tests."""
    if not _installed:
        sys.addaudithook(_hook)
        _installed.append(True)
    _watching.append([])
    try:
        yield _watching[-1]
    finally:
        _watching.pop()


def outside(seen: list[tuple[str, str]], *allowed: Path) -> list[tuple[str, str]]:
    """What was opened neither in the folders `allowed`, nor of Python and this repository themselves, nor of the
    folders that feedsim unpacks to."""
    root = Path(__file__).resolve().parents[1]
    ours = [Path(sys.prefix), Path(sys.base_prefix), root / "master", root / "src", root / "fmus", root / ".venv",
            Path(tempfile.gettempdir()) / "feedsim-", *allowed]  # fmt: skip
    places = [os.path.abspath(place) for place in (*ours, *sys.path) if str(place)]  # noqa: PTH100
    return [(event, path) for event, path in seen if event in NEVER or not path.startswith(tuple(places))]
