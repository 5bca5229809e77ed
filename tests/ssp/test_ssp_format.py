"""What an SSP file looks like to others: names, order, places, what is inside, other readers and writers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import ssp_helpers
from feedsim import scenario
from feedsim.simulation import ssp
from ssp_helpers import STRUCTURE


def test_names_and_master_are_as_omsimulator_reads_them(exported: Path) -> None:
    """Its expression for identifiers, and the first annotation of the system, by the prefixes that it compares."""
    text = ssp_helpers.contents(exported)["SystemStructure.ssd"].decode()
    names = re.findall(r'<ssd:(?:SystemStructureDescription|System|Component) [^>]*?\bname="([^"]*)"', text)
    assert len(names) == 2 + 8
    assert all(re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_-]*", name) for name in names), names
    system = text[text.index("<ssd:System ") : text.index("</ssd:System>")]
    opening = r'<ssd:Annotations> <ssc:Annotation type="([^"]*)"> <oms:Annotations> <oms:SimulationInformation> '
    master = r'<oms:FixedStepMaster description="oms-ma" stepSize="([^"]*)"'
    first = re.search(opening + master, " ".join(system.split()))
    assert first is not None
    assert (first[1], float(first[2])) == ("org.openmodelica", 125e-6)


def test_two_writings_are_the_same_bytes(exported: Path, short: Path, fmus: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.ssp"
    ssp.export(scenario.load(short), again, fmus=fmus)
    assert again.read_bytes() == exported.read_bytes()


def test_every_file_that_one_edits_says_whose_numbers_it_holds(exported: Path) -> None:
    sets = {name: text for name, text in ssp_helpers.contents(exported).items() if name.endswith(".ssv")}
    assert len(sets) == 7  # plant; controller and friction of three axes
    for name, content in sets.items():
        root = ElementTree.fromstring(content)
        assert root.get("description", "").startswith("Synthetic machine;"), name


def test_components_have_places_of_their_own_in_pictures(exported: Path) -> None:
    """The geometry of the standard: no two components overlap, and the signal flows from the left to the right."""
    from xml.etree import ElementTree

    space = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
    root = ElementTree.fromstring(ssp_helpers.contents(exported)[STRUCTURE])
    boxes = {}
    for component in root.iter(f"{space}Component"):
        geometry = component.find(f"{space}ElementGeometry")
        assert geometry is not None
        boxes[component.get("name")] = tuple(float(geometry.get(corner, "nan")) for corner in ("x1", "y1", "x2", "y2"))
    assert len(boxes) == 8
    for name, (x1, y1, x2, y2) in boxes.items():
        assert x1 < x2
        assert y1 < y2
        for other, (a1, b1, a2, b2) in boxes.items():
            assert name == other or x2 <= a1 or a2 <= x1 or y2 <= b1 or b2 <= y1, (name, other)
    assert boxes["setpoint"][2] < boxes["controller_X"][0] < boxes["plant"][0] < boxes["friction_X"][0]
    assert boxes["controller_X"][1] > boxes["controller_Y"][1] > boxes["controller_Z"][1]


def test_what_is_inside(exported: Path) -> None:
    """The schemas of the standard, as FMPy carries them, and its reader."""
    pytest.importorskip("lxml")
    from fmpy.ssp.ssd import read_ssd

    read: Any = read_ssd(str(exported), validate=True)  # system structure and every parameter set
    assert [element.name for element in read.system.elements] == [
        "setpoint", "controller_X", "controller_Y", "controller_Z", "plant", "friction_X", "friction_Y", "friction_Z",
    ]  # fmt: skip
    assert len(read.system.connections) == 8 * 3
    values = {
        f"{element.name}.{parameter.name}": (parameter.value, parameter.unit)
        for element in read.system.elements
        for binding in element.parameterBindings
        for given in binding.parameterValues
        for parameter in given.parameters
    }
    assert values["friction_Z.F_C"] == ("1.6", "N.m")
    assert values["controller_X.K_p"] == ("21.59", "N.m.s/rad")
    assert values["plant.Z.x_0"] == ("0.1", "m")
    assert {unit.name for unit in read.units} >= {"m", "rad/s", "N.m"}


def test_another_reader_of_the_standard_agrees(exported: Path) -> None:
    """pyssp-standard: schemas of its own, parameters and units."""
    pytest.importorskip("pyssp_standard")
    from pyssp_standard.ssp import SSP

    with SSP(str(exported), mode="r") as package:
        assert {"plant.fmu", "controller.fmu", "friction.fmu", "setpoint.fmu", "friction_X.ssv"} <= set(
            package.resources
        )
        with package.system_structure as structure:
            assert len(structure.system.elements) == 8
            assert len(structure.system.connections) == 24


@pytest.mark.parametrize(
    ("place", "source"),
    [
        ("resources/my friction.fmu", "resources/my%20friction.fmu"),
        ("resources/my friction.fmu", "./resources/./my%20friction.fmu"),
        ("resources/my friction.fmu", "resources/other/../my%20friction.fmu"),
        ("resources/reibung_\xfc#1.fmu", "resources/reibung_%C3%BC%231.fmu"),
        ("resources/100%.fmu", "resources/100%25.fmu"),
        ("resources/as it is.fmu", "resources/as it is.fmu"),  # as some programs write it
        ("resources/as%20it%20is.fmu", "resources/as%20it%20is.fmu"),
    ],
)
def test_sources_are_uris(place: str, source: str, exported: Path, tmp_path: Path) -> None:
    """Of units and of sets of parameters; the system is the same."""
    files = {}
    for name, content in ssp_helpers.contents(exported).items():
        if name == STRUCTURE:
            content = content.replace(b"resources/friction.fmu", source.encode())
            content = content.replace(b"resources/plant.ssv", source.replace(".fmu", ".ssv").encode())
        name = place if name == "resources/friction.fmu" else name
        files[place.replace(".fmu", ".ssv") if name == "resources/plant.ssv" else name] = content
    with ssp.open_system(exported) as plain, ssp.open_system(ssp_helpers.write(tmp_path / "uri.ssp", files)) as opened:
        assert opened.scenario.machine.axes == plain.scenario.machine.axes


@pytest.mark.parametrize("name", ["resources/my friction.fmu", "resources/reibung_\xfc#1?.fmu", "resources/100%25.fmu"])
def test_names_are_written_as_uris(name: str) -> None:
    from urllib.parse import unquote

    from feedsim.simulation.ssp.archive import as_source, resolve_source

    source = as_source(name)
    assert source.isascii()
    assert not {" ", "#", "?"} & {*source}
    assert unquote(source) == name == resolve_source(source, {name})
