"""Terminals and icons: by the schema of FMI 3.0, about variables that exist, and together they make the wiring."""

import io
import re
import shutil
import subprocess
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
import pytest
from lxml import etree
from PIL import Image

from feedsim.jobs.export import pack as pack_machine
from feedsim.simulation.cosim import system
from feedsim_packager import build, cli
from feedsim_packager.errors import InputError
from fmu.toy_table import toy
from fmu.unpacked import ROOT, Archive, axes, unpack
from machine_helpers import modes_csv

FILE = "terminalsAndIcons/terminalsAndIcons.xml"
AXES = tuple(name for name, _ in axes())


def terminals(archive: Archive) -> dict[str, ET.Element]:
    return {each.attrib["name"]: each for each in ET.parse(archive.folder / FILE).iterfind("Terminals/Terminal")}


def members(terminal: ET.Element) -> dict[str, str]:
    """Member name -> variable."""
    found = terminal.findall("TerminalMemberVariable")
    return {each.attrib["memberName"]: each.attrib["variableName"] for each in found}


# --- the file


def test_terminals_follow_the_schema_of_the_standard(archive: Archive) -> None:
    # FMI 2.0.4 refers to FMI 3.0, section 2.4.9, and ships no schema of its own.
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(file=str(schema)).assertValid(etree.parse(archive.folder / FILE))


def test_terminals_keep_the_rules_that_no_schema_knows(archive: Archive) -> None:
    variables = archive.variables()
    names = [each.attrib["name"] for each in ET.parse(archive.folder / FILE).iterfind("Terminals/Terminal")]
    assert names
    assert len(set(names)) == len(names)
    for terminal in terminals(archive).values():
        found = terminal.findall("TerminalMemberVariable")
        assert len(members(terminal)) == len(found)  # member names are unique
        for member in found:
            assert variables[member.attrib["variableName"]].attrib["causality"] in ("input", "output")
        picture = terminal.find("TerminalGraphicalRepresentation")
        assert picture is not None
        assert (archive.folder / "terminalsAndIcons" / f"{picture.attrib['iconBaseName']}.png").is_file()
    for path in (archive.folder / "terminalsAndIcons").glob("*.svg"):
        assert path.with_suffix(".png").is_file()  # an SVG is allowed beside a PNG only


def test_symbols_of_terminals_do_not_overlap(archive: Archive) -> None:
    corners = [
        [float(each.attrib[name]) for name in ("x1", "y1", "x2", "y2")]
        for each in ET.parse(archive.folder / FILE).iterfind("Terminals/Terminal/TerminalGraphicalRepresentation")
    ]
    for i, (x1, y1, x2, y2) in enumerate(corners):
        assert -120 < x1 < x2 < 120
        assert -120 < y1 < y2 < 120
        assert all(x2 <= u1 or u2 <= x1 or y2 <= v1 or v2 <= y1 for u1, v1, u2, v2 in corners[:i])


# --- what they group

DRIVE = ("M_a", "n_a", "x_a")
CONTACT = ("M_fr", "n_fr")
SETPOINT = ("x_s", "n_ffw", "release")
TOOL = ("F_X", "F_Y", "F_Z", "x_X", "x_Y", "x_Z")
EXPECTED: dict[str, dict[str, dict[str, str]]] = {
    "plant": {
        "tool": {name: f"tool.{name}" for name in TOOL},
        **{f"{axis}.motor": {name: f"{axis}.{name}" for name in DRIVE} for axis in AXES},
        **{f"{axis}.friction": {name: f"{axis}.{name}" for name in CONTACT} for axis in AXES},
    },
    "controller": {"setpoint": {name: name for name in SETPOINT}, "motor": {name: name for name in DRIVE}},
    "friction": {"friction": {name: name for name in CONTACT}},
    "friction_gms": {"friction": {name: name for name in CONTACT}},
    "setpoint": {f"{axis}.setpoint": {name: f"{axis}.{name}" for name in SETPOINT} for axis in AXES},
    "machine": {
        "tool": {name: f"tool.{name}" for name in TOOL},
        **{f"{axis}.setpoint": {name: f"{axis}.{name}" for name in SETPOINT} for axis in AXES},
    },
}


def test_a_unit_has_the_terminals_of_its_part_in_the_loop(archive: Archive) -> None:
    found = terminals(archive)
    assert {name: members(each) for name, each in found.items()} == EXPECTED[archive.unit]
    for name, each in found.items():
        # All of a pair or nothing; a model of the process may give some of the forces.
        assert each.attrib["matchingRule"] == ("bus" if name == "tool" else "plug")


def test_documentation_lists_the_terminals_with_their_variables(archive: Archive) -> None:
    text = (archive.folder / "documentation/index.html").read_text(encoding="utf-8")
    section = text.partition("<h2>Connections</h2>")[2].partition("</table>")[0]
    cells = [re.findall(r"<td>(.*?)</td>", row) for row in section.split("</tr>")]
    listed = {row[0]: [re.findall(r"<code>(.*?)</code>", cell) for cell in row[2:]] for row in cells if row}
    expected: dict[str, list[list[str]]] = {}
    for name, terminal in terminals(archive).items():
        causalities = {each: archive.variables()[each].attrib["causality"] for each in members(terminal).values()}
        expected[f"<code>{name}</code>"] = [
            [each for each, causality in causalities.items() if causality == wanted] for wanted in ("input", "output")
        ]
    assert listed == expected


@pytest.fixture(scope="module")
def units(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Archive]:
    return {unit: unpack(unit, fmus, tmp_path_factory.mktemp(unit)) for unit in EXPECTED}


def figure_2() -> set[tuple[system.Variable, system.Variable]]:
    """Input and what drives it; without the inputs that nothing does."""
    return {(each.target, each.source) for each in system.figure_2(AXES) if each.source.instance != system.ZERO}


def _plugged(
    first: tuple[str, Archive, str], second: tuple[str, Archive, str]
) -> Iterator[tuple[system.Variable, system.Variable]]:
    """Two terminals (instance, its archive, terminal) as a tool plugs them: members of one name, output to input."""
    sides = [(instance, archive, terminals(archive)[name]) for instance, archive, name in (first, second)]
    assert len({side[2].attrib["terminalKind"] for side in sides}) == 1
    found = [members(terminal) for _, _, terminal in sides]
    assert found[0].keys() == found[1].keys()  # the rule `plug`
    for member in found[0]:
        ends = {
            archive.variables()[names[member]].attrib["causality"]: system.Variable(instance, names[member])
            for (instance, archive, _), names in zip(sides, found, strict=True)
        }
        yield ends["input"], ends["output"]


def test_terminals_plugged_together_are_the_wiring_of_figure_2(units: Mapping[str, Archive]) -> None:
    plugged: list[tuple[system.Variable, system.Variable]] = []
    for axis in AXES:
        control, contact = system.controller(axis), system.friction(axis)
        for other, unit, kind in ((control, "controller", "motor"), (contact, "friction", "friction")):
            plugged += _plugged((system.PLANT, units["plant"], f"{axis}.{kind}"), (other, units[unit], kind))
        plugged += _plugged(
            (system.NC, units["setpoint"], f"{axis}.setpoint"), (control, units["controller"], "setpoint")
        )
    assert len(plugged) == len(set(plugged))
    assert set(plugged) == figure_2()


def test_fmucontainer_plugs_the_terminals(units: Mapping[str, Archive], fmus: Path) -> None:
    """A tool that connects terminals, by its own reading of the files: the wiring from three links an axis."""
    builder = pytest.importorskip(
        "fmu_manipulation_toolbox.container.builder", reason="needs the FMU Manipulation Toolbox (make test-importers)"
    )
    container = builder.FMUContainer("loop", fmus.resolve())

    def load(instance: str, unit: str) -> str:
        container.get_fmu(f"{unit}.fmu", f"{instance}.fmu")
        return f"{instance}.fmu"

    plant, setpoint = load(system.PLANT, "plant"), load(system.NC, "setpoint")
    for axis in AXES:
        control, contact = load(system.controller(axis), "controller"), load(system.friction(axis), "friction")
        container.add_link(setpoint, f"{axis}.setpoint", control, "setpoint")
        container.add_link(control, "motor", plant, f"{axis}.motor")
        container.add_link(plant, f"{axis}.friction", contact, "friction")
    found = {(_end(target), _end(source)) for source, link in container.links.items() for target in link.cport_to_list}
    assert found == {
        (each.target, each.source) for each in system.figure_2(AXES) if each.source.instance != system.ZERO
    }


def _end(port: Any) -> system.Variable:
    return system.Variable(port.fmu.name.removesuffix(".fmu"), port.port.name)


# --- another machine


def test_terminals_are_those_of_the_machine_that_is_packed(fmus: Path, tmp_path: Path) -> None:
    names = ("A", "B1", "tilt", "C", "D", "E", "F")
    (tmp_path / "axes.csv").write_text("axis,x_0 [m]\n" + "".join(f"{name},0\n" for name in names), encoding="utf-8")
    (tmp_path / "modes.csv").write_text(modes_csv(names), encoding="utf-8")
    given = ["--axes", str(tmp_path / "axes.csv"), "--modes", str(tmp_path / "modes.csv")]
    assert cli.main(["repack", str(fmus / "plant.fmu"), *given, "--out", str(tmp_path / "plant.fmu")]) == 0
    packed = unpack("plant", tmp_path, tmp_path / "unpacked")
    assert set(terminals(packed)) == {"tool", *(f"{name}.{kind}" for name in names for kind in ("motor", "friction"))}
    test_terminals_follow_the_schema_of_the_standard(packed)
    test_terminals_keep_the_rules_that_no_schema_knows(packed)
    test_symbols_of_terminals_do_not_overlap(packed)
    with zipfile.ZipFile(fmus / "plant.fmu") as before, zipfile.ZipFile(tmp_path / "plant.fmu") as after:
        pictures = [name for name in before.namelist() if name.endswith((".png", ".svg"))]
        assert len(pictures) == 1 + 2 * (1 + 3)  # model.png; the icon and three kinds of terminals
        assert all(before.read(name) == after.read(name) for name in pictures)


# --- pictures

ICONS = sorted((ROOT / "src").glob("*_fmu/icon.svg"))
SYMBOLS = sorted((ROOT / "src/fmi2/terminals").glob("*.svg"))


def test_there_is_a_picture_of_every_unit_and_every_kind_of_terminal() -> None:
    assert [path.parent.name.removesuffix("_fmu") for path in ICONS] == sorted(EXPECTED)
    assert [path.stem for path in SYMBOLS] == ["friction", "motor", "setpoint", "tool"]


@pytest.mark.parametrize("path", [*ICONS, *SYMBOLS], ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_picture_is_the_drawing(path: Path) -> None:
    root = ET.parse(path).getroot()
    size = (int(root.attrib["width"]), int(root.attrib["height"]))
    assert root.find("{http://www.w3.org/2000/svg}title") is not None
    assert not root.findall(".//{http://www.w3.org/2000/svg}text")  # looks the same whatever fonts there are
    with Image.open(path.with_suffix(".png")) as image:
        image.verify()
        assert (image.format, image.size) == ("PNG", size)
    assert path.with_suffix(".png").stat().st_size < 10_000
    if not shutil.which("rsvg-convert"):
        pytest.skip("size and format are as they should be; no rsvg-convert here to draw it anew")
    drawn = subprocess.run(
        ["rsvg-convert", "-w", str(size[0]), "-h", str(size[1]), str(path)], capture_output=True, check=True
    ).stdout
    with Image.open(path.with_suffix(".png")) as kept, Image.open(io.BytesIO(drawn)) as anew:
        difference = np.abs(np.asarray(kept.convert("RGBA"), float) - np.asarray(anew.convert("RGBA"), float))
    # Versions of the renderer differ at edges only, by parts of a pixel: an old picture differs by whole areas.
    assert difference.mean() < 1.0


def test_icon_is_found_where_importers_look_for_it(archive: Archive) -> None:
    folder = archive.folder
    icon = (ROOT / "src" / f"{archive.unit}_fmu" / "icon.png").read_bytes()
    assert (folder / "model.png").read_bytes() == icon  # FMI 2.0
    assert (folder / "terminalsAndIcons/icon.png").read_bytes() == icon
    assert (folder / "terminalsAndIcons/icon.svg").is_file()


# --- units of others

REAL = 'REAL({}, {}, continuous, 0, "1", "1", NO_MIN, NO_MAX, "", "Text")\n'


def _pack(folder: Path, compiler: tuple[str, ...], *rows: str) -> tuple[dict[str, bytes], list[str]]:
    from feedsim_packager import terminals as under_test

    directory = toy(folder, "/* toy: a unit for tests. */\n" + "".join(rows))
    unit = build.load(directory, compiler)
    return under_test.files(directory, unit.variables)


def test_a_unit_without_icon_and_terminals_goes_without(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    files, warnings = _pack(tmp_path / "toy", compiler, REAL.format("M_fr", "output"))
    assert files == {}  # one member of a pair is no terminal
    assert warnings == ["icon.png of toy is missing: the archive goes without a picture of the unit"]


def test_a_unit_without_icon_may_have_terminals(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    files, _ = _pack(tmp_path / "toy", compiler, REAL.format("M_fr", "output"), REAL.format("n_fr", "input"))
    root = ET.fromstring(files[FILE])
    assert [each.attrib["name"] for each in root.iterfind("Terminals/Terminal")] == ["friction"]
    assert "model.png" not in files


def test_a_pair_that_nothing_fits_is_refused(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    rows = [REAL.format("M_fr", "input"), REAL.format("n_fr", "input")]
    with pytest.raises(InputError) as caught:
        _pack(tmp_path / "toy", compiler, *rows)
    assert (
        "friction: M_fr input, n_fr input; a connection needs M_fr as output, n_fr as input, "
        "or all of them the other way round" in str(caught.value)
    )


# --- without them, for importers that refuse them


def test_archives_go_without_terminals_where_that_is_asked_for(fmus: Path, tmp_path: Path) -> None:
    """What is packed into an archive without them has none either; all else stays."""
    bare, again = tmp_path / "bare.fmu", tmp_path / "again.fmu"
    tables = ["--axes", str(ROOT / "src/plant_fmu/resources/axes.csv")]
    tables += ["--modes", str(ROOT / "scenarios/machines/test_centre/modes.csv")]
    assert cli.main(["repack", str(fmus / "plant.fmu"), *tables, "--no-terminals", "--out", str(bare)]) == 0
    assert cli.main(["repack", str(bare), *tables, "--out", str(again)]) == 0
    packed = tmp_path / "pack.fmu"
    pack_machine(ROOT / "scenarios/machines/test_centre", packed, fmus=fmus, terminals=False)
    for path, base in ((bare, "plant"), (again, "plant"), (packed, "machine")):
        before, after = zipfile.ZipFile(fmus / f"{base}.fmu").namelist(), zipfile.ZipFile(path).namelist()
        assert any(name.startswith("terminalsAndIcons/") for name in before)
        assert not any(name.startswith("terminalsAndIcons/") for name in after)
        assert "model.png" in after
        assert {name for name in before if name.startswith(("binaries/", "sources/"))} <= set(after)
