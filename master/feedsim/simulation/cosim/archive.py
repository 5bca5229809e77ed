"""An FMU archive: unpacked, described, and its shared library for this platform loaded once."""

from __future__ import annotations

import copy
import ctypes
import os
import platform
import re
import sys
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree as ET

from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import BlockResource, defer_signals
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.cosim.unpacked import STORE, Content, check_there
from feedsim.simulation.cosim.worker import mark_call, watched_process

# --- How this process computes: rounding, denormal numbers, traps, which a program of another maker may leave
#     changed
# All units share it: one that rounds upward changes what every other unit computes. The native loop looks at it itself.


# System, processor -> which words of its fenv_t hold settings, with a mask of what is no flag of a past operation.
_SETTINGS = {
    ("linux", "x86_64"): ((0, 0xFFFF), (7, 0xFFC0)),
    ("darwin", "x86_64"): ((0, 0xFFFF), (1, 0xFFC0)),
    ("linux", "aarch64"): ((0, 0xFFFFFFFF),),
    ("darwin", "arm64"): ((2, 0xFFFFFFFF),),
}
_Words = ctypes.c_uint32 * 64  # no fenv_t is larger


def _functions() -> tuple[Any, Any] | None:
    """fegetenv and fesetenv of C's <fenv.h>; None where its fenv_t is not known: nothing is looked at there."""
    if (sys.platform, platform.machine()) not in _SETTINGS:
        return None
    try:
        library = ctypes.PyDLL("libm.so.6" if sys.platform == "linux" else None)
        return library.fegetenv, library.fesetenv
    except (OSError, AttributeError):  # another C library than the usual one
        return None


_FUNCTIONS = _functions()
_MASKS = _SETTINGS.get((sys.platform, platform.machine()), ())
_now = _Words()


def settings() -> Any:
    """Of now, for :func:`restore`."""
    words = _Words()
    if _FUNCTIONS is not None:
        _FUNCTIONS[0](words)
    return words


def restore(kept: Any) -> bool:
    """Go back to :func:`settings` of before. Whether anything but the flags of past operations has changed since."""
    if _FUNCTIONS is None:
        return False
    get, put = _FUNCTIONS
    get(_now)
    for word, mask in _MASKS:
        if (_now[word] ^ kept[word]) & mask:
            put(kept)
            return True
    return False


@contextmanager
def preserve_float_settings(changed: Callable[[], None] | None = None) -> Iterator[None]:
    """A block that calls another program; behind it this process computes as before. `changed` is called where the
    program has left it otherwise."""
    before = settings()
    try:
        yield
    finally:
        if restore(before) and changed is not None:
            changed()


# --- An FMU archive: unpacked, described, and its shared library for this platform loaded once ------------------------


# --- Descriptions of archives that FMI 2.0 does not allow and that other programs run: what is made of them -----------
# Exporters leave away what the standard demands, or write what it does not know. Of a description only the variables,
# their units and what the unit can do matter here; what of them cannot be read is taken away, or becomes what the
# standard has as default.


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


def read_description(file: Path) -> Any:
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


def _parses_as(kind: Callable[[str], object], text: str) -> bool:
    with suppress(ValueError):
        kind(text)
        return True
    return False


def _tidy_attributes(root: ET.Element) -> None:
    for element in root.iter():
        kind, names = _NUMBERS.get(element.tag, (str, ()))
        for name in names:
            if name in element.attrib and not _parses_as(kind, element.attrib[name]):
                del element.attrib[name]
        for name, value in element.attrib.items():
            if element.tag == "CoSimulation" and value.lower() in ("true", "false"):
                element.set(name, value.lower())
    for unit in root.iter("Unit"):
        for base in unit.findall("BaseUnit"):
            if not all(_parses_as(float, value) for value in base.attrib.values()):
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
            _keep_attributes(entry[0], _OF_TYPES)
            for item in entry[0].findall("Item"):
                _keep_attributes(item, ("name", "value", "description"))
                if item.get("name") is None or not _parses_as(int, item.get("value", "")):
                    entry[0].remove(item)


def _keep_attributes(element: ET.Element, names: Iterable[str]) -> None:
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
        if (
            value is None
            or variable.get("name") in seen
            or not _parses_as(int, reference)
            or not 0 <= int(reference) < 2**32
        ):
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


_DESCRIPTION = "modelDescription.xml"
BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # units of FMI 2.0
MAX_PROBLEMS, MAX_PROBLEM = 3, 200  # of a description that are shown; characters of one
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SUFFIXES = {"windows": ".dll", "darwin": ".dylib"}  # elsewhere .so
_FMI_2 = {"windows": "win", "darwin": "darwin", "linux": "linux"}


@dataclass(frozen=True)
class UnitDefinition:
    """A unit as modelDescription.xml defines it: value in base units = factor * value + offset.

    exponents: base unit -> power, without zeros.
    """

    exponents: Mapping[str, int]
    factor: float = 1.0
    offset: float = 0.0

    @property
    def text(self) -> str:
        """The base units as an expression, e.g. "m^2.kg.s^-2"; "1" for none."""
        return ".".join(f"{name}^{power}" for name, power in self.exponents.items()) or "1"


class Archive(BlockResource):
    """An ``.fmu`` file, unpacked for as long as this object is open (a context manager).

    Unpacked is what a run needs: description, resources, and the library for this platform. Archives of the same
    content share it, and a later one finds it still there (feedsim.simulation.cosim.unpacked).

    Attributes:
        directory: where it is unpacked to; only to be read.
        variables: by name.
        platforms: the folders in its binaries/, for this platform and others.
        problems: what FMI 2.0 does not allow of its description, which is read all the same.
        fatal: whether its library can be used no more.
    """

    def __init__(self, path: Path, allowance: unpacked.Allowance | None = None) -> None:
        """`allowance`: of the file that `path` stood in, where it stood in one.

        Raises:
            InputError: no such file, or not an FMI 2.0 archive with co-simulation that can be trusted.
        """
        check_there(path)
        self.path = path
        allowance = allowance or unpacked.Allowance(path)
        self._content: Content | None = STORE.take(path, allowance, partial(_unpack, path, allowance))
        self.directory, self.description = self._content.directory, self._content.description
        self.variables, self.platforms = self._content.variables, self._content.platforms
        self.problems = self._content.problems
        self.fatal = False

    def note_fatal(self) -> None:
        """An instance has returned fmi2Fatal: of none may anything be called any more."""
        self.fatal = True
        if (here := watched_process()) is not None:
            here.spent = True

    def part(self, prefix: str) -> Archive:
        """The same archive, of which only the variables `prefix`NAME are seen, as NAME. It is not to be closed."""
        part = copy.copy(self)
        names = (name for name in self.variables if name.startswith(prefix))
        part.variables = {name.removeprefix(prefix): self.variables[name] for name in names}
        return part

    @property
    def guid(self) -> str:
        return str(self.description.guid)

    @property
    def version(self) -> str:
        return str(self.description.version or "")

    def close(self) -> None:
        """Its units are to be closed before it."""
        content, self._content = self._content, None
        if content is not None:
            STORE.give_back(content)

    @property
    def warnings(self) -> list[Finding]:
        """What a user should know of it."""
        if not self.problems:
            return []
        listed = "; ".join(problem.strip()[:MAX_PROBLEM] for problem in self.problems[:MAX_PROBLEMS])
        more = len(self.problems) - MAX_PROBLEMS
        return [Finding(
            "unit-description-invalid", "doubt",
            f"{self.path.name}: its modelDescription.xml is not what FMI 2.0 demands, and was read as well as it can "
            f"be: {listed}{f'; {more} more like these' if more > 0 else ''}",
            self.path.name,
        )]  # fmt: skip

    def unknown_unit(self, name: str) -> str | None:
        """Unit of variable `name` where neither the archive defines it nor its name is one that is known here."""
        variable = self.variables[name]
        written = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
        if not written or written in self.unit_definitions:
            return None
        try:
            units.unit(str(written))
            return None
        except InputError:
            return str(written)

    def declared_unit(self, name: str) -> str | None:
        """Unit of variable `name` as the archive declares it; None where it declares none that is known."""
        variable = self.variables[name]
        declared = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
        return str(declared) if declared and self.unknown_unit(name) is None else None

    def unit_of(self, name: str) -> str:
        """The same, "1" where it declares none."""
        return self.declared_unit(name) or "1"

    @cached_property
    def unit_definitions(self) -> dict[str, UnitDefinition]:
        result = {}
        for unit_definition in self.description.unitDefinitions:
            if unit_definition.baseUnit is not None and float(unit_definition.baseUnit.factor):
                exponents = {
                    key: int(getattr(unit_definition.baseUnit, key))
                    for key in BASE
                    if int(getattr(unit_definition.baseUnit, key))
                }
                result[unit_definition.name] = UnitDefinition(
                    exponents, float(unit_definition.baseUnit.factor), float(unit_definition.baseUnit.offset)
                )
        return result

    def slave(self, name: str) -> FMU2Slave:
        """FMPy's wrapper for an instance `name`, around a library that is loaded once.

        Raises:
            InputError: there is none for this platform, or none that can be loaded here.
        """
        if self._content is None:
            raise ValueError(f"{self.path}: the archive is closed")
        with STORE.loading:
            if self._content.library is None:
                loaded = self._load()
                self._content.library, self._content.unload = loaded, loaded.freeLibrary
            slave: FMU2Slave = copy.copy(self._content.library)  # looking its functions up takes a millisecond
        slave.instanceName = name
        return slave

    def library(self) -> Path:
        """The shared library for this platform. InputError: there is none."""
        identifier = self.description.coSimulation.modelIdentifier
        return library(self.directory, identifier, self.platforms, f"{self.path}")

    def _load(self) -> FMU2Slave:
        path = self.library()
        before = Path.cwd()
        try:
            with preserve_float_settings(), mark_call(f"{self.path}: loading its library"):
                return FMU2Slave(
                    guid=self.guid, unzipDirectory=str(self.directory), libraryPath=str(path),
                    modelIdentifier=self.description.coSimulation.modelIdentifier,
                )  # fmt: skip
        except Exception as error:
            os.chdir(before)  # fmpy goes to the library's folder and does not come back when it fails
            folder = f"binaries/{path.parent.name}"
            reason = str(error).replace(f"{self.directory.absolute()}{os.sep}", "")
            there = ", ".join(self.platforms)
            raise InputError(
                f"{self.path}: its binary for this platform, in {folder}, cannot be loaded: {reason}; it has "
                f"binaries for {there}"
            ) from error


def _unpack(path: Path, allowance: unpacked.Allowance, file: IO[bytes], content: Content) -> None:
    """Fill a content from the archive `path`, open as `file`."""
    wanted = ("resources/", *(f"binaries/{folder}/" for folder in folders()))
    with unpacked.readable(f"{path}: not a usable FMI 2.0 archive"), zipfile.ZipFile(file) as package:
        zip_infos = unpacked.entries(package, str(path))
        if _DESCRIPTION not in zip_infos:
            raise InputError(f"{path}: not a usable FMI 2.0 archive: it has no {_DESCRIPTION}")
        needed = [entry for name, entry in zip_infos.items() if name == _DESCRIPTION or name.startswith(wanted)]
        content.size = sum(entry.file_size for entry in needed)
        allowance.take(content.size, str(path))
        for entry in needed:
            unpacked.copy_stream(package, entry, content.directory / entry.filename)
    parts = [name.split("/") for name in zip_infos if name.startswith("binaries/")]
    content.platforms = tuple(sorted({part[1] for part in parts if len(part) > 2}))
    content.description, content.problems = _read_description(path, content.directory)
    content.variables = {model_variable.name: model_variable for model_variable in content.description.modelVariables}


def _read_description(path: Path, directory: Path) -> tuple[Any, list[str]]:
    """What FMPy reads, and what FMI 2.0 does not allow of it."""
    what = f"{path}: not a usable FMI 2.0 archive"
    file = directory / _DESCRIPTION
    if (size := file.stat().st_size) > unpacked.LARGEST_DOCUMENT:
        raise InputError(f"{what}: {_DESCRIPTION} has {size} bytes, allowed: {unpacked.LARGEST_DOCUMENT}")
    unpacked.refuse_document_type(file.read_bytes(), f"{path}: {_DESCRIPTION}")
    problems: list[str] = []
    with defer_signals():  # FMPy's validation has a bare `except:`
        try:
            description = read_model_description(str(directory))
        except Exception as error:
            problems = getattr(error, "problems", None) or [f"{error or type(error).__name__}"]
            try:
                description = read_description(file)
            except Exception:
                raise InputError(f"{what}: {error}") from error
    if description.fmiVersion != "2.0":
        raise InputError(f"{what}: it is of FMI {description.fmiVersion}")
    if description.coSimulation is None:
        raise InputError(f"{path}: has no co-simulation interface")
    identifier = str(description.coSimulation.modelIdentifier or "")
    if not _IDENTIFIER.fullmatch(identifier):
        raise InputError(f"{what}: its modelIdentifier {identifier[:80]!r} is no C identifier")
    return description, problems


def folders() -> tuple[str, ...]:
    """Folders under binaries/ that may hold a library for this platform, the likelier first.

    FMI 2.0 names folders for Intel's processors alone (linux64); for others archives use the names of FMI 3.0
    (aarch64-linux), and on a Mac darwin64 may hold a universal file.
    """
    system, machine = platform.system().lower(), platform.machine().lower()
    wide = sys.maxsize > 2**32
    old = f"{_FMI_2.get(system, system)}{64 if wide else 32}"
    if machine in ("aarch64", "arm64"):
        return (f"aarch64-{system}", old)
    return (old, f"{'x86_64' if wide else 'x86'}-{system}")


def library(directory: Path, identifier: str, present: Collection[str], where: str) -> Path:
    """The library `identifier` in the archive unpacked to `directory`.

    Args:
        present: folders under binaries/ that the archive has.

    Raises:
        InputError: there is none for this platform; names which there are.
    """
    suffix = _SUFFIXES.get(platform.system().lower(), ".so")
    for folder in folders():
        path = directory.absolute() / "binaries" / folder / f"{identifier}{suffix}"
        if path.is_file():
            return path
    looked = " or ".join(f"binaries/{folder}/{identifier}{suffix}" for folder in folders())
    there = f"it has {', '.join(sorted(present))}" if present else "it has none at all"
    raise InputError(
        f"{where}: has no binary for this platform, {platform.system()} on {platform.machine()} ({looked}); {there}"
    )
