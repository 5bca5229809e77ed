"""Imports point downwards only and never in a circle, and each outside library has its one room."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
# A room may import the rooms below it.
ORDER = [
    "__main__",
    "cli",
    "jobs",
    "page",
    "report",
    "sweep",
    "replay",
    "identify",
    "tune",
    "uncertainty",
    "analysis",
    "modal",
    "compare",
    "ssp",
    "judge",
    "linear",
    "cosim",
    "structure",
    "nc",
    "scenario",
    "examples",
    "motions",
    "path",
    "part_program",
    "estimation",
    "trace",
    "part_program",
    "files",
    "fields",
    "control",
    "variables",
    "arguments",
    "units",
    "findings",
    "outputs",
    "owned",
    "sheets",
    "cache",
    "called",
    "extras",
    "errors",
    "native",
    "installation",
    "signals",
]
SOLE_USERS = {
    "fmpy": {"cosim/archive.py", "cosim/unit.py"},
    "ctypes": {
        "cosim/unit.py",
        "cosim/friction_law.py",
        "cosim/exchange.py",
        "cosim/arithmetic.py",
        "native.py",
        "path/library.py",
        "path/planned.py",
    },
    "yaml": {"files", "identify/friction_file.py"},
    "matplotlib": set(),
    "PIL": {"report/machine/report.py"},
    "resvg_py": {"report/chart/file.py"},
    "ruckig": {"motions"},
    "jinja2": {"report/page.py"},
    "tqdm": {"cli"},
    "pandas": {"jobs/run.py", "jobs/sweep.py", "trace/trace.py", "sweep/table.py"},
    "pyuff": {"trace/response_files.py"},
    "h5py": {"trace/mat.py"},
    "distributed": {"sweep"},
    "dask": {"sweep"},
    "pyarrow": {"sweep"},
    "feedsim_packager": {
        *("units.py", "structure/pack.py", "structure/mounts.py", "ssp/setpoints.py", "cosim/one_unit.py"),
    },
}


def imported(text: str) -> Iterator[str]:
    """What a file imports: ahead of all else, late within a function, or for types alone."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = {
    ".".join(("feedsim", *f.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): f for f in FILES
}
ROOMS = sorted({module.split(".")[1] for module in MODULES if module != "feedsim"})


def test_every_import_counts() -> None:
    text = "import a\nif TYPE_CHECKING:\n    from b import c\ndef late():\n    from d.e import f\n"
    assert list(imported(text)) == ["a", "b.c", "d.e.f"]
    with pytest.raises(AssertionError, match="relative import"):
        list(imported("from . import a"))


def module_of(name: str) -> str:
    """The module that an imported name stands in: `feedsim.nc.plan` in `feedsim.nc`."""
    while name not in MODULES:
        name = name.rpartition(".")[0]
    return name


@pytest.mark.parametrize("room", ROOMS)
def test_no_circle_within_a_room(room: str) -> None:
    inside = {name: file for name, file in MODULES.items() if name.split(".")[1:2] == [room]}
    graph = {
        name: {module_of(other) for other in imported(file.read_text()) if other.startswith(f"feedsim.{room}.")}
        - {name}
        for name, file in inside.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as circle:
        pytest.fail(" imported by ".join(circle.args[1]))


@pytest.mark.parametrize(
    "room", [name for name, file in MODULES.items() if file.stem == "__init__" and name != "feedsim"]
)
def test_a_room_opens_with_three_lines(room: str) -> None:
    """What it is for, what it may use, where to start reading."""
    opening = (ast.get_docstring(ast.parse(MODULES[room].read_text())) or "").splitlines()
    assert opening
    assert any(line.startswith("May use ") for line in opening), f"{room} does not say what it may use"
    start = next((line for line in opening if line.startswith("Start with ")), "")
    assert start, f"{room} does not say where to start reading"
    named = start.split()[2].rstrip(".,:;").strip("`")
    assert (MODULES[room].parent / named).exists(), f"{room} has no {named}"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_imports_point_downwards(file: Path) -> None:
    room = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room == "__init__":
        pytest.skip("the package's front door names every room, lazily")
    assert room in ORDER, f"{file}: a room that the order does not know"
    for name in imported(file.read_text()):
        parts = name.split(".")
        if parts[0] == "feedsim" and len(parts) > 1 and parts[1] in ORDER:
            assert ORDER.index(parts[1]) >= ORDER.index(room), f"{file} imports upwards: {name}"


def test_a_run_judges_nothing() -> None:
    """Simulating takes a table of modes, and packs a machine: no structure is solved, no loop is closed."""
    allowed = {f"feedsim.structure.{file}" for file in ("assembly", "modes", "pack", "poses_file")}
    for name, file in MODULES.items():
        if name.startswith("feedsim.cosim"):
            taken = {module_of(other) for other in imported(file.read_text()) if other.startswith("feedsim.structure")}
            assert taken <= allowed, f"{file} takes more of a structure than its modes"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_outside_libraries_have_one_room(file: Path) -> None:
    place = file.relative_to(PACKAGE).as_posix()
    for name in imported(file.read_text()):
        homes = SOLE_USERS.get(name.split(".")[0])
        if homes is not None:
            assert any(place == home or place.startswith(f"{home}/") for home in homes), f"{place} imports {name}"
