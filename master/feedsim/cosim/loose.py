"""Descriptions of archives that FMI 2.0 does not allow and that other programs run: what is made of them.

Exporters leave away what the standard demands, or write what it does not know. Of a description only the variables,
their units and what the unit can do matter here; what of them cannot be read is taken away, or becomes what the
standard has as default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from fmpy import read_model_description

TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
# Causality -> its variabilities; the first is taken where another stands there, "discrete" of what is no Real.
_VARIABILITIES = {
    "parameter": ("fixed", "tunable"),
    "calculatedParameter": ("fixed", "tunable"),
    "input": ("continuous", "discrete"),
    "output": ("continuous", "discrete", "constant"),
    "local": ("continuous", "discrete", "constant", "fixed", "tunable"),
    "independent": ("continuous",),
}
_OF_TYPES = ("quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal", "unbounded")
# Element -> attributes that must be of a kind, else they are taken away.
_NUMBERS: dict[str, tuple[Callable[[str], object], tuple[str, ...]]] = {
    "fmiModelDescription": (int, ("numberOfEventIndicators",)),
    "CoSimulation": (int, ("maxOutputDerivativeOrder",)),
    "DefaultExperiment": (float, ("startTime", "stopTime", "tolerance", "stepSize")),
    "DisplayUnit": (float, ("factor", "offset")),
    **{kind: (float, ("min", "max", "nominal")) for kind in TYPES},
}


def read(file: Path) -> Any:
    """The description of FMI 2.0 in a file, as FMPy reads it. Whatever it raises: it cannot be read even so."""
    root = ET.parse(file).getroot()
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]  # FMI 2.0 has no namespace
    if root.get("fmiVersion", "").startswith("2.0."):
        root.set("fmiVersion", "2.0")
    root.set("guid", root.get("guid", ""))
    _tidy_attributes(root)
    _tidy_types(root)
    _tidy_variables(root)
    for structure in root.findall("ModelStructure"):
        root.remove(structure)
    tidied = file.with_name("tidied.xml")
    try:
        ET.ElementTree(root).write(tidied, encoding="utf-8", xml_declaration=True)
        return read_model_description(str(tidied), validate=False)
    finally:
        tidied.unlink(missing_ok=True)


def _is(kind: Callable[[str], object], text: str) -> bool:
    with suppress(ValueError):
        kind(text)
        return True
    return False


def _tidy_attributes(root: ET.Element) -> None:
    for element in root.iter():
        kind, names = _NUMBERS.get(element.tag, (str, ()))
        for name in names:
            if name in element.attrib and not _is(kind, element.attrib[name]):
                del element.attrib[name]
        for name, value in element.attrib.items():
            if element.tag == "CoSimulation" and value.lower() in ("true", "false"):
                element.set(name, value.lower())
    for unit in root.iter("Unit"):
        for base in unit.findall("BaseUnit"):
            if not all(_is(float, value) for value in base.attrib.values()):
                unit.remove(base)
                continue
            for name, value in base.attrib.items():
                if name not in ("factor", "offset"):
                    base.set(name, str(int(float(value))))


def _tidy_types(root: ET.Element) -> None:
    for group in root.findall("TypeDefinitions"):
        for entry in [*group]:
            if not len(entry) or entry[0].tag not in TYPES or entry.get("name") is None:
                group.remove(entry)
                continue
            _keep(entry[0], _OF_TYPES)
            for item in entry[0].findall("Item"):
                _keep(item, ("name", "value", "description"))
                if item.get("name") is None or not _is(int, item.get("value", "")):
                    entry[0].remove(item)


def _keep(element: ET.Element, names: Iterable[str]) -> None:
    for name in {*element.attrib} - {*names}:
        del element.attrib[name]


def _tidy_variables(root: ET.Element) -> None:
    types = {entry.get("name") for entry in root.iterfind("TypeDefinitions/SimpleType")}
    group = root.find("ModelVariables")
    if group is None:
        group = ET.SubElement(root, "ModelVariables")
    seen: set[str | None] = set()
    for variable in [*group]:
        value = next((child for child in variable if child.tag in TYPES), None)
        reference = variable.get("valueReference", "")
        if value is None or variable.get("name") in seen or not _is(int, reference) or not 0 <= int(reference) < 2**32:
            group.remove(variable)
            continue
        seen.add(variable.get("name"))
        if value.get("declaredType") not in types:
            value.attrib.pop("declaredType", None)
        value.attrib.pop("derivative", None)
        if variable.get("causality") not in _VARIABILITIES:
            variable.set("causality", "local")
        allowed = [
            entry
            for entry in _VARIABILITIES[variable.get("causality", "")]
            if value.tag == "Real" or entry != "continuous"
        ]
        if variable.get("variability") not in allowed:
            variable.set("variability", allowed[0] if allowed else "continuous")
