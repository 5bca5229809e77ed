"""A unit's folder -> its archive: every step in order."""

import os
import tempfile
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from . import (
    archive,
    build_description,
    carried,
    compile,
    description,
    documentation,
    flat,
    kinds,
    reference,
    table,
    terminals,
    trial,
    variables,
)
from .checkout import PROJECT, REFERENCES, SHELL, SOURCES, STANDARD, unit_folders
from .errors import CompilerError, InputError
from .machine import Machine, named
from .resources import Experiment, Resources
from .table import Table
from .targets import Target
from .variables import Variable

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
            experiment=self.resources.experiment() if self.resources else Experiment(),
        )


@dataclass(frozen=True)
class Result:
    """A built archive."""

    path: Path
    size: int  # bytes
    guid: str
    platforms: tuple[str, ...]  # folders under binaries/
    glibc: str | None  # newest that a Linux binary needs
    tried: bool  # instantiated here; not where there is no binary for this platform, or extra flags were in use
    warnings: tuple[str, ...]


def unit_directory(name: str) -> Path:
    """`name` is a unit's name (src/<name>_fmu) or the path of its folder."""
    directory = SOURCES / f"{name}_fmu"
    if directory.is_dir():
        return directory
    if Path(name).is_dir():
        return Path(name)
    known = ", ".join(path.name.removesuffix("_fmu") for path in unit_folders())
    raise InputError(f"no unit '{name}' (units: {known}; or the path of a unit's folder)")


def load(
    directory: Path,
    compiler: Sequence[str],
    *,
    name: str = "",
    note: str = "",
    **files: Path | None,
) -> Unit:
    """Read and check a unit. `files` replace those of its resources that it has in its folder, by the names of kinds.py
    (axes, modes, poses; setpoints); `name` and `note` say what machine or motion they are of."""
    rows = table.read(directory, (SHELL, STANDARD), compiler)
    own_files = {option: path for option, path in files.items() if path is not None}
    given = kinds.of_unit(rows.unit, rows.resources, directory, own_files)
    version, warnings = _version()
    own = any((own_files, name, note))
    return Unit(
        directory=directory,
        table=rows,
        resources=given,
        variables=variables.expand(rows, given),
        sources=_sources(rows.unit, directory, given) | {CARRIED: carried.dump(rows, version)},
        guid=variables.guid(rows, given),
        version=version,
        machine=replace(
            named(name, note) if own else Machine(default=True), noun=given.noun if given else Machine.noun
        ),
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


def _sources(unit: str, directory: Path, given: Resources | None) -> dict[str, bytes]:
    """The flat sources folder: shell, the unit, its resources as constants, how to compile them.

    Without the standard's headers: those of the importer are to be used (FMI 2.0, section 2.3).
    """
    paths: dict[str, Path] = {}
    problems: list[str] = []
    for folder in (SHELL, STANDARD, directory):
        for path in sorted(folder.iterdir()):
            if path.suffix not in (".c", ".h", ".def"):
                continue
            if path.name in paths or path.name == EMBEDDED:
                where = paths[path.name].parent if path.name in paths else "the packager's own output"
                problems.append(f"{path.name} is in {path.parent} and in {where}")
            paths[path.name] = path
    if problems:
        raise InputError(f"{directory}: file names must differ, as the archive's sources folder is flat", problems)
    files = {name: flat.content(path) for name, path in paths.items() if path.parent != STANDARD}
    if given:
        files[EMBEDDED] = given.embedded_source()
    listed = [name for name in files if name.endswith(".c")]
    return files | {build_description.NAME: build_description.describe(unit, listed)}


def build(
    unit: Unit,
    out: Path,
    compiler: Sequence[str],
    build_directory: Path | None = None,
    *,
    targets: Sequence[Target] | None = None,
    progress: Callable[[str], None] | None = None,
    with_terminals: bool = True,
) -> Result:
    """Compile and pack `unit` into `out`. `build_directory` keeps what was staged; without it nothing stays.

    `targets`: platforms for which it is compiled, checked to run on machines other than this one; without, for this
    machine by its own compiler. `progress` gets a line for every library that is ready.
    """
    name = unit.table.unit
    with tempfile.TemporaryDirectory(prefix="packager-") as temporary:
        stage = (build_directory or Path(temporary)) / name
        _stage(unit, stage / "sources")
        libraries = _compile(unit, stage, compiler, targets, progress)
        tried = _try(unit, stage, libraries)
    references = _references(unit)
    pages, warnings = _documentation(unit, references)
    pictures, more_warnings = terminals.files(unit.directory, unit.variables)
    warnings += more_warnings
    if not with_terminals:
        pictures = terminals.without(pictures)
    content = archive.pack(
        {
            "modelDescription.xml": unit.description(),
            **{library.path: library.content for library in libraries},
            **{f"sources/{file_name}": content for file_name, content in unit.sources.items()},
            **(unit.resources.files() if unit.resources else {}),
            **pages,
            **pictures,
            **references,
        }
    )
    archive.write(out, content)
    glibc = compile.newest_glibc(b"".join(library.content for library in libraries))
    platforms = tuple(library.path.split("/")[1] for library in libraries)
    return Result(out, len(content), unit.guid, platforms, glibc, tried, (*unit.warnings, *warnings))


def _references(unit: Unit) -> dict[str, bytes]:
    """Pinned reference results, which are of the project's own units with their default resources."""
    name = unit.table.unit
    if not unit.machine.default or unit.directory.resolve() != SOURCES / f"{name}_fmu":
        return {}
    return reference.files(REFERENCES / name, unit.variables)


def _stage(unit: Unit, sources: Path) -> None:
    sources.mkdir(parents=True, exist_ok=True)
    for path in sources.iterdir():
        if path.name in unit.sources or path.suffix in (".c", ".h", ".def"):
            path.unlink()  # of an earlier build: it would be found by #include, or be the same file as another's copy
    for file_name, content in unit.sources.items():
        (sources / file_name).write_bytes(content)


def _compile(
    unit: Unit,
    stage: Path,
    compiler: Sequence[str],
    targets: Sequence[Target] | None,
    progress: Callable[[str], None] | None,
) -> list[compile.Library]:
    """A library per target, in their order; several are compiled at the same time."""
    name = unit.table.unit

    def one(target: Target) -> compile.Library:
        begun = time.monotonic()
        library = compile.compile_library(
            name,
            stage / "sources",
            unit.c_files,
            stage / "binaries" / target.folder,
            compiler,
            target,
            for_others=targets is not None,
        )
        if progress:
            progress(f"{name}: {target.folder} ready after {time.monotonic() - begun:.1f} s")
        return library

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        return list(pool.map(one, targets if targets is not None else [compile.host_target()]))


def _try(unit: Unit, stage: Path, libraries: Sequence[compile.Library]) -> bool:
    """Instantiate the library for this machine once; False where there is none that can be loaded here."""
    try:
        host = compile.host_target()
    except CompilerError:
        return False
    for library in libraries:
        if library.path.split("/")[1] == host.folder and not library.instrumented:
            packed = unit.resources.files() if unit.resources else {}
            trial.check(stage / library.path, unit.table.unit, unit.guid, packed, stage)
            return True
    return False


def _documentation(unit: Unit, references: Mapping[str, bytes]) -> tuple[dict[str, bytes], list[str]]:
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
        references=references[reference.ROOT + reference.README].decode("utf-8") if references else None,
    )
    return pages, warnings
