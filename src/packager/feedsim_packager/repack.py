"""An archive -> the same unit with other resources (a machine's, a motion's); no compiler, no sources.

The binaries of the archive (of any platform) are kept as they are: which axes a machine has is data to them. What says
which machine it is comes anew: resources, GUID, modelDescription.xml, the embedded copy, the page of documentation.
"""

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from . import archive, carried, compile, description, documentation, reference, terminals, trial, variables
from .errors import CompilerError, InputError
from .machine import Machine
from .resources import Resources
from .table import Table

DESCRIPTION = "modelDescription.xml"
EMBEDDED = "sources/embedded_resources.c"


@dataclass(frozen=True)
class Repacked:
    """A packed archive. `tried`: it was instantiated here, where it has a binary for this platform."""

    path: Path
    size: int  # bytes
    guid: str
    platforms: tuple[str, ...]  # folders under binaries/
    tried: bool


def repack(
    base: Path, given: Resources, machine: Machine, out: Path, *, trial_run: bool = True, level: int = 9,
    stage: Path | None = None, with_terminals: bool = True,
) -> Repacked:  # fmt: skip
    """Pack the unit of the archive `base` with the resources `given` into `out`, which may be `base` itself.

    `trial_run`: instantiate what was packed, where `base` has a binary for this platform. `level`: of compression.
    `stage`: folder for the trial's files; None: where the system keeps what is temporary. `with_terminals`: as far as
    `base` has them.

    Raises:
        InputError: `base` is no archive of this packager, or cannot hold the machine; or the unit refuses it.
        OutputError: `out` cannot be written.
    """
    files = archive.read(base)
    table, version = _table(files, base)
    machine = replace(machine, noun=given.noun)
    listed = variables.expand(table, given)
    guid = variables.guid(table, given)
    page = f"{base}: {documentation.INDEX}"
    renewed = {
        EMBEDDED: given.embedded_source(),
        documentation.INDEX: documentation.for_machine(
            files.get(documentation.INDEX, b""), listed, given, machine, page
        ),
        **given.files(),
    }
    kept = {path: content for path, content in files.items() if not path.startswith("resources/")}
    kept = reference.without(kept)  # they are of the resources that go
    if not with_terminals:
        kept = terminals.without(kept)
    described = terminals.describe(listed, kept) if terminals.DESCRIPTION in kept else {}
    packed = kept | renewed | described
    sources = [path.removeprefix("sources/") for path in packed if re.fullmatch(r"sources/[^/]+\.c", path)]
    packed[DESCRIPTION] = description.describe(
        table,
        listed,
        guid=guid,
        version=version,
        sources=sources,
        machine=machine,
        experiment=given.experiment(),
    )
    tried = trial_run and _try(packed, table.unit, guid, given, stage)
    content = archive.pack(packed, level=level)
    archive.write(out, content)
    platforms = sorted({path.split("/")[1] for path in packed if re.match(r"binaries/[^/]+/", path)})
    return Repacked(out, len(content), guid, tuple(platforms), tried)


def _table(files: Mapping[str, bytes], base: Path) -> tuple[Table, str]:
    """Table and version that the archive carries, checked against its GUID."""
    for needed in (DESCRIPTION, carried.PATH):
        if needed not in files:
            raise InputError(
                f"{base}: has no {needed}: an archive of something else, or of an older packager; build it anew "
                "(make fmus)"
            )
    table, version = carried.load(files[carried.PATH], f"{base}: {carried.PATH}")
    try:
        guid = ET.fromstring(files[DESCRIPTION]).get("guid", "")
    except ET.ParseError as error:
        raise InputError(f"{base}: {DESCRIPTION} cannot be read: {error}") from error
    known = variables.fnv1a_64(table.fingerprint_text().encode())
    if guid.partition("-")[0] != known:
        raise InputError(
            f"{base}: its binaries belong to the table {guid.partition('-')[0]}, {carried.PATH} is the table {known}: "
            "the archive was altered; build it anew"
        )
    return table, version


def _try(packed: Mapping[str, bytes], unit: str, guid: str, given: Resources, stage: Path | None) -> bool:
    """Instantiate once; False where there is no binary for this platform."""
    try:
        target = compile.host_target()
    except CompilerError:
        return False
    path = f"binaries/{target.folder}/{unit}{target.suffix}"
    if path not in packed:
        return False
    with tempfile.TemporaryDirectory(prefix="packager-", dir=stage, ignore_cleanup_errors=True) as temporary:
        library = Path(temporary) / Path(path).name
        library.write_bytes(packed[path])
        trial.check(library, unit, guid, given.files(), Path(temporary))
    return True
