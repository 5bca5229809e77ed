"""XML of the SSP standard: namespaces with the prefixes that importers expect, reading without surprises, and the
definitions of units, which several of its documents hold."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from xml.etree import ElementTree as ET

from feedsim.cosim.archive import BASE, UnitDefinition
from feedsim.cosim.untrusted import refuse_document_type
from feedsim.errors import InputError

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
FEEDSIM_NAMESPACE = "urn:feedsim:ssp"
# ecos, libcosim and OMSimulator compare the prefixed text, not the namespace: to them, prefixes are of the format.
PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "oms": OMS, "feedsim": FEEDSIM_NAMESPACE}

Element = ET.Element


def tag(name: str) -> str:
    """ "ssd:System" as ElementTree writes it."""
    prefix, _, local = name.partition(":")
    return f"{{{PREFIXES[prefix]}}}{local}"


def element(name: str, attributes: Mapping[str, str] | None = None) -> Element:
    return ET.Element(tag(name), dict(attributes or {}))


def child(parent: Element, name: str, attributes: Mapping[str, str] | None = None) -> Element:
    return ET.SubElement(parent, tag(name), dict(attributes or {}))


def to_bytes(root: Element) -> bytes:
    """The document, indented, the same for the same tree."""
    for prefix, namespace in PREFIXES.items():
        ET.register_namespace(prefix, namespace)
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def parse(content: bytes, where: str, expected: str) -> Element:
    """The root element of a document. InputError: bad XML, a document type (which is not read), another root."""
    refuse_document_type(content, where)
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{where}: not readable XML: {error}") from error
    if root.tag != tag(expected):
        raise InputError(f"{where}: its root is {shown(root.tag)}, not {expected} of SSP 1.0")
    return root


def shown(name: str) -> str:
    """A tag with its usual prefix."""
    namespace, _, local = name.removeprefix("{").partition("}")
    return next((f"{prefix}:{local}" for prefix, known in PREFIXES.items() if known == namespace), name)


def append_units(parent: Element, name: str, definitions: Mapping[str, UnitDefinition]) -> None:
    """Append the definitions as an element `name`; none where there are none."""
    if not definitions:
        return
    group = child(parent, name)
    for unit, definition in definitions.items():
        base = {key: str(definition.exponents[key]) for key in BASE if key in definition.exponents}
        if definition.factor != 1.0:
            base["factor"] = repr(definition.factor)
        if definition.offset != 0.0:
            base["offset"] = repr(definition.offset)
        child(child(group, "ssc:Unit", {"name": unit}), "ssc:BaseUnit", base)


def read_units(group: Element | None, where: str) -> dict[str, UnitDefinition]:
    """Definitions of a Units element. InputError: a factor or an exponent that is no number."""
    unit_definitions: dict[str, UnitDefinition] = {}
    for entry in () if group is None else group.findall(tag("ssc:Unit")):
        base = entry.find(tag("ssc:BaseUnit"))
        if base is None:
            continue
        try:
            exponents = {key: int(base.get(key, "0")) for key in BASE if int(base.get(key, "0"))}
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        except ValueError:
            raise InputError(f"{where}: unit {entry.get('name')}: its definition holds no number") from None
        if not (isfinite(factor) and isfinite(offset) and factor):
            raise InputError(f"{where}: unit {entry.get('name')}: factor {factor!r}, offset {offset!r}; not allowed")
        unit_definitions[entry.get("name", "")] = UnitDefinition(exponents, factor, offset)
    return unit_definitions
