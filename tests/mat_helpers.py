"""MAT files as programs write them: structures and texts in version 5 and 7.3, result files of Modelica tools.

Content: a dict is a structure, a list of dicts several of them, a text a text, everything else numbers.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat


def save(path: Path, content: Mapping[str, Any], form: str) -> Path:
    """form: "5" or "7.3"."""
    path.write_bytes(hdf5(content) if form == "7.3" else version_5(content))
    return path


def version_5(content: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    savemat(buffer, {name: _for_scipy(value) for name, value in content.items()})
    return buffer.getvalue()


def _for_scipy(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _for_scipy(inner) for name, inner in value.items()}
    if not isinstance(value, list):
        return value
    result = np.empty(len(value), dtype=[(name, object) for name in value[0]])
    for k, element in enumerate(value):
        for name, inner in element.items():
            result[k][name] = _for_scipy(inner)
    return result


def hdf5(content: Mapping[str, Any]) -> bytes:
    """As MATLAB lays out version 7.3: dimensions turned round, fields of several structures as references."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, value in content.items():
            _write(file, file, name, value)
    head = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM"
    return head.ljust(512, b"\0") + buffer.getvalue()[512:]


def _write(file: h5py.File, group: h5py.Group, name: str, value: Any) -> h5py.Dataset | h5py.Group:
    if isinstance(value, (dict, list)):
        item = group.create_group(name)
        item.attrs["MATLAB_class"] = np.bytes_("struct")
        if isinstance(value, dict):
            for key, inner in value.items():
                _write(file, item, key, inner)
            return item
        for key in value[0]:
            store = file.require_group("#refs#")
            references = [_write(file, store, f"r{len(store)}", element[key]).ref for element in value]
            item.create_dataset(key, data=np.array([references], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        return item
    if isinstance(value, str):
        codes = np.array([[ord(c)] for c in value], dtype=np.uint16)
        item = group.create_dataset(name, data=codes if value else np.zeros(2, np.uint64))
        item.attrs["MATLAB_class"] = np.bytes_("char")
        if not value:
            item.attrs["MATLAB_empty"] = np.uint8(1)
        return item
    array = np.atleast_2d(np.asarray(value, dtype=np.float64))
    item = group.create_dataset(name, data=array.T, compression="gzip" if array.size > 1 else None)
    item.attrs["MATLAB_class"] = np.bytes_("double")
    return item


def modelica(
    time: Sequence[float], variables: Mapping[str, tuple[str, int, int]], tables: Sequence[np.ndarray], across: bool,
    beyond: int = -1,
) -> bytes:  # fmt: skip
    """A result file of Dymola or OpenModelica.

    variables: name -> description, table from 1, column from 1 (negative: negated). tables: (rows, columns), abscissa
    first. across: binTrans, a column a name.
    """
    names = ["time", *variables]
    texts = ["Time in [s]", *(description for description, _, _ in variables.values())]
    info = np.array([[0, 1, 0, -1], *([number, at, 0, beyond] for _, number, at in variables.values())], dtype=np.int32)
    layout = ["Atrajectory", "1.1", "", "binTrans" if across else "binNormal"]
    parts = [_matrix("Aclass", _characters(layout)), _matrix("name", _turned(_characters(names), across))]
    parts += [_matrix("description", _turned(_characters(texts), across)), _matrix("dataInfo", _turned(info, across))]
    parts += [_matrix(f"data_{k}", _turned(table, across)) for k, table in enumerate(tables, 1)]
    return b"".join(parts)


def _characters(rows: Sequence[str]) -> np.ndarray:
    width = max(map(len, rows))
    return np.array([[ord(c) for c in row.ljust(width)] for row in rows], dtype=np.uint8)


def _turned(array: np.ndarray, across: bool) -> np.ndarray:
    return array.T if across else array


def _matrix(name: str, array: np.ndarray) -> bytes:
    """A variable of version 4."""
    precision = {"f8": 0, "f4": 1, "i4": 2, "u1": 5}[array.dtype.str[1:]]
    text = array.dtype == np.uint8
    head = struct.pack("<5i", 10 * precision + text, *array.shape, 0, len(name) + 1)
    return head + name.encode() + b"\0" + array.tobytes(order="F")
