"""What records of general motion can tell at all: limits that no small residual lifts.

Sines dwell where the bristles act, period after period. Positioning moves run through it in a few rows of the log, and
what is left of a good model there is its interpolation. A refinement that only explains that finds itself a value with
a narrow interval, and it is nothing of the axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feedsim.identify.search import Solution
from feedsim.identify.torque import RecordTorque, deflection

LEAST_EXPLAINED = 0.01  # of the torque's rms: interpolation, ripple and held commands are not modelled to better
LEAST_ROWS = 5.0  # of the log from a reversal until the bristles have turned over, to tell damping or engaging zone
LEAST_REVERSALS = 4  # to tell the delay of the torque: at each it could also be the bristles'
FAST = 0.05  # of the top speed: what a direction of motion must reach to count


def has_sines(models: Sequence[RecordTorque]) -> bool:
    """Whether any of the stretches is a sine."""
    return any(part.kind == "sine" for model in models for part in model.parts)


def explained(models: Sequence[RecordTorque], found: Solution, tried: Solution) -> float:
    """How much the residual falls from one solution to the other, in squares, as a share of the torque's rms [1]."""
    squares = torque = 0.0
    for k, model in enumerate(models):
        ends = [model.residual(one.values, float(one.states[k, 0]), float(one.states[k, 1])) for one in (found, tried)]
        squares += float(np.sum(ends[0] ** 2) - np.sum(ends[1] ** 2))
        torque += float(np.sum(model.measured**2))
    return float(np.sqrt(max(squares, 0.0) / max(torque, 1e-300)))


def turnover_rows(models: Sequence[RecordTorque], solution: Solution) -> float:
    """Median number of rows from a reversal until the axis has travelled twice the bristles' deflection."""
    way = 2 * deflection(solution.values)
    counts = []
    for model in models:
        n, h = model.motion.coarse(), model.record.interval
        travelled = np.concatenate([[0.0], np.cumsum(np.abs(n[1:] + n[:-1]) / 2) * h])
        for first in _reversals(model):
            last = int(np.searchsorted(travelled, travelled[first] + way))
            counts.append(last - first)
    return float(np.median(counts)) if counts else 0.0


def reversals(models: Sequence[RecordTorque]) -> int:
    """How often the axes turn round, from one direction at speed to the other."""
    return sum(len(_reversals(model)) for model in models)


def _reversals(model: RecordTorque) -> list[int]:
    """Rows at which the speed changes its sign between two directions that are both driven at speed."""
    n = model.motion.coarse()
    fast = np.flatnonzero(np.abs(n) > FAST * np.max(np.abs(n)))
    sides = np.sign(n[fast])
    turns = np.flatnonzero(sides[1:] != sides[:-1])
    found = []
    for k in turns:
        between = n[fast[k] : fast[k + 1] + 1] * sides[k]
        found.append(int(fast[k] + np.argmax(between <= 0)))
    return found
