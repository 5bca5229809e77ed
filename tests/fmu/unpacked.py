"""Built archives as the tests of this folder see them, and variables.def by a parser that is not the packager's."""

import csv
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
from fmpy.fmi2 import FMU2Slave

from feedsim_packager import compile

ROOT = Path(__file__).resolve().parents[2]
UNITS = ("plant", "controller", "friction", "friction_gms", "setpoint", "machine")
PLATFORM = compile.host_target()


@dataclass(frozen=True)
class Archive:
    """An unpacked archive."""

    unit: str
    path: Path
    folder: Path

    @property
    def description(self) -> ET.Element:
        return ET.parse(self.folder / "modelDescription.xml").getroot()

    @property
    def guid(self) -> str:
        return self.description.attrib["guid"]

    @property
    def library(self) -> Path:
        return self.folder / "binaries" / PLATFORM.folder / f"{self.unit}{PLATFORM.suffix}"

    @property
    def source_files(self) -> list[str]:
        return [file.attrib["name"] for file in self.description.iterfind("CoSimulation/SourceFiles/File")]

    @cached_property
    def _variables(self) -> dict[str, ET.Element]:
        return {each.attrib["name"]: each for each in self.description.iterfind("ModelVariables/ScalarVariable")}

    def variables(self) -> dict[str, ET.Element]:
        return self._variables


def unpack(unit: str, fmus: Path, folder: Path) -> Archive:
    with zipfile.ZipFile(fmus / f"{unit}.fmu") as opened:
        opened.extractall(folder)
    return Archive(unit, fmus / f"{unit}.fmu", folder)


def instantiate(archive: Archive, folder: Path | None = None, guid: str | None = None) -> FMU2Slave:
    description = fmpy.read_model_description(str(archive.folder))
    slave = FMU2Slave(
        guid=guid or archive.guid,
        unzipDirectory=str(folder or archive.folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="tried",
    )
    slave.instantiate(loggingOn=False)
    return slave


def initialize(slave: FMU2Slave, archive: Archive | None = None) -> None:
    """Into initialisation mode: the standard lets values be read from there on. An archive that is named has its inputs
    in use, where a motion could take their place."""
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    if archive and (switch := archive.variables().get("motion.built_in")) is not None:
        slave.setBoolean([int(switch.attrib["valueReference"])], [False])


MACROS = {  # columns of each row macro in table.h
    "REAL": "name causality variability start unit display min max depends description",
    "INTEGER": "name causality variability start min max depends description",
    "BOOLEAN": "name causality variability start depends description",
    "STRING": "name causality variability start description",
}


def declared(unit: str) -> Iterator[dict[str, str]]:
    """Rows of a unit's table."""
    return _machine() if unit == "machine" else _own(unit)


INSIDE = ("x_a", "n_a", "M_a", "M_fr", "n_fr")  # what the parts of the machine exchange


def _machine() -> Iterator[dict[str, str]]:
    """The machine's own rows and, by the rules that its README tells, those of its parts."""
    own = list(_own("machine"))
    outside = [row for row in own if row["name"].startswith("setpoints.")]
    yield from (row for row in own if not row["axis"] and row not in outside)
    drive = [row | {"axis": "AXIS_"} for row in _own("controller")]
    friction = [row | {"axis": "AXIS_"} for row in _own("friction")]
    plant, motion = list(_own("plant")), list(_own("setpoint"))
    yield from (_part("motion", row, held=True) for row in motion if not row["axis"])
    yield from (row | {"depends": ""} for row in plant if not row["axis"])
    yield from outside
    yield from (
        _part("plant", row) if row["causality"] == "input" and row["name"] in INSIDE else row
        for row in plant
        if row["axis"]
    )
    yield from (row for row in drive if row["causality"] == "input" and row["name"] not in INSIDE)
    yield from (_part("drive", row) for row in drive)
    yield from (_part("friction", row) for row in friction)
    yield from (_part("motion", row, held=True) for row in motion if row["axis"])
    yield from (row for row in own if row["axis"])


def _part(part: str, row: dict[str, str], held: bool = False) -> dict[str, str]:
    """A part's row: outputs keep their names, unless they are `held` back; inputs are locals."""
    depends = {"depends": "(x_s)" if row["name"] == "x_e" else ""}
    if row["causality"] == "output" and not held:
        return row | depends
    named = row | depends | {"name": f"{part}.{row['name']}"}
    return named if row["causality"] == "parameter" else named | {"causality": "local", "start": "0"}


def _own(unit: str) -> Iterator[dict[str, str]]:
    """Rows of variables.def by a parser of our own: one row a line, comma-separated, quotes as in CSV."""
    for written in (ROOT / "src" / f"{unit}_fmu" / "variables.def").read_text(encoding="utf-8").splitlines():
        line = _expanded(written) if "INTEGER_EXPANDED" in written else written
        match = re.fullmatch(r"(AXIS_)?(REAL|INTEGER|BOOLEAN|STRING)(_OF)?\((.*)\)", line)
        if match is None:
            assert re.match(r"\s*(/?\*.*)?$|#", line), f"line not understood: {line}"
            continue
        fields = next(csv.reader([match[4]], skipinitialspace=True))
        if match[3]:
            fields[:2] = [".".join(fields[:2])]
        row = dict(zip(MACROS[match[2]].split(), fields, strict=True))
        yield (
            {"unit": "", "min": "NO_MIN", "max": "NO_MAX", "depends": ""}
            | row
            | {"kind": match[2], "axis": match[1] or ""}
        )


def _expanded(line: str) -> str:
    """A row with the exchange schemes in its text, as C's preprocessor makes it of the rows of cycle.h."""
    rows = (ROOT / "src" / "machine_fmu" / "cycle.h").read_text(encoding="utf-8")
    schemes = re.findall(r"ROW\((\d+), (\w+),", rows)
    words = "".join(f"; {number} {name}" for number, name in schemes)
    line = line.replace("INTEGER_EXPANDED", "INTEGER_OF").replace("LAST_SCHEME", schemes[-1][0])
    return line.replace('" SCHEMES(SCHEME_TEXT)', f'{words}"')


RESOURCES = {
    "plant": ("axes.csv", "modes.csv", "poses.bin"),
    "setpoint": ("setpoints.csv",),
    "machine": ("settings.csv",),  # which holds the hashes of the others
}  # in the order of the hash


def axes(path: Path = ROOT / "src/plant_fmu/resources/axes.csv") -> list[tuple[str, str]]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return [(name, x_0) for name, x_0 in (line.split(",") for line in lines[1:])]


def expected_variables(archive: Archive) -> list[dict[str, str]]:
    """All variables in the order of their value references, for the axes that the archive holds."""
    rows = list(declared(archive.unit))
    found = [row for row in rows if not row["axis"]]
    resources = archive.folder / "resources"
    named: list[tuple[str, str]] = []
    given: dict[str, str] = {}
    if archive.unit == "machine":
        given = dict(line.split(",") for line in (resources / "settings.csv").read_text("utf-8").splitlines())
    if archive.unit in ("plant", "machine"):
        named = axes(resources / "axes.csv")
    elif archive.unit == "setpoint":
        header = (resources / "setpoints.csv").read_text(encoding="utf-8").splitlines()[0]
        named = [(axis, "") for axis in re.findall(r",(\w+)\.x_s \[m\]", header)]
    found = [row | {"start": given.get(row["name"], row["start"])} for row in found]
    for axis, x_0 in named:
        for row in (row for row in rows if row["axis"]):
            name = f"{axis}.{row['name']}"
            stands = row["name"] == "x_0" or (row["name"], archive.unit) == ("x_s", "machine")
            start = x_0 if stands else given.get(name, row["start"])
            found.append(row | {"name": name, "start": start})
    return found
