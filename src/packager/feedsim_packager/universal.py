"""Mach-O libraries for several processors -> one universal file, and back.

A universal ("fat") file is a big-endian table of contents followed by the libraries as they are, each at an offset that
is a multiple of its processor's page size. Nothing inside a library changes, so that its signature stays valid. Format:
<mach-o/fat.h> of macOS.
"""

import struct
from collections.abc import Sequence

MAGIC = 0xCAFEBABE
# cputype -> exponent of the alignment: pages of 4 KiB on x86-64 and 16 KiB on arm64, as lipo has it.
_ALIGNMENTS = {0x01000007: 12, 0x0100000C: 14}
_HEADER = struct.Struct(">II")  # magic, number of slices
_SLICE = struct.Struct(">iiIII")  # cputype, cpusubtype, offset, size, alignment
_THIN = struct.Struct("<Iii")  # magic, cputype, cpusubtype of a library
_THIN_MAGIC = 0xFEEDFACF  # 64 bit, little-endian


def join(slices: Sequence[bytes]) -> bytes:
    """One file of the libraries `slices`, in this order; ValueError where one is no library of a known processor, or
    two are for the same."""
    kinds = [_processor(content) for content in slices]
    if not slices or len({cputype for cputype, _ in kinds}) < len(kinds):
        raise ValueError("a universal file holds one library per processor, and at least one")
    table = _HEADER.pack(MAGIC, len(slices))
    body = bytearray(_HEADER.size + len(slices) * _SLICE.size)
    for (cputype, subtype), content in zip(kinds, slices, strict=True):
        exponent = _ALIGNMENTS[cputype]
        body += bytes(-len(body) % (1 << exponent))
        table += _SLICE.pack(cputype, subtype, len(body), len(content), exponent)
        body += content
    body[: len(table)] = table
    return bytes(body)


def split(content: bytes) -> list[bytes]:
    """The libraries in a universal file; ValueError where it is none, or cut short."""
    try:
        magic, count = _HEADER.unpack_from(content)
        table = [_SLICE.unpack_from(content, _HEADER.size + i * _SLICE.size) for i in range(count)]
    except struct.error as error:
        raise ValueError(f"not a universal file, or cut short: {error}") from error
    if magic != MAGIC:
        raise ValueError(f"not a universal file: it begins with {magic:08x}")
    if any(offset + size > len(content) or offset % (1 << exponent) for _, _, offset, size, exponent in table):
        raise ValueError("a universal file with a slice outside of it, or not aligned")
    return [content[offset : offset + size] for _, _, offset, size, _ in table]


def _processor(content: bytes) -> tuple[int, int]:
    if len(content) < _THIN.size:
        raise ValueError("too short for a Mach-O library")
    magic, cputype, subtype = _THIN.unpack_from(content)
    if magic != _THIN_MAGIC or cputype not in _ALIGNMENTS:
        raise ValueError(f"not a Mach-O library of a known processor: magic {magic:08x}, cputype {cputype:08x}")
    return cputype, subtype
