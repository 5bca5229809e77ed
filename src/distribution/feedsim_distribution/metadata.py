"""pyproject.toml -> what a wheel and a source archive say of themselves (core metadata 2.4)."""

from collections.abc import Iterator

from .project import PROJECT, table

GENERATOR = "feedsim_distribution"


def describe() -> str:
    """METADATA of a wheel, PKG-INFO of a source archive."""
    readme = PROJECT / str(table()["readme"])
    return "\n".join(_lines()) + "\n\n" + readme.read_text(encoding="utf-8")


def _lines() -> Iterator[str]:
    project = table()
    yield "Metadata-Version: 2.4"
    yield f"Name: {project['name']}"
    yield f"Version: {project['version']}"
    yield f"Summary: {project['description']}"
    yield f"License-Expression: {project['license']}"
    yield from (f"License-File: {name}" for name in project["license-files"])
    yield f"Requires-Python: {project['requires-python']}"
    yield from (f"Requires-Dist: {needed}" for needed in project["dependencies"])
    for extra, packages in project.get("optional-dependencies", {}).items():
        yield f"Provides-Extra: {extra}"
        yield from (f'Requires-Dist: {needed}; extra == "{extra}"' for needed in packages)
    yield "Description-Content-Type: text/markdown"


def wheel(platforms: str) -> str:
    """WHEEL, of a wheel for platforms as its file name has them."""
    tags = "".join(f"Tag: py3-none-{platform}\n" for platform in platforms.split("."))
    pure = str(platforms == "any").lower()
    return f"Wheel-Version: 1.0\nGenerator: {GENERATOR}\nRoot-Is-Purelib: {pure}\n{tags}"


def entry_points() -> str:
    """entry_points.txt."""
    return "[console_scripts]\n" + "".join(f"{name} = {call}\n" for name, call in table()["scripts"].items())
