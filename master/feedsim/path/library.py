"""The path planner's library (``src/planner``), called by ctypes."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim import native
from feedsim.errors import InputError
from feedsim.installation import fmus_directory, mend, shipped

# src/planner/planner.h, word for word.
PLANNER_VERSION = 1
PROGRAM_FIELDS = (
    ("int64_t", "rows"), ("int64_t", "axes"), ("int64_t", "space_x"), ("int64_t", "space_y"), ("int64_t", "space_z"),
    ("doubles", "start"), ("bytes", "motion"), ("doubles", "end"), ("doubles", "centre"), ("doubles", "normal"),
    ("doubles", "angle"), ("doubles", "feed"), ("doubles", "dwell"), ("bytes", "blending"), ("doubles", "tolerance"),
    ("bytes", "jerk_limited"), ("bytes", "compressed"), ("doubles", "max_speed"), ("doubles", "max_acceleration"),
    ("doubles", "max_jerk"), ("doubles", "speed_jump"), ("double", "path_acceleration"), ("double", "path_jerk"),
    ("double", "step_time"), ("double", "grid"), ("double", "split_angle"), ("double", "short_block"),
    ("double", "spline_tolerance"), ("times", "start_time"), ("times", "end_time"), ("codes", "limit_kind"),
    ("codes", "limit_axis"),
)  # fmt: skip
PLANNER_INTERFACE = f"{PLANNER_VERSION}: {' '.join(f'{kind} {name},' for kind, name in PROGRAM_FIELDS)}"
MAX_PLANNED_AXES = 9
STATE_DONE, STATE_MORE = 0, 1

_FIELD_TYPES: dict[str, Any] = {"int64_t": ctypes.c_int64, "double": ctypes.c_double}
_COLUMN_TYPES: dict[str, type] = {"doubles": np.float64, "times": np.float64, "bytes": np.int8, "codes": np.int8}


class Program(ctypes.Structure):
    """What the planner plans; the arrays that it points to are kept in `columns`."""

    _fields_ = tuple((name, _FIELD_TYPES.get(kind, ctypes.c_void_p)) for kind, name in PROGRAM_FIELDS)

    def __init__(self, values: dict[str, object]) -> None:
        super().__init__()
        self.columns: dict[str, NDArray[Any]] = {}
        for kind, name in PROGRAM_FIELDS:
            value = values[name]
            if kind in _COLUMN_TYPES:
                value = self.columns[name] = np.ascontiguousarray(value, dtype=_COLUMN_TYPES[kind])
                setattr(self, name, value.ctypes.data)
            else:
                setattr(self, name, value)


class ProgrammedPath(ctypes.Structure):
    """Elements of a path (src/planner/nearest.h); the arrays that it points to are kept in `arrays`."""

    _fields_ = (
        ("axes", ctypes.c_int64), ("elements", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("begin", "line", "cosine", "sine", "angle", "s")),
    )  # fmt: skip

    def __init__(self, axes: int, elements: int, *arrays: NDArray[np.float64]) -> None:
        self.arrays = [np.ascontiguousarray(array, dtype=np.float64) for array in arrays]
        super().__init__(axes, elements, *(array.ctypes.data for array in self.arrays))


@cache
def load() -> ctypes.CDLL:
    """The library beside the archives.

    Raises:
        InputError: there is none that fits.
    """
    reasons = []
    for folder in dict.fromkeys((fmus_directory(), shipped("fmus"))):
        library = native.library("planner", folder, PLANNER_INTERFACE)
        if not isinstance(library, str):
            pointer, count = ctypes.c_void_p, ctypes.c_int64
            library.planner_create.restype, library.planner_create.argtypes = pointer, (ctypes.POINTER(Program),)
            library.planner_destroy.restype, library.planner_destroy.argtypes = None, (pointer,)
            library.planner_advance.restype, library.planner_advance.argtypes = ctypes.c_int, (pointer, pointer)
            library.planner_duration.restype, library.planner_duration.argtypes = (
                ctypes.c_double, (pointer, pointer, pointer),
            )  # fmt: skip
            library.planner_sections.restype, library.planner_sections.argtypes = count, (pointer,)
            library.planner_section.restype, library.planner_section.argtypes = None, (pointer, count, pointer, pointer)
            library.planner_sample.restype = ctypes.c_int
            library.planner_sample.argtypes = (pointer, count, *(pointer,) * 8)
            library.planner_nearest.restype = None
            library.planner_nearest.argtypes = (ctypes.POINTER(ProgrammedPath), count, *(pointer,) * 7)
            return library
        reasons.append(library)
    why = "; ".join(dict.fromkeys(reasons))
    raise InputError(f"NC programs are planned by a library of C, which is missing here: {why}; {mend('it')}")
