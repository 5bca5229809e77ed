"""What a difference looks like: another time, unit, sign, zero point or number of digits, and what to do about it.

A guess is made of a whole variable, never of its worst row, and only where it explains the difference: with it the
variable lies within its tolerance, or what is left is a tenth of what there was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, inf, isfinite
from typing import Literal

import numpy as np

from feedsim.comparison.between import interpolate_at, usual_step
from feedsim.comparison.options import MAX_LISTED_COLUMNS, Options, factor
from feedsim.comparison.shift import estimated_shift
from feedsim.comparison.tolerance import Tolerances
from feedsim.files.trace import Array, Series
from feedsim.foundation.errors import InputError, shorten_list

# --- What a comparison finds ------------------------------------------------------------------------------------------


Verdict = Literal["same", "different", "unusable"]
EXIT_CODES: dict[Verdict, int] = {"same": 0, "different": 1, "unusable": 2}


@dataclass(frozen=True, eq=False)
class Curves:
    """What was compared, in the reference's unit.

    time, values, lower, upper: (M,) rows of the result and the tube around the reference at their instants.
    reference_time, reference: (N,) rows of the reference.
    """

    time: Array
    values: Array
    lower: Array
    upper: Array
    reference_time: Array
    reference: Array
    hold: bool = False


@dataclass(frozen=True)
class Variable:
    """A column of the reference and what became of it.

    name        of the reference; source: of the result ("" where it has none)
    unit        of all values here: the reference's
    verdict     "missing": the result has no such column, which counts as different
    time        of the worst row [s]; value and expected: of result and reference there
    deviation   distance of the result from the reference in the worst row, less what the tolerance in time forgives;
                inf where the result is no number
    allowed     tolerance in value
    reach       tolerance in time [s]
    rows        instants that were compared; outside: how many are outside the tube
    covered     rows of the result that were compared: those on which its values at these instants rest
    first       first instant outside [s]
    reason      why it is missing, unusable or special
    """

    name: str
    verdict: Literal["same", "different", "missing", "unusable"]
    source: str = ""
    unit: str = ""
    time: float = 0.0
    value: float = 0.0
    expected: float = 0.0
    deviation: float = 0.0
    allowed: float = 0.0
    reach: float = 0.0
    rows: int = 0
    outside: int = 0
    covered: int = 0
    first: float | None = None
    reason: str = ""
    curves: Curves | None = None

    @property
    def ratio(self) -> float:
        """Deviation in shares of what is allowed; above 1 where it is too much."""
        if self.verdict in ("missing", "unusable"):
            return inf
        return self.deviation / self.allowed if self.allowed > 0 else (inf if self.deviation > 0 else 0.0)

    @property
    def line(self) -> str:
        """In words, without the name."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        if self.verdict in ("missing", "unusable"):
            return self.reason
        off = f"off by {self.deviation:.4g}{unit}" if isfinite(self.deviation) else self.reason
        forgiven = f" within {seconds(self.reach)}" if self.reach else ""
        return (
            f"{off} at {self.time:.9g} s, allowed {self.allowed:.4g}{unit}{forgiven} "
            f"({self.value:.9g} for {self.expected:.9g}{unit})"
        )


@dataclass(frozen=True)
class Coverage:
    """How much of a result was held against the reference.

    rows, of_rows         rows of the result, in the variable with the fewest; of all that it has
    columns, of_columns   columns of the result; of_reference: of how many of the reference
    time, of_time         [s] of the result
    """

    rows: int
    of_rows: int
    columns: int
    of_columns: int
    of_reference: int
    time: float
    of_time: float

    @property
    def share(self) -> float:
        """Of the result's rows."""
        return self.rows / self.of_rows

    @property
    def text(self) -> str:
        """In words."""
        parts = [f"all {self.of_rows} rows"]
        if self.rows < self.of_rows:
            parts = [f"{self.rows} of {self.of_rows} rows ({percent(self.share)})"]
        parts += [f"{self.columns} of {self.of_columns} columns"] if self.columns < self.of_columns else ["all columns"]
        if self.columns < self.of_reference:
            parts.append(f"{self.columns} of {self.of_reference} of the reference's")
        if self.time < 0.999 * self.of_time:
            parts.append(f"{self.time:.4g} of {self.of_time:.4g} s")
        return ", ".join(parts)


@dataclass(frozen=True)
class Proposal:
    """What the difference of some variables looks like, and what to do about it: words that begin with their names."""

    names: tuple[str, ...]
    text: str


@dataclass(frozen=True, repr=False)
class Comparison:
    """A result against a reference.

    result, reference  names, of files as a rule
    variables          in the reference's order
    problem            why the whole is unusable, or different although no variable is (it ends too early)
    notes              what a user should know
    start, end         compared time [s]
    shift              added to the result's time [s]
    unused             patterns of tolerances that match no column: they may be for other references
    coverage           how much of the result was compared; None where nothing was
    looks_like         what the differences look like (likeness.py)
    """

    result: str
    reference: str
    verdict: Verdict
    variables: tuple[Variable, ...] = ()
    problem: str = ""
    notes: tuple[str, ...] = ()
    start: float = 0.0
    end: float = 0.0
    shift: float = 0.0
    unused: tuple[str, ...] = ()
    coverage: Coverage | None = None
    looks_like: tuple[Proposal, ...] = ()

    def __repr__(self) -> str:
        return f"Comparison: {self.line}"

    @property
    def same(self) -> bool:
        return self.verdict == "same"

    @property
    def exit_code(self) -> int:
        """0 same, 1 different, 2 unusable."""
        return EXIT_CODES[self.verdict]

    @property
    def worst(self) -> Variable | None:
        """The compared variable that is nearest to its limit or farthest beyond; the first one among equals."""
        compared = [variable for variable in self.variables if variable.verdict in ("same", "different")]
        return max(compared, key=lambda variable: (variable.ratio, variable.deviation), default=None)

    def those(self, *verdicts: str) -> tuple[Variable, ...]:
        """Variables of these verdicts."""
        return tuple(variable for variable in self.variables if variable.verdict in verdicts)

    @property
    def heading(self) -> str:
        """The verdict; of a result that is the same as far as it was compared, how far that is."""
        if self.same and self.coverage is not None and self.coverage.share < 1:
            return f"same in {percent(self.coverage.share)} of the rows"
        return self.verdict

    @property
    def line(self) -> str:
        """In one line: verdict and in which share of the rows, how many, what was compared, the worst."""
        compared = self.those("same", "different")
        beyond = len(self.those("different"))
        parts = [self.problem] if self.problem else []
        if beyond:
            parts.append(f"{beyond} of {len(compared)} variables outside")
        for kind, words in (("missing", "missing: "), ("unusable", "cannot be compared: ")):
            if named := self.those(kind):
                why = f" ({named[0].reason})" if kind == "unusable" else ""
                parts.append(words + shorten_list([variable.name for variable in named], 3) + why)
        if self.verdict == "same":
            parts.append(f"{len(compared)} variable{'s'[: len(compared) != 1]}")
        if self.coverage is not None:
            parts.append(f"compared {self.coverage.text}")
        worst = self.worst
        text = "; ".join(parts)
        if worst is not None:
            text += f"; worst {worst.name}: {worst.line}"
        return f"{self.heading}: {text}"


def percent(share: float) -> str:
    """A share, never rounded up to all of it."""
    return f"{floor(100 * share)} %" if share >= 0.01 else f"{100 * share:.1g} %"


def seconds(value: float) -> str:
    """A time in the unit that reads best."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if abs(value) * scale >= 1 - 1e-9:
            return f"{value * scale:.6g} {unit}"
    return f"{value * 1e9:.6g} ns" if value else "0 s"


EXPLAINED_SHARE = 0.1  # of the difference may be left
# Units that are mistaken for one another, by what is meant: those that are not of the reference's kind drop out.
MISTAKEN = ("m", "mm", "um", "in", "rad", "deg", "rev", "rad/s", "rpm", "deg/s", "rev/s", "m/s", "mm/s", "mm/min",
            "m/min", "in/min", "N", "kN", "N.m", "N.cm", "mN.m", "A", "mA", "percent", "1")  # fmt: skip
LIKE_A_UNIT = 1e-3  # relative; a factor is called a unit when it is that near
ROWS_SEARCHED = 2000  # rows of a result that its digits and its shift are looked for in,
VARIABLES_EXPLAINED = 1000  # that are looked at, the worst
VARIABLES_SEARCHED = 6  # and variables, the worst, that show a shift
MIN_GUESS_ROWS = 3  # rows that a guess rests on
# Largest shift that is looked for: so many steps, or that long, but no more than a tenth of the compared time.
MAX_SHIFT_STEPS, MAX_SHIFT_TIME, MAX_SHIFT_SHARE = 200, 0.05, 0.1
WHOLE_ROW_TOLERANCE = 0.01  # of a step; a shift that is so near to whole rows is one of whole rows


@dataclass(frozen=True)
class _Guess:
    """What one variable looks like.

    remaining: root mean square of what is left of the difference. outside: rows that would still be outside, None where
    nothing can be put right.
    """

    remaining: float
    words: str
    outside: int | None = None


def likeness(
    comparison: Comparison,
    result: Series,
    reference: Series,
    tolerances: Tolerances,
    options: Options,
    again: Callable[[Options], Comparison],
) -> tuple[Proposal, ...]:
    """What the variables that differ look like, those with one explanation together.

    comparison: with the curves of all variables. again: the same comparison with other options.
    """
    those = comparison.those("different")
    if len(those) > VARIABLES_EXPLAINED:
        those = tuple(sorted(those, key=lambda variable: -variable.ratio)[:VARIABLES_EXPLAINED])
    asked = [variable for variable in those if variable.curves is not None and _has_enough_rows(variable.curves)]
    if not asked:
        return ()
    guessed: dict[str, _Guess] = {}
    open_ones: list[Variable] = []  # that no guess of their values explains to the last row
    for entry in asked:
        assert entry.curves is not None
        guesses = [] if entry.curves.hold else list(_guesses(entry, entry.curves, result))
        if guesses:
            guessed[entry.name] = min(guesses, key=lambda guess: guess.remaining)
        if not guesses or guessed[entry.name].outside:
            open_ones.append(entry)
    shift = _find_common_shift(open_ones, result, reference, tolerances, options) if open_ones else None
    if shift is not None and abs(shift - options.shift) <= WHOLE_ROW_TOLERANCE * usual_step(result.time):
        shift = None  # where it is now it fits best
    late: list[Variable] = []
    for entry in open_ones:
        assert entry.curves is not None
        remaining = np.inf if shift is None else _shifted_rms(entry.curves, shift - options.shift)
        if remaining <= EXPLAINED_SHARE * _rms(_difference(entry.curves)) and (
            entry.name not in guessed or remaining < guessed[entry.name].remaining
        ):
            late.append(entry)
            guessed.pop(entry.name, None)
    groups: dict[str, list[Variable]] = {}
    for entry in asked:
        if entry.name in guessed:
            groups.setdefault(guessed[entry.name].words, []).append(entry)
    outside = {name: guess.outside for name, guess in guessed.items()}
    made = [_proposal(those, words, outside) for words, those in groups.items()]
    if late and shift is not None:
        after = {variable.name: variable.outside for variable in again(replace(options, shift=shift)).variables}
        made.insert(0, _proposal(late, _time_words(shift, options.shift, result), after))
    return tuple(made)


def _proposal(those: Sequence[Variable], words: str, outside: Mapping[str, int | None]) -> Proposal:
    """The same words of several variables, and what it would change; outside: rows that it would leave outside."""
    names = [variable.name for variable in those]
    rest = [
        f"{outside[variable.name]} of {variable.rows} rows of {variable.name}"
        for variable in those
        if outside.get(variable.name)
    ]
    if all(outside.get(name) is None for name in names):
        then = ""
    elif rest:
        then = f"; outside would still be {shorten_list(rest, 2)}"
    else:
        then = "; all of it would be within the tolerance"
    return Proposal(tuple(names), f"{shorten_list(names, MAX_LISTED_COLUMNS)}: {words}{then}")


def _has_enough_rows(curves: Curves) -> bool:
    return int(np.isfinite(curves.values).sum()) >= MIN_GUESS_ROWS


def _difference(curves: Curves) -> Array:
    """(M,) result less reference."""
    return curves.values - interpolate_at(curves.reference_time, curves.reference, curves.time)


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    largest = float(np.abs(known).max(initial=0.0))
    return largest * float(np.sqrt(np.mean((known / largest) ** 2))) if largest else 0.0


def _shifted_rms(curves: Curves, by: float) -> float:
    """What a shift of the result [s] would leave of the difference, as a root mean square."""
    at = curves.time + by
    inside = (at >= curves.reference_time[0]) & (at <= curves.reference_time[-1])
    if 2 * np.sum(inside) < len(at):
        return np.inf
    return _rms(curves.values[inside] - interpolate_at(curves.reference_time, curves.reference, at[inside]))


def _find_common_shift(
    asked: Sequence[Variable], result: Series, reference: Series, tolerances: Tolerances, options: Options
) -> float | None:
    """Shift [s] that fits best all that differ; None where none is found."""
    step = usual_step(result.time)
    begin = max(float(reference.time[0]), -np.inf if options.start is None else options.start)
    end = min(float(reference.time[-1]), np.inf if options.end is None else options.end)
    most = min(MAX_SHIFT_SHARE * (end - begin), max(MAX_SHIFT_TIME, MAX_SHIFT_STEPS * step)) + abs(options.shift)
    names = [variable.name for variable in sorted(asked, key=lambda entry: -entry.ratio)[:VARIABLES_SEARCHED]]
    thin = max(1, len(result) // ROWS_SEARCHED)
    every = Series(result.time[::thin], {name: y[::thin] for name, y in result.columns.items()}, result.units)
    others = [name for name in reference.all_names if name not in names]
    try:
        value = estimated_shift(every, reference, most, replace(options, only=(), ignore=others), tolerances).seconds
    except InputError:
        return None
    rows = round(value / step) if step else 0
    return rows * step if rows and abs(value - rows * step) <= WHOLE_ROW_TOLERANCE * step else value


def _time_words(shift: float, before: float, result: Series) -> str:
    by = before - shift
    step = usual_step(result.time)
    rows = round(abs(by) / step) if step else 0
    exactly = rows > 0 and abs(abs(by) - rows * step) <= 1e-9 * step + 1e-12 * abs(by)
    counted = f" ({rows} row{'s'[: rows != 1]})" if exactly else ""
    reason = ""
    if exactly and rows == 1:
        reason = (
            ": results of a step written beside its start"
            if by < 0
            else ": results of the step before, or inputs held for a step"
        )
    direction = "later" if by > 0 else "earlier"
    return f"{direction} by {_shift_text(abs(by))}{counted}{reason}: --shift '{_shift_text(shift)}'"


def _shift_text(time: float) -> str:
    """To the digits that a shift is known to."""
    return seconds(float(f"{time:.5g}"))


def _guesses(variable: Variable, curves: Curves, result: Series) -> Iterator[_Guess]:
    """What the values alone may look like."""
    y = curves.values
    x = interpolate_at(curves.reference_time, curves.reference, curves.time)
    known = np.isfinite(y) & np.isfinite(x)
    off = _rms(y - x)
    header = result.units.get(variable.source, "")
    if rounded := _digits(variable, curves, result, x):
        yield _Guess(0.0, rounded)
        return
    size = float(np.abs(x[known]).max(initial=0.0))
    gain = float((y[known] / size) @ (x[known] / size) / ((x[known] / size) @ (x[known] / size))) if size else 0.0
    if gain and np.isfinite(gain) and abs(gain - 1) > LIKE_A_UNIT and size:
        words, exact = _factor_words(gain, variable, header)
        remaining = _rms(y - exact * x)
        if remaining <= EXPLAINED_SHARE * min(off, _rms(y)):
            yield _Guess(remaining, words, _count_rows_outside(curves, y / exact))
    constant = float(np.median((y - x)[known]))
    remaining = _rms(y - x - constant)
    if constant and remaining <= EXPLAINED_SHARE * off:
        unit = f" {variable.unit}" if variable.unit not in ("", "1") else ""
        words = f"{'more' if constant > 0 else 'less'} by {abs(constant):.4g}{unit} throughout: another zero point?"
        yield _Guess(remaining, words, _count_rows_outside(curves, y - constant))


def _count_rows_outside(curves: Curves, values: Array) -> int:
    """Rows of values that are put right which would still be outside."""
    return int(np.sum((values < curves.lower) | (values > curves.upper)))


def _factor_words(gain: float, variable: Variable, header: str) -> tuple[str, float]:
    """Words of a factor, and the factor that is meant."""
    sign = -1.0 if gain < 0 else 1.0
    turned = "sign reversed" if sign < 0 else ""
    if abs(abs(gain) - 1) <= LIKE_A_UNIT:
        return f"{turned}: the other direction counts as positive there?", sign
    # A column without unit is taken as SI where the reference has one.
    meant = header or variable.unit
    for unit in MISTAKEN:
        try:
            value = factor(meant, variable.unit)[0] / factor(unit, variable.unit or meant)[0]
        except InputError:
            continue
        if unit != meant and abs(abs(gain) / value - 1) <= LIKE_A_UNIT:
            cure = f"its header says {header}" if header else f"--unit '{variable.source}={unit}'"
            parts = [turned, f"factor {value:.6g}: in {unit}? ({cure})"]
            return ", ".join(part for part in parts if part), sign * value
    parts = [turned, f"{abs(gain):.6g} times the reference throughout"]
    return ", ".join(part for part in parts if part), gain


def _digits(variable: Variable, curves: Curves, result: Series, x: Array) -> str:
    """That the result is the reference with fewer digits, in words; else ""."""
    header = result.units.get(variable.source, "")
    try:
        scale = factor(header, variable.unit)[0]
    except InputError:
        return ""
    picked = np.flatnonzero(np.isfinite(curves.values) & np.isfinite(x))
    picked = picked[:: max(1, len(picked) // ROWS_SEARCHED)]
    y, x, room = curves.values[picked] / scale, x[picked] / scale, variable.allowed / scale
    unit = f" {header or variable.unit}" if (header or variable.unit) not in ("", "1") else ""
    off = np.abs(y - x)
    if not off.any() or not y.any():
        return ""
    for places in range(-3, 16):
        quantum = 10.0**-places
        counts = y / quantum
        if np.all(np.abs(counts - np.round(counts)) <= 1e-6 + 4e-16 * np.abs(counts)):
            # Of values that are all multiples, a coarser reference would be one too.
            if np.all(off <= 0.5 * quantum * (1 + 1e-6) + room) and off.max() > 0.25 * quantum:
                return f"rounded to {quantum:g}{unit}: more digits, or --tol '{variable.name}={quantum:g}{unit}'"
            break
    with np.errstate(divide="ignore"):
        decade = 10.0 ** np.floor(np.log10(np.maximum(np.abs(x), 1e-300)))
    for digits in range(3, 13):
        if np.all(np.array([float(f"{value:.{digits - 1}e}") for value in y]) == y):
            if np.all(off <= 0.5 * 10.0 ** (1 - digits) * decade * (1 + 1e-6) + room):
                return f"rounded to {digits} significant digits: more digits, or a tolerance that allows for them"
            break
    with np.errstate(over="ignore"):
        single = y.astype(np.float32).astype(np.float64)
    if np.all(single == y) and np.all(off <= 2.0**-24 * np.abs(x) * (1 + 1e-6) + room):
        return "in single precision: 7 digits, or a tolerance that allows for them"
    return ""
