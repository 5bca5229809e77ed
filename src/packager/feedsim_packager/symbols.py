"""A library's symbols, independent of its format."""

from dataclasses import dataclass


class Unreadable(Exception):
    """No shared library that can be read."""


@dataclass(frozen=True)
class Binary:
    """A shared library for one processor. Symbols as a C program spells them."""

    format: str  # ELF, PE, Mach-O
    processor: str  # x86_64, aarch64
    exported: frozenset[str]
    imported: frozenset[str]
    libraries: tuple[str, ...]  # that it asks the loader for
    versions: frozenset[str] = frozenset()  # of symbols that it asks for, e.g. GLIBC_2.17 (ELF)
    name: str = ""  # the library's own: SONAME, DLL name, install name
    oldest_system: str = ""  # oldest macOS that loads it (Mach-O)
    signed: bool = False  # holds a code signature (Mach-O)


def text(content: bytes, at: int) -> str:
    """The zero-terminated string at this offset."""
    return content[at : content.index(b"\0", at)].decode("ascii")
