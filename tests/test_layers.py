"""Imports point downwards only and never in a circle, and each outside library has its one room."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
# A room may import the rooms below it. A folder of a room that stands here is a room of its own.
ORDER = [
    "__main__",
    "cli",
    "jobs",
    "report.live_page",
    "report",
    "design.sweep",
    "estimation.replay",
    "estimation.identify",
    "design.tune",
    "design.uncertainty",
    "analysis",
    "estimation.modal",
    "comparison",
    "simulation.ssp",
    "simulation.judge",
    "linear",
    "simulation.cosim",
    "structure",
    "simulation.nc",
    "scenario",
    "motions",
    "motions.planner",
    "motions.part_program",
    "estimation",
    "files.trace",
    "files",
    "files.fields",
    "files.control",
    "foundation",
]
SOLE_USERS = {
    "fmpy": {"simulation/cosim/archive.py", "simulation/cosim/unit.py"},
    "ctypes": {
        *(f"simulation/cosim/{name}.py" for name in ("unit", "friction_law", "exchange", "archive")),
        "foundation/installation.py", "motions/planner/planned.py",
    },
    "yaml": {"files", "estimation/identify/friction_file.py"},
    "matplotlib": set(),
    "PIL": {"report/machine.py"},
    "resvg_py": {"report/chart/svg.py"},
    "ruckig": {"motions"},
    "jinja2": {"report/page.py"},
    "tqdm": {"cli"},
    "threadpoolctl": {"jobs/parameters.py"},
    "pandas": {"analysis/figures.py", "jobs/run.py", "jobs/sweep.py", "files/trace/trace.py", "design/sweep/table.py"},
    "pyuff": {"files/trace/response_files.py"},
    "h5py": {"files/trace/mat.py"},
    "distributed": {"design/sweep"},
    "dask": {"design/sweep"},
    "pyarrow": {"design/sweep"},
    "feedsim_packager": {
        "foundation/units.py", "structure/pack.py", "structure/mounts.py", "simulation/ssp/setpoints.py",
        "simulation/cosim/whole.py",
    },
}  # fmt: skip


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
IMPORTED = {name: list(imported(file.read_text(encoding="utf-8"))) for name, file in MODULES.items()}


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


def room_of(module: str) -> str:
    """The innermost room of a module that the order has; "" for the front door and folders of rooms alone."""
    name = module.removeprefix("feedsim").removeprefix(".")
    while name and name not in ORDER:
        name = name.rpartition(".")[0]
    return name


def test_every_module_is_in_a_room() -> None:
    homeless = {name for name in MODULES if not room_of(name)}
    assert homeless == {"feedsim", "feedsim.design", "feedsim.simulation"}


def test_imports_make_no_circle() -> None:
    """Over all modules: those of types, and late ones, too."""
    graph = {
        name: {module_of(other) for other in IMPORTED[name] if other.startswith("feedsim.")} - {name, "feedsim"}
        for name in MODULES
        if name != "feedsim"
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


@pytest.mark.parametrize("room", ORDER)
def test_imports_point_downwards(room: str) -> None:
    for module, names in IMPORTED.items():
        if room_of(module) != room:
            continue
        for name in names:
            other = room_of(module_of(name)) if name.startswith("feedsim.") else ""
            if other:
                assert ORDER.index(other) >= ORDER.index(room), f"{module} imports upwards: {name}"


def loaded_with(module: str) -> set[str]:
    """A module and what it imports when it is loaded: nothing late, nothing for types alone."""
    loaded, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name in loaded:
            continue
        loaded.add(name)
        for node in ast.parse(MODULES[name].read_text(encoding="utf-8")).body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                waiting += [module_of(other) for other in imported(ast.unparse(node)) if other.startswith("feedsim.")]
    return loaded


@pytest.mark.parametrize("job", ["run", "check", "compare", "export", "circle"])
def test_the_core_loads_neither_identification_nor_design(job: str) -> None:
    """What most people use stands without the rest; options such as draws of a run load that when they are given."""
    rest = ("feedsim.design.", *(f"feedsim.estimation.{room}." for room in ("identify", "modal", "replay")))
    loaded = loaded_with(f"feedsim.jobs.{job}")
    assert "feedsim.scenario.machine" in loaded
    assert not {name for name in loaded if name.startswith(rest)}


def test_a_run_judges_nothing() -> None:
    """Simulating takes a table of modes, and packs a machine: no structure is solved, no loop is closed."""
    allowed = {f"feedsim.structure.{file}" for file in ("assembly", "modes", "pack", "poses")}
    for name, names in IMPORTED.items():
        if room_of(name) == "simulation.cosim":
            taken = {module_of(other) for other in names if other.startswith("feedsim.structure")}
            assert taken <= allowed, f"{name} takes more of a structure than its modes: {taken - allowed}"


@pytest.mark.parametrize("library", SOLE_USERS)
def test_outside_libraries_have_one_room(library: str) -> None:
    homes = SOLE_USERS[library]
    for module, names in IMPORTED.items():
        place = MODULES[module].relative_to(PACKAGE).as_posix()
        if any(name.split(".")[0] == library for name in names):
            assert any(place == home or place.startswith(f"{home}/") for home in homes), f"{place} imports {library}"
