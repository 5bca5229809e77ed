"""Packages that only some of the work needs: what is said where one is missing.

A command imports them where it uses them. Whoever meets the person (the command line, the front door) asks
:func:`missing` what to say of an import that failed. May use: errors.
"""

from __future__ import annotations

import re
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from typing import Any

from feedsim.errors import InputError

# Module -> the extra of pyproject.toml that brings it.
EXTRAS = {
    "fmpy": "run", "scipy": "run", "ruckig": "run", "matplotlib": "run", "jinja2": "run", "tqdm": "run",
    "distributed": "sweep", "dask": "sweep", "pyuff": "uff", "pyarrow": "parquet", "pandas": "pandas",
}  # fmt: skip
# Work -> the extra that it takes whole: nobody is to install those of `run` and be told of the next one then.
WHOLE = {"feedsim sweep": "sweep", "feedsim.sweep": "sweep"}


class MissingPackage(InputError):
    """A package that this work needs is not installed; the message has the line that installs it."""


def missing(error: ImportError, what: str = "this") -> MissingPackage | None:
    """What to say where `what` (such as "feedsim run") needs a package that is missing; None: it is not that."""
    module = (error.name or "").partition(".")[0]
    if not isinstance(error, ModuleNotFoundError) or module not in EXTRAS:
        return None
    extra = EXTRAS[module]
    extra = WHOLE.get(what, extra) if extra == "run" else extra
    names = " ".join(dict.fromkeys(packages(extra))) or module
    return MissingPackage(f"{what} needs the package {module}, which is not installed: pip install {names}")


def packages(extra: str) -> list[str]:
    """Names of the packages of an extra, those of the extras that it names included.

    >>> packages("uff")[-1]
    'pyuff'
    """
    try:
        asked = requires("feedsim") or []
    except PackageNotFoundError:  # run from its sources, not installed
        return []
    own = [each.partition(";")[0] for each in asked if re.search(rf"extra == ['\"]{extra}['\"]", each)]
    found: list[str] = []
    for text in own:
        if inner := re.match(r"feedsim\[([\w,]+)\]", text):
            found += [name for part in inner[1].split(",") for name in packages(part)]
        elif name := re.match(r"[\w.-]+", text):
            found.append(name[0])
    return found


def need(module: str, what: str) -> Any:
    """The module, for `what` (such as "a DataFrame") needs it. Raises MissingPackage.

    >>> need("json", "a page").dumps([1])
    '[1]'
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing(error, what) or error from None
