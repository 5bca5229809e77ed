"""Points of axes on the grid of the interpolator, computed when they are asked for: a long program holds none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.nc.path import CircularPath, Line
from feedsim.nc.profile import Profile
from feedsim.nc.spline import Points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Held:
    """An axis that stays at ``value`` for ``count`` points."""

    value: float
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> Array:
        return np.full(len(range(self.count)[rows]), self.value)


@dataclass(frozen=True)
class Along:
    """An axis of a path: point i is where the path is (i + 1) ``cycle`` [s] after the start of its profile."""

    path: Line | CircularPath
    profile: Profile
    axis: str
    cycle: float
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> Array:
        wanted = range(self.count)[rows]
        at = np.arange(wanted.start + 1, wanted.stop + 1, dtype=np.float64) * self.cycle
        return self.path.position(self.profile.at(at)[0])[self.axis]


class Joined:
    """Points one after the other."""

    def __init__(self, pieces: Sequence[Points]) -> None:
        self._pieces = tuple(pieces)
        self._ends = np.cumsum([len(piece) for piece in self._pieces])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, rows: slice) -> Array:
        wanted = range(len(self))[rows]
        found = []
        i, first = int(np.searchsorted(self._ends, wanted.start, side="right")), wanted.start
        while first < wanted.stop:
            begin, end = int(self._ends[i]) - len(self._pieces[i]), int(self._ends[i])
            last = min(end, wanted.stop)
            found.append(self._pieces[i][first - begin : last - begin])
            i, first = i + 1, last
        return np.concatenate(found) if found else np.zeros(0)
