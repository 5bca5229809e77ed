"""What an NC program commands, as columns: one row for each movement or dwell, in the program's order. SI units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
