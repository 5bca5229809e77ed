"""The instants at which a result is looked at, and whether it covers the reference."""

from __future__ import annotations

from math import inf

import numpy as np

from feedsim.compare.options import Options
from feedsim.compare.tube import Rows, along, slack_of, usual_step
from feedsim.compare.verdict import seconds
from feedsim.trace import Array, Series

# A gap is worth a word from this many usual steps on.
GAP_STEP_RATIO = 10.0
# Times that a usual step must be longer than the other's to be called coarser.
FINER = 1.5
# Rows of the reference that may come on one of the result. Those that lie farther behind it are not seen,
SPARSE = 10
# and so many of the reference's may be: beyond, the result says too little about it.
MAX_UNSEEN_SHARE = 0.25
# Share of the compared time that a result may lack at an end for its shift or its tolerance in time, at most.
LACKING = 0.1


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
                f"{_span(time)}{_asked(options)}"
            )
            return
        steps = usual_step(time), usual_step(self.theirs)
        instants = np.unique(time[self._inside(time, self.start, self.end)])
        # A shift takes rows away at the end that it moves the result from; a tolerance in time at both.
        longest = LACKING * (self.end - self.start)
        forgiven = [min(max(reach, value, 0.0), longest) for value in (options.shift, -options.shift)]
        # Tools begin or end a step apart; a step of a reference with few rows would be much.
        most = max(steps[1], 0.01 * (self.end - self.start))
        first, last = (
            1.001 * min(max(steps[0], float(step)), most) + self.slack
            for step in (np.diff(instants)[[0, -1]] if len(instants) > 1 else (0.0, 0.0))
        )
        parts = []
        for lacking, step, allowed, words in (
            (self.theirs[0] - self.start, first, forgiven[0], ("begins", self.theirs[0], self.start)),
            (self.end - self.theirs[-1], last, forgiven[1], ("ends", self.theirs[-1], self.end)),
        ):
            text = f"the result {words[0]} at {words[1]:.9g} s, the reference at {words[2]:.9g} s"
            if lacking > step + allowed:
                parts.append(text)
            elif lacking > step:
                why = "its tolerance in time" if allowed <= reach else "its shift"
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
            values = along(self.theirs, whole, self.at)
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


def _asked(options: Options) -> str:
    begin = "" if options.start is None else f"from {options.start:.9g} s"
    end = "" if options.end is None else f"to {options.end:.9g} s"
    return f" (asked for {' '.join(part for part in (begin, end) if part)})" if begin or end else ""


def _span(time: Array) -> str:
    return f"{time[0]:.9g} to {time[-1]:.9g} s"
