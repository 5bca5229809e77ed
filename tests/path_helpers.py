"""Programs as columns, without a file: what tests of the path planner plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim.motions.part_program import Blending, Motion, Moves
from feedsim.motions.planner import Limits

Floats = NDArray[np.float64]


@dataclass
class Draft:
    """A program in the making. `blending`, `tolerance`, `feed` and the like hold for rows from here on."""

    axes: tuple[str, ...]
    start: Floats
    feed: float = 0.1
    blending: Blending = Blending.EXACT_STOP
    tolerance: float = np.nan
    jerk_limited: bool = True
    compressed: bool = False

    def __post_init__(self) -> None:
        self.start = np.asarray(self.start, dtype=np.float64)
        self.rows: list[dict[str, Any]] = []

    @property
    def position(self) -> Floats:
        return self.rows[-1]["end"] if self.rows else self.start

    def _add(self, motion: Motion, end: ArrayLike, **values: Any) -> None:
        self.rows.append({
            "motion": motion, "end": np.asarray(end, dtype=np.float64), "centre": np.full(3, np.nan),
            "normal": np.full(3, np.nan), "angle": np.nan, "feed": self.feed, "dwell": 0.0, "blending": self.blending,
            "tolerance": self.tolerance, "jerk_limited": self.jerk_limited, "compressed": self.compressed, **values,
        })  # fmt: skip

    def line(self, *end: float) -> None:
        self._add(Motion.LINE, end)

    def rapid(self, *end: float) -> None:
        self._add(Motion.RAPID, end, feed=np.nan)

    def dwell(self, duration: float) -> None:
        self._add(Motion.DWELL, self.position, feed=np.nan, dwell=duration)

    def arc(
        self, centre: Sequence[float], angle: float, normal: Sequence[float] = (0, 0, 1), rise: float = 0.0
    ) -> None:
        """About `centre` (3,) by `angle` about the normal; its own sense is that of the sign of the angle."""
        n = np.asarray(normal, dtype=np.float64) * np.sign(angle)
        angle, c = abs(angle), np.asarray(centre, dtype=np.float64)
        p = np.array([self.position[self.axes.index(name)] if name in self.axes else 0.0 for name in "XYZ"])
        c = c + n * (n @ (p - c))
        r = p - c
        end_3d = c + r * np.cos(angle) + np.cross(n, r) * np.sin(angle) + n * rise
        end = self.position.copy()
        for k, name in enumerate("XYZ"):
            if name in self.axes:
                end[self.axes.index(name)] = end_3d[k]
        self._add(Motion.ARC, end, centre=c, normal=n, angle=angle)

    @property
    def moves(self) -> Moves:
        kinds = {
            "motion": np.int8, "blending": np.int8, "jerk_limited": np.bool_, "compressed": np.bool_,
        }  # fmt: skip
        names = ("motion", "end", "centre", "normal", "angle", "feed", "dwell", "blending", "tolerance", "jerk_limited",
                 "compressed")  # fmt: skip
        columns = {
            name: np.array([row[name] for row in self.rows], dtype=kinds.get(name, np.float64)) for name in names
        }
        count = len(self.rows)
        return Moves(
            axes=self.axes, start=self.start, **columns, feedforward=np.ones(count, np.bool_),
            file=np.zeros(count, np.int32), line=np.arange(1, count + 1, dtype=np.int32), files=("made.mpf",),
            texts=("\n" * count,), notes=(),
        )  # fmt: skip


def limits_of(
    axes: Sequence[str], speed: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike, T_ipo: float = 2e-3, **more: Any
) -> Limits:
    """Limits of axes, one value for all or one each."""
    spread = (
        np.broadcast_to(np.asarray(each, dtype=np.float64), len(axes)).copy() for each in (speed, acceleration, jerk)
    )
    return Limits(tuple(axes), *spread, T_ipo=T_ipo, **more)


def square(side: float = 50e-3, feed: float = 0.1, tolerance: float = 5e-6) -> Moves:
    draft = Draft(("X", "Y"), np.zeros(2), feed, Blending.TOLERANCE if tolerance else Blending.EXACT_STOP, tolerance)
    for corner in ((side, 0), (side, side), (0, side), (0, 0)):
        draft.line(*corner)
    return draft.moves
