"""Packages that only some of the work needs: what is said where one is missing.

A command says which extra it needs (``@job(..., needs=...)``), and is not begun without; work that finds
out later, such as drawing, calls :func:`ask` ahead of its imports. Whoever meets the person asks :func:`missing` what
to say of an import that failed all the same. May use: errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from feedsim.errors import InputError

# Extra of pyproject.toml -> the modules that it brings, smaller extras first.
_RUN = ("fmpy", "scipy", "ruckig")
EXTRAS = {
    "run": _RUN, "figures": (*_RUN, "PIL", "resvg_py"), "sweep": (*_RUN, "distributed"), "uff": (*_RUN, "pyuff"),
    "xlsx": (*_RUN, "xlsxwriter"), "hdf5": ("h5py",),
    "parquet": ("pyarrow",), "pandas": ("pandas",),
}  # fmt: skip


class MissingPackage(InputError):
    """Packages that this work needs are not installed; the message has the line that installs them."""


def ask(what: str, *extras: str) -> None:
    """Raise MissingPackage where packages of the extras are missing that `what` (such as "feedsim run") needs.

    >>> ask("a comparison")
    """
    lacking = [module for extra in extras for module in EXTRAS[extra] if not _is_there(module)]
    if lacking:
        raise _told(what, lacking, extras)


def missing(error: ImportError, what: str = "this") -> MissingPackage | None:
    """What to say of an import that failed; None: it was of no package of an extra.

    All is asked for that the work's extra lacks: the one of its name ("feedsim.sweep"), else the smallest that has the
    package.
    """
    module = (error.name or "").partition(".")[0]
    work = what.rpartition(".")[2]
    if isinstance(error, ModuleNotFoundError):
        for extra in (work, *EXTRAS):
            if module in EXTRAS.get(extra, ()):
                lacking = (name for name in EXTRAS[extra] if name == module or not _is_there(name))
                return _told(what, lacking, [extra])
    return None


def need(module: str, what: str) -> Any:
    """The module, for `what` (such as "a DataFrame") needs it. Raises MissingPackage.

    >>> need("json", "a page").dumps([1])
    '[1]'
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing(error, what) or error from None


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def _told(what: str, lacking: Iterable[str], extras: Iterable[str]) -> MissingPackage:
    *others, last = dict.fromkeys(lacking)
    names, verb = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    asked = f"feedsim[{','.join(dict.fromkeys(extras))}]"
    return MissingPackage(f'{what} needs {asked}, of which {names} {verb} not installed: pip install "{asked}"')
