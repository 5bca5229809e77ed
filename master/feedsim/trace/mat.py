"""MAT files of version 4 to 7, read in Python alone: a damaged one is an error, whatever is damaged.

Read are numbers, and structures of them; all else that a file may hold is reported as what it is. Formats: "MAT-File
Format", The MathWorks (versions 4 and 5; 7 is 5 with variables that zlib has deflated).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.files import regular

MAX_INFLATED_BYTES = 2 << 30  # bytes that the variables of a file may inflate to,
RATIO = 100  # nor more than this many times the file's own size,
FREE = 256 << 20  # from so many bytes on
MAX_DEPTH = 50  # structures within structures
MAX_FIELDS = 100_000  # variables and fields

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}  # of data
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_OTHERS = {1: "a cell array", 3: "an object", 4: "text", 5: "a sparse matrix", 16: "a function"}
_MATRIX, _COMPRESSED = 14, 15
_STRUCTURE, _OPAQUE = 2, 17
_COMPLEX = 0x0800
_VERSION_4 = ("f8", "f4", "i4", "i2", "u2", "u1")


@dataclass(frozen=True)
class Other:
    """What is neither numbers nor a structure of its own. `what`: in words; `opaque`: only MATLAB reads it."""

    what: str
    opaque: bool = False


Value = NDArray[np.generic] | dict[str, "Value"] | Other


class _Fault(Exception):
    """What is wrong, in words."""


def read_mat(path: Path) -> dict[str, Value]:
    """Variables by name: numbers as arrays without dimensions of length 1, a structure as its fields.

    Raises InputError: no such file, none of these versions, damaged, or one that inflates to more than is allowed.
    """
    content = regular.content(path, pipes=True)
    try:
        return _variables(content)
    except NotImplementedError:
        raise InputError(f"{path} is a MAT file of version 7.3 (HDF5); save it with -v7") from None
    except _Fault as fault:
        raise InputError(f"{path} is no MAT file that can be read: {fault}") from None


def _variables(content: bytes) -> dict[str, Value]:
    if len(content) < 20:
        raise _Fault(f"it has {len(content)} bytes")
    if 0 in content[:4]:
        return _version_4(content)
    if content[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
        raise NotImplementedError
    if content[124:128] not in (b"\x00\x01IM", b"\x01\x00MI"):
        raise _Fault("its head is that of no known version")
    reader = _Reader(
        "<" if content[126:128] == b"IM" else ">", min(MAX_INFLATED_BYTES, max(FREE, RATIO * len(content)))
    )
    result: dict[str, Value] = {}
    at = 128
    while at < len(content):
        kind, data, at = reader.element(content, at, f"variable {len(result) + 1}")
        if kind == _COMPRESSED:
            kind, data, _ = reader.element(reader.inflated(data), 0, f"variable {len(result) + 1}")
        if kind != _MATRIX:
            raise _Fault(f"where variable {len(result) + 1} should stand, there is data of type {kind}")
        name, value = reader.matrix(data, 0)
        result[name] = Other("several variables of that name") if name in result else value
    return result


class _Reader:
    """Elements of version 5, whose bytes stand in the order `order` ("<" or ">"); inflates up to `allowed` bytes."""

    def __init__(self, order: str, allowed: int) -> None:
        self.order, self.allowed, self.count = order, allowed, 0
        self._words, self._flags = struct.Struct(f"{order}II"), struct.Struct(f"{order}I")

    def element(self, content: bytes | memoryview, at: int, what: str) -> tuple[int, memoryview, int]:
        """Type and data of the element at `at`, and where the next one begins."""
        view = memoryview(content)
        if at + 8 > len(view):
            raise _Fault(f"it ends within {what}")
        kind, size = self._words.unpack_from(view, at)
        start = at + 8
        if kind >> 16:  # up to four bytes in the tag itself
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise _Fault(f"{what} gives {size} bytes where there are 4")
        else:
            end = start + size + (-size % 8 if kind != _COMPRESSED else 0)
        if start + size > len(view):
            raise _Fault(f"it ends within {what}, which declares {size} bytes and has {len(view) - start}")
        return kind, view[start : start + size], end

    def inflated(self, data: memoryview) -> bytes:
        try:
            stream = zlib.decompressobj()
            result = stream.decompress(data, self.allowed + 1)
        except zlib.error as error:
            raise _Fault(f"a variable cannot be inflated: {error}") from None
        self.allowed -= len(result)
        if self.allowed < 0:
            raise _Fault("its variables inflate to more bytes than are allowed of a file of this size")
        if not stream.eof:
            raise _Fault("a variable is cut off")
        return result

    def matrix(self, data: memoryview, depth: int) -> tuple[str, Value]:
        """Name and value of a variable or a field."""
        self.count += 1
        if depth > MAX_DEPTH or self.count > MAX_FIELDS:
            raise _Fault(f"more than {MAX_DEPTH} structures within one another, or {MAX_FIELDS} fields")
        if not len(data):
            return "", np.zeros(0)
        kind, flags, at = self.element(data, 0, "the head of a variable")
        if kind != 6 or len(flags) < 4:
            raise _Fault("the head of a variable holds no flags")
        (word,) = self._flags.unpack_from(flags)
        of_class = word & 0xFF
        shape: tuple[int, ...] = (1,)
        if of_class != _OPAQUE:
            dimensions, at = self._numbers(data, at, "the size of a variable")
            shape = tuple(int(length) for length in dimensions)
            if dimensions.dtype.kind not in "iu" or len(shape) < 2 or len(shape) > 32 or min(shape) < 0:
                raise _Fault(f"a variable has the size {dimensions.tolist()}")
        _, text, at = self.element(data, at, "the name of a variable")
        name = _text(bytes(text))
        where = repr(name[:60]) if name else "a field"
        if of_class in _CLASSES:
            return name, self._array(
                data, at, np.dtype(self.order + _CLASSES[of_class]), shape, bool(word & _COMPLEX), where
            )
        if of_class == _STRUCTURE and math.prod(shape) == 1:
            return name, self._fields(data, at, depth, where)
        if of_class == _STRUCTURE:
            return name, Other(f"structures of shape {shape}")
        if of_class == _OPAQUE or of_class in _OTHERS:
            return name, Other(_OTHERS.get(of_class, "an object"), of_class in (_OPAQUE, 16))
        raise _Fault(f"{where} is of the unknown class {of_class}")

    def _numbers(self, data: memoryview, at: int, what: str) -> tuple[NDArray[np.generic], int]:
        kind, raw, at = self.element(data, at, what)
        if kind not in _TYPES:
            raise _Fault(f"{what} is data of type {kind}")
        dtype = np.dtype(self.order + _TYPES[kind])
        if len(raw) % dtype.itemsize:
            raise _Fault(f"{what} has {len(raw)} bytes, no whole number of values")
        return np.frombuffer(raw, dtype), at

    def _array(
        self,
        data: memoryview,
        at: int,
        dtype: np.dtype[np.generic],
        shape: tuple[int, ...],
        is_complex: bool,
        where: str,
    ) -> Value:
        parts = []
        for _ in range(1 + is_complex):
            values, at = self._numbers(data, at, where)
            if len(values) != math.prod(shape):
                raise _Fault(f"{where} holds {len(values)} values; its size {shape} gives {math.prod(shape)}")
            with np.errstate(all="ignore"):
                parts.append(values.astype(dtype.newbyteorder("="), copy=False))
        result = parts[0] + 1j * parts[1] if is_complex else parts[0]
        return result.reshape(shape, order="F").squeeze()

    def _fields(self, data: memoryview, at: int, depth: int, where: str) -> dict[str, Value]:
        lengths, at = self._numbers(data, at, f"the fields of {where}")
        _, text, at = self.element(data, at, f"the fields of {where}")
        length = int(lengths[0]) if len(lengths) == 1 else 0
        if length <= 0 or len(text) % length:
            raise _Fault(f"the names of the fields of {where} have no length")
        result: dict[str, Value] = {}
        for i in range(0, len(text), length):
            name = _text(bytes(text[i : i + length]))
            kind, inner, at = self.element(data, at, f"the field {name[:60]!r} of {where}")
            if kind != _MATRIX:
                raise _Fault(f"the field {name[:60]!r} of {where} is data of type {kind}")
            value = self.matrix(inner, depth + 1)[1]
            result[name] = Other("several fields of that name") if name in result else value
        return result


def _text(raw: bytes) -> str:
    return raw.partition(b"\0")[0].decode("utf-8", "replace")


def _version_4(content: bytes) -> dict[str, Value]:
    (first,) = struct.unpack_from("<i", content)
    order = "<" if 0 <= first <= 5000 else ">"
    head = struct.Struct(f"{order}5i")
    result: dict[str, Value] = {}
    at = 0
    while at < len(content):
        if at + head.size > len(content):
            raise _Fault(f"it ends within the head of variable {len(result) + 1}")
        code, rows, columns, imaginary, length = head.unpack_from(content, at)
        at += head.size
        kind, precision = code % 10, code // 10 % 10
        fits = 0 <= code < 5000 and not code // 100 % 10 and kind <= 2 and precision < len(_VERSION_4)
        if not fits or min(rows, columns) < 0 or not 0 < length <= 1024 or imaginary not in (0, 1):
            raise _Fault(f"the head of variable {len(result) + 1} is that of none")
        name = _text(content[at : at + length])
        dtype = np.dtype(order + _VERSION_4[precision])
        at += length
        size = rows * columns * dtype.itemsize
        if at + size * (1 + imaginary) > len(content):
            raise _Fault(f"it ends within {name[:60]!r}, which is to have {rows} rows and {columns} columns")
        if name in result:
            result[name] = Other("several variables of that name")
        elif kind:
            result[name] = Other(("text", "a sparse matrix")[kind - 1])
        else:
            values = np.frombuffer(content, dtype, rows * columns, at).astype(dtype.newbyteorder("="), copy=False)
            if imaginary:
                values = values + 1j * np.frombuffer(content, dtype, rows * columns, at + size)
            result[name] = values.reshape((rows, columns), order="F").squeeze()
        at += size * (1 + imaginary)
    return result


def flat(content: Mapping[str, Value], prefix: str = "") -> list[tuple[str, NDArray[np.generic] | Other]]:
    """Variables, those inside structures too, each with its name, "structure.field"."""
    result: list[tuple[str, NDArray[np.generic] | Other]] = []
    for name, value in content.items():
        result += flat(value, f"{prefix}{name}.") if isinstance(value, dict) else [(prefix + name, value)]
    return result
