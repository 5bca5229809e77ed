"""MAT files (up to version 7): their variables, and CSV traces made of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim import units
from feedsim.errors import InputError
from feedsim.trace.csv import write_csv
from feedsim.trace.trace import Array, Trace, suggest


@dataclass(frozen=True, eq=False)
class Variables:
    """Variables of a MAT file; a field inside a structure is "structure.field".

    Attributes:
        path: the file.
        vectors: names of the vectors of real numbers, rows and columns alike.
        scalars: single real numbers.
        kinds: everything else, in words ("'map' (float64 of shape (3, 4))").
    """

    path: Path
    vectors: tuple[str, ...]
    scalars: Mapping[str, float]
    kinds: Mapping[str, str]
    content: Mapping[str, Any]

    def vector(self, name: str) -> Array:
        """Values of a vector. InputError: no vector of finite real numbers, with the element."""
        return _vector(self.path, self.content, name)


def read_mat(path: str | Path) -> Variables:
    """Read the variables of a MAT file of version 4 to 7.

    Raises InputError: the file is not there or is none; one of version 7.3, which is HDF5.
    """
    path = Path(path)
    content = _load(path)
    vectors: list[str] = []
    scalars: dict[str, float] = {}
    kinds: dict[str, str] = {}
    for name, value in _flat(content):
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim == 1 and array.size > 1:
            vectors.append(name)
        elif array.dtype.kind in "fiu" and array.size == 1:
            scalars[name] = float(array.item())
        elif type(value).__name__ in ("MatlabOpaque", "MatlabFunction"):
            kinds[name] = "an object such as a table or timetable, which only MATLAB reads: save its columns as vectors"
        else:
            kinds[name] = f"{name!r} ({array.dtype} of shape {array.shape})"
    return Variables(path, tuple(vectors), scalars, kinds, content)


def _flat(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Variables, those inside structures too, each with its name."""
    for name, value in content.items():
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            yield prefix + name, value
        else:
            yield from _flat({each: getattr(value, each) for each in fields}, f"{prefix}{name}.")


def convert_mat(path: str | Path, columns: Sequence[tuple[str, str, str]], out: str | Path) -> Trace:
    """Write variables of a MAT file as a CSV trace and return the trace.

    columns  (variable, new name, unit of the values); the first must be the time (name "time", any unit of time). A
             variable inside a structure is "structure.field".

    Raises InputError: no MAT file that can be read, a variable that is missing (with those there are), no vector of
    real finite numbers, or of another length than the time. OutputError: `out` cannot be written.
    """
    path = Path(path)
    if not columns or columns[0][1] != "time":
        raise InputError("the first column must be the time, for example t=time:s")
    factor = units.factor(columns[0][2], "s")
    for _, _, unit in columns[1:]:
        units.unit(unit)
    if doubled := [name for i, (_, name, _) in enumerate(columns) if name in [other for _, other, _ in columns[:i]]]:
        raise InputError(f"two columns are to be called {doubled[0]!r}")
    variables = _load(path)
    vectors = {name: _vector(path, variables, variable) for variable, name, _ in columns}
    time = vectors.pop("time") * float(factor)
    for variable, name, _ in columns[1:]:
        if vectors[name].size != time.size:
            raise InputError(
                f"{path}: {variable!r} has {vectors[name].size} values, the time {columns[0][0]!r} has {time.size}"
            )
    try:
        trace = Trace(time, vectors, {name: unit for _, name, unit in columns[1:]})
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    write_csv(out, trace)
    return trace


def _load(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        # Read into memory first: given a name, the reader tries further names of its own.
        with path.open("rb") as file:
            content = loadmat(file, struct_as_record=False, squeeze_me=True)
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except NotImplementedError:
        raise InputError(f"{path} is a MAT file of version 7.3 (HDF5); save it with -v7") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except Exception as error:  # the reader raises many kinds on a file that is none
        raise InputError(f"{path} is no MAT file that can be read: {error}") from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _vector(path: Path, variables: Mapping[str, Any], variable: str) -> Array:
    names = variable.split(".")
    value: Any = variables.get(names[0])
    if value is None:
        raise InputError(f"{path}: no variable {names[0]!r}{suggest(names[0], variables)}")
    for depth, name in enumerate(names[1:], start=1):
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            raise InputError(f"{path}: {'.'.join(names[:depth])!r} is no structure")
        if name not in fields:
            raise InputError(f"{path}: no field {name!r} in {'.'.join(names[:depth])!r}{suggest(name, fields)}")
        value = getattr(value, name)
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        kind = f"{array.dtype} of shape {array.shape}" if array.dtype.kind in "fiucb" else "no numbers"
        raise InputError(f"{path}: {variable!r} is {kind}; a vector of real numbers is needed")
    numbers = array.astype(np.float64)
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{path}: {variable!r} is not finite at element {int(np.argmin(np.isfinite(numbers))) + 1}")
    return numbers
