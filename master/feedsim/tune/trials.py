"""Circles that a friction compensation is found on, and what friction alone does to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.scenario import Machine
from feedsim.tune.circles import Circles, Contour, extremes
from feedsim.tune.effects import frictionless
from feedsim.tune.groups import with_groups
from feedsim.uncertainty import draw_named


@dataclass(frozen=True, eq=False)
class Trials:
    """Circles that values are found on, on a machine and on draws of it.

    free: per machine the contours without friction. What they have is no error that a friction compensation is to
    take off: a pulse that made the ellipse of the drives smaller on one circle would make it larger on another.
    """

    circles: Circles
    machines: Sequence[Machine]
    free: Sequence[Sequence[Contour]]
    fmus: Path | None

    @classmethod
    def of(cls, circles: Circles, machines: Sequence[Machine], fmus: Path | None) -> Trials:
        """With the runs without friction. Raises as :meth:`errors`."""
        free = []
        for k, machine in enumerate(machines):
            with _named(k, machines):
                free.append(circles.contours(frictionless(machine, circles.plane), fmus=fmus))
        return cls(circles, machines, free, fmus)

    def errors(self, group: str = "", values: Mapping[str, Mapping[str, float | bool | int]] | None = None) -> Array:
        """(machines x pairs, axes, 2) peaks and dips [m] that friction makes, where axes have a group of their drives
        with other values. Raises as :func:`feedsim.cosim.run`."""
        result = []
        for k, (machine, free) in enumerate(zip(self.machines, self.free, strict=True)):
            own = with_groups(machine, self.machines[0], group, values or {})
            with _named(k, self.machines):
                result.append(extremes(self.circles.contours(own, fmus=self.fmus), free))
        return np.concatenate(result)


def _named(k: int, machines: Sequence[Machine]) -> AbstractContextManager[None]:
    return draw_named(k - 1, len(machines) - 1, "which the values are found on") if k else nullcontext()
