"""Is the feedsim of a worker the one that sent it the work? Only then do its figures belong into the same table."""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

# What a worker is asked, in words that every Python knows, whatever is installed there.
QUESTION = "__import__('feedsim.sweep.same', fromlist=['told']).told()"


@cache
def told() -> dict[str, str]:
    """Version of feedsim, hash of its Python sources, and what else figures may depend on in the last digit."""
    return {
        "feedsim": _version("feedsim"),
        "sources": _sources(),
        "Python": platform.python_version(),
        "numpy": _version("numpy"),
        "scipy": _version("scipy"),
        "ruckig": _version("ruckig"),
        "machine": f"{sys.platform} {platform.machine()}",
    }


def fault(address: str, answer: Any, here: Mapping[str, str]) -> str | None:
    """What is wrong with the worker at `address` that answered so, if `here` is what the client tells of itself; None
    where nothing is."""
    if isinstance(answer, ModuleNotFoundError):
        return f"worker {address}: has no feedsim {here['feedsim']} ({answer}); install the same version there"
    if not isinstance(answer, Mapping):
        return f"worker {address}: does not tell its version of feedsim: {answer}"
    if answer["feedsim"] != here["feedsim"]:
        return (
            f"worker {address}: has feedsim {answer['feedsim']}, here is {here['feedsim']}; a study needs the same "
            "everywhere"
        )
    if answer["sources"] != here["sources"]:
        return (
            f"worker {address}: its feedsim {here['feedsim']} has other sources than the one that the study was begun "
            "with; install the same there and start the worker anew (or the files have changed meanwhile: begin anew)"
        )
    return None


def differences(answers: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Sentences on workers with other versions of what feedsim calculates with: the last digits may differ."""
    here = told()
    found: dict[str, list[str]] = {}
    for address, answer in answers.items():
        for name in ("Python", "numpy", "scipy", "ruckig", "machine"):
            if answer.get(name) != here[name]:
                found.setdefault(f"{name} {answer.get(name)} in place of {here[name]}", []).append(address)
    return [
        f"{', '.join(addresses[:3])}{f' and {len(addresses) - 3} more' if len(addresses) > 3 else ''}: {what}; figures "
        "from there may differ in the last digits"
        for what, addresses in found.items()
    ]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "(not installed)"


def _sources() -> str:
    """SHA-256 over the package's Python files, wherever they lie and however their lines end."""
    root = Path(__file__).resolve().parents[1]
    found = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        content = file.read_bytes().replace(b"\r\n", b"\n")
        found.update(f"{file.relative_to(root).as_posix()} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()
