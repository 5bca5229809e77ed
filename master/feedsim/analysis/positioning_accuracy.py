"""Accuracy and repeatability of positioning a linear axis, in the letters of ISO 230-2 (docs/figures.md).

Every target is approached several times from below and from above. Of the deviations at rest come a mean and a standard
deviation per target and side, and of those the figures of an acceptance sheet; "two standard deviations" is the
standard's coverage factor of 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feedsim.analysis.figures import Array, Figure, column, window
from feedsim.motions.positioning_cycle import Visits
from feedsim.trace import Trace

SIDES = ("up", "down")  # of an approach: towards larger positions, and towards smaller ones


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Deviations at the targets of an axis.

    Attributes:
        targets: (M,) programmed [m], from the lowest to the highest.
        deviations: (2, M, N) measured less programmed [m]: approached upwards, then downwards; N runs.
    """

    targets: Sequence[float]
    deviations: Array

    @property
    def mean(self) -> Array:
        """(2, M) mean unidirectional deviations [m]."""
        return np.asarray(self.deviations.mean(axis=2))

    @property
    def s(self) -> Array:
        """(2, M) standard deviations of the approaches, with N - 1 [m]."""
        return np.asarray(self.deviations.std(axis=2, ddof=1))

    @property
    def B(self) -> Array:
        """(M,) reversal value: mean upwards less mean downwards [m]."""
        up, down = self.mean
        return np.asarray(up - down)

    @property
    def R(self) -> Array:
        """(M,) bidirectional repeatability [m]: the largest of 4 s of either side, and of 2 s of both with |B|."""
        up, down = self.s
        return np.asarray(np.max([2 * up + 2 * down + np.abs(self.B), 4 * up, 4 * down], axis=0))

    @property
    def figures(self) -> dict[str, Figure]:
        """A, R, E, M, B as acceptance sheets have them, by name."""
        mean, s = self.mean, self.s
        middle = mean.mean(axis=0)

        def um(value: float | np.floating[Any], meaning: str) -> Figure:
            return Figure(1e6 * float(value), "um", meaning)

        result = {
            "A": um(np.max(mean + 2 * s) - np.min(mean - 2 * s), "bidirectional accuracy of positioning (ISO 230-2)"),
            "R": um(np.max(self.R), "bidirectional repeatability of positioning, largest of all targets (ISO 230-2)"),
            "M": um(np.ptp(middle), "range of the mean bidirectional deviations (ISO 230-2)"),
            "B": um(np.max(np.abs(self.B)), "reversal value, largest magnitude of all targets (ISO 230-2)"),
            "B_mean": um(np.mean(self.B), "mean reversal value: upwards less downwards (ISO 230-2)"),
            "E": um(np.ptp(mean), "bidirectional systematic deviation of positioning (ISO 230-2)"),
        }
        for side, m, d in zip(SIDES, mean, s, strict=True):
            approaches = f"of approaches {side}wards (ISO 230-2)"
            result |= {
                f"A_{side}": um(np.max(m + 2 * d) - np.min(m - 2 * d), f"accuracy {approaches}"),
                f"R_{side}": um(4 * np.max(d), f"repeatability {approaches}"),
                f"E_{side}": um(np.ptp(m), f"systematic deviation {approaches}"),
            }
        return result


def readings(trace: Trace, visits: Visits, name: str, noise: float, rng: np.random.Generator) -> Array:
    """(2, M, N) position `name` less target at the end of every rest [m]: upwards, then downwards.

    noise: standard deviation of the measuring system [m]. Raises InputError where the position is not recorded, or not
    up to the last visit.
    """
    purpose = f"positioning accuracy of axis {visits.axis}"
    position = column(trace, name, purpose)
    values = np.empty((len(SIDES), len(visits.targets), visits.runs))
    places = {target: i for i, target in enumerate(visits.targets)}
    for visit in visits.visits:
        rows = window(trace, visit.begin, visit.end, purpose)
        at = (0 if visit.sense > 0 else 1, places[visit.target], visit.run)
        values[at] = position[rows.stop - 1] - visit.target + noise * rng.standard_normal()
    return values
