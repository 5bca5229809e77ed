"""A unit's folder -> its archive: every step in order."""

import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import archive, carried, compile, description, documentation, resources, table, trial, variables
from .errors import InputError
from .machine import Machine, named
from .resources import Resources
from .table import Table
from .variables import Variable

SHELL = Path(__file__).resolve().parent.parent  # src/fmi2
PROJECT = SHELL.parent.parent
STANDARD = SHELL / "standard"
DEFAULT_MODES = PROJECT / "scenarios" / "machines" / "test_centre" / "modes.csv"
EMBEDDED = "embedded_resources.c"
CARRIED = carried.PATH.removeprefix("sources/")


@dataclass(frozen=True)
class Unit:
    """Everything of a unit that needs no compiler but the preprocessor."""

    directory: Path
    table: Table
    resources: Resources | None
    variables: tuple[Variable, ...]
    sources: dict[str, bytes]  # flat: name -> content
    guid: str
    version: str
    machine: Machine
    warnings: tuple[str, ...]

    @property
    def c_files(self) -> list[str]:
        """The files to compile."""
        return sorted(name for name in self.sources if name.endswith(".c"))

    def description(self) -> bytes:
        """modelDescription.xml."""
        return description.describe(
            self.table,
            self.variables,
            guid=self.guid,
            version=self.version,
            sources=self.c_files,
            machine=self.machine,
        )


@dataclass(frozen=True)
class Result:
    """A built archive."""

    path: Path
    size: int  # bytes
    guid: str
    platform: str
    glibc: str | None
    warnings: tuple[str, ...]


def unit_directory(name: str) -> Path:
    """`name` is a unit's name (src/<name>_fmu) or the path of its folder."""
    directory = PROJECT / "src" / f"{name}_fmu"
    if directory.is_dir():
        return directory
    if Path(name).is_dir():
        return Path(name)
    known = ", ".join(sorted(path.name.removesuffix("_fmu") for path in (PROJECT / "src").glob("*_fmu")))
    raise InputError(f"no unit '{name}' (units: {known}; or the path of a unit's folder)")


def load(
    directory: Path,
    compiler: Sequence[str],
    *,
    axes: Path | None = None,
    modes: Path | None = None,
    poses: Path | None = None,
    name: str = "",
    note: str = "",
) -> Unit:
    """Read and check a unit. `axes`, `modes` and `poses` replace the default resources of a unit with rows per axis;
    `name` and `note` say what machine they are of."""
    rows = table.read(directory, (SHELL, STANDARD), compiler)
    given = None
    if rows.axis_rows or axes or modes or poses:
        given = resources.read(axes or directory / "resources" / "axes.csv", modes or DEFAULT_MODES, poses)
    version, warnings = _version()
    own = any((axes, modes, poses, name, note))
    return Unit(
        directory=directory,
        table=rows,
        resources=given,
        variables=variables.expand(rows, given),
        sources=_sources(directory, given) | {CARRIED: carried.dump(rows, version)},
        guid=variables.guid(rows, given),
        version=version,
        machine=named(name, note) if own else Machine(default=True),
        warnings=warnings,
    )


def _version() -> tuple[str, tuple[str, ...]]:
    path = PROJECT / "pyproject.toml"
    if not path.is_file():
        return "0", (f"{path.name} is missing: the version is written as 0",)
    with path.open("rb") as file:
        version = tomllib.load(file).get("project", {}).get("version")
    if not isinstance(version, str):
        raise InputError(f"{path}: [project] has no version")
    return version, ()


def _sources(directory: Path, given: Resources | None) -> dict[str, bytes]:
    """The flat sources folder: shell, headers of the standard, the unit, its resources as constants."""
    found: dict[str, Path] = {}
    problems: list[str] = []
    for folder in (SHELL, STANDARD, directory):
        for path in sorted(folder.iterdir()):
            if path.suffix not in (".c", ".h", ".def"):
                continue
            if path.name in found or path.name == EMBEDDED:
                where = found[path.name].parent if path.name in found else "the packager's own output"
                problems.append(f"{path.name} is in {path.parent} and in {where}")
            found[path.name] = path
    if problems:
        raise InputError(f"{directory}: file names must differ, as the archive's sources folder is flat", problems)
    embedded = {EMBEDDED: resources.embedded_source(given)} if given else {}
    return {name: path.read_bytes() for name, path in found.items()} | embedded


def build(unit: Unit, out: Path, compiler: Sequence[str], build_directory: Path | None = None) -> Result:
    """Compile and pack `unit` into `out`. `build_directory` keeps what was staged; without it nothing stays."""
    target = compile.host_target()
    name = unit.table.unit
    with tempfile.TemporaryDirectory(prefix="packager-") as temporary:
        stage = (build_directory or Path(temporary)) / name
        sources = stage / "sources"
        sources.mkdir(parents=True, exist_ok=True)
        for path in sources.iterdir():
            if path.name not in unit.sources and path.suffix in (".c", ".h", ".def"):
                path.unlink()  # left from an earlier build; it would be found by #include
        for file_name, content in unit.sources.items():
            (sources / file_name).write_bytes(content)
        library = compile.compile_library(
            name, sources, unit.c_files, stage / "binaries" / target.folder, compiler, target
        )
        if not library.instrumented:
            packed = unit.resources.files() if unit.resources else {}
            trial.check(stage / library.path, name, unit.guid, packed, stage)
    pages, warnings = _documentation(unit)
    content = archive.pack(
        {
            "modelDescription.xml": unit.description(),
            library.path: library.content,
            **{f"sources/{file_name}": content for file_name, content in unit.sources.items()},
            **(unit.resources.files() if unit.resources else {}),
            **pages,
        }
    )
    archive.write(out, content)
    return Result(out, len(content), unit.guid, target.folder, library.glibc, (*unit.warnings, *warnings))


def _documentation(unit: Unit) -> tuple[dict[str, bytes], list[str]]:
    warnings: list[str] = []
    texts: dict[str, str | None] = {}
    for what, path in (("readme", unit.directory / "README.md"), ("licence", PROJECT / "LICENSE")):
        texts[what] = path.read_text(encoding="utf-8") if path.is_file() else None
        if texts[what] is None:
            warnings.append(f"{path.name} of {path.parent.name} is missing: the documentation goes without it")
    pages = documentation.pages(
        unit.table,
        unit.variables,
        unit.resources,
        readme=texts["readme"],
        licence=texts["licence"],
        standard_header=(STANDARD / "fmi2TypesPlatform.h").read_text(encoding="utf-8"),
        version=unit.version,
        machine=unit.machine,
    )
    return pages, warnings
