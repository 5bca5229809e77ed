"""Changes of a file at random: bits, bytes, chunks, numbers and words, in archives mostly of an entry."""

from __future__ import annotations

import io
import random
import re
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress

LONGEST = 300_000  # bytes that text is allowed to grow to
NUMBERS = ("1e308", "1e999", "-1", "0", "nan", "inf", "99999999999999999999", "1e-320", "0x7f", "1_0", "2147483648",
           "9" * 400, "1e-99999999", "٣", "--1", "")  # fmt: skip
WORDS = ("\0", "\ufeff", "\t", "*", "&a ", "!!float ", "[[[[[[[[", "{", "}", "<<: ", "'", '"', ",,,,", ";", "\r", "../",
         "/dev/zero", "\x85", "\u2028", "é", "<!DOCTYPE x>", "]]>", "&lt;", "- ", ": ", "null", "true", "#",
         "x" * 300)  # fmt: skip


def entries(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as package:
        return {name: package.read(name) for name in package.namelist()}


def packed(content: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as package:
        for name, data in content.items():
            package.writestr(zipfile.ZipInfo(name), data)
    return buffer.getvalue()


def changed(chance: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A file with one to some changes; of archives mostly inside an entry."""
    if content[:2] == b"PK" and chance.random() < 0.9:
        with suppress(zipfile.BadZipFile, ValueError, NotImplementedError, OSError, zlib.error, EOFError):
            inside = entries(content)
            name = chance.choice([name for name in inside if not name.startswith("binaries/")])
            inside[name] = changed(chance, inside[name], [*inside.values()])
            if chance.random() < 0.05:
                inside[chance.choice(["resources/", "../"]) + name] = inside.pop(name)
            return packed(inside)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        content = chance.choice(CHANGES)(chance, content, others)[:LONGEST]
    return content


def _place(chance: random.Random, content: bytes) -> int:
    """Heads matter more than what follows."""
    return chance.randrange(min(len(content), chance.choice((64, 300, 10**9))) + 1)


def _flip(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    found = bytearray(content or b"\0")
    for _ in range(chance.choice((1, 2, 8))):
        found[_place(chance, found[:-1])] ^= 1 << chance.randrange(8)
    return bytes(found)


def _overwrite(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    size = chance.choice((1, 2, 4, 8))
    value = chance.choice((0, 1, 127, 128, 255, 256, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)) % 256**size
    return content[:at] + value.to_bytes(size, chance.choice(("little", "big"))) + content[at + size :]


def _cut(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    return content[: _place(chance, content)]


def _lose(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    return content[:at] + content[at + chance.choice((1, 4, 40, 400)) :]


def _double(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at, size = _place(chance, content), chance.choice((1, 8, 80, 800))
    return content[:at] + content[at : at + size] * chance.choice((2, 3, 100)) + content[at + size :]


def _splice(chance: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    other = chance.choice(others)
    return content[: _place(chance, content)] + other[_place(chance, other) :]


def _number(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    found = list(re.finditer(rb"-?[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?", content[:20_000]))
    if not found:
        return _overwrite(chance, content, ())
    match = chance.choice(found)
    return content[: match.start()] + chance.choice(NUMBERS).encode() + content[match.end() :]


def _word(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    return content[:at] + chance.choice(WORDS).encode() + content[at:]


def _value(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    """What stands behind a colon, in quotes or between commas, in the place of another such text."""
    found = list(re.finditer(rb'(?<=: )[^\n,}]+|(?<=")[^"\n]*(?=")|(?<=,)[^,\n]*', content[:20_000]))
    if len(found) < 2:
        return _word(chance, content, ())
    match, other = chance.choice(found), chance.choice(found)
    return content[: match.start()] + other[0] + content[match.end() :]


CHANGES = (_flip, _overwrite, _cut, _lose, _double, _splice, _number, _number, _word, _value, _value)
