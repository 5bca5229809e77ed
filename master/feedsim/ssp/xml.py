"""XML of the SSP standard: namespaces with the prefixes that importers expect, and reading without surprises."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from feedsim.cosim.untrusted import refuse_document_type
from feedsim.errors import InputError

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OWN = "urn:feedsim:ssp"
# ecos and libcosim compare the prefixed text, not the namespace: the prefixes are part of the format for them.
PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "osp": OSP, "feedsim": OWN}

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
