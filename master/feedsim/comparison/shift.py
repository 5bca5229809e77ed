"""The shift in time that lays a result over a reference best, for records whose clocks know nothing of one another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import floor, log10, sqrt

import numpy as np
from numpy.typing import NDArray

from feedsim.comparison.between import Rows, usual_step
from feedsim.comparison.options import MAX_LISTED_COLUMNS, Options, chosen, factor, sources, with_units
from feedsim.comparison.tolerance import Tolerances
from feedsim.files.trace import Array, Series
from feedsim.foundation.errors import InputError, shorten_list

# Positions tried over the whole range before the best is refined, at most.
TRIES = 2001
# Values of the result that a try looks at, of all columns together, and rows at least and at most; the best are then
# looked at in full.
SAMPLES_COMPARED, MIN_ROWS_COMPARED, MAX_ROWS_COMPARED = 40_000, 500, 2000
# Minima of the tries that are looked at in full.
CANDIDATES = 8


@dataclass(frozen=True)
class Shift:
    """What is added to the result's time [s], the columns that show it, and those that do not, with the reason."""

    seconds: float
    used: tuple[str, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)

    @property
    def note(self) -> str:
        """For people."""
        reasons: dict[str, list[str]] = {}
        for name, reason in self.left_out.items():
            reasons.setdefault(reason, []).append(name)
        without = "".join(
            f"; without {shorten_list(names, MAX_LISTED_COLUMNS)}: {reason}" for reason, names in reasons.items()
        )
        return f"the shift in time is found from {shorten_list(self.used, MAX_LISTED_COLUMNS)}{without}"


@np.errstate(all="ignore")  # values of any magnitude are compared; what is no number then fits nowhere
def estimated_shift(
    result: Series, reference: Series, most: float, options: Options | None = None, tolerances: Tolerances | None = None
) -> Shift:
    """Shift [s] within +-most, added to the result's time, with the least mean square difference.

    Over the columns and the time that are compared: what options or tolerances leave out does not count. Every column
    counts in shares of its range in the reference; columns that do not move do not count. Rows without a number on
    either side are left out, and instants whose shifted time leaves the reference; at least half of those in common
    must stay. InputError: nothing moves, or the best is at the end of the range.
    """
    options, tolerances = options or Options(), tolerances or Tolerances()
    if not most > 0:
        raise InputError(f"the largest shift in time is {most:.6g} s; it must be more than 0")
    if not len(result) or not len(reference):
        raise InputError("the shift in time cannot be found: there are no rows")
    begin = float(reference.time[0] if options.start is None else max(reference.time[0], options.start))
    end = float(reference.time[-1] if options.end is None else min(reference.time[-1], options.end))
    compared = (reference.time >= begin) & (reference.time <= end)
    near = (result.time >= begin - most) & (result.time <= end + most)
    result, reference = with_units(result, options.units), with_units(reference, options.reference_units)
    asked = [n for n in chosen(reference.all_names, options) if n in reference and not tolerances.of(n).ignore]
    results: dict[str, tuple[Array, Array]] = {}
    left_out: dict[str, str] = {}
    for name, source in sources(result.all_names, asked, options).items():
        if source not in result:
            continue
        try:
            scale, _ = factor(result.units[source], reference.units[name])
        except InputError:
            left_out[name] = "units differ"
            continue
        expected, values = _numbers(reference[name]), _numbers(result[source][near] * scale)
        known = expected[compared & np.isfinite(expected)]
        if not known.size or not np.isfinite(values).any():
            left_out[name] = "no numbers there"
        elif not 0 < (span := float(np.ptp(known))) < np.inf:
            left_out[name] = "the reference does not move"
        else:
            results[name] = expected / span, values / span
    if not results:
        why = f" ({shorten_list([*left_out], MAX_LISTED_COLUMNS)}: {next(iter(left_out.values()))})" if left_out else ""
        raise InputError(f"the shift in time cannot be found: no column of the reference moves{why}")
    misfit = _Misfit(
        reference.time,
        np.array([expected for expected, _ in results.values()]),
        result.time[near],
        np.array([values for _, values in results.values()]),
        (begin, end),
    )
    step = max(min(usual_step(reference.time), usual_step(result.time)), 2 * most / (TRIES - 1))
    tried = step * np.arange(-np.floor(most / step), np.floor(most / step) + 1)
    best = _find_best_shift(misfit, tried)
    if best is None or best in (0, len(tried) - 1):
        raise InputError(f"the shift in time cannot be found within +-{most:.6g} s; allow a larger one")
    refined = _find_minimum(misfit.of, float(tried[best - 1]), float(tried[best + 1]), 1e-8 * step)
    # No more digits than rounding of the misfit leaves.
    return Shift(round(refined, -floor(log10(1e-6 * step))) + 0.0, tuple(results), left_out)


def _find_minimum(of: Callable[[float], float], low: float, high: float, width: float) -> float:
    """Where a function with one minimum between two places has it, to `width`: by golden sections."""
    golden = (sqrt(5) - 1) / 2
    inner, outer = high - golden * (high - low), low + golden * (high - low)
    at_inner, at_outer = of(inner), of(outer)
    while high - low > width:
        if at_inner <= at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - golden * (high - low)
            at_inner = of(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + golden * (high - low)
            at_outer = of(outer)
    return (low + high) / 2


@dataclass(frozen=True, eq=False)
class _Misfit:
    """Mean square difference over the shift.

    time, expected: (N,) and (K, N) of the reference; at, values: (M,) and (K, M) of the result; NaN where there is no
    number. span: begin and end of what is compared [s].
    """

    time: Array
    expected: Array
    at: Array
    values: Array
    span: tuple[float, float]

    def rows(self, shift: float) -> slice:
        """Rows of the result that the compared time holds."""
        begin, end = (edge - shift for edge in self.span)
        return slice(int(np.searchsorted(self.at, begin, "left")), int(np.searchsorted(self.at, end, "right")))

    def parts(self, shift: float) -> tuple[Array, NDArray[np.int64]]:
        """(K,) mean square differences and (K,) numbers of rows that they are of; NaN of none."""
        inside = self.rows(shift)
        at = self.at[inside] + shift
        row = (np.searchsorted(self.time, at, side="right") - 1).clip(0, len(self.time) - 2)
        step = self.time[row + 1] - self.time[row]
        share = np.where(step > 0, (at - self.time[row]) / np.where(step > 0, step, 1.0), 1.0)
        before = self.expected[:, row]
        off = self.values[:, inside] - before - share * (self.expected[:, row + 1] - before)
        known = np.isfinite(off)
        count = known.sum(axis=1)
        with np.errstate(invalid="ignore"):
            return (np.where(known, off, 0.0) ** 2).sum(axis=1) / count, count

    def of(self, shift: float) -> float:
        """Of all columns together; infinite where one has no rows left."""
        mean = float(np.mean(self.parts(shift)[0]))
        return mean if np.isfinite(mean) else float("inf")

    def thinned(self) -> _Misfit:
        """With fewer rows of the result: even in time, and even in what the columns move."""
        count = int(np.clip(SAMPLES_COMPARED // len(self.values), MIN_ROWS_COMPARED, MAX_ROWS_COMPARED))
        if len(self.at) <= count:
            return self
        moved = np.nan_to_num(np.abs(np.diff(self.values, axis=1))).sum(axis=0)
        way = np.cumsum(np.r_[0.0, moved / (moved.sum() or 1.0) + 1 / len(moved)])
        picked: Rows = np.unique(np.searchsorted(way, np.linspace(0, way[-1], count)).clip(max=len(self.at) - 1))
        return _Misfit(self.time, self.expected, self.at[picked], self.values[:, picked], self.span)


def _find_best_shift(misfit: _Misfit, tried: Array) -> int | None:
    """Which of the tried shifts is best; None where the times do not overlap enough."""
    coarse = misfit.thinned()
    parts = [coarse.parts(shift) for shift in tried.tolist()]
    counts = np.array([count for _, count in parts])
    errors = np.array([np.mean(mean) for mean, _ in parts])
    spans = [misfit.rows(shift) for shift in tried.tolist()]
    inside = np.array([span.stop - span.start for span in spans])
    enough = (inside >= 0.5 * min(len(misfit.at), int(inside.max(initial=0)))) & (inside > 0)
    # A shift that lays the result into a gap of the reference has little to be wrong with.
    enough &= np.all(counts >= 0.5 * counts.max(axis=0), axis=1)
    errors = np.where(enough & np.isfinite(errors), errors, np.inf)
    if not np.isfinite(errors).any():
        return None
    around = np.r_[np.inf, errors, np.inf]
    lowest = np.flatnonzero((errors <= around[:-2]) & (errors <= around[2:]) & np.isfinite(errors))
    lowest = lowest[np.argsort(errors[lowest], kind="stable")][:CANDIDATES]
    if coarse is misfit:
        return int(lowest[0])
    whole: dict[int, float] = {}

    def full(i: int) -> float:
        if i not in whole:
            whole[i] = misfit.of(float(tried[i])) if 0 <= i < len(tried) and np.isfinite(errors[i]) else np.inf
        return whole[i]

    best = min((int(i) for i in lowest), key=full)
    while (lower := min((best - 1, best + 1), key=full)) and full(lower) < full(best):
        best = lower
    return best


def _numbers(values: Array) -> Array:
    """Infinities as NaN."""
    return np.where(np.isfinite(values), values, np.nan)
