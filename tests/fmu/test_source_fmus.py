"""Archives as source code: compiled by an importer, and linked into one program, they give what their binaries give."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from feedsim_packager import toolchain
from fmu.unpacked import PLATFORM, UNITS, Archive, unpack
from platforms import hosts
from platforms.cases import Floats, cases

pytestmark = [
    pytest.mark.extensive,
    pytest.mark.skipif(PLATFORM.suffix != ".so", reason="the driving program here is one for Linux"),
]
FUNCTIONS = (
    *("Instantiate", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode", "SetReal", "GetReal"),
    *("SetRealInputDerivatives", "DoStep", "Terminate", "FreeInstance"),
)


def _compile(*arguments: str, folder: Path) -> None:
    command = [*toolchain.find_compiler(), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def _is_gcc() -> bool:
    """Of the packager and of CMake, which takes CC or cc."""
    told = subprocess.run([*toolchain.find_compiler(), "--version"], capture_output=True, text=True, check=False)
    return "Free Software Foundation" in told.stdout


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Loads a shared library and drives it. Linked with the mathematics, as Python is: FMPy compiles units without
    naming that library, and a program that lacks it could not load them."""
    folder = tmp_path_factory.mktemp("drive")
    last = ["-o", "drive", "-ldl", "-Wl,--no-as-needed", "-lm"]
    _compile(*hosts.FLAGS, f"-I{hosts.HEADERS}", str(hosts.HERE / "drive.c"), *last, folder=folder)
    return folder / "drive"


HOST = hosts.Host(PLATFORM.folder, ())


@pytest.mark.skipif(not shutil.which("cmake"), reason="FMPy compiles by CMake, which is not installed")
def test_fmpy_compiles_an_archive_without_binaries(archive: Archive, program: Path, tmp_path: Path) -> None:
    """FMPy's own optimisation, and no option of the packager's. On a processor that contracts no multiplications and
    additions by default, the same operations in the same order come of it: equal numbers, to the last bit. On others,
    and with a compiler that computes a constant by another library, the last digits may differ."""
    exactly = PLATFORM.folder == "linux64" and _is_gcc()
    bare = tmp_path / f"{archive.unit}.fmu"
    with zipfile.ZipFile(archive.path) as whole, zipfile.ZipFile(bare, "w") as opened:
        for name in whole.namelist():
            if not name.startswith("binaries/"):
                opened.writestr(name, whole.read(name))
    command = [str(Path(sys.executable).parent / "fmpy"), "compile", str(bare)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(bare) as opened:
        opened.extractall(tmp_path / "rebuilt")
    library = next((tmp_path / "rebuilt" / "binaries").glob(f"*/{archive.unit}.*"))
    assert library.name == archive.library.name
    for case in cases((archive.unit,)):
        delivered, rebuilt = (
            hosts.drive(HOST, program, path, archive.folder, case, tmp_path) for path in (archive.library, library)
        )
        assert delivered.keys() == rebuilt.keys()
        assert any(np.ptp(values) > 0 for values in delivered.values()), "the case moves nothing"
        for name, values in delivered.items():
            if exactly:
                assert np.array_equal(rebuilt[name], values), (case.name, name)
            scale = float(np.max(np.abs(values)))
            assert np.max(np.abs(rebuilt[name] - values)) <= 1e-12 * scale, (case.name, name)


def test_all_units_run_in_one_program(fmus: Path, program: Path, tmp_path: Path) -> None:
    """Every unit's flat sources with its FMI2_FUNCTION_PREFIX, linked statically, without resource files: each steps
    through its cases and gives, to the last bit, what a shared library of the same sources and compiler gives."""
    flags, include = ["-std=c99", "-O2", "-ffp-contract=off"], f"-I{hosts.HEADERS}"
    expected: list[dict[str, Floats]] = []
    arguments: list[str] = []
    read: list[list[str]] = []
    objects: list[str] = []
    for unit in UNITS:
        archive = unpack(unit, fmus, tmp_path / unit)
        sources, built = archive.folder / "sources", tmp_path / f"{unit} built"
        assert all(path.is_file() for path in sources.iterdir())  # flat
        built.mkdir()
        prefix = f"-DFMI2_FUNCTION_PREFIX={unit}_"
        files = [str(sources / name) for name in archive.source_files]
        _compile(*flags, prefix, include, "-c", *files, folder=built)
        objects += map(str, sorted(built.glob("*.o")))
        library = built / f"{unit}.so"
        _compile(*flags, "-shared", "-fPIC", include, *archive.source_files, "-lm", "-o", str(library), folder=sources)
        for i, case in enumerate(cases((unit,))):
            script = tmp_path / f"{unit} {i}.txt"
            read.append(hosts.write_script(script, case, archive.folder, "-"))
            arguments += [unit, str(script), str(script.with_suffix(".out"))]
            expected.append(hosts.drive(HOST, program, library, archive.folder, case, tmp_path))
    lines = ['#include "fmi2FunctionTypes.h"']
    lines += [f"fmi2{name}TYPE {unit}_fmi2{name};" for unit in UNITS for name in FUNCTIONS]
    lines += [
        "static const struct {",
        "    const char *unit, *name;",
        "    void (*address)(void);",
        "} static_units[] = {",
    ]
    lines += [f'{{"{u}", "fmi2{name}", (void (*)(void)){u}_fmi2{name}}},' for u in UNITS for name in FUNCTIONS]
    (tmp_path / "static_units.h").write_text("\n".join([*lines, "{0, 0, 0}};", ""]), encoding="ascii")
    source = str(hosts.HERE / "drive.c")
    _compile(
        *hosts.FLAGS, "-DSTATIC_UNITS", "-I.", include, source, *objects, "-lm", "-o", "one program", folder=tmp_path
    )
    done = subprocess.run([str(tmp_path / "one program"), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for names, result, values in zip(read, arguments[2::3], expected, strict=True):
        found = hosts.read_result(Path(result), names)
        assert any(np.ptp(each) > 0 for each in found.values()), "the case moves nothing"
        for name in names:
            assert np.array_equal(found[name], values[name]), (result, name)
