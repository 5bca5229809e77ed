"""What a wheel holds besides Python: archives, native libraries, scenarios and machines, documentation."""

import platform
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from feedsim_packager import build, checkout, declared, native, table, targets, web
from feedsim_packager.errors import CompilerError, InputError

from .project import PROJECT, files

PLACE = "feedsim/shipped/"  # where feedsim.foundation.installation looks
SCENARIOS = "scenarios"
# Whose native libraries the wheel of all platforms holds: of each, the file that its machines look for.
PLATFORMS = ("linux64", "aarch64-linux", "win64", "darwin64")
ANY = "any"


@dataclass(frozen=True)
class Shipped:
    """Files by their paths in the wheel, and the platform that pip may install them on, as a file name has it."""

    files: dict[str, bytes]
    platform: str


def for_this_machine(compiler: Sequence[str]) -> Shipped:
    """By a compiler that makes code for this machine alone, as `make fmus` does."""
    tag = sysconfig.get_platform().replace("-", "_").replace(".", "_").replace("universal2", platform.machine())
    return Shipped(_archives(compiler, None) | _libraries(compiler, None) | _page(None) | _plain(compiler), tag)


def for_every_machine(compiler: Sequence[str], archives: Path | None = None, site: Path | None = None) -> Shipped:
    """By zig: archives and native libraries for all platforms.

    archives: folder that has them already, for all platforms. site: folder of the documentation that `make docs` built.
    """
    units = _archives(compiler, targets.named("all")) if archives is None else _placed(taken(archives))
    for name in PLATFORMS:
        units |= _libraries(compiler, targets.ALL[name])
    page = _page(zig_for_pages())
    return Shipped(units | page | _documentation(site) | _plain(compiler), ANY)


def _documentation(site: Path | None) -> dict[str, bytes]:
    """The pages of the site, without what only the next build of it would read."""
    if site is None:
        return {}
    if not (site / "index.html").is_file():
        raise InputError(f"{site}: has no index.html; make docs builds the documentation")
    pages = sorted(
        path for path in site.rglob("*") if path.is_file() and path.name not in (".buildinfo", "objects.inv")
    )
    return {f"{PLACE}site/{path.relative_to(site).as_posix()}": path.read_bytes() for path in pages}


def taken(folder: Path) -> dict[str, bytes]:
    """The archives of a folder by their file names. Raises InputError where one is missing."""
    names = [f"{path.name.removesuffix('_fmu')}.fmu" for path in checkout.unit_folders()]
    if missing := [name for name in names if not (folder / name).is_file()]:
        raise InputError(f"{folder}: has no {', '.join(missing)}; make fmus-all builds them")
    return {name: (folder / name).read_bytes() for name in names}


def _placed(files: dict[str, bytes]) -> dict[str, bytes]:
    return {f"{PLACE}fmus/{name}": content for name, content in files.items()}


def _archives(compiler: Sequence[str], platforms: Sequence[targets.Target] | None) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for path in checkout.unit_folders():
            unit = build.load(path, compiler)
            build.build(unit, folder / f"{unit.table.unit}.fmu", compiler, targets=platforms)
        return _placed(taken(folder))


def _libraries(compiler: Sequence[str], target: targets.Target | None) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as scratch:
        built = [native.build(name, Path(scratch), compiler, target) for name in native.LIBRARIES]
        return _placed({library.name: library.read_bytes() for library in built})


def _page(compiler: Sequence[str] | None) -> dict[str, bytes]:
    """The module of pages. compiler: for WebAssembly; None: one that is here, and without one there are no pages."""
    with tempfile.TemporaryDirectory() as scratch:
        try:
            built = web.make(Path(scratch) / web.FILE, compiler)
        except CompilerError:
            if compiler is not None:
                raise
            return {}
        return _placed({built.name: built.read_bytes()})


def _plain(compiler: Sequence[str]) -> dict[str, bytes]:
    """Scenarios, and what the master knows of the units' variables."""
    tables = [table.read(path, (checkout.SHELL, checkout.STANDARD), compiler) for path in checkout.unit_folders()]
    result = {PLACE + path.relative_to(PROJECT).as_posix(): path.read_bytes() for path in files(SCENARIOS)}
    return result | {"feedsim/foundation/variables.json": declared.dump(tables)}


def zig() -> tuple[str, ...]:
    """The compiler for all platforms."""
    return (sys.executable, "-m", "ziglang", "cc")


def zig_for_pages() -> tuple[str, ...] | None:
    """The compiler for the module of pages."""
    return (*zig(), "-target", "wasm32-wasi")
