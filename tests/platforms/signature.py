"""Code signatures of Mach-O libraries, checked as macOS does it when it loads a page. Format: XNU's cs_blobs.h."""

from __future__ import annotations

import hashlib
import struct

_SIGNATURE, _SUPER_BLOB, _CODE_DIRECTORY, _SHA256 = 0x1D, 0xFADE0CC0, 0xFADE0C02, 2


def pages_that_differ(library: bytes) -> list[int]:
    """Pages whose contents are not those that were signed; ValueError where there is no signature of SHA-256."""
    count = struct.unpack_from("<I", library, 16)[0]
    at = 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", library, at)
        if command == _SIGNATURE:
            (start,) = struct.unpack_from("<I", library, at + 8)
            return _check(library, start)
        at += size
    raise ValueError("not signed")


def _check(library: bytes, start: int) -> list[int]:
    magic, _, blobs = struct.unpack_from(">III", library, start)
    if magic != _SUPER_BLOB:
        raise ValueError("no signature where the load command says")
    for i in range(blobs):
        at = start + struct.unpack_from(">II", library, start + 12 + 8 * i)[1]
        if struct.unpack_from(">I", library, at)[0] == _CODE_DIRECTORY:
            break
    else:
        raise ValueError("a signature without a directory of pages")
    hashes, _, _, pages, limit = struct.unpack_from(">5I", library, at + 16)
    hash_size, hash_type, _, page_exponent = struct.unpack_from(">4B", library, at + 36)
    if hash_type != _SHA256 or limit != start:
        raise ValueError("not a signature by SHA-256 of all that stands ahead of it")
    page = 1 << page_exponent
    return [
        k
        for k in range(pages)
        if hashlib.sha256(library[k * page : min((k + 1) * page, limit)]).digest()[:hash_size]
        != library[at + hashes + k * hash_size : at + hashes + (k + 1) * hash_size]
    ]
