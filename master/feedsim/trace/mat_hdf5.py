"""MAT files of version 7.3, which are HDF5 (sole user of h5py).

How MATLAB lays them out: a variable is a dataset or a group with the attribute MATLAB_class; dimensions stand in the
opposite order; fields of several structures and cells are references. Links into other files are not followed.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from feedsim.extras import need
from feedsim.trace.mat_values import MAX_DEPTH, MAX_FIELDS, Fault, Other, Value, allowed_bytes, characters

SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEADS = (0, 512)  # where the signature stands: of any HDF5 file, behind MATLAB's head


def is_hdf5(content: bytes) -> bool:
    """Whether bytes are those of an HDF5 file."""
    return any(content[at : at + len(SIGNATURE)] == SIGNATURE for at in HEADS)


def variables(content: bytes) -> dict[str, Value]:
    """Variables by name. Fault: damaged, or more than is allowed. InputError: h5py is missing."""
    h5py = need("h5py", "a MAT file of version 7.3 (HDF5; or save it with -v7)")
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            return _Reader(h5py, file, allowed_bytes(len(content))).members(file, 0)
    except Fault:
        raise
    except Exception as error:  # the library meets damage in many ways
        raise Fault(f"its HDF5 cannot be read: {error}") from None


class _Reader:
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
            result[name] = self.value(group[name], depth + 1) if own else Other("a link")
        return result

    def value(self, item: Any, depth: int) -> Value:
        self.count += 1
        if depth > MAX_DEPTH or self.count > MAX_FIELDS:
            raise Fault(f"more than {MAX_DEPTH} structures within one another, or {MAX_FIELDS} fields")
        attributes: Mapping[str, Any] = item.attrs
        of_class = _text(attributes.get("MATLAB_class", ""))
        if "MATLAB_object_decode" in attributes and of_class not in ("string", "function_handle"):
            return Other(f"an object of class {of_class}", opaque=True)
        if of_class == "function_handle":
            return Other("a function", opaque=True)
        if "MATLAB_sparse" in attributes:
            return Other("a sparse matrix")
        if isinstance(item, self.h5py.Group):
            return self._group(item, of_class, depth)
        if not isinstance(item, self.h5py.Dataset):
            return Other("a type")
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
            return Other("numbers of another file")
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
            return Other("complex numbers" if item.dtype.names == ("real", "imag") else f"data of type {item.dtype}")
        values = np.asarray(item[()]).T
        if of_class == "char":
            return characters(np.asarray(values, dtype=np.uint32))
        return values.astype(np.uint8) if values.dtype.kind == "b" else values


def _text(attribute: object) -> str:
    return attribute.decode("ascii", "replace") if isinstance(attribute, bytes) else str(attribute)
