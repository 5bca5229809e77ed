"""Words of SINUMERIK and ISO programs: what each sets, what is passed over, what is refused and why."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

# --- What an NC program commands, as columns: one row for each movement or dwell, in the program's order. SI units ----


Floats = NDArray[np.float64]


class Motion(IntEnum):
    """What a row is. An arc may be a helix: its end then differs along the normal."""

    RAPID = 0
    LINE = 1
    ARC = 2
    DWELL = 3


class Blending(IntEnum):
    """How the path passes from the end of a row to the next one.

    EXACT_STOP: speed 0 there (G60, G9). CONTINUOUS: within the permitted jump of speed (G64). DISTANCE: a corner whose
    legs are `tolerance` long (G641). TOLERANCE: a corner within `tolerance` of the programmed path (G642, G645).
    """

    EXACT_STOP = 0
    CONTINUOUS = 1
    DISTANCE = 2
    TOLERANCE = 3


@dataclass(frozen=True)
class Note:
    """A word that does not move the path and was passed over. count: how often; file (index), line: where first."""

    word: str
    count: int
    file: int
    line: int


@dataclass(frozen=True)
class Moves:
    """Movements and dwells of a program; N rows, A axes. Angles in rad, lengths in m, times in s.

    axes: names, of which X, Y and Z come first as far as they occur. start (A,): position before the first row.
    motion (N,): Motion. end (N, A): position at the end of each row, in the frame of the machine. centre (N, 3): of
    arcs, in the space of X, Y, Z; its component along the normal is that of the arc's start. normal (N, 3): unit
    vector, about which the arc turns by the right-hand rule. angle (N,): swept by the arc, positive; a full circle has
    2 pi. centre, normal and angle are NaN where a row is no arc. feed (N,): programmed speed along the path [m/s], NaN
    of rapids and dwells. dwell (N,): [s], else 0. blending (N,): Blending at the end of the row. tolerance (N,): [m],
    of Blending.DISTANCE and TOLERANCE, and of compressed rows; else NaN. jerk_limited (N,): SOFT. feedforward (N,):
    FFWON. compressed (N,): COMPCAD and its like. file (N,): index into files. line (N,): from 1. files: names of the
    program and its subprograms. texts: what these files hold. notes: what was passed over.
    """

    axes: tuple[str, ...]
    start: Floats
    motion: NDArray[np.int8]
    end: Floats
    centre: Floats
    normal: Floats
    angle: Floats
    feed: Floats
    dwell: Floats
    blending: NDArray[np.int8]
    tolerance: Floats
    jerk_limited: NDArray[np.bool_]
    feedforward: NDArray[np.bool_]
    compressed: NDArray[np.bool_]
    file: NDArray[np.int32]
    line: NDArray[np.int32]
    files: tuple[str, ...]
    texts: tuple[str, ...]
    notes: tuple[Note, ...]

    def __len__(self) -> int:
        return len(self.motion)

    @cached_property
    def _ends_of_lines(self) -> Mapping[int, NDArray[np.int64]]:
        return {
            index: np.array([match.start() for match in re.finditer("\n|$", text)], dtype=np.int64)
            for index, text in enumerate(self.texts)
        }

    def text(self, row: int) -> str:
        """The block that a row stands in, as the file has it."""
        file, line = int(self.file[row]), int(self.line[row])
        ends = self._ends_of_lines[file]
        return self.texts[file][int(ends[line - 2]) + 1 if line > 1 else 0 : int(ends[line - 1])].strip()


def row_type(axes: int) -> np.dtype[Any]:
    """Columns of Moves that have an entry per row, as one structured type."""
    return np.dtype([
        ("motion", np.int8), ("end", np.float64, (axes,)), ("centre", np.float64, (3,)), ("normal", np.float64, (3,)),
        ("angle", np.float64), ("feed", np.float64), ("dwell", np.float64), ("blending", np.int8),
        ("tolerance", np.float64), ("jerk_limited", np.bool_), ("feedforward", np.bool_), ("compressed", np.bool_),
        ("file", np.int32), ("line", np.int32),
    ])  # fmt: skip


# --- Words of SINUMERIK and ISO programs: what each sets, what is passed over, what is refused and why ----------------


XY, ZX, YZ = (0, 1, 2), (2, 0, 1), (1, 2, 0)  # first and second axis of the plane, and its normal
INCH = 25.4

# A code: its group, of which a block has one; what it sets (a field of Modal, or an action of its own); the value.
Code = tuple[str, str, Any]


@dataclass
class Modal:
    """What stays in force from block to block. Lengths in mm, tolerance of CTOL too.

    length, feed_length: mm in a unit of positions and of F. feed: mm/min, 1/min or mm per revolution by feed_mode.
    """

    motion: str = "G1"
    plane: tuple[int, int, int] = XY
    incremental: bool = False
    length: float = 1.0
    feed_length: float = 1.0
    feed_mode: str = "G94"
    feed: float = 0.0
    offset: str = "G500"
    blending: Blending = Blending.EXACT_STOP
    adis: float = 0.0
    adispos: float = 0.0
    ctol: float | None = None
    jerk_limited: bool = True
    feedforward: bool = False
    compressed: bool = False
    rounding: float = 0.0
    corner_feed: float = 0.0
    centre_absolute: bool = False


_COMMON: dict[float, Code] = {
    0: ("motion", "motion", "G0"),
    1: ("motion", "motion", "G1"),
    2: ("motion", "motion", "G2"),
    3: ("motion", "motion", "G3"),
    4: ("block", "dwell", True),
    9: ("exact stop of a block", "exact", True),
    17: ("plane", "plane", XY),
    18: ("plane", "plane", ZX),
    19: ("plane", "plane", YZ),
    40: ("tool radius", "", None),
    53: ("frame of a block", "suppress", True),
    **{number: ("work offset", "offset", f"G{number}") for number in range(54, 60)},
    90: ("dimension", "incremental", False),
    91: ("dimension", "incremental", True),
    93: ("kind of feed", "feed_mode", "G93"),
    94: ("kind of feed", "feed_mode", "G94"),
    95: ("kind of feed", "feed_mode", "G95"),
    97: ("kind of spindle speed", "", None),
}
_TOOL_RADIUS = "tool radius compensation is not supported: program the path of the tool's centre (G40)"
_TAPPING_REASON = "threads and tapping follow the spindle, which is not simulated"
_CYCLE = "cycles are not supported: write out their movements"

SINUMERIK_CODES: Mapping[float, Code] = {
    **{number: code for number, code in _COMMON.items() if number not in (58, 59)},
    60: ("exact stop, continuous path", "blending", Blending.EXACT_STOP),
    64: ("exact stop, continuous path", "blending", Blending.CONTINUOUS),
    641: ("exact stop, continuous path", "blending", Blending.DISTANCE),
    642: ("exact stop, continuous path", "blending", Blending.TOLERANCE),
    645: ("exact stop, continuous path", "blending", Blending.TOLERANCE),
    **{number: ("criterion of exact stop", "", None) for number in (601, 602, 603)},
    70: ("unit of length", "units", (INCH, 1.0)),
    71: ("unit of length", "units", (1.0, 1.0)),
    700: ("unit of length", "units", (INCH, INCH)),
    710: ("unit of length", "units", (1.0, 1.0)),
    110: ("block", "pole", "position"),
    111: ("block", "pole", "zero"),
    112: ("block", "pole", "pole"),
    153: ("frame of a block", "suppress", True),
    500: ("work offset", "offset", "G500"),
    **{number: ("work offset", "offset", f"G{number}") for number in range(505, 600)},
    **{number: ("approach", "", None) for number in (450, 451)},
}
ISO_CODES: Mapping[float, Code] = {
    **_COMMON,
    20: ("unit of length", "units", (INCH, INCH)),
    21: ("unit of length", "units", (1.0, 1.0)),
    49: ("tool length", "", None),
    43: ("tool length", "tool_length", True),
    59.1: ("work offset", "offset", "G59.1"),
    59.2: ("work offset", "offset", "G59.2"),
    59.3: ("work offset", "offset", "G59.3"),
    61: ("exact stop, continuous path", "blending", Blending.EXACT_STOP),
    61.1: ("exact stop, continuous path", "blending", Blending.EXACT_STOP),
    64: ("exact stop, continuous path", "blending", Blending.CONTINUOUS),
    80: ("motion", "motion", ""),
    90.1: ("dimension of centres", "centre_absolute", True),
    91.1: ("dimension of centres", "centre_absolute", False),
    98: ("retract", "", None),
    99: ("retract", "", None),
}
_REFUSAL_REASONS: dict[float, str] = {
    **dict.fromkeys((41, 42, 41.1, 42.1), _TOOL_RADIUS),
    **dict.fromkeys((33, 34, 35, 63, 331, 332, 33.1), _TAPPING_REASON),
    **dict.fromkeys((96, 961, 971, 962), "constant cutting speed needs the spindle, which is not simulated"),
}
SINUMERIK_REFUSED: Mapping[float, str] = {
    **_REFUSAL_REASONS,
    **dict.fromkeys((74, 75), "the reference or fixed point of the machine is not known: program the position (G53)"),
    **dict.fromkeys((25, 26), "limits of the working area and the spindle are not supported"),
    **dict.fromkeys((58, 59), "axial substitution of the programmable offset is not supported: use TRANS, ATRANS"),
    **dict.fromkeys((140, 141, 142, 143, 147, 148, 247, 248, 340, 341, 347, 348), "soft approach is not supported"),
    **dict.fromkeys((290, 291), "the dialect does not change within a program"),
    **dict.fromkeys((643, 644, 646), "this kind of continuous path is not supported: use G64, G641, G642 or G645"),
    **dict.fromkeys((5, 7), "inclined axes are not supported"),
    **dict.fromkeys((68, 69, 810, 811), "the code is not supported"),
}
ISO_REFUSED: Mapping[float, str] = {
    **_REFUSAL_REASONS,
    **dict.fromkeys((28, 30, 28.1, 30.1), "the reference position is not known: program the position (G53)"),
    **dict.fromkeys((73, 74, 76, *range(81, 90)), _CYCLE),
    **dict.fromkeys((10, 52, 92, 92.1, 92.2, 92.3), "offsets that a program sets are not supported"),
    **dict.fromkeys((43.1, 43.2, 44), "offsets of the tool are not supported"),
    **dict.fromkeys((5, 5.1, 5.2, 5.3), "splines are not supported"),
    **dict.fromkeys((15, 16, 50, 51, 68, 69), "polar coordinates, scaling and rotation are not supported here"),
    **dict.fromkeys((65, 66, 67), "macro calls are not supported"),
    **dict.fromkeys((38.2, 38.3, 38.4, 38.5, 31), "probing is not supported"),
}

NAMED_CODES: Mapping[str, Code] = {
    "CIP": ("motion", "motion", "CIP"),
    "CT": ("motion", "motion", "CT"),
    "BRISK": ("kind of acceleration", "jerk_limited", False),
    "SOFT": ("kind of acceleration", "jerk_limited", True),
    "FFWON": ("feedforward", "feedforward", True),
    "FFWOF": ("feedforward", "feedforward", False),
    "COMPOF": ("compressor", "compressed", False),
    **{name: ("compressor", "compressed", True) for name in ("COMPON", "COMPCURV", "COMPCAD", "COMPSURF")},
    "SUPA": ("frame of a block", "suppress", True),
    "DIAMOF": ("diameter", "", None),
}
FRAMES = frozenset({"TRANS", "ATRANS", "ROT", "AROT", "SCALE", "ASCALE", "MIRROR", "AMIRROR"})
# Named values of a block. Lengths of the workpiece follow G70 and G71; those of smoothing G700 and G710.
WORKPIECE_LENGTHS = frozenset({"I", "J", "K", "I1", "J1", "K1", "CR", "RP", "RND", "RNDM", "CHF", "CHR"})
VALUES = WORKPIECE_LENGTHS | {"AR", "TURN", "AP", "ANG", "FRC", "FRCM", "ADIS", "ADISPOS", "CTOL", "RPL", "FB"}
WITH_WAY = frozenset({"I", "J", "K", "I1", "J1", "K1", "AP", "RP"})  # which AC and IC may stand at

# What does not move the path: passed over and listed. Some have arguments in parentheses, or a value.
NOTED_WITH_ARGUMENTS = frozenset({
    "MSG", "SETAL", "WAITM", "INIT", "START", "WRTPR", "FGROUP", "LIMS", "GROUP_BEGIN", "GROUP_END", "GROUP_ADDEND",
    "WORKPIECE", "SETMS",
})  # fmt: skip
NOTED_WORDS = NOTED_WITH_ARGUMENTS | {
    "STOPRE", "STARTFIFO", "STOPFIFO", "FIFOCTRL", "DYNNORM", "DYNPOS", "DYNROUGH", "DYNSEMIFIN", "DYNFINISH",
    "DYNPREC", "NORM", "KONT", "KONTC", "KONTT", "CUT2D", "CUT2DF", "CFC", "CFTCP", "CFIN", "WALIMON", "WALIMOF",
    "SBLON", "SBLOF", "DISPLON", "DISPLOF", "WAITS", "FENDNORM", "FENDP", "UPATH", "SPATH", "TRAFOOF", "ORIWKS",
    "ORIMKS", "ORIAXES", "ORIVECT", "TCOABS", "TOROTOF", "PAROTOF", "SPCON", "SPCOF", "FNORM", "RTLION", "RTLIOF",
}  # fmt: skip
NOTED_VALUES = frozenset({
    "S", "T", "D", "H", "M", "SPOS", "SPOSA", "DL", "LIMS", "OTOL", "ATOL", "STOLF", "CTOLG0", "OTOLG0",
})  # fmt: skip
NAMES_REFUSED: Mapping[str, str] = {
    **dict.fromkeys(("TRAORI", "TRANSMIT", "TRACYL", "TRAANG", "TRACON", "TRAFOON", "TOROT", "PAROT"),
                    "transformations are not supported"),
    **dict.fromkeys(("ASPLINE", "BSPLINE", "CSPLINE", "POLY", "SPLINE"), "splines and polynomials are not supported"),
    **dict.fromkeys(("INVCW", "INVCCW"), "involutes are not supported"),
    **dict.fromkeys(("DIAMON", "DIAM90", "DIAMCYCOF", "DIAMONA"), "programming of diameters is not supported"),
    **dict.fromkeys(("POS", "POSA", "POSP", "FA"), "positioning axes are not supported"),
    **dict.fromkeys(("MCALL", "PCALL", "ISOCALL"), "this kind of call is not supported"),
    **dict.fromkeys(("TRAILON", "LEADON", "COUPON", "COUPDEF", "EGON", "GANTRY"), "coupled axes are not supported"),
    **dict.fromkeys(("ROTS", "AROTS", "CROTS", "MEAFRAME"), "rotation by solid angles is not supported: use ROT"),
    **dict.fromkeys(("WHEN", "WHENEVER", "EVERY", "ID", "IDS", "DO"), "synchronised actions are not supported"),
    **dict.fromkeys(("MEAS", "MEAW", "MEAC"), "measuring is not supported"),
    **dict.fromkeys(("HOLES1", "HOLES2", "POCKET1", "POCKET2", "POCKET3", "POCKET4", "SLOT1", "SLOT2", "LONGHOLE"),
                    _CYCLE),
    **dict.fromkeys(("OVR", "OVRRAP", "OVRA", "ACC", "VELOLIM", "ACCLIM", "JERKLIM"),
                    "shares of speed, acceleration and jerk are not supported"),
    "CYCLE832": "the cycle is not supported: write what it sets, as CTOL=0.01 COMPCAD G645 SOFT FFWON",
    "DRIVE": "this kind of acceleration is not supported: use BRISK or SOFT",
    "REDEF": "the statement is not supported",
    "CTRANS": "frames as values are not supported: use TRANS, ROT, SCALE, MIRROR",
}  # fmt: skip


def refusal_of(name: str) -> str | None:
    """Why a word with letters is refused; None: it is not known."""
    if name in NAMES_REFUSED:
        return NAMES_REFUSED[name]
    if name.startswith("CYCLE"):
        return _CYCLE
    if name.startswith("$"):
        return "variables of the control are not known here"
    return None


def spell_code(code: float) -> str:
    return f"G{code:.10g}" if math.isfinite(code) else f"G{code}"
