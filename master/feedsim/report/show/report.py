"""The report of results and records side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure, positioning
from feedsim.analysis.alignment import stops
from feedsim.analysis.side_by_side import SUMMARY as OF_RESULT
from feedsim.analysis.side_by_side import Source, differing
from feedsim.report import sections
from feedsim.report.content import Bullets, Report, Section, Table, Text, code
from feedsim.report.control import control_section
from feedsim.report.formatting import counted, display_unit, minus, scale, shown
from feedsim.report.provenance import hashed, inputs_part, quantity, software
from feedsim.report.results import REPORT, SUMMARY, check_place
from feedsim.report.show.pictures import Stop, pictures_of, stop_seen, stops_of

FORMAT = 1
MOST_LEADING = 5  # figures that are told first
LEAST_CHANGE = 0.05  # [%] of a figure, below which it has not changed
BAND = 1e-6  # [m] about the target, within which an axis has settled
# Figures whose change is told first, by what stands behind the last dot.
LEADING_FIGURES = ("G", "G_b", "peak_", "servo_mismatch", "overshoot", "settling_time")


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the report can be written to ``directory`` without one of ``inputs`` being lost."""
    check_place(directory, (REPORT, SUMMARY), inputs, kind="show")


def files_of(sources: Sequence[Source]) -> list[Path]:
    """Files that are read."""
    found = []
    for source in sources:
        found += [source.recording.path]
        if source.figures:
            found += [source.recording.path.with_name(OF_RESULT)]
    return found


def lines(sources: Sequence[Source]) -> list[str]:
    """What the command says: parameters that differ, and the leading figures of every source."""
    rows = differing(sources)
    said = [f"differs: {name}: {' | '.join(map(_readable, values))}" for name, values in rows[:10]]
    if len(rows) > 10:
        said.append(f"and {len(rows) - 10} parameters more, in the report")
    for name in _leading(sources):
        values = [source.figures.get(name) for source in sources]
        said.append(f"{name}: {' | '.join('–' if v is None else str(Figure(*v, '')) for v in values)}")
    said += [
        f"{source.name} is aligned {source.aligned}" for source in sources if source.aligned and not source.figures
    ]
    return said or ["the sources have neither figures nor parameters to compare; the pictures do"]


def answers(sources: Sequence[Source]) -> list[str]:
    """The same in the words of the page: what differs, and how far the leading figures are from the first source's."""
    names = [source.name for source in sources]
    rows = differing(sources)
    said = [f"{name}: {_each(names, map(_readable, values))}." for name, values in rows[:3]]
    if len(rows) > 3:
        said.append(f"{counted(len(rows) - 3, 'parameter')} more that differ are listed below.")
    for name in _leading(sources)[:MOST_LEADING]:
        values = [source.figures.get(name) for source in sources]
        text = ["–" if v is None else " ".join(shown(Figure(*v, ""))) for v in values]
        first, last = values[0], values[-1]
        change = ""
        if len(sources) == 2 and first is not None and last is not None and first[1] == last[1] and first[0]:
            share = 100 * (last[0] / first[0] - 1)
            change = f" ({share:+.1f} %)" if abs(share) >= LEAST_CHANGE else " (unchanged)"
        said.append(f"{name}: {_each(names, text)}{minus(change)}.")
    return said or lines(sources)


def _each(names: Sequence[str], values: Iterable[str]) -> str:
    return ", ".join(f"{value} in {name}" for name, value in zip(names, values, strict=True))


def _readable(value: str) -> str:
    """A parameter as a person reads it, 4 (m/min)/mm for 66.6666667 1/s; a dash where a source has none."""
    number, _, unit = value.partition(" ")
    with suppress(ValueError):
        amount = float(number)
        best = scale(unit, np.array([amount]))
        return value if best.factor == 1 else f"{best.factor * amount:.6g} {best.unit}"
    return value or "–"


def _leading(sources: Sequence[Source]) -> list[str]:
    names = dict.fromkeys(name for source in sources for name in source.figures)
    return [name for name in names if name.count(".") == 1 and name.partition(".")[2].startswith(LEADING_FIGURES)
            and name.partition(".")[2].rstrip("+-") == name.partition(".")[2]]  # fmt: skip


def report_of(sources: Sequence[Source]) -> Report:
    """Content of the report."""
    names = [source.name for source in sources]
    rows = [(f"Source {k}", f"{source.name}: {len(source.time)} rows") for k, source in enumerate(sources, 1)]
    return Report(
        " against ".join(names) if len(names) <= 3 else f"{len(names)} results side by side",
        counted(len(sources), "source"),
        answer=answers(sources),
        next_step=(
            "See whether they are the same within a tolerance:\n",
            code("feedsim compare RESULT.csv REFERENCE.csv --tol 1e-6"),
        )
        if len(sources) > 1
        else "",
        notes=tuple(note for source in sources for note in source.notes),
        main=[
            *pictures_of(sources),
            _stops(sources),
            _figures(sources),
            _parameters(sources),
            control_section(changes=dict(differing(sources))),
            _alignment(sources),
            Section("What each says of itself", [Bullets([f"{s.name}: {line}" for s in sources for line in s.answer])])
            if any(source.answer for source in sources)
            else None,
        ],
        provenance=sections.provenance_section(rows, hashed([("source", file) for file in files_of(sources)])),
        footer="Differences are to the first source that has the figure. Values in full precision: summary.json.",
    )


def _alignment(sources: Sequence[Source]) -> Section | None:
    rows = [(source.name, source.aligned or "the others are laid onto it") for source in sources]
    return Section("How they are laid over each other", [Table("lp", (), rows)]) if len(sources) > 1 else None


def _stops(sources: Sequence[Source]) -> Section | None:
    """Every stop of an axis: overshoot and settling time of every source."""
    found = stops(sources)
    rows = []
    for axis, number in stops_of(found):
        seen = [stop_seen(source, own, axis, number) for source, own in zip(sources, found, strict=True)]
        cells = [cell for each in seen for cell in _stop(each)]
        rows.append((f"{axis}, stop {number + 1}", *cells))
    if not rows:
        return None
    heads = [f"{source.name}: {what}" for source in sources for what in ("overshoot [µm]", "settling [ms]")]
    note = (
        "Overshoot: largest distance beyond the end position. Settling: last instant outside "
        f"±{BAND * 1e6:g} µm about it, counted from where the setpoint comes to rest."
    )
    return Section("Stops", [Table("l" + "r" * len(heads), ["Axis", *heads], rows, note)])


def _stop(stop: Stop | None) -> tuple[str, str]:
    if stop is None:
        return "–", "–"
    figures = positioning(stop.trace, stop.approach, band=BAND)
    return shown(figures["overshoot"])[0], shown(figures["settling_time"])[0]


def _figures(sources: Sequence[Source]) -> Section | None:
    """Every figure of every source, with its difference to the first one."""
    names = list(dict.fromkeys(name for source in sources for name in source.figures))
    if not names:
        return None
    rows: list[tuple[Text, ...]] = []
    for name in names:
        unit = next(source.figures[name][1] for source in sources if name in source.figures)
        first = math.nan
        cells: list[str] = []
        for k, source in enumerate(sources):
            value, own = source.figures.get(name, (math.nan, unit))
            cells.append(shown(Figure(value, unit, ""))[0] if name in source.figures and own == unit else "–")
            if k:
                difference = value - first
                cells.append(_difference(difference, unit))
            if math.isnan(first) and own == unit:
                first = value
        rows.append((code(name), *cells, display_unit(unit)))
    heads = ["Figure", sources[0].name]
    for source in sources[1:]:
        heads += [source.name, "difference"]
    return Section("Figures", [Table("l" + "r" * (len(heads) - 1) + "l", [*heads, "Unit"], rows)])


def _difference(value: float, unit: str) -> str:
    """As many places as the values have, with a sign; 0 where rounding leaves nothing."""
    if not math.isfinite(value):
        return "–"
    text, _ = shown(Figure(abs(value) if abs(value) > 1e-9 else 0.0, unit, ""))
    return text if not any(digit in text for digit in "123456789") else f"{'+' if value > 0 else '−'}{text}"


def _parameters(sources: Sequence[Source]) -> Section | None:
    if sum(bool(source.parameters) for source in sources) < 2:
        return None
    rows: list[tuple[Text, ...]] = [(code(name), *map(_readable, values)) for name, values in differing(sources)]
    if not rows:
        return Section(
            "Parameters that differ", [Bullets(["None: machine, motion, coupling and recording are the same."])]
        )
    heads = ("Parameter", *(source.name for source in sources))
    return Section("Parameters that differ", [Table("l" + "p" * len(sources), heads, rows)])


def summary(sources: Sequence[Source], names: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json."""
    return {
        "format": FORMAT,
        "sources": [
            {
                "name": source.name,
                "rows": len(source.time),
                "aligned": source.aligned,
                "shift": quantity(math.nan if source.shift is None else source.shift, "s"),
                "figures": {name: quantity(value, unit) for name, (value, unit) in source.figures.items()},
            }
            for source in sources
        ],
        "differing": {
            name: dict(zip([source.name for source in sources], values, strict=True))
            for name, values in differing(sources)
        },
        "inputs": inputs_part(hashed([("source", file) for file in files_of(sources)])),
        "software": software(),
        "files": list(names),
    }
