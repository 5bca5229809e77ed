"""What this installation has besides its Python files: archives and native loop, scenarios, machines, documentation.

May use: nothing. Start reading at shipped().
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import InputError

PACKAGE = Path(__file__).resolve().parents[1]
SHIPPED_FOLDER = "shipped"  # folder within the package


@cache
def checkout() -> Path | None:
    """The checkout that this package runs from; None where it is installed."""
    root = PACKAGE.parents[1]
    return root if (root / "src" / "fmi2").is_dir() and (root / "Makefile").is_file() else None


@cache
def version(package: str) -> str | None:
    """Version of an installed package; None where it is not installed as one. Kept, as finding it reads a file."""
    from importlib import metadata  # loads that of e-mail; most commands never ask

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def shipped(name: str) -> Path:
    """The folder `name` ("fmus", "scenarios"): of the checkout, where make fills it, else inside the package."""
    return (checkout() or PACKAGE / SHIPPED_FOLDER) / name


def fmus_directory() -> Path:
    """Folder of the archives: FEEDSIM_FMUS, else `fmus/` of the checkout, else those inside the installed package."""
    named = os.environ.get("FEEDSIM_FMUS")
    return Path(named) if named else shipped("fmus")


def documentation() -> Path | None:
    """First page of the documentation: of the site, or of its sources in a checkout that has not built it; None where
    this installation has neither."""
    root = checkout()
    pages = (
        [root / "build/site/index.html", root / "docs/index.md"]
        if root
        else [PACKAGE / SHIPPED_FOLDER / "site/index.html"]
    )
    return next((page for page in pages if page.is_file()), None)


def repair_advice(what: str) -> str:
    """What to do where `what` (such as "the archives") is missing or does not fit."""
    if checkout():
        return f"`make fmus` builds {what}"
    return f"installing feedsim anew brings {what} along"


# --- Packages that only some of the work needs: what is said where one is missing -------------------------------------
# A command says which extra it needs (``@job(..., needs=...)``), and is not begun without; work that finds
# out later, such as drawing, calls :func:`require_extras` ahead of its imports. Whoever meets the person asks
# :func:`missing_package_error` what to say of an import that failed all the same. May use: errors.


# Extra of pyproject.toml -> the modules that it brings, smaller extras first.
_RUN = ("fmpy", "scipy", "ruckig", "threadpoolctl")
EXTRAS = {
    "run": _RUN, "figures": (*_RUN, "PIL", "resvg_py"), "sweep": (*_RUN, "distributed"), "uff": (*_RUN, "pyuff"),
    "xlsx": (*_RUN, "xlsxwriter"), "hdf5": ("h5py",),
    "parquet": ("pyarrow",), "pandas": ("pandas",),
}  # fmt: skip


class MissingPackage(InputError):
    """Packages that this work needs are not installed; the message has the line that installs them."""


def require_extras(what: str, *extras: str) -> None:
    """Raise MissingPackage where packages of the extras are missing that `what` (such as "feedsim run") needs.

    >>> require_extras("a comparison")
    """
    lacking = [module for extra in extras for module in EXTRAS[extra] if not _is_there(module)]
    if lacking:
        raise _missing_extras_error(what, lacking, extras)


def missing_package_error(error: ImportError, what: str = "this") -> MissingPackage | None:
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
                return _missing_extras_error(what, lacking, [extra])
    return None


def require_module(module: str, what: str) -> Any:
    """The module, for `what` (such as "a DataFrame") needs it. Raises MissingPackage.

    >>> require_module("json", "a page").dumps([1])
    '[1]'
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_package_error(error, what) or error from None


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def _missing_extras_error(what: str, lacking: Iterable[str], extras: Iterable[str]) -> MissingPackage:
    *others, last = dict.fromkeys(lacking)
    names, verb = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    asked = f"feedsim[{','.join(dict.fromkeys(extras))}]"
    return MissingPackage(f'{what} needs {asked}, of which {names} {verb} not installed: pip install "{asked}"')


# --- Libraries of C that the master calls, beside the archives: found, checked for their interface, loaded once -------
# May use: installation. Start reading at library().


# A wheel holds those of all platforms, of Linux for two processors.
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
if hasattr(os, "uname") and (sys.platform, os.uname().machine) == ("linux", "aarch64"):
    _SUFFIX = "-aarch64.so"

# By name and SHA-256 of the file: each study lays out a copy of its own, and what is loaded stays until the end.
_loaded_libraries: dict[tuple[str, bytes], ctypes.CDLL] = {}


def library_name(name: str) -> str:
    """File name of a library on this platform, such as "exchange.so"."""
    return name + _SUFFIX


@cache
def library(name: str, folder: Path, interface: str) -> ctypes.CDLL | str:
    """The library beside the archives in `folder`, or why none there can be used, without the folder's name.

    interface: what the function `<name>_interface` of the library must return: version and layouts of its sources.
    """
    file = library_name(name)
    path = folder.resolve() / file
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
        if (known := _loaded_libraries.get((name, digest))) is not None:
            return known
        loaded = ctypes.CDLL(str(path))
        asked = getattr(loaded, f"{name}_interface")
        asked.restype = ctypes.c_char_p
        result = (asked() or b"").decode(errors="replace")
    except FileNotFoundError:
        return f"{file}: no such file beside the archives"
    except (OSError, AttributeError) as error:
        return f"{file}: cannot be used: {str(error).replace(str(path), file)}"
    if result != interface:
        return f"{file}: built from other sources (its interface is {result!r}, wanted is {interface!r})"
    _loaded_libraries[name, digest] = loaded
    return loaded
