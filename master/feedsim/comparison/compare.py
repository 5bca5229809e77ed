"""Compare a result with a reference, variable by variable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from feedsim.comparison.between import (
    ABOVE,
    BELOW,
    BoundsBetween,
    Rows,
    bounds,
    check_bounds,
    interpolate_at,
    slack_of,
    usual_step,
)
from feedsim.comparison.likeness import Comparison, Coverage, Curves, Variable, Verdict, likeness, percent, seconds
from feedsim.comparison.options import (
    MAX_LISTED_COLUMNS,
    Options,
    check_used,
    chosen,
    describe_missing_column,
    factor,
    repeated_units,
    sources,
    with_units,
)
from feedsim.comparison.tolerance import DEFAULT_TOLERANCE, OF_MAGNITUDE, Tolerances, allowed_deviation
from feedsim.files.trace import Array, Series, Trace, as_series, matches
from feedsim.foundation.errors import InputError, shorten_list

# --- The instants at which a result is looked at, and whether it covers the reference ---------------------------------


# A gap is worth a word from this many usual steps on.
GAP_STEP_RATIO = 10.0
# Times that a usual step must be longer than the other's to be called coarser.
FINER = 1.5
# Rows of the reference that may come on one of the result. Those that lie farther behind it are not seen,
SPARSE = 10
# and so many of the reference's may be: beyond, the result says too little about it.
MAX_UNSEEN_SHARE = 0.25
# Share of the compared time that a result may lack at an end for its shift or its tolerance in time, at most.
MAX_LACKING_SHARE = 0.1


class Overlap:
    """The instants at which a result is looked at, and what there is to say about the two times.

    start, end: compared time [s]; at: (M,) instants; rows: which rows of the result they are, None where the result is
    interpolated; inside: its rows within the compared time. bounded: the reference shows what all that is compared may
    be between its rows. problem: why nothing can be compared; uncovered: what of the reference the result does not
    cover.
    """

    def __init__(self, result: Series, reference: Series, options: Options, reach: float, bounded: bool) -> None:
        self.result, self.reference, self.options = result, reference, options
        time = reference.time
        self.theirs = result.time + options.shift
        # What is left of a row that falls on 0.
        self.theirs[np.abs(self.theirs) <= 4 * np.finfo(float).eps * abs(options.shift)] = 0.0
        self.slack = slack_of(time)
        self.start = max(float(time[0]), -inf if options.start is None else options.start)
        self.end = min(float(time[-1]), inf if options.end is None else options.end)
        self.problem, self.uncovered, self.notes = "", "", list[str]()
        rows = self.inside = self._inside(self.theirs, self.start, self.end)
        self.bounded = bounded
        self.at, self.rows = self.theirs[rows], None if self._at_reference(len(rows)) else rows
        if self.rows is None:
            inside = self._inside(time, max(self.start, self.theirs[0]), min(self.end, self.theirs[-1]))
            self.at = np.unique(time[inside])
        if self.start > self.end or not self.at.size:
            shifted = f" (shifted by {seconds(options.shift)})" if options.shift else ""
            self.problem = (
                f"the times do not overlap: the result's is {_span(self.theirs)}{shifted}, the reference's "
                f"{_span(time)}{_requested_span(options)}"
            )
            return
        steps = usual_step(time), usual_step(self.theirs)
        instants = np.unique(time[self._inside(time, self.start, self.end)])
        # A shift takes rows away at the end that it moves the result from; a tolerance in time at both.
        longest = MAX_LACKING_SHARE * (self.end - self.start)
        forgiven = [min(max(reach, value, 0.0), longest) for value in (options.shift, -options.shift)]
        # Tools begin or end a step apart; a step of a reference with few rows would be much.
        most = max(steps[1], 0.01 * (self.end - self.start))
        first, last = (
            1.001 * min(max(steps[0], float(step)), most) + self.slack
            for step in (np.diff(instants)[[0, -1]] if len(instants) > 1 else (0.0, 0.0))
        )
        parts = []
        for lacking, step, forgiven_time, words in (
            (self.theirs[0] - self.start, first, forgiven[0], ("begins", self.theirs[0], self.start)),
            (self.end - self.theirs[-1], last, forgiven[1], ("ends", self.theirs[-1], self.end)),
        ):
            text = f"the result {words[0]} at {words[1]:.9g} s, the reference at {words[2]:.9g} s"
            if lacking > step + forgiven_time:
                parts.append(text)
            elif lacking > step:
                why = "its tolerance in time" if forgiven_time <= reach else "its shift"
                self.notes.append(f"{text}; {why} allows for it, what the reference does there is not seen")
        if (outside := len(self.theirs) - len(rows)) > 1:
            self.notes.append(f"{outside} rows of the result are outside the compared time and are left out")
        parts += self._gaps(self.theirs[rows], max(steps)) or self._unseen(self.theirs[rows], instants)
        self.uncovered = "; ".join(parts)

    @property
    def time_compared(self) -> float:
        """Of the result's time [s]."""
        return float(min(self.end, self.theirs[-1]) - max(self.start, self.theirs[0]))

    def covered(self, at: Array) -> int:
        """Of how many rows the result's values at instants `at` are made."""
        before = (np.searchsorted(self.theirs, at + self.slack, side="right") - 1).clip(0)
        after = np.searchsorted(self.theirs, at - self.slack, side="left").clip(max=len(self.theirs) - 1)
        if not len(at):
            return 0
        # All rows of one instant, such as those before and after an event.
        hit = before >= after
        low, high = np.where(hit, after, before), np.where(hit, before, after)
        marks = np.zeros(len(self.theirs) + 1, dtype=np.int64)
        np.add.at(marks, low, 1)
        np.add.at(marks, high + 1, -1)
        return int(np.count_nonzero(np.cumsum(marks[:-1])))

    def rows_of(self, name: str, hold: bool, bounded: bool) -> tuple[Array, Array]:
        """(K,) instants and values of a column of the result: those looked at, and its rows between that are none.

        bounded: the reference shows what the column may be between its rows, so that all rows are looked at.
        """
        whole = self.result[name]
        if self.rows is not None or (bounded and self.options.at == "auto"):
            return self.theirs[self.inside], np.asarray(whole[self.inside])
        if hold:
            values = whole[(np.searchsorted(self.theirs, self.at + self.slack, side="right") - 1).clip(0)]
        else:
            values = interpolate_at(self.theirs, whole, self.at)
        broken = self._inside(self.theirs, self.start, self.end)
        broken = broken[~np.isfinite(whole[broken])]
        # Those at an instant that shows it already do not count twice.
        reported = np.r_[self.at[~np.isfinite(values)], inf]
        behind = reported[np.searchsorted(reported, self.theirs[broken] - self.slack, side="left")]
        broken = broken[behind > self.theirs[broken] + self.slack]
        at, values = np.r_[self.at, self.theirs[broken]], np.r_[values, whole[broken]]
        order = np.argsort(at, kind="stable")
        return at[order], values[order]

    def _inside(self, time: Array, start: float, end: float) -> Rows:
        return np.flatnonzero((time >= start - self.slack) & (time <= end + self.slack))

    def _at_reference(self, rows: int) -> bool:
        if self.options.at != "auto":
            return self.options.at == "reference"
        coarser = not self.bounded and usual_step(self.reference.time) > FINER * usual_step(self.theirs) > 0
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
        if gaps.size and gaps[longest] > GAP_STEP_RATIO * step > 0:
            count = int(np.sum(gaps > GAP_STEP_RATIO * step))
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

    def _unseen(self, at: Array, instants: Array) -> list[str]:
        """That the result has too few rows for the reference's, unless it is asked for to look at no others."""
        if self.options.at != "reference" and len(at) < 2 <= len(instants):
            return [f"the result has one row only in the compared time, the reference {len(instants)}"]
        if self.options.at != "auto" or len(instants) <= SPARSE + 1:
            return []
        # In rows of the reference, so that uneven steps do not matter; its ends are beside the result's.
        rows = len(instants) - 1
        passed = np.diff(np.r_[0.0, np.interp(at, instants, np.arange(len(instants))), rows])
        unseen = float((passed - SPARSE).clip(0.0).sum()) / rows
        # Tools end a step apart.
        if rows <= SPARSE * len(at) and unseen <= MAX_UNSEEN_SHARE:
            return []
        return [
            f"the result has too few rows: {len(at)} for {len(instants)} of the reference, {100 * unseen:.3g} % of "
            f"which lie more than {SPARSE} rows behind the last of the result; --at result looks at its own rows "
            "alone, --at reference interpolates between them"
        ]


def _requested_span(options: Options) -> str:
    begin = "" if options.start is None else f"from {options.start:.9g} s"
    end = "" if options.end is None else f"to {options.end:.9g} s"
    return f" (asked for {' '.join(part for part in (begin, end) if part)})" if begin or end else ""


def _span(time: Array) -> str:
    return f"{time[0]:.9g} to {time[-1]:.9g} s"


# A conversion of units rounds twice.
CONVERSION_ROUNDING = 4 * np.finfo(float).eps
# A variable follows another one where they differ by less than this share of its range.
FOLLOWS = 0.1
# Curves are kept of so many variables, the worst ones.
CURVES = 12
MAX_SUGGESTIONS = 20  # missing columns for which a name that could be meant is looked for
MAX_PAIRS = 10_000  # of columns that are looked through for one that another follows


def compare(
    result: Series | Trace,
    reference: Series | Trace,
    tolerances: Tolerances | None = None,
    options: Options | None = None,
    *,
    between: Series | None = None,
    names: tuple[str, str] = ("result", "reference"),
) -> Comparison:
    """Every row of the result against the tube around the reference (see tube.bounds).

    Columns that the reference lacks are ignored; those that the result lacks are missing, which is different; so is a
    result that begins later or ends earlier than the reference by more than a step. What differs or cannot be compared
    is reported in what is returned. between: bounds of the reference between its rows (`feedsim.comparison.between`).
    InputError: the options themselves are wrong for these columns, or the bounds are of another reference.
    """
    tolerances, options = tolerances or Tolerances(), options or Options()
    result, reference = as_series(result), as_series(reference)

    def again(options: Options) -> Comparison:
        return _compare_variables(result, reference, tolerances, options, between, names)

    comparison = again(options)
    if comparison.those("different"):
        ours, theirs = with_units(result, options.units), with_units(reference, options.reference_units)
        comparison = replace(comparison, looks_like=likeness(comparison, ours, theirs, tolerances, options, again))
    return replace(comparison, variables=_drop_curves(comparison.variables))


def _compare_variables(
    result: Series,
    reference: Series,
    tolerances: Tolerances,
    options: Options,
    between: Series | None,
    names: tuple[str, str],
) -> Comparison:
    """compare(), with the curves of all variables."""
    asked = [name for name in chosen(reference.all_names, options) if not tolerances.of(name).ignore]
    results = sources((*result.all_names, *result.skipped), asked, options)
    notes = _note_unused_columns(result, reference, tolerances, options)
    notes += repeated_units(reference.units, asked, options.reference_units, "reference")
    notes += repeated_units(result.units, results.values(), options.units, "result")
    result, reference = with_units(result, options.units), with_units(reference, options.reference_units)
    unused = tuple(tolerances.unused(reference.all_names))
    blank = Comparison(*names, "unusable", notes=tuple(notes), shift=options.shift, unused=unused)
    if not results:
        wanted = (
            describe_missing_column(asked[0], result.names) if asked else "every column of the reference is left out"
        )
        return replace(blank, problem=f"no column in common: {wanted}")
    if not len(result) or not len(reference):
        return replace(blank, problem=f"the {'result' if len(reference) else 'reference'} has no rows")
    tubes = _bounds_between(between, reference)
    reach = min(tolerances.of(name).time or 0.0 for name in results)
    over = Overlap(result, reference, options, reach, bounded=tubes.keys() >= results.keys())
    peers = _magnitudes(reference, asked)
    blank = replace(blank, start=over.start, end=over.end)
    if over.problem:
        return replace(blank, problem=over.problem)
    notes += over.notes
    reported: dict[str, list[str]] = {}
    variables = []
    missed = 0
    for name in asked:
        if fault := _not_read(reference, name, results.get(name), result):
            variables.append(
                Variable(name, "unusable", results.get(name, ""), reference.units.get(name, ""), reason=fault)
            )
        elif name in results:
            variable, remarks = _variable(over, name, results[name], tolerances, peers, tubes.get(name))
            for remark in remarks:
                reported.setdefault(remark, []).append(name)
            variables.append(variable)
        elif not options.common:
            missed += 1
            reason = (
                describe_missing_column(name, result.names)
                if missed <= MAX_SUGGESTIONS
                else f"the result has no column {name!r}"
            )
            variables.append(Variable(name, "missing", reason=reason))
    notes += [f"{shorten_list(who, MAX_LISTED_COLUMNS)}: {remark}" for remark, who in reported.items()]
    notes += _note_default_tolerance(variables, reference, tolerances)
    verdict: Verdict = "same"
    if over.uncovered or any(variable.verdict in ("different", "missing") for variable in variables):
        verdict = "different"
    if any(variable.verdict == "unusable" for variable in variables):
        verdict = "unusable"
    coverage = _coverage(over, variables)
    problem = over.uncovered
    if coverage is not None and coverage.share < options.cover:
        verdict = "different" if verdict == "same" else verdict
        asked_for = f"{coverage.rows} of {coverage.of_rows} rows of the result are compared"
        problem = "; ".join(part for part in (problem, f"{asked_for}, {percent(options.cover)} are asked for") if part)
    return replace(
        blank, verdict=verdict, variables=tuple(variables), problem=problem, notes=tuple(notes), coverage=coverage
    )


def _bounds_between(between: Series | None, reference: Series) -> dict[str, BoundsBetween]:
    """Variable -> its bounds between the rows of the reference. InputError: they are of another one."""
    if between is None:
        return {}
    check_bounds(between, reference)
    return {
        name: BoundsBetween(reference.time, reference[name], between[name + BELOW], between[name + ABOVE])
        for name in reference.columns
        if name + BELOW in between
    }


def _coverage(over: Overlap, variables: Sequence[Variable]) -> Coverage | None:
    compared = [variable for variable in variables if variable.verdict in ("same", "different")]
    if not compared:
        return None
    result, reference = over.result, over.reference
    return Coverage(
        rows=min(variable.covered for variable in compared),
        of_rows=len(result),
        columns=len({variable.source for variable in compared}),
        of_columns=len(result.all_names) + len(result.skipped),
        of_reference=len(reference.all_names) + len(reference.skipped),
        time=over.time_compared,
        of_time=float(np.ptp(result.time)),
    )


def _variable(
    over: Overlap,
    name: str,
    source: str,
    tolerances: Tolerances,
    peers: Mapping[str, float],
    between: BoundsBetween | None,
) -> tuple[Variable, list[str]]:
    """A variable and what there is to say about it."""
    options, tolerance = over.options, tolerances.of(name)
    unit, theirs = over.reference.units[name], over.result.units[source]
    remarks = []
    try:
        scale, remark = factor(theirs, unit)
        remarks += [remark] if remark else []
    except InputError as error:
        return Variable(name, "unusable", source, unit, reason=f"units differ: {error}"), []
    time, values = over.reference.time, over.reference[name]
    hold = tolerance.hold
    if hold is None and any(matches(name, pattern) for pattern in options.hold):
        hold = True
    if hold:
        remarks.append("held between rows, as asked for: the value of either neighbour is right")
    elif hold is None and (hold := _is_flag(values)):
        remarks.append(
            "held between rows, as the reference is 0 or 1 alone: the value of either neighbour is right "
            "({hold: false} in a file of tolerances makes it a ramp)"
        )
    at, y = over.rows_of(source, bool(hold), between is not None)
    y = y * scale
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
        limit = allowed_deviation(tolerance, unit, span, magnitude)
    except InputError as error:
        reason = f"its tolerance: {error}{_suggest_columns(over.reference, tolerances, name)}"
        return Variable(name, "unusable", source, unit, reason=reason), remarks
    if tolerance.unit and not unit and not theirs:
        remarks.append("neither side gives a unit; both are taken as SI for the tolerance")
    reach = tolerance.time or 0.0
    low, high = bounds(time, values, at, reach, slack=over.slack, hold=bool(hold))
    if between is not None:
        low, high = between.widened(low, high, at, reach, over.slack)
    with np.errstate(invalid="ignore"):
        off = np.maximum(np.maximum(y - high, low - y), 0.0)
    bad = ~np.isfinite(y)
    off[bad | np.isnan(off)] = inf
    guard = 0.0 if scale == 1.0 else CONVERSION_ROUNDING * np.maximum(np.abs(low), np.abs(high))
    beyond = (off > limit + guard) | ~np.isfinite(off)
    if scale != 1.0:
        off = np.where(off <= guard, 0.0, off)
    if not beyond.any() and span > OF_MAGNITUDE * magnitude and np.max(low) - limit <= np.min(high) + limit:
        remarks.append("the tolerance is as wide as what the reference does: a constant would be the same too")
    worst = int(np.argmax(off))
    expected = float(interpolate_at(time, values, at[worst : worst + 1])[0])
    if 0 < off[worst] < inf:
        expected = float(np.clip(y[worst], low[worst], high[worst]))
    reason = ""
    if not np.isfinite(off[worst]):
        reason = f"beyond what can be calculated ({y[worst]:.9g} for {expected:.9g})"
    if bad.any():
        reason = f"the result holds no number ({y[np.argmax(bad)]}) in {np.sum(bad)} of {len(y)} rows"
    return Variable(
        name, "different" if beyond.any() else "same", source, unit,
        time=float(at[worst]), value=float(y[worst]), expected=expected, deviation=float(off[worst]),
        allowed=limit, reach=reach, rows=len(at), outside=int(np.sum(beyond)),
        covered=over.covered(at),
        first=float(at[np.argmax(beyond)]) if beyond.any() else None, reason=reason,
        curves=Curves(at, y, low - limit, high + limit, time, values, bool(hold)),
    ), remarks  # fmt: skip


def _drop_curves(variables: Sequence[Variable]) -> tuple[Variable, ...]:
    """Curves of the worst ones only."""
    ranked = sorted(variables, key=lambda variable: (-variable.ratio, -variable.deviation))
    kept = [variable.name for variable in ranked if variable.curves is not None][:CURVES]
    keep = {name for i, name in enumerate(kept) if i == 0 or next(v for v in variables if v.name == name).outside}
    return tuple(variable if variable.name in keep else replace(variable, curves=None) for variable in variables)


def _note_unused_columns(result: Series, reference: Series, tolerances: Tolerances, options: Options) -> list[str]:
    """Columns that are not read. InputError: rules that match nothing."""
    notes: list[str] = []
    own = [pattern for pattern, _ in tolerances.rules if pattern not in tolerances.shared]
    for what, patterns, names in (
        ("tolerance", own, reference.all_names),
        ("unit", options.units, result.all_names),
        ("reference's unit", options.reference_units, reference.all_names),
        ("hold", options.hold, reference.all_names),
    ):
        check_used(what, patterns, names)
    for whose, series in (("result", result), ("reference", reference)):
        notes += [str(note) for note in series.notes]
        if series.skipped:
            notes.append(f"columns of text in the {whose} are not compared: {', '.join(series.skipped[:5])}")
    return notes


def _note_default_tolerance(variables: Sequence[Variable], reference: Series, tolerances: Tolerances) -> list[str]:
    """What the default allows where no tolerance is given, beside what matters: how near a variable is to another one
    that it follows, such as a position to its setpoint."""
    compared = [
        variable
        for variable in variables
        if variable.verdict in ("same", "different") and variable.deviation > 0 and not tolerances.given(variable.name)
    ]
    if not compared:
        return []
    names = shorten_list([variable.name for variable in compared], MAX_LISTED_COLUMNS)
    text = f"no tolerance is given for {names}: {DEFAULT_TOLERANCE:g} of the range is allowed"
    few_enough = max(1, MAX_PAIRS // len(reference.columns))
    followed = [(variable, *_leader(variable, reference)) for variable in compared[:few_enough]]
    entry, leader, apart = max(followed, key=lambda item: item[0].allowed / item[2] if item[2] else 0.0)
    if apart:
        text += (
            f", {entry.allowed:.3g} {entry.unit} of {entry.name}, which differs from {leader} by {apart:.3g} "
            f"{entry.unit} at most; --tol '{entry.name}={DEFAULT_TOLERANCE * apart:.1g} {entry.unit}' is a "
            f"thousandth of that"
        )
    return [text]


def _leader(variable: Variable, reference: Series) -> tuple[str, float]:
    """The column of the same unit that a variable is nearest to, and the largest difference from it.

    ("", 0.0) without a unit, and where there is none within a tenth of the variable's range.
    """
    if variable.unit in ("", "1"):
        return "", 0.0
    values = reference[variable.name]
    best, apart = "", FOLLOWS * float(np.ptp(values))
    for name in reference.columns:
        if name != variable.name and reference.units[name] == variable.unit:
            far = float(np.abs(values - reference[name]).max(initial=0.0))
            if 0 < far < apart:
                best, apart = name, far
    return (best, apart) if best else ("", 0.0)


def _magnitudes(reference: Series, names: Sequence[str]) -> dict[str, float]:
    """Unit -> largest magnitude of the reference's columns in it; of plain numbers none."""
    result: dict[str, float] = {}
    for name in names:
        if name in reference and (unit := reference.units[name]) not in ("", "1"):
            values = np.abs(reference[name])
            result[unit] = max(result.get(unit, 0.0), float(values[np.isfinite(values)].max(initial=0.0)))
    return result


def _not_read(reference: Series, name: str, source: str | None, result: Series) -> str:
    """Why a column of either side holds no numbers; "" where it does."""
    if name in reference.broken:
        return reference.broken[name]
    if source is not None and source in result.skipped:
        return f"the result's column {source!r} holds text"
    return result.broken.get(source, "") if source is not None else ""


def _suggest_columns(reference: Series, tolerances: Tolerances, name: str) -> str:
    """Where a tolerance for all columns does fit some: how to give it to those alone."""
    rule = next(((p, t) for p, t in reversed(tolerances.rules) if t.value is not None and matches(name, p)), None)
    if rule is None or rule[0] != "*" or not rule[1].unit:
        return ""
    for other, unit in reference.units.items():
        try:
            factor(rule[1].unit, unit or "1")
        except InputError:
            continue
        pattern = f"*.{other.rpartition('.')[2]}" if "." in other else other
        return f"; give it to the columns that it is for, such as {f'{pattern}={rule[1].text}'!r}"
    return ""


def _is_flag(values: Array) -> bool:
    """Whether a reference switches between 0 and 1 and is nothing else.

    Other whole numbers may be a ramp, of a speed in rpm or a count: held, it would have a row of room in time.
    """
    finite = values[np.isfinite(values)]
    return bool(np.any(finite == 0) and np.any(finite == 1) and np.all((finite == 0) | (finite == 1)))
