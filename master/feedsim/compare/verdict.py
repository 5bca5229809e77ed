"""What a comparison finds."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, isfinite
from typing import Literal

from feedsim.errors import few
from feedsim.trace import Array

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
                parts.append(words + few([variable.name for variable in named], 3) + why)
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
