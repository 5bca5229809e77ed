"""Mach-O (macOS): load commands, export trie, undefined symbols. Format: <mach-o/loader.h> and <mach-o/nlist.h>."""

import struct

from . import universal
from .symbols import Binary, text

_PROCESSORS = {0x01000007: "x86_64", 0x0100000C: "aarch64"}
_MAGIC, _DYLIB = 0xFEEDFACF, 6
_SYMTAB, _LOAD, _ID, _LOAD_WEAK, _REEXPORT = 0x02, 0x0C, 0x0D, 0x80000018, 0x8000001F
_DYLD_INFO, _TRIE, _BUILD, _MIN_MACOS, _SIGNATURE = (0x22, 0x80000022), 0x80000033, 0x32, 0x24, 0x1D
_N_STAB, _N_TYPE, _N_EXT, _N_UNDF = 0xE0, 0x0E, 0x01, 0x00


def read(content: bytes) -> tuple[Binary, ...]:
    """A dynamic library, or a universal file of several."""
    if content[:4] == universal.MAGIC.to_bytes(4, "big"):
        return tuple(_thin(part) for part in universal.split(content))
    return (_thin(content),)


def _thin(content: bytes) -> Binary:
    magic, cputype, _, kind, count, _, _ = struct.unpack_from("<7I", content)
    if magic != _MAGIC or kind != _DYLIB:
        raise ValueError(f"no dynamic library of Mach-O with 64 bit: magic {magic:08x}, type {kind}")
    name, oldest, signed = "", "", False
    libraries: list[str] = []
    exported: set[str] = set()
    imported: set[str] = set()
    at = 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", content, at)
        if command in (_LOAD, _LOAD_WEAK, _REEXPORT):
            libraries.append(text(content, at + struct.unpack_from("<I", content, at + 8)[0]))
        elif command == _ID:
            name = text(content, at + struct.unpack_from("<I", content, at + 8)[0])
        elif command == _SYMTAB:
            imported = _undefined(content, *struct.unpack_from("<III", content, at + 8))
        elif command in (*_DYLD_INFO, _TRIE):
            trie_at, trie_size = struct.unpack_from("<II", content, at + (8 if command == _TRIE else 40))
            exported |= _trie(content[trie_at : trie_at + trie_size])
        elif command in (_BUILD, _MIN_MACOS):
            version = struct.unpack_from("<I", content, at + (12 if command == _BUILD else 8))[0]
            oldest = f"{version >> 16}.{version >> 8 & 0xFF}"
        elif command == _SIGNATURE:
            signed = True
        at += size
    return Binary(
        format="Mach-O",
        processor=_PROCESSORS.get(cputype, f"cputype {cputype:#x}"),
        exported=frozenset(exported),
        imported=frozenset(imported),
        libraries=tuple(libraries),
        name=name,
        oldest_system=oldest,
        signed=signed,
    )


def _c_name(symbol: str) -> str:
    return symbol.removeprefix("_")


def _undefined(content: bytes, symbols: int, count: int, strings: int) -> set[str]:
    result = set()
    for i in range(count):
        name, kind = struct.unpack_from("<IB", content, symbols + 16 * i)
        if not kind & _N_STAB and kind & _N_EXT and kind & _N_TYPE == _N_UNDF:
            result.add(_c_name(text(content, strings + name)))
    return result


def _trie(trie: bytes) -> set[str]:
    """Names in the export trie: a node is its value's size (0: no symbol ends here), the value, its children."""
    result: set[str] = set()
    pending, seen = [(0, b"")] if trie else [], set()
    while pending:
        at, prefix = pending.pop()
        if at in seen:
            raise ValueError("an export trie that runs in a circle")
        seen.add(at)
        size, at = _uleb(trie, at)
        if size:
            result.add(_c_name(prefix.decode("ascii")))
        at += size
        children = trie[at]
        at += 1
        for _ in range(children):
            end = trie.index(b"\0", at)
            child, following = _uleb(trie, end + 1)
            pending.append((child, prefix + trie[at:end]))
            at = following
    return result


def _uleb(content: bytes, at: int) -> tuple[int, int]:
    """Unsigned LEB128 at this offset; with the offset behind it."""
    value = shift = 0
    while True:
        byte = content[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if not byte & 0x80:
            return value, at
