"""Rooms that share their name with what a person calls: ``feedsim.compare(...)`` beside ``feedsim.compare.Options``.

Once such a room is loaded, Python binds its name in the package, and what the front door has under that name cannot be
reached any more; so the room itself is called, and passes the call on. May use: errors.
Start reading at called().
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

from feedsim.errors import InputError


class _CalledRoom(ModuleType):
    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        """What is called is what a person asks for help on; without the packages for it, the room."""
        try:
            return inspect.getdoc(self._call)
        except InputError:
            return str(vars(self)["__doc__"])

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self._call(*given, **named)

    @property
    def _call(self) -> Callable[..., Any]:
        package, _, name = self.__name__.rpartition(".")
        result: Callable[..., Any] = import_module(package).__getattr__(name)
        return result

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._call)


def called(room: str) -> None:
    """Have the room of that module name stand for the front door's function of the same name."""
    sys.modules[room].__class__ = _CalledRoom
