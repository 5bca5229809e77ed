"""An SSP file: its files by name, read with distrust and when they are asked for; written the same each time, whole or
not at all.
"""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit
from xml.etree import ElementTree as ET

from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import InputError, no_such_file
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.cosim.archive import BASE, UnitDefinition
from feedsim.simulation.cosim.unpacked import Allowance, refuse_document_type

STRUCTURE = "SystemStructure.ssd"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date that a zip file can hold


def write(path: Path, files: Mapping[str, bytes]) -> int:
    """Write `files` in their order and return the size [bytes]. Stored, not deflated: what weighs is archives already,
    and the bytes then depend on no version of zlib. OutputError: the file cannot be written; nothing is left then."""
    with written_whole(path) as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
            for name, content in files.items():
                entry = zipfile.ZipInfo(name, _EPOCH)
                entry.create_system = 3
                entry.external_attr = 0o644 << 16
                package.writestr(entry, content)
        return file.tell()


class Files(Mapping[str, bytes]):
    """Files of an SSP by name. Only what is asked for is unpacked, and only so much of it (`allowance`)."""

    def __init__(self, path: Path, package: zipfile.ZipFile) -> None:
        self.path = path
        self.allowance = Allowance(path)
        self._package = package
        self._entries = unpacked.entries(package, str(path))

    def __getitem__(self, name: str) -> bytes:
        """A document, whole. InputError: it is damaged, or too large for one."""
        entry = self._entries[name]
        if entry.file_size > unpacked.LARGEST_DOCUMENT:
            raise InputError(
                f"{self.path}: {name} has {entry.file_size} bytes; at most {unpacked.LARGEST_DOCUMENT} are read of a "
                "document"
            )
        self.allowance.take(entry.file_size, str(self.path))
        with unpacked.readable(f"{self.path}: {name} cannot be read"):
            return self._package.read(entry)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def copy(self, name: str, to: Path) -> None:
        """Write a file of any size to `to`, whose folders are made. InputError: damaged, too large, no room for it."""
        self.allowance.take(self._entries[name].file_size, str(self.path))
        with unpacked.readable(f"{self.path}: {unpacked.shorten_name(name)} cannot be unpacked"):
            unpacked.copy_stream(self._package, self._entries[name], to)


def resolve_source(source: str, files: Container[str]) -> str:
    """Name of the file that a `source` means: a URI (RFC 3986) relative to the SSP file's top. InputError: there is
    none, in words that go on behind "source 'x'".

    Some programs write names as they are: such a source is taken where the file has that very name.
    """
    if source in files:
        return source
    try:
        uri = urlsplit(source)
        path = unquote(uri.path, errors="strict")
    except ValueError:
        raise InputError("is not in the file: it is no URI (RFC 3986)") from None
    if uri.scheme or uri.netloc or path.startswith("/"):
        raise InputError("is not in the file: it is not relative to it")
    if "\\" in path or not path.isprintable():
        raise InputError("is not in the file: it has backslashes or control characters, where / parts folders")
    name = posixpath.normpath(path)
    if name.split("/")[0] == "..":
        raise InputError("is not in the file: it leads out of it")
    if name not in files:
        raise InputError("is not in the file")
    return name


def as_source(name: str) -> str:
    """The URI of a file inside, relative to the top."""
    return quote(name, safe="/!$&'()*+,;=@~")


@contextmanager
def open_files(path: Path) -> Iterator[Files]:
    """The files of an SSP, for as long as the block lasts.

    Raises:
        InputError: no such file, no zip file, damaged, or with entries that do not belong into one
            (:func:`feedsim.simulation.cosim.unpacked.entries`); it unpacks to more than it may.
    """
    with unpacked.readable(f"{path} cannot be read"):
        folder, there, regular = path.is_dir(), path.exists(), path.is_file()
    if folder:
        raise InputError(f"{path} is a folder, not an SSP file")
    if not there:
        raise InputError(no_such_file(path))
    if not regular:
        raise InputError(f"{path} is no regular file, and no SSP file")
    with unpacked.readable(f"{path}: not a readable SSP, which is a zip file"):
        package = zipfile.ZipFile(path)
    with package:
        files = Files(path, package)
        if STRUCTURE not in files:
            raise InputError(f"{path}: has no {STRUCTURE} at its top; it is no SSP file, or damaged")
        yield files


# --- XML of the SSP standard: namespaces with the prefixes that importers expect, reading without surprises, and
#     the
# definitions of units, which several of its documents hold.


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
        raise InputError(f"{where}: its root is {prefixed_tag(root.tag)}, not {expected} of SSP 1.0")
    return root


def prefixed_tag(name: str) -> str:
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
