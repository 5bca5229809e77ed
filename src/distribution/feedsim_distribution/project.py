"""pyproject.toml, and which files are the project's."""

import subprocess
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from feedsim_packager.checkout import PROJECT

__all__ = ["PROJECT", "configuration", "files", "table"]

_LITTER = ("__pycache__", ".egg-info")


def configuration() -> dict[str, Any]:
    """pyproject.toml."""
    return tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))


def table() -> dict[str, Any]:
    """[project] of pyproject.toml."""
    project: dict[str, Any] = configuration()["project"]
    return project


def files(*places: str) -> list[Path]:
    """Files below the places (files or folders of the project), sorted.

    In a checkout those that git has, so that what a user has left in scenarios/ is not handed out; else all.
    """
    if (PROJECT / ".git").exists():
        done = subprocess.run(["git", "ls-files", "-z", "--", *places], cwd=PROJECT, capture_output=True, check=True)
        listed = [PROJECT / name for name in done.stdout.decode().split("\0") if name]
        return sorted(path for path in listed if path.is_file())
    return sorted(_walk(places))


def _walk(places: Sequence[str]) -> Iterator[Path]:
    for place in places:
        root = PROJECT / place
        for path in root.rglob("*") if root.is_dir() else [root]:
            if path.is_file() and not any(part.endswith(_LITTER) for part in path.relative_to(PROJECT).parts):
                yield path
