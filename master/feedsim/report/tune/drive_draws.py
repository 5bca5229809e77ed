"""What the intervals of identified values make of a tuned drive: figures, findings, a sentence and a section."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.report.content import Section, Table, Text, code
from feedsim.report.formatting import minus, typeset
from feedsim.report.uncertainty import drawn_values
from feedsim.tune.drive_result import Case, Tuned, decibels
from feedsim.uncertainty import interval, share_of


def reductions(case: Case, name: str) -> Any:
    """By how much an error of every motion falls [%]; below 1 nm counts as 1 nm."""
    before, after = (np.maximum(getattr(errors, name), 1e-9) for errors in (case.before, case.after))
    return 100 * (1 - after / before)


def drawn_intervals(tuned: Tuned) -> dict[str, tuple[float, float]]:
    """Figure -> interval over draws of the machine: margins, and reductions of a drive that changes; empty without."""
    drawn = tuned.drawn
    if drawn is None:
        return {}
    values = {
        "gain_margin_after": [margin.gain for margin in drawn.margins],
        "phase_margin_after": [margin.phase for margin in drawn.margins],
    }
    for name in ("peak", "overshoot") if drawn.cases else ():
        values[f"{name}_reduction"] = [float(np.median(reductions(case, name))) for case in drawn.cases]
    return {
        name: tuple(map(float, interval(np.array(value))))  # type: ignore[misc]
        for name, value in values.items()
        if np.isfinite(value).all()
    }


def share_text(tuned: Tuned) -> str:
    """Share of further draws that an interval holds."""
    assert tuned.drawn is not None
    return f"{100 * share_of(tuned.drawn.count):.0f} %"


def drawn_findings(tuned: Tuned) -> list[str]:
    """What draws of the machine lack: margins, and motions that get worse."""
    drawn, limits = tuned.drawn, tuned.limits
    if drawn is None:
        return []
    result = []
    if thin := [margin for margin in drawn.margins if limits.missing(margin) > 0]:
        least = (
            f"{decibels(min(margins.gain for margins in thin))} and {min(margins.phase for margins in thin):.3g} deg"
        )
        result.append(
            f"in {len(thin)} of {drawn.count} draws of the machine a margin is below {limits.gain_margin:g} dB or "
            f"{limits.phase_margin:g} deg; the least are {least}"
        )
    if bad := [case for case in drawn.cases if case.worse]:
        result.append(f"in {len(bad)} of {drawn.count} draws of the machine a motion gets worse than before")
    return result


def drawn_answer(tuned: Tuned) -> list[str]:
    """What the intervals of identified values make of it."""
    words = {"peak_reduction": "peaks fall by {} to {} %", "overshoot_reduction": "overshoot by {} to {} %",
             "gain_margin_after": "the gain margin is {} to {} dB",
             "phase_margin_after": "the phase margin {} to {} deg"}  # fmt: skip
    result = drawn_intervals(tuned)
    if not result or tuned.drawn is None:
        return []
    parts = [words[name].format(*(f"{end:.3g}" for end in result[name])) for name in words if name in result]
    return [
        f"With what identification leaves open: {', '.join(parts)} ({share_text(tuned)}, {tuned.drawn.count} draws)."
    ]


def drawn_section(tuned: Tuned, figures: Mapping[str, Figure]) -> Iterator[Section]:
    """Intervals over draws of the machine, and what was drawn."""
    if tuned.drawn is None:
        return
    lines: list[tuple[Text, ...]] = []
    for name, ends in drawn_intervals(tuned).items():
        figure = figures[f"{tuned.axis}.{name}"]
        values = (minus(f"{value:.3g}") for value in (figure.value, *ends))
        lines.append((code(f"{tuned.axis}.{name}"), *values, typeset(figure.unit)))
    note = (
        f"{tuned.drawn.count} draws of the machine, which the values were not found on. An interval holds "
        f"{share_text(tuned)} of further draws. Margins: the least over loops, poses and modes."
    )
    table = Table("lrrrl", ("Figure", "Value", "From", "To", "Unit"), lines, note)
    yield Section("What identification leaves open", [table, drawn_values(tuned.drawn.cloud)])
