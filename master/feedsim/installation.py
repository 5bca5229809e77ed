"""What this installation has besides its Python files: archives and native loop, scenarios, machines, documentation.

May use: nothing. Start reading at shipped().
"""

from __future__ import annotations

import os
from functools import cache
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as version_of
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSIDE = "shipped"  # folder within the package


@cache
def checkout() -> Path | None:
    """The checkout that this package runs from; None where it is installed."""
    root = PACKAGE.parents[1]
    return root if (root / "src" / "fmi2").is_dir() and (root / "Makefile").is_file() else None


@cache
def version(package: str) -> str | None:
    """Version of an installed package; None where it is not installed as one. Kept, as finding it reads a file."""
    try:
        return version_of(package)
    except PackageNotFoundError:
        return None


def shipped(name: str) -> Path:
    """The folder `name` ("fmus", "scenarios"): of the checkout, where make fills it, else inside the package."""
    return (checkout() or PACKAGE / INSIDE) / name


def fmus_directory() -> Path:
    """Folder of the archives: FEEDSIM_FMUS, else `fmus/` of the checkout, else those inside the installed package."""
    named = os.environ.get("FEEDSIM_FMUS")
    return Path(named) if named else shipped("fmus")


def documentation() -> Path | None:
    """First page of the documentation: of the site, or of its sources in a checkout that has not built it; None where
    this installation has neither."""
    root = checkout()
    pages = [root / "build/site/index.html", root / "docs/index.md"] if root else [PACKAGE / INSIDE / "site/index.html"]
    return next((page for page in pages if page.is_file()), None)


def mend(what: str) -> str:
    """What to do where `what` (such as "the archives") is missing or does not fit."""
    if checkout():
        return f"`make fmus` builds {what}"
    return f"installing feedsim anew, from the wheel for this platform, brings {what} along"
