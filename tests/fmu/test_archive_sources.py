"""Archives from their sources: byte-identical rebuilds, builds by others, all units in one program, another machine."""

import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import pytest
from lxml import etree

from feedsim_packager import build, checkout, compile, machine_tables, toolchain, variables
from fmu.unpacked import PLATFORM, UNITS, Archive, initialize, instantiate, unpack

HEADERS = f"-I{checkout.STANDARD}"  # an importer has them


@pytest.mark.extensive
def test_rebuilding_gives_the_same_bytes(unit: str, tmp_path: Path) -> None:
    compiler = toolchain.find_compiler()
    for name in ("first", "a longer name"):  # other folders, other paths
        loaded = build.load(build.unit_directory(unit), compiler)
        build.build(loaded, tmp_path / name / f"{unit}.fmu", compiler, tmp_path / name / "staged")
    first, second = ((tmp_path / name / f"{unit}.fmu").read_bytes() for name in ("first", "a longer name"))
    assert first == second


# --- sources


def _compiler() -> list[str]:
    return list(toolchain.find_compiler())


def test_sources_compile_without_a_warning(archive: Archive, tmp_path: Path) -> None:
    flags = [*compile.FLAGS, "-pedantic", "-Werror", HEADERS, "-c"]
    for source in archive.source_files:
        target = str(tmp_path / f"{Path(source).stem}.o")
        done = subprocess.run(
            [*_compiler(), *flags, source, "-o", target],
            cwd=archive.folder / "sources",
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == 0, done.stderr


@pytest.mark.extensive
def test_sources_compile_as_one_file_without_a_warning_and_to_the_same_tables(archive: Archive, tmp_path: Path) -> None:
    """As zig is given them: a macro that one file leaves behind is another file's."""
    sources = archive.folder / "sources"
    text, apart = toolchain.together(archive.source_files)
    whole = tmp_path / "whole.c"
    whole.write_text(text, encoding="utf-8")
    rebuilt = tmp_path / "unpacked"
    shutil.copytree(archive.folder, rebuilt)
    library = rebuilt / "binaries" / PLATFORM.folder / archive.library.name
    library.unlink()
    flags = [*compile.FLAGS, "-pedantic", "-Werror", HEADERS, "-I."]
    done = subprocess.run(
        [*_compiler(), *flags, "-shared", str(whole), *apart, "-lm", "-o", str(library)],
        cwd=sources, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    slave = instantiate(archive, rebuilt)  # the GUID holds the table's hash
    slave.freeInstance()


@pytest.mark.extensive
def test_sources_build_by_themselves(archive: Archive, tmp_path: Path) -> None:
    """As an importer of source-code FMUs does it: the files that the description lists, no definition, no option but
    where its own headers are."""
    sources = archive.folder / "sources"
    assert set(archive.source_files) == {path.name for path in sources.glob("*.c")}
    rebuilt = tmp_path / "unpacked"
    shutil.copytree(archive.folder, rebuilt)
    library = rebuilt / "binaries" / PLATFORM.folder / archive.library.name
    library.unlink()
    command = [*_compiler(), "-shared", "-fPIC", HEADERS, *archive.source_files, "-lm", "-o", str(library)]
    subprocess.run(command, cwd=sources, check=True)
    slave = instantiate(archive, rebuilt)
    try:
        initialize(slave)
        slave.exitInitializationMode()
        slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=125e-6)
    finally:
        slave.freeInstance()


def test_the_headers_of_the_standard_are_left_to_the_importer(archive: Archive) -> None:
    """FMI 2.0, section 2.3: all headers but fmi2Functions.h, fmi2FunctionTypes.h and fmi2TypesPlatform.h."""
    assert [path.name for path in (archive.folder / "sources").iterdir() if path.name.startswith("fmi2")] == []


@pytest.mark.extensive
def test_build_description_says_how_to_compile(archive: Archive, tmp_path: Path) -> None:
    path = archive.folder / "sources/buildDescription.xml"
    schema = Path(fmpy.__file__).parent / "schema/fmi3/fmi3BuildDescription.xsd"
    etree.XMLSchema(file=str(schema)).assertValid(etree.parse(path))
    (configuration,) = fmpy.model_description.read_build_description(str(archive.folder))
    assert configuration.modelIdentifier == archive.unit
    (files,) = configuration.sourceFileSets
    assert files.language == "C99"
    assert sorted(files.sourceFiles) == sorted(archive.source_files)
    root = ET.parse(path).getroot()
    options = root.findall("BuildConfiguration/SourceFileSet")[0].attrib["compilerOptions"].split()
    libraries = [f"-l{each.attrib['name']}" for each in root.iterfind("BuildConfiguration/Library")]
    assert (options, libraries) == (["-std=c99", "-ffp-contract=off"], ["-lm"])
    # What it says is enough: nothing stays undefined.
    whole = ["-shared", "-fPIC", "-Wl,--no-undefined"] if PLATFORM.suffix == ".so" else ["-shared", "-fPIC"]
    command = [*_compiler(), *options, *whole, HEADERS, *files.sourceFiles, *libraries, "-o", str(tmp_path / "unit")]
    subprocess.run(command, cwd=archive.folder / "sources", check=True)


PROGRAM = """\
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

fmi2InstantiateTYPE plant_fmi2Instantiate, controller_fmi2Instantiate, friction_fmi2Instantiate,
    friction_gms_fmi2Instantiate, setpoint_fmi2Instantiate, machine_fmi2Instantiate;
fmi2FreeInstanceTYPE plant_fmi2FreeInstance, controller_fmi2FreeInstance, friction_fmi2FreeInstance,
    friction_gms_fmi2FreeInstance, setpoint_fmi2FreeInstance, machine_fmi2FreeInstance;

static int try(fmi2InstantiateTYPE *instantiate, fmi2FreeInstanceTYPE *release, const char *guid) {
    const fmi2CallbackFunctions callbacks = {NULL, calloc, free, NULL, NULL};
    fmi2Component component = instantiate("static", fmi2CoSimulation, guid, NULL, &callbacks, 0, 0);
    if (component == NULL)
        return 1;
    release(component);
    return 0;
}

int main(int count, char **guids) {
    if (count != 7)
        return 2;
    return try(plant_fmi2Instantiate, plant_fmi2FreeInstance, guids[1]) +
           try(controller_fmi2Instantiate, controller_fmi2FreeInstance, guids[2]) +
           try(friction_fmi2Instantiate, friction_fmi2FreeInstance, guids[3]) +
           try(friction_gms_fmi2Instantiate, friction_gms_fmi2FreeInstance, guids[4]) +
           try(setpoint_fmi2Instantiate, setpoint_fmi2FreeInstance, guids[5]) +
           try(machine_fmi2Instantiate, machine_fmi2FreeInstance, guids[6]);
}
"""


@pytest.mark.extensive
def test_all_units_link_into_one_program(fmus: Path, tmp_path: Path) -> None:
    """Statically, each with its FMI2_FUNCTION_PREFIX; without resource files, hence with those embedded."""
    objects: list[Path] = []
    guids: list[str] = []
    for unit in UNITS:
        archive = unpack(unit, fmus, tmp_path / unit)
        guids.append(archive.guid)
        folder = tmp_path / unit / "sources"
        found = [(folder / name).with_suffix(".o") for name in archive.source_files]
        for source, compiled in zip(archive.source_files, found, strict=True):
            command = [*_compiler(), "-c", HEADERS, f"-DFMI2_FUNCTION_PREFIX={unit}_", source, "-o", str(compiled)]
            subprocess.run(command, cwd=folder, check=True)
        if shutil.which("nm"):
            listed = subprocess.run(
                ["nm", "-g", "--defined-only", "-P", *map(str, found)], capture_output=True, text=True, check=True
            ).stdout
            symbols = [line.split()[0] for line in listed.splitlines() if len(line.split()) > 1]
            assert symbols
            assert [symbol for symbol in symbols if not symbol.lstrip("_").startswith(f"{unit}_")] == []
        objects += found
    (tmp_path / "main.c").write_text(PROGRAM, encoding="utf-8")
    program = tmp_path / "program"
    subprocess.run(
        [*_compiler(), HEADERS, "main.c", *map(str, objects), "-lm", "-o", str(program)], cwd=tmp_path, check=True
    )
    assert subprocess.run([str(program), *guids]).returncode == 0


# --- another machine in the same binary


def test_another_machine_needs_no_compiler(plant: Archive, tmp_path: Path) -> None:
    """The plant's binary as it is, with the resources and the GUID of a machine of one axis."""
    (tmp_path / "axes.csv").write_text("axis,x_0 [m]\nW,0.25\n", encoding="utf-8")
    header = ",".join(machine_tables.modes_header(["W"]))
    (tmp_path / "modes.csv").write_text(
        f"{header}\n0,0,0,2,0.01,0.01,0,0\n1,50,0.02,1,0.005,0.004,0,0\n", encoding="utf-8"
    )
    given = machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv")
    loaded = build.load(build.unit_directory("plant"), toolchain.find_compiler())
    repacked = tmp_path / "unpacked"
    shutil.copytree(plant.folder, repacked)
    for path, content in given.files().items():
        (repacked / path).write_bytes(content)
    described = variables.expand(loaded.table, given)
    slave = instantiate(plant, repacked, guid=variables.guid(loaded.table, given))
    try:
        initialize(slave)
        (reference,) = (each.reference for each in described if each.name == "W.x_0")
        assert slave.getReal([reference]) == [0.25]
        with pytest.raises(Exception, match="fmi2GetReal"):
            slave.getReal([len(described)])  # there is no second axis
    finally:
        slave.freeInstance()


def test_staged_sources_that_are_also_another_folders_stay_as_they_are_there(tmp_path: Path) -> None:
    """A copy of a build folder by hard links, as of a whole checkout: a build here does not write into the other."""
    loaded = build.load(build.unit_directory("friction"), toolchain.find_compiler())
    there, here = tmp_path / "there", tmp_path / "here"
    for folder in (there, here):
        folder.mkdir()
    for name in loaded.sources:
        (there / name).write_text("another version")
        (here / name).hardlink_to(there / name)
    build._stage(loaded, here)
    assert {name: (here / name).read_bytes() for name in loaded.sources} == dict(loaded.sources)
    assert {(there / name).read_text() for name in loaded.sources} == {"another version"}
