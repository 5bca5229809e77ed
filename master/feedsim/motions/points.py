"""Points of an axis that are computed when they are asked for: held, and one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.motions.kind import Array, Points


@dataclass(frozen=True)
class Held:
    """An axis that stays at ``value`` for ``count`` points."""

    value: float
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> Array:
        return np.full(len(range(self.count)[rows]), self.value)


class Joined:
    """Points one after the other."""

    def __init__(self, pieces: Sequence[Points]) -> None:
        self._pieces = tuple(pieces)
        self._ends = np.cumsum([len(piece) for piece in self._pieces])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, rows: slice) -> Array:
        wanted = range(len(self))[rows]
        result = []
        i, first = int(np.searchsorted(self._ends, wanted.start, side="right")), wanted.start
        while first < wanted.stop:
            begin, end = int(self._ends[i]) - len(self._pieces[i]), int(self._ends[i])
            last = min(end, wanted.stop)
            result.append(self._pieces[i][first - begin : last - begin])
            i, first = i + 1, last
        return np.concatenate(result) if result else np.zeros(0)
