"""PE (Windows): directories of exports and imports. Format: Microsoft's "PE Format" specification."""

import struct
from collections.abc import Callable

from .symbols import Binary, text

_PROCESSORS = {0x8664: "x86_64", 0xAA64: "aarch64"}
_PE32_PLUS = 0x20B
_BY_ORDINAL = 1 << 63


def read(content: bytes) -> Binary:
    """A DLL of 64 bit."""
    (header,) = struct.unpack_from("<I", content, 60)
    if content[header : header + 4] != b"PE\0\0":
        raise ValueError("a program of MS-DOS")
    machine, sections = struct.unpack_from("<HH", content, header + 4)
    (optional_size,) = struct.unpack_from("<H", content, header + 20)
    optional = header + 24
    if struct.unpack_from("<H", content, optional)[0] != _PE32_PLUS:
        raise ValueError("a PE file that is not 64 bit")
    exports, _, imports, _ = struct.unpack_from("<4I", content, optional + 112)
    table = [
        struct.unpack_from("<4I", content, optional + optional_size + 40 * i + 8) for i in range(sections)
    ]  # virtual size, address, size in the file, offset in the file

    def offset(address: int) -> int:
        for size, start, in_file, at in table:
            if start <= address < start + max(size, in_file):
                return int(at + address - start)
        raise ValueError(f"address {address:#x} is in no section")

    libraries, imported = _imports(content, offset(imports), offset) if imports else ([], set())
    name, exported = "", set()
    if exports:
        at = offset(exports)
        name_at, _, _, count, _, names = struct.unpack_from("<6I", content, at + 12)
        name = text(content, offset(name_at))
        addresses = struct.unpack_from(f"<{count}I", content, offset(names)) if count else ()
        exported = {text(content, offset(address)) for address in addresses}
    return Binary(
        format="PE",
        processor=_PROCESSORS.get(machine, f"machine {machine:#x}"),
        exported=frozenset(exported),
        imported=frozenset(imported),
        libraries=tuple(libraries),
        name=name,
    )


def _imports(content: bytes, at: int, offset: Callable[[int], int]) -> tuple[list[str], set[str]]:
    libraries: list[str] = []
    symbols: set[str] = set()
    while True:
        lookup, _, _, name, addresses = struct.unpack_from("<5I", content, at)
        if not name:
            return libraries, symbols
        libraries.append(text(content, offset(name)))
        entry = offset(lookup or addresses)
        while (value := struct.unpack_from("<Q", content, entry)[0]) != 0:
            symbols.add(f"#{value & 0xFFFF}" if value & _BY_ORDINAL else text(content, offset(value) + 2))
            entry += 8
        at += 20
