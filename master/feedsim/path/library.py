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
VERSION = 1
FIELDS = (
    ("int64_t", "rows"), ("int64_t", "axes"), ("int64_t", "space_x"), ("int64_t", "space_y"), ("int64_t", "space_z"),
    ("doubles", "start"), ("bytes", "motion"), ("doubles", "end"), ("doubles", "centre"), ("doubles", "normal"),
    ("doubles", "angle"), ("doubles", "feed"), ("doubles", "dwell"), ("bytes", "blending"), ("doubles", "tolerance"),
    ("bytes", "jerk_limited"), ("bytes", "compressed"), ("doubles", "max_speed"), ("doubles", "max_acceleration"),
    ("doubles", "max_jerk"), ("doubles", "speed_jump"), ("double", "path_acceleration"), ("double", "path_jerk"),
    ("double", "step_time"), ("double", "grid"), ("double", "split_angle"), ("double", "short_block"),
    ("double", "spline_tolerance"), ("times", "start_time"), ("times", "end_time"), ("codes", "limit_kind"),
    ("codes", "limit_axis"),
)  # fmt: skip
INTERFACE = f"{VERSION}: {' '.join(f'{kind} {name},' for kind, name in FIELDS)}"
MOST_AXES = 9
DONE, MORE = 0, 1

_TYPES: dict[str, Any] = {"int64_t": ctypes.c_int64, "double": ctypes.c_double}
_DTYPES: dict[str, type] = {"doubles": np.float64, "times": np.float64, "bytes": np.int8, "codes": np.int8}


class Program(ctypes.Structure):
    """What the planner plans; the arrays that it points to are kept in `columns`."""

    _fields_ = tuple((name, _TYPES.get(kind, ctypes.c_void_p)) for kind, name in FIELDS)

    def __init__(self, values: dict[str, object]) -> None:
        super().__init__()
        self.columns: dict[str, NDArray[Any]] = {}
        for kind, name in FIELDS:
            value = values[name]
            if kind in _DTYPES:
                value = self.columns[name] = np.ascontiguousarray(value, dtype=_DTYPES[kind])
                setattr(self, name, value.ctypes.data)
            else:
                setattr(self, name, value)


@cache
def load() -> ctypes.CDLL:
    """The library beside the archives.

    Raises:
        InputError: there is none that fits.
    """
    reasons = []
    for folder in dict.fromkeys((fmus_directory(), shipped("fmus"))):
        found = native.library("planner", folder, INTERFACE)
        if not isinstance(found, str):
            pointer, count = ctypes.c_void_p, ctypes.c_int64
            found.planner_create.restype, found.planner_create.argtypes = pointer, (ctypes.POINTER(Program),)
            found.planner_destroy.restype, found.planner_destroy.argtypes = None, (pointer,)
            found.planner_advance.restype, found.planner_advance.argtypes = ctypes.c_int, (pointer, pointer)
            found.planner_duration.restype, found.planner_duration.argtypes = (
                ctypes.c_double, (pointer, pointer, pointer),
            )  # fmt: skip
            found.planner_sections.restype, found.planner_sections.argtypes = count, (pointer,)
            found.planner_section.restype, found.planner_section.argtypes = None, (pointer, count, pointer, pointer)
            found.planner_sample.restype = ctypes.c_int
            found.planner_sample.argtypes = (pointer, count, *(pointer,) * 8)
            return found
        reasons.append(found)
    why = "; ".join(dict.fromkeys(reasons))
    raise InputError(f"NC programs are planned by a library of C, which is missing here: {why}; {mend('it')}")
