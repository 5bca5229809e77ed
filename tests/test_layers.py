"""Imports point downwards only, and each outside library has its one room."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
# A room may import the rooms below it.
ORDER = [
    "__main__",
    "cli",
    "report",
    "sweep",
    "identify",
    "analysis",
    "compare",
    "ssp",
    "cosim",
    "structure",
    "nc",
    "scenario",
    "motions",
    "trace",
    "files",
    "fields",
    "variables",
    "units",
    "errors",
]
SOLE_USERS = {
    "fmpy": {"cosim/archive.py", "cosim/unit.py"},
    "ctypes": {"cosim/unit.py", "cosim/friction_law.py", "cosim/exchange.py"},
    "yaml": {"files", "scenario/friction_file.py"},
    "matplotlib": {"report"},
    "ruckig": {"motions"},
    "jinja2": {"report/page.py"},
    "tqdm": {"cli"},
    "pyuff": {"trace/uff.py"},
    "distributed": {"sweep"},
    "dask": {"sweep"},
    "pyarrow": {"sweep"},
    "feedsim_packager": {"units.py", "structure/pack.py", "ssp/setpoints.py"},
}


def imported(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_imports_point_downwards(file: Path) -> None:
    room = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room == "__init__":
        pytest.skip("the package's front door names every room, lazily")
    assert room in ORDER, f"{file}: a room that the order does not know"
    for name in imported(file):
        parts = name.split(".")
        if parts[0] == "feedsim" and len(parts) > 1 and parts[1] in ORDER:
            assert ORDER.index(parts[1]) >= ORDER.index(room), f"{file} imports upwards: {name}"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_outside_libraries_have_one_room(file: Path) -> None:
    place = file.relative_to(PACKAGE).as_posix()
    for name in imported(file):
        homes = SOLE_USERS.get(name.split(".")[0])
        if homes is not None:
            assert any(place == home or place.startswith(f"{home}/") for home in homes), f"{place} imports {name}"
