"""The archives of `make fmus-all` on the platforms that they are for: `make test-platforms`.

Not part of `make test`: the archives take zig, which compiles for minutes when a platform is new to it. Each part is
left out, with the reason, where this machine cannot run it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from feedsim_packager import binary, build, checkout, portable, targets, toolchain, universal
from platforms import hosts, signature
from platforms.cases import Case, Floats, cases

ARCHIVES = Path(os.environ.get("FEEDSIM_PLATFORM_FMUS", "/nonexistent"))
UNITS = tuple(sorted(path.stem for path in ARCHIVES.glob("*.fmu")))
pytestmark = pytest.mark.skipif(not UNITS, reason="archives of all platforms are tested by make test-platforms")

# Outputs differ between platforms by what their exp, pow, log, sin and cos differ by: a unit or two in the last place
# (2e-16) of a coefficient or a step, which the units, stable as they are, do not amplify by more than the thousands of
# steps that they remember. Relative to the largest value of the output in the case.
LARGEST = 1e-12

_figures: dict[tuple[str, str], list[tuple[float, str, float]]] = {}


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("platforms")


@pytest.fixture(scope="session")
def unpacked(scratch: Path) -> dict[str, Path]:
    """Each archive, unpacked into a folder with a name that is not plain ASCII."""
    folders = {}
    for unit in UNITS:
        folders[unit] = scratch / "Prüfstand Nr 1" / unit
        with zipfile.ZipFile(ARCHIVES / f"{unit}.fmu") as archive:
            archive.extractall(folders[unit])
    return folders


@pytest.fixture(scope="session", autouse=True)
def table() -> Iterator[None]:
    """Prints what was measured (shown with pytest -s)."""
    yield
    if _figures:
        print("\n\n| unit | against linux64 built by zig | largest difference | of | relative to its largest value |")
        print("|---|---|---|---|---|")
    for (unit, other), found in sorted(_figures.items()):
        relative, name, absolute = max(found)
        print(f"| {unit} | {other} | {f'{absolute:.2g}' if absolute else 'none'} | {name} | {relative:.1g} |")


@pytest.fixture(scope="session")
def natively(scratch: Path, unpacked: dict[str, Path]) -> dict[str, dict[str, Floats]]:
    """Case -> outputs of the linux64 binary, run by a program of the same make."""
    if reason := hosts.why_not("linux64"):
        pytest.skip(reason)
    host = hosts.host("linux64", scratch)
    program = hosts.compile_program(host, scratch)
    return {
        f"{case.unit}: {case.name}": hosts.drive(
            host, program, _library(unpacked, case.unit, "linux64"), unpacked[case.unit], case, scratch
        )
        for case in cases(UNITS)
    }


def _library(unpacked: dict[str, Path], unit: str, folder: str) -> Path:
    return unpacked[unit] / "binaries" / folder / f"{unit}{targets.ALL[folder].suffix}"


def _compare(case: Case, other: str, found: dict[str, Floats], reference: dict[str, Floats]) -> None:
    assert found.keys() == reference.keys()
    moved = False
    for name, values in reference.items():
        assert np.all(np.isfinite(values)), name
        moved = moved or bool(np.ptp(values) > 0)
        scale = np.max(np.abs(values))
        absolute = float(np.max(np.abs(found[name] - values)))
        relative = absolute / scale if scale else absolute
        _figures.setdefault((case.unit, other), []).append((relative, name, absolute))
        assert relative <= LARGEST, (name, absolute)
    assert moved, "the case moves nothing"


@pytest.fixture(scope="session", params=["win64", "aarch64-linux"])
def foreign(request: pytest.FixtureRequest, scratch: Path) -> tuple[hosts.Host, Path]:
    """A platform that is not this one, and the program for it."""
    if reason := hosts.why_not(request.param):
        pytest.skip(reason)
    host = hosts.host(request.param, scratch)
    return host, hosts.compile_program(host, scratch)


@pytest.mark.parametrize("case", cases(UNITS), ids=lambda case: f"{case.unit}, {case.name}")
def test_other_platforms_give_the_same(
    case: Case,
    foreign: tuple[hosts.Host, Path],
    scratch: Path,
    unpacked: dict[str, Path],
    natively: dict[str, dict[str, Floats]],
) -> None:
    """Wine or qemu run the binary from a path with spaces and umlauts, its resources behind a URI."""
    host, program = foreign
    library = _library(unpacked, case.unit, host.folder)
    found = hosts.drive(host, program, library, unpacked[case.unit], case, scratch)
    _compare(case, host.folder, found, natively[f"{case.unit}: {case.name}"])


@pytest.mark.parametrize("case", cases(UNITS), ids=lambda case: f"{case.unit}, {case.name}")
def test_other_compilers_give_the_same(
    case: Case, scratch: Path, unpacked: dict[str, Path], natively: dict[str, dict[str, Floats]]
) -> None:
    """This machine's own compiler against zig."""
    compiler = next((name for name in ("gcc", "cc", "clang") if shutil.which(name)), None)
    if compiler is None:
        pytest.skip("no C compiler but zig on this machine")
    library = scratch / compiler / f"{case.unit}.so"
    if not library.is_file():
        library.parent.mkdir(exist_ok=True)
        sources = unpacked[case.unit] / "sources"
        flags = [
            "-std=c99",
            "-O2",
            "-fPIC",
            "-shared",
            "-fvisibility=hidden",
            "-ffp-contract=off",
            f"-I{hosts.HEADERS}",
        ]
        files = sorted(path.name for path in sources.glob("*.c"))
        subprocess.run([compiler, *flags, *files, "-lm", "-o", str(library)], cwd=sources, check=True)
    host = hosts.host("linux64", scratch)
    found = hosts.drive(host, hosts.compile_program(host, scratch), library, unpacked[case.unit], case, scratch)
    _compare(case, f"linux64 by {compiler}", found, natively[f"{case.unit}: {case.name}"])


# --- what no program here can run


@pytest.mark.parametrize("unit", UNITS)
def test_archives_hold_every_platform(unit: str, unpacked: dict[str, Path]) -> None:
    found = sorted(path.relative_to(unpacked[unit]).as_posix() for path in unpacked[unit].glob("binaries/*/*"))
    assert found == sorted(f"binaries/{name}/{unit}{target.suffix}" for name, target in targets.ALL.items())
    for name, target in targets.ALL.items():
        content = _library(unpacked, unit, name).read_bytes()
        own = portable.own_functions(unit, unpacked[unit] / "sources")
        assert portable.problems(content, target, own=own) == []
        for trace in (str(checkout.PROJECT), str(Path.home()) + "/", "packager-", "ziglang", "/tmp/"):
            assert trace.encode() not in content, (name, trace)


@pytest.mark.parametrize("unit", UNITS)
def test_libraries_for_macos(unit: str, unpacked: dict[str, Path]) -> None:
    both = _library(unpacked, unit, "darwin64").read_bytes()
    arm = _library(unpacked, unit, "aarch64-darwin").read_bytes()
    slices = universal.split(both)
    assert slices[1] == arm  # copied as it is, signature and all
    assert [part.processor for part in binary.read(both)] == ["x86_64", "aarch64"]
    for part in binary.read(both):
        assert part.name == f"@rpath/{unit}.dylib"
        assert part.oldest_system == targets.OLDEST_MACOS
        assert part.libraries == ("/usr/lib/libSystem.B.dylib",)
    assert signature.pages_that_differ(arm) == []
    at = both.index(b"fmi2DoStep", len(both) - len(arm))
    altered = both[:at] + b"F" + both[at + 1 :]
    assert len(signature.pages_that_differ(universal.split(altered)[1])) == 1


@pytest.mark.parametrize("unit", UNITS)
def test_rebuilding_gives_the_same_bytes(unit: str, tmp_path: Path) -> None:
    """In another folder; the archives were built by the same zig in theirs."""
    compiler = tuple(hosts.zig())
    assert toolchain.is_zig(compiler)
    unpacked = build.load(build.unit_directory(unit), compiler)
    again = tmp_path / "höhe 2" / f"{unit}.fmu"
    build.build(unpacked, again, compiler, tmp_path / "höhe 2", targets=tuple(targets.ALL.values()))
    assert again.read_bytes() == (ARCHIVES / f"{unit}.fmu").read_bytes()
