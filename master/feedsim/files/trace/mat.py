"""MAT files of version 4 to 7, read in Python alone: a damaged one is an error, whatever is damaged.

Read are numbers, texts, and structures and cells of them; all else that a file may hold is reported as what it is.
Formats: "MAT-File Format", The MathWorks (versions 4 and 5; 7 is 5 with variables that zlib has deflated). Version 7.3,
which is HDF5: py.
"""

from __future__ import annotations

import io
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.files import source
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import require_module
from feedsim.foundation.units import known_unit, spell_unit

# --- What a MAT file holds, whatever its version: numbers, texts, structures and cells, by name -----------------------


MAX_INFLATED_BYTES = 2 << 30  # bytes that the variables of a file may inflate to,
RATIO = 100  # nor more than this many times the file's own size,
FREE_BYTES = 256 << 20  # from so many bytes on
MAX_DEPTH = 50  # structures within structures
MAX_FIELDS = 100_000  # variables and fields
REAL_KINDS = "fiu"  # kinds of numpy's types


@dataclass(frozen=True)
class OtherValue:
    """What is neither numbers nor a structure of its own. `what`: in words; `opaque`: only MATLAB reads it."""

    what: str
    opaque: bool = False


# Text is an array of characters (kind U), several structures and cells are a list.
Value = NDArray[np.generic] | dict[str, "Value"] | list["Value"] | OtherValue


class Fault(Exception):
    """What is wrong with a file, in words."""


def allowed_bytes(size: int) -> int:
    """What the variables of a file of `size` bytes may inflate to."""
    return min(MAX_INFLATED_BYTES, max(FREE_BYTES, RATIO * size))


def characters(codes: NDArray[np.uint32]) -> NDArray[np.str_]:
    """Code points as characters; what is none is a blank."""
    allowed = (codes < 0xD800) | ((codes > 0xDFFF) & (codes <= 0x10FFFF))
    return np.where(allowed, codes, 0x20).astype("<u4").view("<U1")


def lines(value: object) -> list[str]:
    """Rows of a text, without the blanks behind them; none of what is no text."""
    if not isinstance(value, np.ndarray) or value.dtype.kind != "U" or value.ndim > 2:
        return []
    return ["".join(row.tolist()).replace("\0", "").rstrip() for row in np.atleast_2d(value)]


def flatten_variables(content: Mapping[str, Value]) -> Iterator[tuple[str, NDArray[np.generic] | OtherValue]]:
    """Variables, those inside structures too, as MATLAB calls them: "structure.field", "signals(2).values". Numbers
    have no dimensions of length 1."""
    for name, value in content.items():
        yield from _parts(name, value)


def _parts(name: str, value: Value) -> Iterator[tuple[str, NDArray[np.generic] | OtherValue]]:
    if isinstance(value, dict):
        for field, inner in value.items():
            yield from _parts(f"{name}.{field}", inner)
    elif isinstance(value, list):
        for number, inner in enumerate(value, 1):
            yield from _parts(f"{name}({number})" if isinstance(inner, dict) else f"{name}{{{number}}}", inner)
    else:
        yield name, value.squeeze() if isinstance(value, np.ndarray) and value.dtype.kind != "U" else value


# --- MAT files of version 7.3, which are HDF5 (sole user of h5py) -----------------------------------------------------
# How MATLAB lays them out: a variable is a dataset or a group with the attribute MATLAB_class; dimensions stand in
# the
# opposite order; fields of several structures and cells are references. Links into other files are not followed.


SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEADS = (0, 512)  # where the signature stands: of any HDF5 file, behind MATLAB's head


def is_hdf5(content: bytes) -> bool:
    """Whether bytes are those of an HDF5 file."""
    return any(content[at : at + len(SIGNATURE)] == SIGNATURE for at in HEADS)


def variables(content: bytes) -> dict[str, Value]:
    """Variables by name. Fault: damaged, or more than is allowed. InputError: h5py is missing."""
    h5py = require_module("h5py", "a MAT file of version 7.3 (HDF5; or save it with -v7)")
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            return _MatHdf5Reader(h5py, file, allowed_bytes(len(content))).members(file, 0)
    except Fault:
        raise
    except Exception as error:  # the library meets damage in many ways
        raise Fault(f"its HDF5 cannot be read: {error}") from None


class _MatHdf5Reader:
    """Values of a file, of up to `allowed` bytes."""

    def __init__(self, h5py: Any, file: Any, allowed: int) -> None:
        self.h5py, self.file, self.allowed, self.count = h5py, file, allowed, 0

    def members(self, group: Any, depth: int) -> dict[str, Value]:
        """What stands in a group, but MATLAB's own (#refs#, #subsystem#)."""
        result: dict[str, Value] = {}
        for name in group:
            if name.startswith("#"):
                continue
            own = isinstance(group.get(name, getlink=True), self.h5py.HardLink)
            result[name] = self.value(group[name], depth + 1) if own else OtherValue("a link")
        return result

    def value(self, item: Any, depth: int) -> Value:
        self.count += 1
        if depth > MAX_DEPTH or self.count > MAX_FIELDS:
            raise Fault(f"more than {MAX_DEPTH} structures within one another, or {MAX_FIELDS} fields")
        attributes: Mapping[str, Any] = item.attrs
        of_class = _mat_hdf5_text(attributes.get("MATLAB_class", ""))
        if "MATLAB_object_decode" in attributes and of_class not in ("string", "function_handle"):
            return OtherValue(f"an object of class {of_class}", opaque=True)
        if of_class == "function_handle":
            return OtherValue("a function", opaque=True)
        if "MATLAB_sparse" in attributes:
            return OtherValue("a sparse matrix")
        if isinstance(item, self.h5py.Group):
            return self._group(item, of_class, depth)
        if not isinstance(item, self.h5py.Dataset):
            return OtherValue("a type")
        return self._dataset(item, of_class, depth)

    def _group(self, group: Any, of_class: str, depth: int) -> Value:
        fields = self.members(group, depth)
        several = [value for name, value in fields.items() if self._refers(group, name)]
        if of_class != "struct" or not several or len(several) < len(fields):
            return fields
        sizes = {len(value) if isinstance(value, list) else 0 for value in several}
        if len(sizes) > 1:
            raise Fault(f"the fields of {group.name!r} have {', '.join(map(str, sorted(sizes)))} elements")
        return [
            {name: value[k] for name, value in fields.items() if isinstance(value, list)} for k in range(sizes.pop())
        ]

    def _refers(self, group: Any, name: str) -> bool:
        """Whether a field is that of several structures, and no cell array."""
        item = group.get(name)
        return self._references(item) and "MATLAB_class" not in item.attrs

    def _references(self, item: Any) -> bool:
        return isinstance(item, self.h5py.Dataset) and self.h5py.check_ref_dtype(item.dtype) is self.h5py.Reference

    def _dataset(self, item: Any, of_class: str, depth: int) -> Value:
        if item.attrs.get("MATLAB_empty", 0):
            return np.zeros(0)
        if item.is_virtual or item.external:
            return OtherValue("numbers of another file")
        size = math.prod(item.shape or (0,)) * item.dtype.itemsize
        self.allowed -= size
        if self.allowed < 0:
            raise Fault(f"{item.name!r} has {size} bytes, more than are allowed of a file of this size")
        if self._references(item):
            count = math.prod(item.shape)
            if count > MAX_FIELDS:
                raise Fault(f"{item.name!r} has {count} elements; up to {MAX_FIELDS} are read")
            return [
                self.value(self.file[reference], depth + 1) if reference else np.zeros(0)
                for reference in np.asarray(item[()]).ravel().tolist()
            ]
        if item.dtype.kind not in "fiub":
            return OtherValue(
                "complex numbers" if item.dtype.names == ("real", "imag") else f"data of type {item.dtype}"
            )
        values = np.asarray(item[()]).T
        if of_class == "char":
            return characters(np.asarray(values, dtype=np.uint32))
        return values.astype(np.uint8) if values.dtype.kind == "b" else values


def _mat_hdf5_text(attribute: object) -> str:
    return attribute.decode("ascii", "replace") if isinstance(attribute, bytes) else str(attribute)


_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}  # of data
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_OTHER_CLASSES = {3: "an object", 5: "a sparse matrix", 16: "a function"}
_ENCODINGS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}  # of texts; other types hold a code point each
_MATRIX, _COMPRESSED = 14, 15
_CELLS, _STRUCTURE, _CHARACTERS, _OPAQUE = 1, 2, 4, 17
_COMPLEX = 0x0800
_VERSION_4 = ("f8", "f4", "i4", "i2", "u2", "u1")


def read_mat(path: Path) -> dict[str, Value]:
    """Variables by name: numbers and characters as arrays, a structure as its fields, several as a list.

    Raises InputError: no such file, none of these versions, damaged, or one that inflates to more than is allowed.
    """
    content = source.content(path, pipes=True)
    try:
        if is_hdf5(content):
            return variables(content)
        return _variables(content)
    except Fault as fault:
        raise InputError(f"{path} is no MAT file that can be read: {fault}") from None


def _variables(content: bytes) -> dict[str, Value]:
    if len(content) < 20:
        raise Fault(f"it has {len(content)} bytes")
    if 0 in content[:4]:
        return _version_4(content)
    if content[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
        raise Fault("its head is that of version 7.3, and what follows is no HDF5")
    if content[124:128] not in (b"\x00\x01IM", b"\x01\x00MI"):
        raise Fault("its head is that of no known version")
    reader = _Reader("<" if content[126:128] == b"IM" else ">", allowed_bytes(len(content)))
    result: dict[str, Value] = {}
    at = 128
    while at < len(content):
        kind, data, at = reader.element(content, at, f"variable {len(result) + 1}")
        if kind == _COMPRESSED:
            kind, data, _ = reader.element(reader.inflate(data), 0, f"variable {len(result) + 1}")
        if kind != _MATRIX:
            raise Fault(f"where variable {len(result) + 1} should stand, there is data of type {kind}")
        name, value = reader.matrix(data, 0)
        result[name] = OtherValue("several variables of that name") if name in result else value
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
            raise Fault(f"it ends within {what}")
        kind, size = self._words.unpack_from(view, at)
        start = at + 8
        if kind >> 16:  # up to four bytes in the tag itself
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise Fault(f"{what} gives {size} bytes where there are 4")
        else:
            end = start + size + (-size % 8 if kind != _COMPRESSED else 0)
        if start + size > len(view):
            raise Fault(f"it ends within {what}, which declares {size} bytes and has {len(view) - start}")
        return kind, view[start : start + size], end

    def inflate(self, data: memoryview) -> bytes:
        try:
            stream = zlib.decompressobj()
            result = stream.decompress(data, self.allowed + 1)
        except zlib.error as error:
            raise Fault(f"a variable cannot be inflated: {error}") from None
        self.allowed -= len(result)
        if self.allowed < 0:
            raise Fault("its variables inflate to more bytes than are allowed of a file of this size")
        if not stream.eof:
            raise Fault("a variable is cut off")
        return result

    def matrix(self, data: memoryview, depth: int) -> tuple[str, Value]:
        """Name and value of a variable or a field."""
        self.count += 1
        if depth > MAX_DEPTH or self.count > MAX_FIELDS:
            raise Fault(f"more than {MAX_DEPTH} structures within one another, or {MAX_FIELDS} fields")
        if not len(data):
            return "", np.zeros(0)
        kind, flags, at = self.element(data, 0, "the head of a variable")
        if kind != 6 or len(flags) < 4:
            raise Fault("the head of a variable holds no flags")
        (word,) = self._flags.unpack_from(flags)
        of_class = word & 0xFF
        shape: tuple[int, ...] = (1,)
        if of_class != _OPAQUE:
            dimensions, at = self._numbers(data, at, "the size of a variable")
            shape = tuple(int(length) for length in dimensions)
            if dimensions.dtype.kind not in "iu" or len(shape) < 2 or len(shape) > 32 or min(shape) < 0:
                raise Fault(f"a variable has the size {dimensions.tolist()}")
        _, text, at = self.element(data, at, "the name of a variable")
        name = _text(bytes(text))
        where = repr(name[:60]) if name else "a field"
        if of_class in _CLASSES:
            return name, self._array(
                data, at, np.dtype(self.order + _CLASSES[of_class]), shape, bool(word & _COMPLEX), where
            )
        if of_class == _CHARACTERS:
            return name, self._characters(data, at, shape, where)
        if of_class == _STRUCTURE:
            elements = self._elements(data, at, depth, shape, where)
            return name, elements[0] if len(elements) == 1 else elements
        if of_class == _CELLS:
            return name, self._cells(data, at, depth, shape, where)
        if of_class == _OPAQUE:
            kind_name = ""
            with suppress(Fault):  # behind the name: the system of classes, and the class
                _, _, at = self.element(data, at, "an object")
                kind_name = _text(bytes(self.element(data, at, "an object")[1]))
            return name, OtherValue(f"an object of class {kind_name}" if kind_name.isidentifier() or "." in kind_name
                               else "an object", opaque=True)  # fmt: skip
        if of_class in _OTHER_CLASSES:
            return name, OtherValue(_OTHER_CLASSES[of_class], of_class == 16)
        raise Fault(f"{where} is of the unknown class {of_class}")

    def _numbers(self, data: memoryview, at: int, what: str) -> tuple[NDArray[np.generic], int]:
        kind, raw, at = self.element(data, at, what)
        if kind not in _TYPES:
            raise Fault(f"{what} is data of type {kind}")
        dtype = np.dtype(self.order + _TYPES[kind])
        if len(raw) % dtype.itemsize:
            raise Fault(f"{what} has {len(raw)} bytes, no whole number of values")
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
                raise Fault(f"{where} holds {len(values)} values; its size {shape} gives {math.prod(shape)}")
            with np.errstate(all="ignore"):
                parts.append(values.astype(dtype.newbyteorder("="), copy=False))
        result = parts[0] + 1j * parts[1] if is_complex else parts[0]
        return result.reshape(shape, order="F")

    def _characters(self, data: memoryview, at: int, shape: tuple[int, ...], where: str) -> Value:
        kind, raw, _ = self.element(data, at, where)
        if kind in _ENCODINGS:
            order = "" if kind == 16 else "-le" if self.order == "<" else "-be"
            text = bytes(raw).decode(_ENCODINGS[kind] + order, "replace")
            codes = np.frombuffer(text.encode("utf-32-le"), "<u4")
        else:
            numbers, _ = self._numbers(data, at, where)
            if numbers.dtype.kind not in "iu":
                raise Fault(f"{where} is text of data of type {kind}")
            codes = numbers.astype(np.uint32)
        if len(codes) != math.prod(shape):
            return OtherValue("text")
        return characters(codes).reshape(shape, order="F")

    def _cells(self, data: memoryview, at: int, depth: int, shape: tuple[int, ...], where: str) -> list[Value]:
        result: list[Value] = []
        for _ in range(math.prod(shape)):
            value, at = self._read_inner(data, at, depth, f"a cell of {where}")
            result.append(value)
        return result

    def _read_inner(self, data: memoryview, at: int, depth: int, what: str) -> tuple[Value, int]:
        """What stands within a structure or a cell, and where the next one begins."""
        kind, inner, at = self.element(data, at, what)
        if kind != _MATRIX:
            raise Fault(f"{what} is data of type {kind}")
        return self.matrix(inner, depth + 1)[1], at

    def _elements(self, data: memoryview, at: int, depth: int, shape: tuple[int, ...], where: str) -> list[Value]:
        """The structures of an array."""
        lengths, at = self._numbers(data, at, f"the fields of {where}")
        _, text, at = self.element(data, at, f"the fields of {where}")
        length = int(lengths[0]) if len(lengths) == 1 else 0
        if length <= 0 or len(text) % length:
            raise Fault(f"the names of the fields of {where} have no length")
        names = [_text(bytes(text[i : i + length])) for i in range(0, len(text), length)]
        count = math.prod(shape)
        if count > MAX_FIELDS:
            raise Fault(f"{where} has {count} structures; up to {MAX_FIELDS} are read")
        result: list[Value] = []
        for _ in range(count):
            fields: dict[str, Value] = {}
            for name in names:
                value, at = self._read_inner(data, at, depth, f"the field {name[:60]!r} of {where}")
                fields[name] = OtherValue("several fields of that name") if name in fields else value
            result.append(fields)
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
            raise Fault(f"it ends within the head of variable {len(result) + 1}")
        code, rows, columns, imaginary, length = head.unpack_from(content, at)
        at += head.size
        kind, precision = code % 10, code // 10 % 10
        fits = 0 <= code < 5000 and not code // 100 % 10 and kind <= 2 and precision < len(_VERSION_4)
        if not fits or min(rows, columns) < 0 or not 0 < length <= 1024 or imaginary not in (0, 1):
            raise Fault(f"the head of variable {len(result) + 1} is that of none")
        name = _text(content[at : at + length])
        dtype = np.dtype(order + _VERSION_4[precision])
        at += length
        size = rows * columns * dtype.itemsize
        if at + size * (1 + imaginary) > len(content):
            raise Fault(f"it ends within {name[:60]!r}, which is to have {rows} rows and {columns} columns")
        if name in result:
            result[name] = OtherValue("several variables of that name")
        elif kind == 2:
            result[name] = OtherValue("a sparse matrix")
        else:
            values = np.frombuffer(content, dtype, rows * columns, at).astype(dtype.newbyteorder("="), copy=False)
            if imaginary:
                values = values + 1j * np.frombuffer(content, dtype, rows * columns, at + size)
            if kind:  # text: a number a character
                codes = np.nan_to_num(values.real, nan=0, posinf=0, neginf=0).clip(0, 0x10FFFF)
                values = characters(codes.astype(np.uint32))
            result[name] = values.reshape((rows, columns), order="F")
        at += size * (1 + imaginary)
    return result


# --- Result files of Modelica tools: Dymola, OpenModelica, OMSimulator ------------------------------------------------
# A MAT file with Aclass, name, description, dataInfo, and tables data_1, data_2, ... "binTrans" has a column for each
# name, "binNormal" a row. A row of dataInfo is of a name: table (0: the abscissa of all), column of it (negative: with
# the opposite sign), interpolation, and what is beyond its ends (-1: nothing, 0: the end's value, 1: a line). Each
# table has its abscissa first; data_1 has parameters and constants, at the first and the last instant.


TIME_NAME = "time"
NOT_BEYOND, LINE_BEYOND = -1, 1  # of the last column of dataInfo
_UNIT = re.compile(r".*\[([^\[\]|]+)(?:\|[^\[\]]*)?\]\s*")  # "angle [rad|deg]"


@dataclass(frozen=True)
class Column:
    """A variable of a result over the time of the result. constant: it is the same throughout, and in one number."""

    name: str
    values: NDArray[np.generic]
    unit: str
    constant: bool


def is_result(content: Mapping[str, Value]) -> bool:
    """Whether variables of a MAT file are those of a result."""
    return {"Aclass", "name", "dataInfo"} <= content.keys() and any(name.startswith("data_") for name in content)


def columns(path: Path, content: Mapping[str, Value]) -> Iterator[Column]:
    """Variables of a result, the time first, called "time". InputError: tables that do not fit one another."""
    across = any("binTrans" in row for row in lines(content["Aclass"])) or any(
        "binTrans" in row for row in lines(_transpose_value(content["Aclass"]))
    )
    names, texts = (
        lines(_transpose_value(content.get(key)) if across else content.get(key)) for key in ("name", "description")
    )
    info = _table(path, content, "dataInfo", across)
    if info.shape[1] < 4 or len(names) != len(info) or not np.all(np.isfinite(info)):
        raise InputError(
            f"{path}: a result file of Modelica with {len(names)} names, but dataInfo of {info.shape[0]} rows and "
            f"{info.shape[1]} columns; as many rows as names, and 4 columns of whole numbers, are expected"
        )
    numbered = {int(key[5:]): key for key in content if re.fullmatch(r"data_[1-9][0-9]{0,3}", key)}
    tables = {number: _table(path, content, key, across) for number, key in numbered.items()}
    if not tables:
        raise InputError(f"{path}: a result file of Modelica without data_1, data_2, ...")
    longest = max(tables.values(), key=len)
    time = np.asarray(longest[:, 0])
    yield Column(TIME_NAME, time, _unit(texts, int(np.argmax(info[:, 0] == 0))) or "s", False)
    seen = {TIME_NAME}
    for k, (name, row) in enumerate(zip(names, info.tolist(), strict=True)):
        number, place, beyond = int(row[0]), int(row[1]), int(row[3])
        if number == 0 or not name or name in seen:
            continue
        table = tables.get(number)
        if table is None or not 1 <= abs(place) <= table.shape[1]:
            there = f"which has {table.shape[1]}" if table is not None else "which is missing"
            raise InputError(f"{path}: {name[:60]!r} is to be column {abs(place)} of data_{number}, {there}")
        seen.add(name)
        values = table[:, abs(place) - 1] if place > 0 else -table[:, abs(place) - 1]
        constant = bool(np.all(values == values[0]))
        over_time = _resample_table(time, table[:, 0], values, beyond, constant)
        yield Column(name, over_time, _unit(texts, k), constant and number == 1)


def _resample_table(time: Array, own: Array, values: Array, beyond: int, constant: bool) -> Array:
    """Values of a table over the time of the result."""
    if len(own) == len(time) and bool(np.all(own == time)):
        return values
    if constant:
        return np.broadcast_to(values[:1], time.shape)
    result = np.interp(time, own, values)
    if beyond == NOT_BEYOND:
        result[(time < own[0]) | (time > own[-1])] = np.nan
    elif beyond == LINE_BEYOND:
        for outside, a, b in ((time < own[0], 0, 1), (time > own[-1], -2, -1)):
            run = own[b] - own[a]
            result[outside] = values[a] + (time[outside] - own[a]) * ((values[b] - values[a]) / run if run else 0.0)
    return result


def _table(path: Path, content: Mapping[str, Value], key: str, across: bool) -> Array:
    value = content[key]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in REAL_KINDS or value.ndim != 2 or not value.size:
        raise InputError(f"{path}: a result file of Modelica, whose {key} is no table of numbers")
    return np.asarray(value.T if across else value, dtype=np.float64)


def _transpose_value(value: Value | None) -> Value | None:
    return value.T if isinstance(value, np.ndarray) else value


def _unit(texts: list[str], k: int) -> str:
    """Unit at the end of a description."""
    match = _UNIT.fullmatch(texts[k]) if k < len(texts) else None
    return spell_unit(match[1].strip()) if match and known_unit(match[1].strip()) else ""


# --- Columns of a MAT file, as the programs call them that have written it --------------------------------------------
# Vectors, rows and columns of matrices, and fields of structures are called as MATLAB writes them: `rec.pos`,
# `data(:,2)`, `simout.signals(1).values`. Simulink ("Structure With Time", "Structure", "To File"), timeseries that are
# structures, and ControlDesk (X and Y) give besides which of them is the time, and names of the others. Result files of
# Modelica tools have tables of their own: modelica.py.


MAT = ".mat"
TIME, TIME_FIELDS = "time", ("time", "t")
# What to type in MATLAB for an object that only MATLAB reads.
_ADVICE = {
    "timeseries": "t = {0}.Time; x = {0}.Data; save('record.mat', 't', 'x', '-v7')",
    "Simulink.SimulationData.Dataset":
        "x = {0}{{1}}.Values; t = x.Time; x = x.Data; save('record.mat', 't', 'x', '-v7')",
    "timetable": "t = seconds({0}.(1)); x = {0}.(2); save('record.mat', 't', 'x', '-v7')",
    "table": "s = table2struct({0}, 'ToScalar', true); save('record.mat', 's', '-v7')",
}  # fmt: skip
MIN_MATRIX_ROWS = 8  # of a matrix whose columns are signals: a record has as many
_UNIT_BEHIND = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]")
_ONE_OF_A_VECTOR = re.compile(r"\((?::|:,1|1,:)\)$")

Numbers = NDArray[np.generic]


@dataclass
class MatColumns:
    """Columns of a file.

    Attributes:
        columns: name -> numbers (N,). units: name -> unit, "" where none is known. scalars: single numbers.
        spellings: what MATLAB calls a column, without what may be omitted -> its name here.
        others: what is neither column nor number -> in words. notes: what a reader should know.
    """

    columns: dict[str, Numbers] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    spellings: dict[str, str] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    notes: list[Finding] = field(default_factory=list)

    def add(self, name: str, values: Numbers, unit: str = "", written: str = "") -> None:
        """A column. written: as MATLAB calls it, where that is not its name."""
        self.columns[name], self.units[name] = values, unit
        self.spellings[_short_name(written or name)] = name


def find_column(name: str, names: Iterable[str], spellings: Mapping[str, str]) -> str:
    """The name of a column in any of its spellings; as it is where there is none."""
    if name in names:
        return name
    short = _short_name(name)
    return spellings.get(short) or spellings.get(_ONE_OF_A_VECTOR.sub("", short), name)


def _short_name(text: str) -> str:
    """What MATLAB calls a value, without blanks and the (1) of what is one alone."""
    return re.sub(r"\s+|\(1\)|\{1\}", "", text)


def read_columns(path: Path) -> MatColumns:
    """Columns of a MAT file. InputError: what read_mat() refuses, no column, tables of Modelica that do not fit."""
    content = {name: value for name, value in read_mat(path).items() if name and not name.startswith("__")}
    result = MatColumns()
    if is_result(content):
        for column in columns(path, content):
            result.add(column.name, column.values, column.unit)
            if column.constant:
                result.scalars[column.name] = float(column.values[0].item())
    else:
        groups = [group for name, value in content.items() for group in _groups(name, value)]
        _add_groups(result, groups, taken=set(content))
        _add_rest(result, content, groups)
        _time_of_rows(path, result, content)
    if not result.columns:
        there = f"; there is {', '.join(result.others.values())}" if result.others else ""
        raise InputError(f"{path}: no variable is a vector of real numbers{there}")
    return result


# --- what programs write besides plain variables ---


@dataclass(frozen=True)
class _Signal:
    """Numbers, how MATLAB calls them, and the label and unit that the program gives them."""

    written: str
    values: Numbers
    label: str = ""
    unit: str = ""


@dataclass(frozen=True)
class _Group:
    """Signals over one time, which may be missing. whole: nothing else of the variable is a column."""

    written: str
    time: _Signal | None
    signals: tuple[_Signal, ...]
    whole: bool = True


def _groups(written: str, value: Value) -> Iterator[_Group]:
    """Groups of a variable, and within its structures."""
    if isinstance(value, list):
        for number, inner in enumerate(value, 1):
            yield from _groups(f"{written}({number})", inner)
    elif isinstance(value, dict):
        own = [*_of_simulink(written, value), *_of_control_desk(written, value), *_of_timeseries(written, value)]
        yield from own
        if not own:
            for name, inner in value.items():
                yield from _groups(f"{written}.{name}", inner)


def _of_simulink(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    signals = list(_elements(f"{written}.signals", value.get("signals")))
    if not signals or not all(isinstance(signal.get("values"), np.ndarray) for _, signal in signals):
        return
    time = _numbers(value.get("time"))
    yield _Group(
        written,
        None if time is None else _Signal(f"{written}.time", time),
        tuple(
            _Signal(f"{name}.values", numbers, *_label(_text_of(signal.get("label"))))
            for name, signal in signals
            if (numbers := _numbers(signal["values"])) is not None
        ),
    )


def _of_control_desk(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    times, signals = (list(_elements(f"{written}.{name}", value.get(name))) for name in ("X", "Y"))
    if not times or not signals or not all("Data" in element for _, element in (*times, *signals)):
        return
    paths = [_text_of(signal.get("Name")).strip("\"'") for _, signal in signals]
    ends = [re.split(r"[/\\]", path)[-1].strip("\"'") for path in paths]
    labels = [end if ends.count(end) == 1 else path for end, path in zip(ends, paths, strict=True)]
    for number, (name, element) in enumerate(times, 1):
        time = _numbers(element["Data"])
        own = [
            _Signal(f"{written_signal}.Data", numbers, *_label(label, _text_of(signal.get("Unit"))))
            for (written_signal, signal), label in zip(signals, labels, strict=True)
            if (numbers := _numbers(signal["Data"])) is not None
            and (len(times) == 1 or _index(signal.get("XIndex")) == number)
        ]
        if own:
            yield _Group(written, None if time is None else _Signal(f"{name}.Data", time), tuple(own))


def _of_timeseries(written: str, value: Mapping[str, Value]) -> Iterator[_Group]:
    time, data = _numbers(value.get("Time")), _numbers(value.get("Data"))
    if time is None or data is None:
        return
    about = value.get("DataInfo")
    label = _label(_text_of(value.get("Name")), _text_of(about.get("Units")) if isinstance(about, dict) else "")
    yield _Group(
        written, _Signal(f"{written}.Time", time), (_Signal(f"{written}.Data", data, *label),), "TimeInfo" in value
    )


def _elements(written: str, value: Value | None) -> Iterator[tuple[str, dict[str, Value]]]:
    """Structures, one or several, each as MATLAB calls it."""
    for number, element in enumerate(value if isinstance(value, list) else [value], 1):
        if isinstance(element, dict):
            yield (f"{written}({number})" if isinstance(value, list) else written), element


def _numbers(value: Value | None) -> Numbers | None:
    """Real numbers without dimensions of length 1, more than one; None: it is something else."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in REAL_KINDS or value.size < 2:
        return None
    return value.squeeze()


def _index(value: Value | None) -> int:
    """Which X a signal goes with; the first one, where it does not say so."""
    number = value.item() if isinstance(value, np.ndarray) and value.dtype.kind in REAL_KINDS and value.size == 1 else 1
    return int(number) if np.isfinite(number) else 1


def _text_of(value: Value | None) -> str:
    return " ".join(lines(value)).strip()


def _label(text: str, unit: str = "") -> tuple[str, str]:
    """Label and unit; of "pos [mm]" its parts."""
    if (match := _UNIT_BEHIND.fullmatch(text)) and not match[2].strip().isdecimal() and known_unit(match[2]):
        text, unit = match[1], match[2]
    return text, spell_unit(unit) if unit and known_unit(unit) else ""


def _add_groups(result: MatColumns, groups: list[_Group], taken: set[str]) -> None:
    """Signals by their labels, where each has its own; the time of all of them as "time". taken: names of variables."""
    times = [group.time for group in groups if group.time is not None]
    one = bool(times) and all(np.array_equal(times[0].values, time.values) for time in times) and TIME not in taken
    for time in times:
        result.add(TIME if one else time.written, time.values, "s", time.written)
    labels = Counter(signal.label for group in groups for signal in group.signals)
    for group in groups:
        for signal in group.signals:
            own = labels[signal.label] == 1 and signal.label not in {*taken, *result.columns, TIME}
            for part, values in _vectors(signal.values, len(group.time.values) if group.time is not None else None):
                name = f"{signal.label}{part}" if signal.label and own else f"{signal.written}{part}"
                result.add(name, values, signal.unit, f"{signal.written}{part}")


# --- plain variables ---


def _vectors(values: Numbers, length: int | None = None) -> Iterator[tuple[str, Numbers]]:
    """Columns within an array, and how MATLAB calls each: of a matrix those of `length`, else the longer ones."""
    if values.ndim == 1:
        yield "", values
    elif values.ndim == 2:
        down = values.shape[0] >= values.shape[1] if length not in values.shape else length == values.shape[0]
        for k, vector in enumerate(values.T if down else values, 1):
            yield f"(:,{k})" if down else f"({k},:)", vector
    elif values.ndim == 3 and length == values.shape[2]:
        for i, j in np.ndindex(*values.shape[:2]):
            yield f"({i + 1},{j + 1},:)", values[i, j]


def _add_rest(result: MatColumns, content: Mapping[str, Value], groups: list[_Group]) -> None:
    """What no group has."""
    whole = tuple(f"{group.written}." for group in groups if group.whole)
    plain: dict[str, Numbers] = {}
    for name, value in flatten_variables(content):
        if name.startswith(whole) or _short_name(name) in result.spellings:
            continue
        if isinstance(value, OtherValue):
            result.others[name] = _describe_other(name, value)
        elif value.dtype.kind not in REAL_KINDS:
            kind = "text" if value.dtype.kind == "U" else f"{value.dtype} of shape {value.shape}"
            result.others[name] = f"{name!r} ({kind})"
        elif value.size == 1:
            result.scalars[name] = float(value.item())
        elif (value.ndim == 1 and value.size) or (value.ndim == 2 and max(value.shape) >= MIN_MATRIX_ROWS):
            vectors = _vectors(value)
            plain |= {f"{name}{part}": vector for part, vector in vectors}
        else:
            result.others[name] = f"{name!r} ({value.dtype} of shape {value.shape})"
    times = [name for name in plain if name.rpartition(".")[2].lower() in TIME_FIELDS]
    inside = len(times) == 1 and times[0].lower() not in TIME_FIELDS and TIME not in result.columns
    for name, vector in plain.items():
        result.add(TIME if inside and name == times[0] else name, vector, written=name)


def _describe_other(name: str, value: OtherValue) -> str:
    if not value.opaque:
        return f"{name!r} ({value.what})"
    of_class = value.what.rpartition(" ")[2]
    advice = _ADVICE.get(of_class, "").format(name) or "save what it holds as vectors"
    return f"{name!r} ({value.what}, which only MATLAB reads; there: {advice})"


def _time_of_rows(path: Path, result: MatColumns, content: Mapping[str, Value]) -> None:
    """The first row of a file's only matrix as the time, where it can be: Simulink's "To File" writes it so."""
    names = [name for name in content if f"{name}(1,:)" in result.columns]
    if len(names) != 1 or not all(name.startswith(f"{names[0]}(") for name in result.columns):
        return
    first = f"{names[0]}(1,:)"
    if bool(np.all(np.diff(result.columns[first].astype(np.float64)) > 0)):
        columns = dict(result.columns)
        result.columns.clear()
        result.add(TIME, columns.pop(first), "s", first)
        result.columns |= columns
        text = f"{path}: {first} is taken to be the time in s, as Simulink's To File writes it"
        result.notes.append(Finding("time-assumed", "doubt", text, str(path)))
