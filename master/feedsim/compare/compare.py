"""Compare a result with a reference, variable by variable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from math import inf

import numpy as np

from feedsim.compare.options import Options, chosen, missing, sources, unit_of, unmatched
from feedsim.compare.quantity import allowed, factor
from feedsim.compare.tolerance import Tolerance, Tolerances
from feedsim.compare.tube import Rows, along, bounds, slack_of, usual_step
from feedsim.compare.verdict import Comparison, Curves, Variable, Verdict, seconds
from feedsim.errors import InputError
from feedsim.trace import Array, Series, Trace, as_series

# A gap is worth a word from this many usual steps on.
GAP = 10.0
# Times that a usual step must be longer than the other's to be called coarser.
FINER = 1.5
# A conversion of units rounds twice.
ROUNDING = 4 * np.finfo(float).eps
# Curves are kept of so many variables, the worst ones.
CURVES = 12


def compare(
    result: Series | Trace,
    reference: Series | Trace,
    tolerances: Tolerances | None = None,
    options: Options | None = None,
    *,
    names: tuple[str, str] = ("result", "reference"),
) -> Comparison:
    """Every row of the result against the tube around the reference (see tube.bounds).

    Columns that the reference lacks are ignored; those that the result lacks are missing, which is different; so is a
    result that begins later or ends earlier than the reference by more than a step. What differs or cannot be compared
    is told in what is returned. InputError: the options themselves are wrong for these columns.
    """
    tolerances, options = tolerances or Tolerances(), options or Options()
    result, reference = as_series(result), as_series(reference)
    asked = [name for name in chosen(reference.names, options) if not tolerances.of(name).ignore]
    found = sources(result.names, asked, options)
    notes = _unused(result, reference, tolerances, options)
    unused = tuple(pattern for pattern in tolerances.unused(reference.names) if pattern in tolerances.filed)
    blank = Comparison(*names, "unusable", notes=tuple(notes), shift=options.shift, unused=unused)
    if not found:
        wanted = missing(asked[0], result.names) if asked else "every column of the reference is left out"
        return replace(blank, problem=f"no column in common: {wanted}")
    if not len(result) or not len(reference):
        return replace(blank, problem=f"the {'result' if len(reference) else 'reference'} has no rows")
    over = _Overlap(result, reference, options, max(tolerances.of(name).time or 0.0 for name in found))
    peers = _magnitudes(reference, asked, options)
    blank = replace(blank, start=over.start, end=over.end)
    if over.problem:
        return replace(blank, problem=over.problem)
    notes += over.notes
    told: dict[str, list[str]] = {}
    variables = []
    for name in asked:
        if name in found:
            variable, remarks = _variable(over, name, found[name], tolerances.of(name), peers)
            for remark in remarks:
                told.setdefault(remark, []).append(name)
            variables.append(variable)
        elif not options.common:
            variables.append(Variable(name, "missing", reason=missing(name, result.names)))
    notes += [f"{_listed(who)}: {remark}" for remark, who in told.items()]
    verdict: Verdict = "same"
    if over.uncovered or any(each.verdict in ("different", "missing") for each in variables):
        verdict = "different"
    if any(each.verdict == "unusable" for each in variables):
        verdict = "unusable"
    return replace(blank, verdict=verdict, variables=_light(variables), problem=over.uncovered, notes=tuple(notes))


class _Overlap:
    """The instants at which a result is looked at, and what there is to say about the two times.

    start, end: compared time [s]; at: (M,) instants; rows: which rows of the result they are, None where the result is
    interpolated. problem: why nothing can be compared; uncovered: what of the reference the result does not cover.
    """

    def __init__(self, result: Series, reference: Series, options: Options, reach: float) -> None:
        self.result, self.reference, self.options = result, reference, options
        time = reference.time
        self.theirs = result.time + options.shift
        self.slack = slack_of(time)
        self.start = max(float(time[0]), -inf if options.start is None else options.start)
        self.end = min(float(time[-1]), inf if options.end is None else options.end)
        self.problem, self.uncovered, self.notes = "", "", list[str]()
        rows = self._inside(self.theirs, self.start, self.end)
        self.at, self.rows = self.theirs[rows], None if self._at_reference(len(rows)) else rows
        if self.rows is None:
            inside = self._inside(time, max(self.start, self.theirs[0]), min(self.end, self.theirs[-1]))
            self.at = np.unique(time[inside])
        if self.start > self.end or not self.at.size:
            asked = f" (of it {self.start:.9g} to {self.end:.9g} s asked for)"
            shifted = f" (shifted by {seconds(options.shift)})" if options.shift else ""
            self.problem = (
                f"the times do not overlap: the result's is {_span(self.theirs)}{shifted}, the reference's "
                f"{_span(time)}{asked if (options.start, options.end) != (None, None) else ''}"
            )
            return
        step = max(usual_step(time), usual_step(self.theirs))
        margin = 1.001 * step + self.slack + max(reach, abs(options.shift))
        parts = []
        if self.theirs[0] - self.start > margin:
            parts.append(f"the result begins at {self.theirs[0]:.9g} s, the reference at {self.start:.9g} s")
        if self.end - self.theirs[-1] > margin:
            parts.append(f"the result ends at {self.theirs[-1]:.9g} s, the reference at {self.end:.9g} s")
        if (outside := len(self.theirs) - len(rows)) > 1:
            self.notes.append(f"{outside} rows of the result are outside the compared time and are left out")
        parts += self._gaps(self.theirs[rows], step)
        self.uncovered = "; ".join(parts)

    def values(self, name: str, hold: bool) -> Array:
        """(M,) values of a column of the result at the instants."""
        whole = self.result[name]
        if self.rows is not None:
            return np.asarray(whole[self.rows])
        if hold:
            return np.asarray(whole[(np.searchsorted(self.theirs, self.at + self.slack, side="right") - 1).clip(0)])
        return along(self.theirs, whole, self.at)

    def _inside(self, time: Array, start: float, end: float) -> Rows:
        return np.flatnonzero((time >= start - self.slack) & (time <= end + self.slack))

    def _at_reference(self, rows: int) -> bool:
        if self.options.at != "auto":
            return self.options.at == "reference"
        coarser = usual_step(self.reference.time) > FINER * usual_step(self.theirs) > 0
        if coarser:
            every = [seconds(usual_step(time)) for time in (self.reference.time, self.theirs)]
            self.notes.append(
                f"the reference has fewer rows than the result (one every {every[0]} for {every[1]}): compared at its "
                "instants, what the result does between is not seen (--at result looks there too)"
            )
        return coarser and rows > 0

    def _gaps(self, at: Array, step: float) -> list[str]:
        """What there is to say about rows that are missing; returned where it makes the result different."""
        gaps = np.diff(at)
        longest = int(np.argmax(gaps)) if gaps.size else 0
        most = self.options.max_gap
        if gaps.size and most is not None and gaps[longest] > most + self.slack:
            return [
                f"rows are missing: no row of the result from {at[longest]:.9g} to {at[longest + 1]:.9g} s, "
                f"allowed gap {seconds(most)}"
            ]
        if gaps.size and gaps[longest] > GAP * step > 0:
            count = int(np.sum(gaps > GAP * step))
            self.notes.append(
                f"rows are missing: {count} gap{'s'[: count != 1]} in the result, the longest from {at[longest]:.9g} "
                f"to {at[longest + 1]:.9g} s; what happens there is not seen"
            )
        ratio = usual_step(self.theirs) / (usual_step(self.reference.time) or inf)
        if self.rows is not None and ratio > FINER:
            self.notes.append(
                f"the result has about one row per {ratio:.3g} of the reference; those between are not seen"
            )
        return []


def _variable(
    over: _Overlap, name: str, source: str, tolerance: Tolerance, peers: Mapping[str, float]
) -> tuple[Variable, list[str]]:
    """A variable and what there is to say about it."""
    options = over.options
    unit = over.reference.units[name] or unit_of(name, options.reference_units)
    theirs = over.result.units[source] or unit_of(source, options.units)
    remarks = []
    try:
        scale, remark = factor(theirs, unit)
        remarks += [remark] if remark else []
    except InputError as error:
        return Variable(name, "unusable", source, unit, reason=f"units differ: {error}"), []
    time, values = over.reference.time, over.reference[name]
    hold = tolerance.hold
    if hold is None:
        hold = any(fnmatchcase(name, pattern) for pattern in options.hold) or (
            _whole(values) and _whole(over.result[source] * scale)
        )
    at, y = over.at, over.values(source, hold) * scale
    usable = np.isfinite(values)
    if not usable.all():
        # Instants whose neighbours in the reference are no numbers cannot be judged.
        before = (np.searchsorted(time, at + over.slack, side="right") - 1).clip(0)
        after = np.searchsorted(time, at - over.slack, side="left").clip(max=len(time) - 1)
        known = usable[before] & usable[after]
        remarks.append(
            f"the reference holds no number in {np.sum(~usable)} rows, the first at {time[np.argmin(usable)]:.9g} s; "
            f"{np.sum(~known)} rows of the result are not compared"
        )
        time, values, at, y = time[usable], values[usable], at[known], y[known]
    if not len(time) or not len(at):
        return Variable(name, "unusable", source, unit, reason="there is no row with numbers to compare"), remarks
    inside = values[(time >= over.start - over.slack) & (time <= over.end + over.slack)]
    span = float(np.ptp(inside)) if inside.size else 0.0
    try:
        magnitude = peers.get(unit, float(np.abs(inside).max(initial=0.0)))
        limit = allowed(tolerance, unit, span, magnitude)
    except InputError as error:
        return Variable(name, "unusable", source, unit, reason=f"its tolerance: {error}"), remarks
    if tolerance.unit and not unit and not theirs:
        remarks.append("neither side tells a unit; both are taken as SI for the tolerance")
    reach = tolerance.time or 0.0
    low, high = bounds(time, values, at, reach, slack=over.slack, hold=hold)
    with np.errstate(invalid="ignore"):
        off = np.maximum(np.maximum(y - high, low - y), 0.0)
    bad = ~np.isfinite(y)
    off[bad] = inf
    guard = 0.0 if scale == 1.0 else ROUNDING * np.maximum(np.abs(low), np.abs(high))
    beyond = off > limit + guard
    if scale != 1.0:
        off = np.where(off <= guard, 0.0, off)
    worst = int(np.argmax(off))
    expected = float(along(time, values, at[worst : worst + 1])[0])
    if 0 < off[worst] < inf:
        expected = float(np.clip(y[worst], low[worst], high[worst]))
    reason = ""
    if bad.any():
        reason = f"the result holds no number ({y[np.argmax(bad)]}) in {np.sum(bad)} of {len(y)} rows"
    return Variable(
        name,
        "different" if beyond.any() else "same",
        source,
        unit,
        time=float(at[worst]),
        value=float(y[worst]),
        expected=expected,
        deviation=float(off[worst]),
        allowed=limit,
        reach=reach,
        rows=len(at),
        outside=int(np.sum(beyond)),
        first=float(at[np.argmax(beyond)]) if beyond.any() else None,
        reason=reason,
        curves=Curves(at, y, low - limit, high + limit, time, values, hold),
    ), remarks


def _light(variables: Sequence[Variable]) -> tuple[Variable, ...]:
    """Curves of the worst ones only."""
    ranked = sorted(variables, key=lambda each: (-each.ratio, -each.deviation))
    kept = [each.name for each in ranked if each.curves is not None][:CURVES]
    keep = {name for i, name in enumerate(kept) if i == 0 or next(v for v in variables if v.name == name).outside}
    return tuple(each if each.name in keep else replace(each, curves=None) for each in variables)


def _unused(result: Series, reference: Series, tolerances: Tolerances, options: Options) -> list[str]:
    """Rules that match nothing, and columns that are not read."""
    notes = [
        f"the tolerance for {pattern!r} matches no column"
        for pattern in tolerances.unused(reference.names)
        if pattern not in tolerances.filed
    ]
    for what, patterns, names in (
        ("unit", options.units, result.names),
        ("reference's unit", options.reference_units, reference.names),
        ("hold", options.hold, reference.names),
    ):
        if unused := unmatched(patterns, names):
            raise InputError(
                f"{what} given for {unused[0]!r}, which matches no column; there is {', '.join(names[:12])}"
            )
    for whose, series in (("result", result), ("reference", reference)):
        if series.skipped:
            notes.append(f"columns of text in the {whose} are not compared: {', '.join(series.skipped[:5])}")
    return notes


def _magnitudes(reference: Series, names: Sequence[str], options: Options) -> dict[str, float]:
    """Unit -> largest magnitude of the reference's columns in it; of plain numbers none."""
    found: dict[str, float] = {}
    for name in names:
        unit = reference.units[name] or unit_of(name, options.reference_units)
        values = np.abs(reference[name])
        if unit not in ("", "1"):
            found[unit] = max(found.get(unit, 0.0), float(values[np.isfinite(values)].max(initial=0.0)))
    return found


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _span(time: Array) -> str:
    return f"{time[0]:.9g} to {time[-1]:.9g} s"


def _whole(values: Array) -> bool:
    finite = values[np.isfinite(values)]
    return bool(np.all(finite == np.rint(finite)))
