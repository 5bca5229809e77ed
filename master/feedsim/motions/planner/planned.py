"""Rows of an NC program -> the motion along them within the limits of every axis. Equations: docs/theory.md."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim.foundation import installation
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import fmus_directory, repair_advice, shipped
from feedsim.motions.part_program import Moves

# --- The path planner's library (``src/planner``), called by ctypes ---------------------------------------------------


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
        library = installation.library("planner", folder, PLANNER_INTERFACE)
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
    raise InputError(f"NC programs are planned by a library of C, which is missing here: {why}; {repair_advice('it')}")


# --- Rows of an NC program -> the motion along them within the limits of every axis. Equations: docs/theory.md --------


Floats = NDArray[np.float64]


class Acts(IntEnum):
    """What held a row back for most of its time."""

    NOTHING = 0
    FEED = 1
    SPEED = 2
    ACCELERATION = 3
    JERK = 4
    CORNER = 5


@dataclass(frozen=True)
class Limits:
    """Limits of a machine for its programs; arrays have an entry per axis, in SI units.

    axes: names. max_speed [m/s], max_acceleration [m/s^2], max_jerk [m/s^3]: of each axis; a jerk may be infinite.
    T_ipo: cycle of the interpolator [s], at a multiple of which motions begin. path_acceleration [m/s^2], path_jerk
    [m/s^3]: of the speed along the path, beside those of the axes. speed_jump: permitted jump of an axis's speed at a
    corner in continuous-path mode (G64), as a multiple of max_acceleration T_ipo. step_time: the acceleration of an
    axis may step by its max_jerk times this [s] at the ends of a corner with legs (G641), and where curvature steps in
    G64. split_angle: corners above it split a compressor's spline [rad]. short_block: longest block that a compressor
    takes into a spline [m]. spline_tolerance: largest distance of a spline from the programmed path where the program
    names none [m].
    """

    axes: tuple[str, ...]
    max_speed: Floats
    max_acceleration: Floats
    max_jerk: Floats
    T_ipo: float
    path_acceleration: float = np.inf
    path_jerk: float = np.inf
    speed_jump: float = 1.2
    step_time: float = 2e-3
    split_angle: float = np.pi / 6
    short_block: float = 20e-3
    spline_tolerance: float = 5e-6

    def of(self, axes: tuple[str, ...]) -> tuple[Floats, Floats, Floats]:
        """Speed, acceleration and jerk of these axes, in their order. InputError: one is missing or not positive."""
        if missing := [name for name in axes if name not in self.axes]:
            raise InputError(f"the program moves {missing[0]}; the machine's axes are {', '.join(self.axes)}")
        at = [self.axes.index(name) for name in axes]
        limits = []
        for what in ("max_speed", "max_acceleration", "max_jerk"):
            values = np.asarray(getattr(self, what), dtype=np.float64)
            if values.shape != (len(self.axes),):
                raise InputError(f"{what} has the shape {values.shape}; one value per axis is needed, {len(self.axes)}")
            bad = ~(values > 0) | (np.isinf(values) & (what != "max_jerk"))
            if bad.any():
                axis = int(np.flatnonzero(bad)[0])
                finite = "" if what == "max_jerk" else " and finite"
                raise InputError(f"{what} of {self.axes[axis]} is {values[axis]:.9g}; it must be above 0{finite}")
            limits.append(values[at])
        return limits[0], limits[1], limits[2]


@dataclass(frozen=True)
class SampledPath:
    """At T instants: position (T, A) [m]; row (T,), the row of the program; s (T,), place on the programmed path [m]
    from its beginning."""

    position: Floats
    row: NDArray[np.int64]
    s: Floats


@dataclass(frozen=True)
class Derivatives:
    """At T instants, exactly: velocity, acceleration, jerk (T, A) [m/s, m/s^2, m/s^3]; parameter (T, 4): the path's
    parameter q in its section, which is its length but for corners, and its three derivatives by time; to_end (T,):
    distance to the nearer end of the line, arc or corner along the path [m], where the jerk steps, and in G64 and G641
    the acceleration."""

    velocity: Floats
    acceleration: Floats
    jerk: Floats
    parameter: Floats
    to_end: Floats


@dataclass(frozen=True)
class Sections:
    """Stretches of the plan, K of them: begin, duration [s]; filter_time T [s]; share of acceleration and jerk that
    curvature may take; first_row, last_row."""

    begin: Floats
    duration: Floats
    filter_time: Floats
    share: Floats
    first_row: NDArray[np.int64]
    last_row: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A program as a motion over time.

    moves, limits: what it was planned from. duration [s]: from its first motion to its last. start_time, end_time
    (N,): of every row [s]; rows meet where the middle of their corner is passed. acts (N,): what held the row back for
    most of its time (:class:`Acts`). axis (N,): index of the axis whose limit it is; -1: the path's. notes: what there
    is to say.
    """

    moves: Moves
    limits: Limits
    duration: float
    start_time: Floats
    end_time: Floats
    acts: NDArray[np.int8]
    axis: NDArray[np.int8]
    notes: tuple[Finding, ...]
    _planner: int = field(repr=False)
    _program: Program = field(repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    def sample(self, t: ArrayLike) -> SampledPath:
        """Position and place on the programmed path at ascending instants ``t`` (T,) [s].

        Raises:
            InputError: the instants do not ascend.
        """
        at, position = self._at(t)
        row, s = np.empty(len(at), np.int64), np.empty(len(at))
        self._call(at, position, row, s, None, None, None, None)
        return SampledPath(position, row, s)

    def derivatives(self, t: ArrayLike) -> Derivatives:
        """Velocity, acceleration and jerk at ascending instants ``t`` (T,) [s], in closed form."""
        at, position = self._at(t)
        v, a, j = (np.zeros_like(position) for _ in range(3))
        q = np.empty((len(at), 5))
        self._call(at, position, None, None, v, a, j, q)
        return Derivatives(v, a, j, q[:, :4], q[:, 4])

    @property
    def sections(self) -> Sections:
        """The stretches that were planned each with its own filter time."""
        library = load()
        count = library.planner_sections(self._planner)
        rows, values = np.empty((count, 2), np.int64), np.empty((count, 4))
        for k in range(count):
            library.planner_section(self._planner, k, rows[k].ctypes.data, values[k].ctypes.data)
        return Sections(*values.T, *rows.T)

    def _at(self, t: ArrayLike) -> tuple[Floats, Floats]:
        at = np.ascontiguousarray(t, dtype=np.float64)
        if at.ndim != 1 or not np.all(np.diff(at) >= 0):
            raise InputError("instants of a planned path must be one row of ascending numbers")
        return at, np.empty((len(at), len(self.moves.axes)))

    def _call(self, at: Floats, *columns: NDArray[np.generic] | None) -> None:
        pointers = [None if column is None else column.ctypes.data for column in columns]
        with self._lock:
            if load().planner_sample(self._planner, len(at), at.ctypes.data, *pointers) != STATE_DONE:
                raise MemoryError("no memory to sample a planned path")


def plan_moves(moves: Moves, limits: Limits, progress: Callable[[int, int], None] | None = None) -> PlannedPath:
    """Plan the motion of a program.

    progress: called with the rows that are planned and all rows, now and then; what it raises ends the plan, as Ctrl-C
    does.

    Raises:
        InputError: an axis without limits, a limit that is none, or no library for this platform.
    """
    library = load()
    axes = moves.axes
    speed, acceleration, jerk = limits.of(axes)
    if len(axes) > MAX_PLANNED_AXES:
        raise InputError(f"the program moves {len(axes)} axes; at most {MAX_PLANNED_AXES} are planned")
    if not limits.T_ipo > 0:
        raise InputError(f"the cycle of the interpolator is {limits.T_ipo:.9g} s; it must be above 0")
    rows = len(moves)
    space = {f"space_{name.lower()}": axes.index(name) if name in axes else -1 for name in "XYZ"}
    program = Program({
        **{name: getattr(moves, name) for name in (
            "start", "motion", "end", "centre", "normal", "angle", "feed", "dwell", "blending", "tolerance",
            "jerk_limited", "compressed",
        )},
        **space, "rows": rows, "axes": len(axes),
        "max_speed": speed, "max_acceleration": acceleration, "max_jerk": jerk,
        "speed_jump": limits.speed_jump * acceleration * limits.T_ipo,
        "path_acceleration": limits.path_acceleration, "path_jerk": limits.path_jerk,
        "step_time": limits.step_time, "grid": limits.T_ipo, "split_angle": limits.split_angle,
        "short_block": limits.short_block, "spline_tolerance": limits.spline_tolerance,
        "start_time": np.zeros(rows), "end_time": np.zeros(rows),
        "limit_kind": np.zeros(rows, np.int8), "limit_axis": np.full(rows, -1, np.int8),
    })  # fmt: skip
    planner = library.planner_create(ctypes.byref(program))
    if not planner:
        raise MemoryError("no memory to plan a program")
    try:
        done, state = ctypes.c_int64(0), STATE_MORE
        while state == STATE_MORE:
            state = library.planner_advance(planner, ctypes.byref(done))
            if progress is not None:
                progress(done.value, rows)
        if state != STATE_DONE:
            raise MemoryError("no memory to plan a program")
        saved, corners = np.zeros(2), ctypes.c_int64(0)
        duration = library.planner_duration(planner, saved.ctypes.data, ctypes.byref(corners))
        written = program.columns
        planned = PlannedPath(
            moves,
            limits,
            duration,
            start_time=written["start_time"],
            end_time=written["end_time"],
            acts=written["limit_kind"],
            axis=written["limit_axis"],
            notes=(*_fast_feeds(moves, speed), *_slow_roundings(saved, corners.value)),
            _planner=planner,
            _program=program,
        )
    except BaseException:
        library.planner_destroy(planner)
        raise
    weakref.finalize(planned, library.planner_destroy, planner)
    return planned


def _fast_feeds(moves: Moves, speed: Floats) -> list[Finding]:
    """Programmed speeds that no axis reaches, nor all of them together."""
    fastest = float(np.linalg.norm(speed))
    above = np.flatnonzero(np.nan_to_num(moves.feed) > fastest)
    if not len(above):
        return []
    row = above[0]
    more = f", as in {len(above) - 1} other rows" if len(above) > 1 else ""
    place = f"{moves.files[moves.file[row]]}:{moves.line[row]}"
    return [Finding(
        "feed-out-of-reach", "note",
        f"{place}: F {moves.feed[row] * 6e4:.6g} mm/min is above what the "
        f"axes reach together, {fastest * 6e4:.6g} mm/min{more}; their limits hold",
        place,
    )]  # fmt: skip


def _slow_roundings(saved: Floats, corners: int) -> list[Finding]:
    """Stretches whose corners take longer than stops would."""
    if not corners:
        return []
    remedy = "G60 or a larger tolerance is faster there"
    return [Finding(
        "corners-slower-than-stops", "note",
        f"{corners} rounded corners take longer than exact stops: {saved[0]:.4g} s in place of {saved[1]:.4g} s. "
        f"{remedy}",
        "", remedy,
    )]  # fmt: skip
