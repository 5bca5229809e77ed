"""The built archives: what importers find in them, and that binary, description and resources agree."""

import html
import math
import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest
import yaml
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from lxml import etree

from fmu.unpacked import PLATFORM, RESOURCES, ROOT, Archive, axes, declared, expected_variables, initialize, instantiate

# --- the archive as a file


def test_fmpy_finds_nothing_to_complain_about(archive: Archive) -> None:
    assert validate_fmu(str(archive.path)) == []


def test_description_follows_the_schema_of_the_standard(archive: Archive) -> None:
    schema = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    etree.XMLSchema(file=str(schema)).assertValid(etree.parse(archive.folder / "modelDescription.xml"))


def test_archive_has_its_parts_and_no_trace_of_this_machine(archive: Archive) -> None:
    with zipfile.ZipFile(archive.path) as opened:
        assert opened.testzip() is None
        names = opened.namelist()
        assert names == sorted(set(names))
        assert all(re.fullmatch(r"[\w./-]+", name) and not name.startswith("/") and ".." not in name for name in names)
        assert {entry.date_time for entry in opened.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        for entry in opened.infolist():
            for trace in (str(ROOT), str(Path.home()), "packager-"):
                assert trace == "/" or trace.encode() not in opened.read(entry), (entry.filename, trace)
    expected = {"modelDescription.xml", "documentation/index.html", "documentation/licenses/license.txt"}
    expected |= {"sources/variables.json", "sources/buildDescription.xml"}
    expected |= {f"binaries/{PLATFORM.folder}/{archive.unit}{PLATFORM.suffix}", "sources/functions.c"}
    expected |= {f"resources/{name}" for name in RESOURCES.get(archive.unit, ()) if name.endswith(".csv")}
    assert expected <= set(names)
    assert {name.split("/")[0] for name in names} <= {
        *("modelDescription.xml", "binaries", "documentation", "resources", "sources"),
        *("model.png", "terminalsAndIcons", "extra"),
    }


# --- description against declaration and binary


def test_every_declared_variable_is_described(archive: Archive) -> None:
    found = list(archive.variables().values())
    expected = expected_variables(archive)
    assert [each.attrib["name"] for each in found] == [row["name"] for row in expected]
    assert [int(each.attrib["valueReference"]) for each in found] == list(range(len(expected)))
    for element, row in zip(found, expected, strict=True):
        (typed,) = element
        attributes = element.attrib
        assert typed.tag == row["kind"].capitalize()
        for key in ("causality", "variability", "description"):
            assert attributes[key] == row[key], row["name"]
        assert typed.get("unit", "") == row["unit"]
        for bound in ("min", "max"):
            assert (bound in typed.attrib) == (row[bound] != f"NO_{bound.upper()}"), row["name"]
            assert bound not in typed.attrib or float(typed.attrib[bound]) == float(row[bound])
        if row["causality"] in ("output", "local"):
            assert "start" not in typed.attrib
            assert attributes["initial"] == "calculated"
        elif row["kind"] == "STRING":
            assert typed.attrib["start"] == row["start"]
        elif row["kind"] == "BOOLEAN":
            assert typed.attrib["start"] == {"0": "false", "1": "true"}[row["start"]]
        else:
            assert float(typed.attrib["start"]) == float(row["start"])


def test_units_and_types_are_defined(archive: Archive) -> None:
    root = archive.description
    defined = {
        element.attrib["name"]: {each.attrib["name"] for each in element.iterfind("DisplayUnit")}
        for element in root.iterfind("UnitDefinitions/Unit")
    }
    types = {element.attrib["name"]: element[0] for element in root.iterfind("TypeDefinitions/SimpleType")}
    reals = [element[0] for element in archive.variables().values() if element[0].tag == "Real"]
    assert reals
    assert not set(types) & set(archive.variables())  # the standard wants both unique together
    for real in (*reals, *types.values()):
        assert real.attrib["unit"] in defined
        assert "displayUnit" not in real.attrib or real.attrib["displayUnit"] in defined[real.attrib["unit"]]
    for real in reals:
        if real.attrib["unit"] in ("1/m", "1/m^2"):
            continue  # of straightness alone: no quantity that has a name
        assert types[real.attrib["declaredType"]].attrib["unit"] == real.attrib["unit"]
    assert len({each.attrib["unit"] for each in types.values()}) == len(types)


def test_a_variables_display_unit_is_that_of_its_row(archive: Archive) -> None:
    """As importers find it: the variable's own, else its type's, else the unit."""
    types = {each.attrib["name"]: each[0] for each in archive.description.iterfind("TypeDefinitions/SimpleType")}
    rows = [row for row in expected_variables(archive) if row["kind"] == "REAL"]
    for row in rows:
        real = archive.variables()[row["name"]][0]
        own = types[real.attrib["declaredType"]] if "declaredType" in real.attrib else real
        inherited = own.get("displayUnit", real.attrib["unit"])
        assert real.get("displayUnit", inherited) == row["display"], row["name"]


def _structure(archive: Archive, part: str) -> dict[int, set[int]]:
    """Index of each unknown -> indices it depends on."""
    unknowns = archive.description.findall(f"ModelStructure/{part}/Unknown")
    return {int(each.attrib["index"]): {int(i) for i in each.attrib["dependencies"].split()} for each in unknowns}


def test_structure_tells_the_direct_feedthrough(archive: Archive) -> None:
    rows = expected_variables(archive)
    index = {row["name"]: i for i, row in enumerate(rows, 1)}
    parameters = {index[row["name"]] for row in rows if row["causality"] == "parameter"}
    outputs: dict[int, set[int]] = {}
    initial: dict[int, set[int]] = {}
    for row in (row for row in rows if row["causality"] == "output"):
        axis = row["name"].rpartition(".")[0]
        names = {name: name.strip("()") for name in row["depends"].split()}
        found = {name: index.get(f"{axis}.{plain}") or index[plain] for name, plain in names.items()}
        outputs[index[row["name"]]] = {i for name, i in found.items() if not name.startswith("(")}
        initial[index[row["name"]]] = {*found.values(), *parameters}
    assert _structure(archive, "Outputs") == outputs
    assert _structure(archive, "InitialUnknowns") == initial
    for unknown in archive.description.findall("ModelStructure/*/Unknown"):
        assert len(unknown.attrib["dependencies"].split()) == len(unknown.attrib["dependenciesKind"].split())


def test_guid_is_the_hash_of_table_and_resources(archive: Archive) -> None:
    rows = sorted(declared(archive.unit), key=lambda row: bool(row["axis"]))
    keys = ("name", "kind", "causality", "variability", "start", "unit", "min", "max")
    text = "".join("|".join(row[key] for key in keys) + "\n" for row in rows)
    packed = b"".join(
        path.read_bytes()
        for path in (archive.folder / "resources" / name for name in RESOURCES.get(archive.unit, ()))
        if path.exists()
    )
    halves = []
    for data in (text.encode(), packed):
        digest = 14695981039346656037
        for byte in data:
            digest = (digest ^ byte) * 1099511628211 % 2**64
        halves.append(f"{digest:016x}")
    assert archive.guid == "-".join(halves)


def test_binary_starts_with_the_described_values(archive: Archive) -> None:
    slave = instantiate(archive)
    try:
        initialize(slave)
        for name, element in archive.variables().items():
            reference, typed = [int(element.attrib["valueReference"])], element[0]
            start: Any = typed.get("start")
            match typed.tag:
                case "Real":
                    (value,) = slave.getReal(reference)
                    assert start is None or value == float(start), name
                    assert math.isfinite(value), name
                case "Integer":
                    (value,) = slave.getInteger(reference)
                    assert start is None or value == int(start), name
                case "Boolean":
                    (value,) = slave.getBoolean(reference)
                    assert start is None or value == (start == "true"), name
                case "String":
                    assert slave.getString(reference) == [start.encode()], name
    finally:
        slave.freeInstance()


def test_initial_values_depend_on_the_inputs_that_are_told(archive: Archive) -> None:
    elements = archive.variables().values()
    outputs = [
        (int(each.attrib["valueReference"]), each[0].tag) for each in elements if each.attrib["causality"] == "output"
    ]
    inputs = [
        (int(each.attrib["valueReference"]), each[0].tag) for each in elements if each.attrib["causality"] == "input"
    ]

    def values(slave: FMU2Slave) -> list[float]:
        return [(slave.getReal if tag == "Real" else slave.getBoolean)([reference])[0] for reference, tag in outputs]

    found: dict[int, set[int]] = {reference + 1: set() for reference, _ in outputs}
    for reference, kind in inputs:
        slave = instantiate(archive)
        try:
            initialize(slave, archive)
            before = values(slave)
            if kind == "Real":
                slave.setReal([reference], [0.37])
            else:
                slave.setBoolean([reference], [not slave.getBoolean([reference])[0]])
            for (output, _), old, new in zip(outputs, before, values(slave), strict=True):
                if new != old:
                    found[output + 1].add(reference + 1)
        finally:
            slave.freeInstance()
    candidates = {reference + 1 for reference, _ in inputs}
    told = {index: known & candidates for index, known in _structure(archive, "InitialUnknowns").items()}
    names = {int(each.attrib["valueReference"]) + 1: each.attrib["name"] for each in elements}
    for index, known in told.items():  # n_a moves x_m through a hysteresis of measuring, which is off by default
        assert found[index] <= known <= found[index] | {k for k in known if (names[index], names[k]) == ("x_m", "n_a")}


def _one_digit_off(guid: str, digit: int) -> str:
    return guid[:digit] + ("0" if guid[digit] != "0" else "1") + guid[digit + 1 :]


def test_archive_of_another_table_is_refused(archive: Archive) -> None:
    with pytest.raises(Exception, match="instantiate"):
        instantiate(archive, guid=_one_digit_off(archive.guid, 0))


def test_archive_of_other_resources_is_refused(archive: Archive) -> None:
    with pytest.raises(Exception, match="instantiate"):
        instantiate(archive, guid=_one_digit_off(archive.guid, 17))


# What a unit exports besides the functions of the standard.
OWN_FUNCTIONS = {unit: {f"{unit}_responses", f"{unit}_free_axis"} for unit in ("friction", "friction_gms")}


def test_exactly_the_functions_of_the_standard_are_exported(archive: Archive) -> None:
    if PLATFORM.suffix != ".so" or not shutil.which("nm"):
        pytest.skip("needs nm and an ELF library")
    header = (ROOT / "src/fmi2/standard/fmi2Functions.h").read_text(encoding="utf-8")
    common, model_exchange = header[header.index("Inquire version numbers") :].split(
        "Functions for FMI2 for Model Exchange"
    )
    co_simulation = model_exchange.split("Functions for FMI2 for Co-Simulation")[1]
    wanted = set(re.findall(r"FMI2_Export\s+\w+TYPE\s+(fmi2\w+);", common + co_simulation))
    assert len(wanted) == 25 + 9  # the standard's common functions and those for co-simulation
    lines = subprocess.run(
        ["nm", "-D", "--defined-only", str(archive.library)], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert {line.split()[-1] for line in lines} == wanted | OWN_FUNCTIONS.get(archive.unit, set())


def test_default_axes_are_the_pose_of_the_default_machine() -> None:
    path = ROOT / "scenarios/machines/test_centre/machine.yaml"
    if not path.is_file():
        pytest.skip("machine.yaml is not there")
    pose = yaml.safe_load(path.read_text(encoding="utf-8"))["pose"]
    scale = {"m": 1.0, "mm": 1e-3}
    stated = {axis: float(text.split()[0]) * scale[text.split()[1]] for axis, text in pose.items()}
    packed = {axis: float(x_0) for axis, x_0 in axes()}  # of the sources
    assert packed.keys() == stated.keys()
    # mm to m costs at most one rounding.
    assert all(math.isclose(packed[axis], stated[axis], rel_tol=3e-16) for axis in packed)


def test_capabilities_are_those_of_the_variables(archive: Archive) -> None:
    """All inputs can be interpolated, be there none of them; outputs have slopes where they are continuous. The binary
    answers accordingly: slopes of inputs are taken, those of held outputs would be 0."""
    rows = [
        (each[0].tag, each.attrib["causality"], each.attrib["variability"]) for each in archive.variables().values()
    ]
    inputs = any(row[:2] == ("Real", "input") for row in rows)
    continuous = ("Real", "output", "continuous") in rows
    attributes = archive.description.find("CoSimulation").attrib
    told = [attributes[name] for name in ("canInterpolateInputs", "providesDirectionalDerivative")]
    assert told == ["true"] * 2
    assert attributes["maxOutputDerivativeOrder"] == str(int(continuous))
    assert (inputs, continuous) == ((False, False) if archive.unit == "setpoint" else (True, True))
    slave = instantiate(archive)
    try:
        initialize(slave)
        slave.exitInitializationMode()
        known, held, sloped = (
            [
                int(each.attrib["valueReference"])
                for each, row in zip(archive.variables().values(), rows, strict=True)
                if row in wanted
            ]
            for wanted in (
                {("Real", "input", "continuous"), ("Real", "input", "discrete")},
                {("Real", "output", "discrete")},
                {("Real", "output", "continuous")},
            )
        )
        slave.setRealInputDerivatives(known, [1] * len(known), [0.0] * len(known))
        assert len(slave.getDirectionalDerivative(held + sloped, known, [1.0] * len(known))) == len(held + sloped)
        if sloped:
            assert all(map(math.isfinite, slave.getRealOutputDerivatives(sloped, [1] * len(sloped))))
        if held:
            assert not any(slave.getRealOutputDerivatives(held, [1] * len(held)))
    finally:
        slave.freeInstance()


# --- documentation


def test_documentation_is_whole_and_self_contained(archive: Archive) -> None:
    text = (archive.folder / "documentation/index.html").read_text(encoding="utf-8")
    for name in archive.variables():
        assert f"<code>{name}</code>" in text
    assert not re.search(r"<(script|link|img|iframe)\b", text)
    assert not re.search(r"@import|url\(", text)
    local = re.findall(r"""href="(?!https?:|mailto:|#)(.*?)\"""", text)
    if (ROOT / "tests/reference" / archive.unit).is_dir():
        _check_page_of_references(archive, local)
    assert "of a synthetic default machine" in text
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert licence in (archive.folder / "documentation/licenses/license.txt").read_text(encoding="utf-8")
    assert "2-Clause BSD License" in (archive.folder / "documentation/licenses/fmi-headers.txt").read_text("utf-8")
    readme = ROOT / "src" / f"{archive.unit}_fmu" / "README.md"
    if readme.is_file():
        heading = re.sub(r"[#*`]", "", readme.read_text(encoding="utf-8").splitlines()[0]).strip()
        (shown,) = re.findall(r"<h1>(.*?)</h1>", text)
        assert html.unescape(re.sub(r"<[^>]*>", "", shown)) == heading


def _check_page_of_references(archive: Archive, local: list[str]) -> None:
    assert local == ["fmi-ls-ref.html"]  # the page that FMI-LS-REF recommends
    references = (archive.folder / "documentation/fmi-ls-ref.html").read_text(encoding="utf-8")
    assert not re.search(r"""<(script|link|img|iframe)\b|@import|url\(|href=(?!"(https?:|mailto:|#))""", references)
    readme = (archive.folder / "extra/org.fmi-standard.fmi-ls-ref/README.md").read_text(encoding="utf-8")
    heading = readme.splitlines()[0].strip("# ")
    assert f"<h1>{html.escape(heading)}</h1>" in references
