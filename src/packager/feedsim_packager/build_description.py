"""sources/buildDescription.xml: how an importer compiles the sources. FMI 2.0.4 takes this file over from FMI 3.0."""

from collections.abc import Iterable
from xml.etree import ElementTree as ET

NAME = "buildDescription.xml"
# Without contraction, as the binaries are compiled: the results are to be the same. Clang takes the same options; other
# compilers have other names for them.
COMPILER = "gcc"
OPTIONS = "-std=c99 -ffp-contract=off"


def describe(unit: str, sources: Iterable[str]) -> bytes:
    """The file's content. `sources` are the C files to compile, by name; the headers are found beside them, but for
    those of the standard, which the importer has."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    about = (
        "One folder, nothing to define; the headers of FMI 2.0 are the importer's. For static linking define "
        f"FMI2_FUNCTION_PREFIX as {unit}_"
    )
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=unit, description=about)
    listed = ET.SubElement(configuration, "SourceFileSet", language="C99", compiler=COMPILER, compilerOptions=OPTIONS)
    for name in sorted(sources):
        ET.SubElement(listed, "SourceFile", name=name)
    ET.SubElement(
        configuration, "Library", name="m", external="true", description="Mathematics of the C library, where separate"
    )
    ET.indent(root)
    content: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{content}\n'.encode()
