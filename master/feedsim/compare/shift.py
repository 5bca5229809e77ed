"""The shift in time that lays a result over a reference best, for records whose clocks know nothing of one another."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from feedsim.compare.options import Options, chosen, sources, unit_of
from feedsim.compare.quantity import factor
from feedsim.compare.tube import along, usual_step
from feedsim.errors import InputError
from feedsim.trace import Array, Series

# Positions tried over the whole range before the best is refined, at most.
TRIES = 2001


def estimated_shift(result: Series, reference: Series, most: float, options: Options | None = None) -> float:
    """Shift [s] within +-most, added to the result's time, with the least mean square difference.

    Every column counts in shares of its range in the reference; columns that do not move do not count. Instants whose
    shifted time leaves the reference are left out; at least half of those in common must stay.
    InputError: nothing moves, or the best is at the end of the range.
    """
    options = options or Options()
    columns: list[tuple[Array, Array]] = []
    for name, source in sources(result.names, chosen(reference.names, options), options).items():
        unit = reference.units[name] or unit_of(name, options.reference_units)
        scale, _ = factor(result.units[source] or unit_of(source, options.units), unit)
        expected, values = reference[name], result[source] * scale
        span = float(np.ptp(expected))
        if np.isfinite(span) and span > 0 and np.all(np.isfinite(values)):
            columns.append((expected / span, values / span))
    if not columns:
        raise InputError("the shift in time cannot be found: no column of the reference moves")
    begin, end = reference.time[0], reference.time[-1]

    def difference(shift: float) -> float:
        at = result.time + shift
        inside = (at >= begin) & (at <= end)
        if inside.sum() < 0.5 * min(len(result), np.sum((result.time >= begin - most) & (result.time <= end + most))):
            return float("inf")
        return float(np.mean([np.mean((y[inside] - along(reference.time, x, at[inside])) ** 2) for x, y in columns]))

    step = max(min(usual_step(reference.time), usual_step(result.time)), 2 * most / (TRIES - 1))
    tried = step * np.arange(-np.floor(most / step), np.floor(most / step) + 1)
    errors = [difference(shift) for shift in tried.tolist()]
    best = int(np.argmin(errors))
    if not np.isfinite(errors[best]) or best in (0, len(tried) - 1):
        raise InputError(f"the shift in time cannot be found within +-{most:.6g} s; allow a larger one")
    found = minimize_scalar(
        difference, bounds=(tried[best - 1], tried[best + 1]), method="bounded", options={"xatol": 1e-6 * step}
    )
    return float(found.x)
