"""Archives of another maker: a drive and a friction unit, compiled from C that knows nothing of feedsim, with other
names and units than ours; and the shipped units under other names."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from feedsim.simulation.cosim.archive import folders
from feedsim_packager import toolchain

HERE = Path(__file__).resolve().parent
HEADERS = HERE.parents[1] / "src" / "fmi2" / "standard"
# Name -> exponents, factor: as exporters write them, and not all that feedsim knows by name.
UNITS: Mapping[str, Mapping[str, str]] = {
    "mm": {"m": "1", "factor": "0.001"},
    "rpm": {"rad": "1", "s": "-1", "factor": "0.10471975511965977"},
    "N.mm": {"kg": "1", "m": "2", "s": "-2", "factor": "0.001"},
    "N.mm/rpm": {"kg": "1", "m": "2", "s": "-1", "rad": "-1", "factor": "0.009549296585513721"},
    "1/s": {"s": "-1"},
    "ms": {"s": "1", "factor": "0.001"},
    "%": {"factor": "0.01"},
    "mm/turn": {"m": "1", "rad": "-1", "factor": "0.00015915494309189535"},
}


@dataclass(frozen=True)
class Variable:
    """A row of modelDescription.xml; its place in the list is its value reference."""

    name: str
    causality: str
    unit: str | None = None
    start: str | None = None
    kind: str = "Real"
    limits: tuple[str | None, str | None] = (None, None)
    variability: str | None = None
    reference: int = 0


def numbered(*variables: Variable) -> tuple[Variable, ...]:
    counts: dict[str, int] = {}
    found = []
    for each in variables:
        counts[each.kind] = counts.get(each.kind, -1) + 1
        found.append(replace(each, reference=counts[each.kind]))
    return tuple(found)


DRIVE = numbered(
    Variable("PosSetpoint", "input", "mm", "0"),
    Variable("PosActual", "input", "mm", "0"),
    Variable("SpeedForward", "input", "rpm", "0"),
    Variable("SpeedActual", "input", "rpm", "0"),
    Variable("Override", "input", "%", "100"),
    Variable("Torque", "output", "N.mm"),
    Variable("SpeedSetpoint", "output", "rpm"),
    Variable("Kv", "parameter", "1/s", "40", limits=("0", "1000")),
    Variable("Kp", "parameter", "N.mm/rpm", "0.1"),
    Variable("Tn", "parameter", "ms", "50", limits=("0.001", None)),
    Variable("Lead", "parameter", "mm/turn", "2.5"),
    Variable("Limit", "parameter", "N.mm", "140"),
    Variable("Enable", "input", None, "false", "Boolean"),
    Variable("Limited", "output", None, None, "Boolean"),
)
FRICTION = numbered(
    Variable("Speed", "input", "rpm", "0"),
    Variable("Torque", "output", "N.mm"),
    Variable("Coulomb", "parameter", "N.mm", "8", limits=("0", None)),
    Variable("Viscous", "parameter", "N.mm/rpm", "0.003"),
    Variable("Knee", "parameter", "rpm", "20"),
)
ROWS = {"drive": DRIVE, "friction": FRICTION}
MAPPED_DRIVE = {
    "inputs": {
        "x_s": "PosSetpoint", "x_a": "PosActual", "n_ffw": "SpeedForward", "n_a": "SpeedActual", "release": "Enable",
    },
    "outputs": {"M_a": "Torque", "n_s": "SpeedSetpoint", "torque_limited": "Limited"},
}  # fmt: skip
MAPPED_FRICTION = {"inputs": {"n_fr": "Speed"}, "outputs": {"M_fr": "Torque"}}


def compiled(folder: Path, name: str, *macros: str) -> bytes:
    """The library of drive.c, friction.c or faulty.c; macros: such as "HABIT=1" (shell.h)."""
    library = folder / f"{name}.so"
    command = [*toolchain.find_compiler(), "-std=gnu99", "-O1", "-fPIC", "-shared", f"-I{HEADERS}"]
    command += [f"-D{macro}" for macro in macros]
    subprocess.run([*command, str(HERE / f"{name}.c"), "-o", str(library), "-lm"], check=True)
    return library.read_bytes()


def archive(
    path: Path,
    name: str,
    library: bytes,
    variables: Sequence[Variable],
    *,
    flags: Mapping[str, str] | None = None,
    step: str | None = None,
    units: Mapping[str, Mapping[str, str]] = UNITS,
    version: str = "2.0",
    platform: str | None = None,
    edit: Callable[[ET.Element], object] | None = None,
    separator: str = "/",
) -> Path:
    """An archive of the unit `name`; flags: attributes of its co-simulation element; edit: of its description;
    separator: in the names of its entries."""
    identity = {"fmiVersion": version, "modelName": f"acme {name}", "guid": f"{{acme-{name}}}"}
    root = ET.Element("fmiModelDescription", identity)
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": name, **(flags or {})})
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit, base in units.items():
        entry = ET.SubElement(definitions, "Unit", {"name": unit})
        if base:
            ET.SubElement(entry, "BaseUnit", dict(base))
    if step is not None:
        ET.SubElement(root, "DefaultExperiment", {"stepSize": step})
    group = ET.SubElement(root, "ModelVariables")
    outputs = []
    for i, each in enumerate(variables):
        fixed = "fixed" if each.causality == "parameter" else "discrete" if each.kind == "Boolean" else "continuous"
        entry = ET.SubElement(group, "ScalarVariable", {
            "name": each.name, "valueReference": str(each.reference), "causality": each.causality,
            "variability": each.variability or fixed,
        })  # fmt: skip
        given = {"unit": each.unit, "start": each.start, "min": each.limits[0], "max": each.limits[1]}
        ET.SubElement(entry, each.kind, {key: value for key, value in given.items() if value is not None})
        outputs += [str(i + 1)] if each.causality == "output" else []
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Outputs", "InitialUnknowns"):
        entries = ET.SubElement(structure, kind)
        for index in outputs:
            ET.SubElement(entries, "Unknown", {"index": index})
    if edit is not None:
        edit(root)
    suffix = ".dll" if "win" in (platform or folders()[0]) else ".so"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("modelDescription.xml", ET.tostring(root, encoding="utf-8", xml_declaration=True))
        package.writestr(separator.join(("binaries", platform or folders()[0], f"{name}{suffix}")), library)
    return path


def renamed(shipped: Path, out: Path, rename: Callable[[str], str], model: str) -> Path:
    """A copy of an archive whose modelDescription.xml calls its variables otherwise; nothing else is changed."""
    with zipfile.ZipFile(shipped) as source, zipfile.ZipFile(out, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                root = ET.fromstring(content)
                root.set("modelName", model)
                for variable in root.iter("ScalarVariable"):
                    variable.set("name", rename(variable.get("name", "")))
                content = ET.tostring(root, encoding="utf-8", xml_declaration=True)
            if not name.startswith("terminalsAndIcons/"):
                target.writestr(name, content)
    return out
