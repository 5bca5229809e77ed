"""pyproject.toml -> what a wheel and a source archive say of themselves (core metadata 2.4)."""

import re
from collections.abc import Iterator
from typing import Any

from .project import PROJECT, table

GENERATOR = "feedsim_distribution"
SOURCE = "Repository"  # label in [project.urls] of where the sources can be read

_PICTURE = re.compile(r"^!\[[^\]]*\]\([^)]*\)\n(?:\n\*(?:[^*]|\*\*)*\*\n)?\n?", re.MULTILINE)  # and the words below it
_LINK = re.compile(r"\[([^\]]+)\]\((?!\w+:)([^)\s]+)\)")


def describe() -> str:
    """METADATA of a wheel, PKG-INFO of a source archive."""
    project = table()
    readme = (PROJECT / str(project["readme"])).read_text(encoding="utf-8")
    return "\n".join(_lines()) + "\n\n" + readable_anywhere(readme, project)


def readable_anywhere(page: str, project: dict[str, Any]) -> str:
    """The README as an index of packages shows it, beside none of the files that it links to.

    Links lead to the sources of this version where the project says an address of them; else they are words, and
    pictures are left out.
    """
    address = str(project.get("urls", {}).get(SOURCE, "")).rstrip("/")
    if not address:
        return _LINK.sub(lambda match: match[1], _PICTURE.sub("", page))
    address = f"{address}/%s/v{project['version']}/"
    pictures = re.sub(r"(!\[[^\]]*\]\()(?!\w+:)", lambda match: match[1] + address % "raw", page)
    return _LINK.sub(lambda match: f"[{match[1]}]({address % 'blob'}{match[2]})", pictures)


def _lines() -> Iterator[str]:
    project = table()
    yield "Metadata-Version: 2.4"
    yield f"Name: {project['name']}"
    yield f"Version: {project['version']}"
    yield f"Summary: {project['description']}"
    yield from (f"Author: {author['name']}" for author in project["authors"])
    yield f"Keywords: {','.join(project['keywords'])}"
    yield from (f"Classifier: {classifier}" for classifier in project["classifiers"])
    yield from (f"Project-URL: {label}, {address}" for label, address in project.get("urls", {}).items())
    yield f"License-Expression: {project['license']}"
    yield from (f"License-File: {name}" for name in project["license-files"])
    yield f"Requires-Python: {project['requires-python']}"
    yield from (f"Requires-Dist: {needed}" for needed in project["dependencies"])
    for extra, packages in project.get("optional-dependencies", {}).items():
        yield f"Provides-Extra: {extra}"
        yield from (f'Requires-Dist: {needed}; extra == "{extra}"' for needed in packages)
    yield "Description-Content-Type: text/markdown"


def wheel(platform: str) -> str:
    """WHEEL, of a wheel for a platform as its file name has it."""
    pure = str(platform == "any").lower()
    return f"Wheel-Version: 1.0\nGenerator: {GENERATOR}\nRoot-Is-Purelib: {pure}\nTag: py3-none-{platform}\n"


def entry_points() -> str:
    """entry_points.txt."""
    return "[console_scripts]\n" + "".join(f"{name} = {call}\n" for name, call in table()["scripts"].items())
