"""Packages that only some of the work needs: loaded where they are used, and named where they are missing.

May use: errors. Start reading at need().
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from feedsim.errors import InputError


class MissingPackage(InputError):
    """A package that this work needs is not installed; the message has the line that installs it."""


def need(module: str, what: str, package: str = "") -> Any:
    """The module `module`, for `what` (such as "figures") needs it; package: what pip calls it, if otherwise.

    >>> need("json", "a page").dumps([1])
    '[1]'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        top = module.partition(".")[0]
        if error.name is None or error.name.partition(".")[0] != top:
            raise
        name = package or top
        raise MissingPackage(f"{what} needs the package {name}, which is not installed: pip install {name}") from None
