"""Whether a library runs on machines other than the one that made it: functions, libraries, versions, paths."""

import re
from collections.abc import Sequence
from pathlib import Path

from . import binary
from .checkout import STANDARD
from .symbols import Binary
from .targets import OLDEST_GLIBC, OLDEST_MACOS, Target

HEADER = STANDARD / "fmi2Functions.h"

# What linkers export by themselves; no importer looks for them, and none takes them for its own.
_LINKERS = frozenset({"_mh_dylib_header", "__dso_handle", "_init", "_fini", "_edata", "_end", "__bss_start"})
# Part of every system of that kind: C library, mathematics, Windows itself.
_SYSTEM = {
    "ELF": r"lib[cm]\.so\.6|ld-linux-[\w-]+\.so\.\d",
    "PE": r"kernel32\.dll|ucrtbase\.dll|api-ms-win-crt-[\w-]+\.dll",
    "Mach-O": r"/usr/lib/libSystem\.B\.dylib",
}
_FORMATS = {".so": "ELF", ".dll": "PE", ".dylib": "Mach-O"}


def fmi_functions() -> frozenset[str]:
    """Every function that a co-simulation unit must export, from the standard's header."""
    text = HEADER.read_text(encoding="ascii")
    sections = re.split(r"Functions for FMI2 for (\w+-?\s?\w+)\n\*+/", text.partition("/* Version number */")[0])
    names = sections[0] + sections[sections.index("Co-Simulation") + 1]
    return frozenset(re.findall(r"fmi2FullName\((fmi2\w+)\)", names))


def own_functions(unit: str, sources: Path) -> frozenset[str]:
    """Functions that a unit means to export besides those of the FMI: what its headers declare with an ..._EXPORT of
    their own, under the unit's prefix."""
    declared: set[str] = set()
    for path in sorted(sources.glob("*.h")):
        declared |= set(
            re.findall(r"^(?!FMI2)\w+_EXPORT\s[^;(]*?(\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
        )
    return frozenset(f"{unit}_{name}" for name in declared)


def problems(
    content: bytes,
    target: Target,
    *,
    functions: frozenset[str] | None = None,
    own: frozenset[str] = frozenset(),
    for_others: bool = True,
    machine: Sequence[str] = (),
) -> list[str]:
    """What is wrong with the library `content` for `target`; nothing where it can be used there.

    Without `for_others` only whether it is for the target and exports all `functions`, those of the FMI where none are
    given. `own`: what it may export besides. `machine`: paths of this machine, which must not be in the library.
    """
    try:
        binaries = binary.read(content)
    except binary.Unreadable as error:
        return [str(error)]
    functions = fmi_functions() if functions is None else functions
    expected = [name.partition("-")[0] for name in target.zig]
    reported = []
    if [part.processor for part in binaries] != expected or {part.format for part in binaries} != {
        _FORMATS[target.suffix]
    }:
        kinds = ", ".join(f"{part.format} for {part.processor}" for part in binaries)
        reported.append(f"is {kinds}; needed is {_FORMATS[target.suffix]} for {', '.join(expected)}")
    for part in binaries:
        if missing := sorted(functions - part.exported):
            reported.append(f"{part.processor}: does not export {', '.join(missing)}")
        if for_others:
            reported += [f"{part.processor}: {problem}" for problem in _not_for_others(part, functions | own)]
    reported += [f"holds a path of this machine: {path}" for path in machine if path.encode() in content]
    return reported


def _not_for_others(part: Binary, meant: frozenset[str]) -> list[str]:
    reported = []
    if stray := sorted(part.exported - meant - _LINKERS):
        reported.append(f"exports more than it is meant to: {', '.join(stray)}")
    foreign = [name for name in part.libraries if not re.fullmatch(_SYSTEM[part.format], name, re.IGNORECASE)]
    if foreign:
        reported.append(f"needs libraries that are no part of the system: {', '.join(foreign)}")
    newer = sorted(version for version in part.versions if _newer(version, "GLIBC_" + OLDEST_GLIBC))
    if newer:
        reported.append(
            f"needs {', '.join(newer)}, where {OLDEST_GLIBC} is the newest allowed: systems with an older C library "
            "would not load it; zig links against any (make fmus-all)"
        )
    if part.format == "Mach-O":
        if _newer(part.oldest_system or "999", OLDEST_MACOS):
            reported.append(f"needs macOS {part.oldest_system or 'of an unknown version'}; allowed is {OLDEST_MACOS}")
        if part.processor == "aarch64" and not part.signed:
            reported.append("is not signed, and macOS loads nothing unsigned on this processor")
    return reported


def _newer(version: str, limit: str) -> bool:
    """Versions of another family than the limit's (GLIBC_PRIVATE, GCC_3.0) count as newer."""
    numbers = [re.fullmatch(r"(\D*)(\d+(?:\.\d+)*)", name) for name in (version, limit)]
    if numbers[0] is None or numbers[1] is None or numbers[0][1] != numbers[1][1]:
        return True
    indexes, allowed = ([int(part) for part in match[2].split(".")] for match in numbers if match)
    return indexes > allowed
