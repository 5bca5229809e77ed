"""The report of results and records side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Approach, Figure, deviation, positioning_figures
from feedsim.analysis.circularity import Turn, amplitude_spectrum, contour
from feedsim.analysis.side_by_side import COMPARED_SIGNALS, Source, differing_parameters, stops
from feedsim.analysis.side_by_side import SUMMARY as OF_RESULT
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError
from feedsim.report import content
from feedsim.report.changes import control_section
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.content import Bullets, Picture, Report, Section, Step, Table, Text, Tile, code, with_remark
from feedsim.report.formatting import (
    BEFORE_COLOUR,
    GREEN,
    NARROW,
    ORANGE,
    PURPLE,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    SKY,
    VERMILLION,
    Array,
    count_things,
    display_unit,
    figure_text,
    minus,
    plain_unit,
    scale,
    three_digits,
)
from feedsim.report.provenance import hash_files, inputs_part, quantity
from feedsim.report.run.axis_plots import ZOOM_AFTER, ZOOM_BEFORE, circle, circle_chart, turn_curve

# --- Pictures of several results over each other: contours of circles, stops, signals over time and by frequency ------


FURTHER_COLOURS = (SKY, GREEN, PURPLE, ORANGE, VERMILLION)  # of further results
ABSCISSA = Axis("time from the first row", "s")
TIME_AFTER_MOTION = Axis("time after the end of the motion", "ms", span=(-1e3 * ZOOM_BEFORE, 1e3 * ZOOM_AFTER))
FREQUENCY = Axis("frequency", "Hz", log=True)
SHAKEN_AXIS_SHARE = 0.02
LEFT_OUT = f"Axes with less than {100 * SHAKEN_AXIS_SHARE:g} % of the largest range are left out."
# What a picture answers: stem, title, signal, factor from SI, ordinate.
QUESTIONS = (
    ("following-error", "How far do the axes lag?", "x_e", 1e6, Axis("following error", "µm")),
    ("torque", "What do the motors need?", "M_a", 1.0, Axis("motor torque", "N·m")),
    ("speed", "How fast are the motors?", "n_a", 1.0, Axis("motor speed", "rad/s")),
    ("position", "Where are the axes?", "x_a", 1e3, Axis("position", "mm")),
)
# Stops of an axis that are drawn, and the distance beyond the target that is shown at least [um].
MOST_STOPS, LEAST_REACH = 6, 2.2
# Spectra: signal, title, factor from SI, unit; stretch [s], rows of it at least, and how far down they are drawn.
SPECTRA = (("x_e", "following error", 1e6, "µm"), ("M_a", "motor torque", 1.0, "N·m"))
STRETCH, MIN_SPECTRUM_ROWS, DOWN = 1.0, 64, 1e-4


@dataclass(frozen=True, eq=False)
class _Curve:
    angle: Array
    deviation: Array


def looks_of(sources: Sequence[Source]) -> list[tuple[str, Dash]]:
    """Colour and dash of every source: records as records; of results alone the first is what was before."""
    kinds: tuple[Dash, ...] = ("", "dashed", "dotted")
    records = [not source.figures and not source.parameters for source in sources]
    names = (
        [SIMULATED_COLOUR, *FURTHER_COLOURS] if any(records) else [BEFORE_COLOUR, SIMULATED_COLOUR, *FURTHER_COLOURS]
    )
    result: list[tuple[str, Dash]] = []
    for k, recorded in enumerate(records):
        number = sum(record == recorded for record in records[:k])
        own = [RECORDED_COLOUR] if recorded else names
        result.append((own[number % len(own)], kinds[number // len(own) % len(kinds)]))
    return result


def pictures_of(sources: Sequence[Source]) -> list[Picture]:
    """A picture per question that at least one source answers."""
    pictures = [picture for prefix in _prefixes(sources) if (picture := contour_picture(sources, prefix)) is not None]
    more = [
        stop_picture(sources, stops(sources)),
        *(_over_time(sources, *question) for question in QUESTIONS),
        spectrum_picture(sources),
    ]
    return pictures + [picture for picture in more if picture is not None]


def _prefixes(sources: Sequence[Source]) -> list[str]:
    return list(dict.fromkeys(prefix for source in sources for prefix in source.circles))


def contours(source: Source, turns: Sequence[Turn]) -> list[_Curve]:
    """Measured turns of a result, by the scales."""
    names = [f"{axis}.x_a" for axis in turns[0].axes]
    columns = {name: curve for name in names if (curve := source.curve(name, "m")) is not None}
    trace = Trace(source.time, columns)
    try:
        result = [contour(trace, turn) for turn in turns]
    except InputError as error:
        raise InputError(f"{source.path}: {error}") from None
    return [_Curve(entry.angle, entry.deviation) for entry in result]


def contour_picture(sources: Sequence[Source], prefix: str) -> Picture | None:
    """Contour errors of one circle over each other, each turn in its source's colour."""
    own = [(k, source, source.circles[prefix]) for k, source in enumerate(sources) if prefix in source.circles]
    if not own:
        return None
    curves = [(k, source, turns, contours(source, turns)) for k, source, turns in own]
    on = circle(own[0][2][0], max(float(np.abs(c.deviation).max()) for *_, drawn in curves for c in drawn))
    axes = "-".join(own[0][2][0].axes)
    caption = (
        f"Rings at ±{on.ring:g} µm about the programmed circle; clockwise turns are drawn thin. Where the radii are "
        "not the same, the deviation is what is compared."
    )
    looks = looks_of(sources)
    shown = [
        turn_curve(source.name, looks[k][0], curve.angle, curve.deviation, looks[k][1],
               1.4 if turn.sense > 0 else 0.8)
        for k, source, turns, drawn in curves
        for turn, curve in zip(turns, drawn, strict=True)
    ]  # fmt: skip
    stem, title = f"contour-{prefix.replace('#', '-')}", f"Is the circle round? Plane {axes}"
    return Picture(stem, title, caption, circle_chart(on, shown))


@dataclass(frozen=True, eq=False)
class Stop:
    """A stop of a source: the motion that it ends, and the source's position over its own ``t``."""

    approach: Approach
    trace: Trace


# A curve of a source, by its number: abscissae and ordinates.
_SourceCurve = tuple[int, Array, Array]


def _curves(sources: Sequence[Source], own: Sequence[_SourceCurve]) -> list[Curve]:
    looks = looks_of(sources)
    return [Curve(sources[k].name, x, y, *looks[k], 1.2) for k, x, y in own]


def _over_time(
    sources: Sequence[Source], stem: str, title: str, signal: str, factor: float, ordinate: Axis
) -> Picture | None:
    result: dict[str, list[_SourceCurve]] = {}
    for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
        curves = (
            (k, source, source.curve(f"{axis}.{signal}", COMPARED_SIGNALS[signal])) for k, source in enumerate(sources)
        )
        result[axis] = [(k, source.t, factor * y) for k, source, y in curves if y is not None]
    sizes = {axis: max((float(np.ptp(y)) for *_, y in curves), default=0.0) for axis, curves in result.items()}
    panels = [
        Panel(f"Axis {axis}", ABSCISSA, ordinate, _curves(sources, result[axis]), [Level(0.0, dash="")], linked="t")
        for axis in _moved_axes(sizes)
    ]
    caption = f"Over the time of the first source, from its first row on. {LEFT_OUT}"
    return Picture(stem, title, caption, Chart(panels)) if panels else None


def stop_picture(sources: Sequence[Source], stops: Sequence[Sequence[Approach]]) -> Picture | None:
    """Distance beyond the target about the ends of motions, a panel for every stop of an axis."""
    panels = []
    for axis, number in stops_of(stops):
        own: list[_SourceCurve] = []
        most, said = LEAST_REACH, []
        for k, (source, approaches) in enumerate(zip(sources, stops, strict=True)):
            if (seen := stop_seen(source, approaches, axis, number)) is None:
                continue
            approach = seen.approach
            time, beyond = deviation(seen.trace, approach, f"{axis}.x_a")
            after = 1e3 * (time - approach.end)
            near = (after >= -1e3 * ZOOM_BEFORE) & (after <= 1e3 * ZOOM_AFTER)
            own.append((k, after[near], 1e6 * beyond[near]))
            most = max(most, 1e6 * float(beyond.max()))
            said.append(f"{approach.target * 1e3:.6g}")
        title = f"Axis {axis}, stop {number + 1} at {' and '.join(dict.fromkeys(said))} mm"
        ordinate = Axis("beyond the target", "µm", span=(-1.45 * most, 1.45 * most))
        levels = [Level(0.0, dash=""), Level(0.0, upright=True, dash="dotted")]
        if own and number < MOST_STOPS:
            panels.append(Panel(title, TIME_AFTER_MOTION, ordinate, _curves(sources, own), levels, linked="stop"))
    caption = (
        "Actual position less end position in the sense of the motion, positive past it, over the time after the "
        "setpoint has come to rest."
    )
    if any(number >= MOST_STOPS for _, number in stops_of(stops)):
        caption += f" The first {MOST_STOPS} stops of each axis are drawn; the table has all."
    return Picture("stop", "How do the axes come to rest?", caption, Chart(panels)) if panels else None


def stops_of(stops: Sequence[Sequence[Approach]]) -> list[tuple[str, int]]:
    """Axis and number of every stop that any source has."""
    names = dict.fromkeys(approach.axis for stop in stops for approach in stop)
    most = {axis: max(sum(approach.axis == axis for approach in stop) for stop in stops) for axis in names}
    return [(axis, number) for axis in names for number in range(most[axis])]


def stop_seen(source: Source, approaches: Sequence[Approach], axis: str, number: int) -> Stop | None:
    """A stop of a source; None where it has not recorded it whole."""
    own = [approach for approach in approaches if approach.axis == axis]
    position = source.curve(f"{axis}.x_a", "m")
    if number >= len(own) or position is None or not source.t[0] <= own[number].start < own[number].end < source.t[-1]:
        return None
    return Stop(own[number], Trace(source.t, {f"{axis}.x_a": position}))


def spectrum_picture(sources: Sequence[Source]) -> Picture | None:
    """Amplitude spectra of following error and torque of every axis, over the whole of each source."""
    panels = []
    for signal, words, factor, unit in SPECTRA:
        result: dict[str, list[_SourceCurve]] = {}
        for axis in dict.fromkeys(axis for source in sources for axis in source.axes):
            curves = [(k, _spectrum(source, f"{axis}.{signal}", factor)) for k, source in enumerate(sources)]
            result[axis] = [(k, *curve) for k, curve in curves if curve is not None]
        tops = {axis: max((float(a.max()) for *_, a in curves), default=0.0) for axis, curves in result.items()}
        for axis in _moved_axes(tops):
            y = Axis("amplitude", unit, log=True, span=(DOWN * tops[axis], 2 * tops[axis]))
            panels.append(Panel(f"Axis {axis}: {words}", FREQUENCY, y, _curves(sources, result[axis]), linked="f"))
    caption = (
        f"Amplitude spectra over the whole of each source: Hann windows of {STRETCH:g} s, half over each other, "
        "averaged by power. A steady vibration stands there with its amplitude; what only rings now and then stands "
        f"lower. {LEFT_OUT}"
    )
    chart = Chart(panels, (1.0, 1.0))
    return Picture("spectrum", "Which frequencies are in it?", caption, chart) if panels else None


def _spectrum(source: Source, name: str, factor: float) -> tuple[Array, Array] | None:
    values = source.curve(name, COMPARED_SIGNALS[name.partition(".")[2]])
    if values is None or len(values) < MIN_SPECTRUM_ROWS or not np.ptp(values):
        return None
    interval = float(np.median(np.diff(source.time)))
    even = np.arange(source.time[0], source.time[-1], interval)
    rows = max(MIN_SPECTRUM_ROWS, round(STRETCH / interval))
    f, a = amplitude_spectrum(factor * np.interp(even, source.time, values), interval, rows)
    return f[2:], a[2:]  # what is below holds the mean


def _moved_axes(sizes: Mapping[str, float]) -> list[str]:
    """Axes that are worth a panel, by how large what they do is."""
    return [axis for axis, size in sizes.items() if size > SHAKEN_AXIS_SHARE * max(sizes.values())]


FORMAT = 1
MOST_DIFFERING, MOST_LISTED = 3, 20  # parameters that are named in the answer, and by the command
LEAST_CHANGE = 0.05  # [%] of a figure, below which it has not changed
BAND = 1e-6  # [m] about the target, within which an axis has settled
# Figures whose change comes first, by what stands behind the last dot, with their names in words.
LEADING_FIGURES = {
    "G": "circular deviation G",
    "servo_mismatch": "servo mismatch",
    "peak_": "reversal peak of {}",
    "overshoot": "overshoot",
    "settling_time": "settling time",
    "ringing_frequency": "ringing frequency",
    "A": "accuracy of positioning A",
    "R": "repeatability R",
    "B": "largest reversal value B",
    "largest": "largest deviation from the path",
    "p95": "95 % of the positions within",
    "duration": "duration",
}
MOST_BLOCKS = 100  # of NC programs, side by side
LARGEST_SHARE = 1000.0  # [%] a change beyond is one from next to nothing, of which a share says nothing


def files_of(sources: Sequence[Source]) -> list[Path]:
    """Files that are read."""
    paths = []
    for source in sources:
        paths += [source.recording.path]
        if source.figures:
            paths += [source.recording.path.with_name(OF_RESULT)]
    return paths


def lines(sources: Sequence[Source]) -> list[str]:
    """What the command says: what has changed, parameters that differ, how all was aligned."""
    rows = differing_parameters(sources)
    said = _changes(sources)
    said += [f"differs: {name}: {' | '.join(map(_readable, values))}" for name, values in rows[:MOST_LISTED]]
    if len(rows) > MOST_LISTED:
        said.append(f"and {len(rows) - MOST_LISTED} parameters more, in the report")
    said += [
        f"{source.name} is aligned {source.aligned}" for source in sources if source.aligned and not source.figures
    ]
    return said or ["the sources have neither figures nor parameters to compare; the pictures do"]


def answers(sources: Sequence[Source]) -> list[str]:
    """The same in the words of the page: what has changed, and in what the sources differ."""
    names = [source.name for source in sources]
    rows = differing_parameters(sources)
    said = _changes(sources)
    if len(sources) == 2:
        said += [f"{name}: {' -> '.join(map(_readable, values))}." for name, values in rows[:MOST_DIFFERING]]
    else:
        said += [f"{name}: {_values_by_name(names, map(_readable, values))}." for name, values in rows[:MOST_DIFFERING]]
    if len(rows) > MOST_DIFFERING:
        said.append(f"{count_things(len(rows) - MOST_DIFFERING, 'parameter')} more that differ are listed below.")
    return said or lines(sources)


def _changes(sources: Sequence[Source]) -> list[str]:
    """The leading figures from source to source, a sentence for each prefix; those that are alike are named last."""
    leading = _leading_figures(sources)
    said = []
    for prefix in dict.fromkeys(name.partition(".")[0] for name in leading):
        own = {name: values for name, values in leading.items() if name.partition(".")[0] == prefix}
        same = [_words(name) for name, values in own.items() if _is_alike(values)]
        changed = [f"{_words(name)} {_values_text(values)}" for name, values in own.items() if not _is_alike(values)]
        text = ", ".join(changed)
        if same and len(sources) > 1:
            text += f"{'; ' * bool(text)}unchanged: {', '.join(same)}"
        elif same:
            text = ", ".join(f"{_words(name)} {_values_text(values)}" for name, values in own.items())
        said.append(f"{prefix.replace('#', ' no. ')}: {text}.")
    return said


Values = Sequence[tuple[float, str] | None]


def _is_alike(values: Values) -> bool:
    """Whether a figure is the same in all sources, to what is shown of it or to LEAST_CHANGE."""
    if any(value is None for value in values):
        return False
    texts = {figure_text(Figure(*value, "")) for value in values if value is not None}
    numbers = [value[0] for value in values if value is not None]
    if len(texts) == 1:
        return True
    return len({unit for _, unit in texts}) == 1 and np.ptp(numbers) < LEAST_CHANGE / 100 * max(map(abs, numbers))


def _values_text(values: Values) -> str:
    """A figure of all sources: 8.19 -> 7.40 um (-9.7 %)."""
    texts = [("–", "") if value is None else _three_digits(value) for value in values]
    units = {unit for _, unit in texts if unit}
    last = f" {next(iter(units))}" if len(units) == 1 else ""
    text = " -> ".join(number if last else f"{number} {unit}".strip() for number, unit in texts) + last
    first, second = values[0], values[-1]
    if len(values) == 2 and first is not None and second is not None and first[1] == second[1] and first[0]:
        share = 100 * (second[0] / first[0] - 1)
        text += f" ({share:+.3g} %)" if abs(share) < LARGEST_SHARE else ""
    return text


def _three_digits(value: tuple[float, str]) -> tuple[str, str]:
    """Number, three digits of it at most, and unit."""
    number, unit = value
    if not math.isfinite(number):
        return "not determined", ""
    short, _ = figure_text(Figure(number, unit, ""))
    return min(three_digits(number).replace("−", "-"), short.replace("−", "-"), key=len), plain_unit(unit)


def _words(name: str) -> str:
    key = name.partition(".")[2]
    what = next(name for name in LEADING_FIGURES if key == name or (name.endswith("_") and key.startswith(name)))
    return LEADING_FIGURES[what].format(key.removeprefix(what))


def _values_by_name(names: Sequence[str], values: Iterable[str]) -> str:
    return ", ".join(f"{value} in {name}" for name, value in zip(names, values, strict=True))


def _readable(value: str) -> str:
    """A parameter as a person reads it, 4 (m/min)/mm for 66.6666667 1/s; a dash where a source has none."""
    number, _, unit = value.partition(" ")
    with suppress(ValueError):
        amount = float(number)
        best = scale(unit, np.array([amount]))
        text = number if best.factor == 1 else f"{best.factor * amount:.6g}"
        return f"{text} {plain_unit(best.unit)}".rstrip()
    return value or "–"


def _leading_figures(sources: Sequence[Source]) -> dict[str, Values]:
    """Leading figure -> its value and unit in every source, in the order of LEADING_FIGURES within each prefix.

    Where results have leading figures in common, those that one of them lacks are left to the table.
    """
    places: dict[str, int] = {}
    axes = {axis for source in sources for axis in source.axes}
    for name in dict.fromkeys(name for source in sources for name in source.figures):
        key = name.partition(".")[2]
        for k, text in enumerate(LEADING_FIGURES):
            if key == text or (text.endswith("_") and key.startswith(text) and key.removeprefix(text) in axes):
                places[name] = k
    order = sorted(places, key=lambda name: (name.partition(".")[0], places[name]))
    common = [name for name in order if all(name in source.figures for source in sources if source.figures)]
    order = common or order
    return {name: [source.figures.get(name) for source in sources] for name in order}


def _tiles(sources: Sequence[Source]) -> list[Tile]:
    """The leading figures before and after, those that have changed most first; none but of two sources."""
    leading = _leading_figures(sources)
    if len(sources) != 2:
        return []
    order = sorted(leading, key=lambda name: _is_alike(leading[name]))
    return [
        Tile(
            minus(_values_text(leading[name]).partition(" (")[0].replace("->", "→").replace("um", "µm")),
            f"{name.partition('.')[0]}: {_words(name)}",
            f"{name}, {sources[0].name} → {sources[1].name}",
        )
        for name in order
    ]


def report_of(sources: Sequence[Source]) -> Report:
    """Content of the report."""
    names = [source.name for source in sources]
    rows = [(f"Source {k}", f"{source.name}: {len(source.time)} rows") for k, source in enumerate(sources, 1)]
    notes = tuple(dict.fromkeys(note for source in sources for note in source.notes))
    pictures = with_remark(pictures_of(sources), " ".join(filter(None, notes)), *NARROW)
    return Report(
        " against ".join(names) if len(names) <= 3 else f"{len(names)} results side by side",
        count_things(len(sources), "source"),
        answer=answers(sources),
        tiles=_tiles(sources),
        next_step=_next_step(sources),
        notes=notes,
        main=[
            *pictures,
            _stops(sources),
            _figures(sources),
            _blocks(sources),
            _parameters(sources),
            control_section(changes=dict(differing_parameters(sources))),
            _alignment(sources),
            Section("What each says of itself", [Bullets([f"{s.name}: {line}" for s in sources for line in s.answer])])
            if any(source.answer for source in sources)
            else None,
        ],
        provenance=content.provenance_section(rows, hash_files([("source", file) for file in files_of(sources)])),
        footer="Differences are to the first source that has the figure. Values in full precision: summary.json.",
    )


def _next_step(sources: Sequence[Source]) -> Step | None:
    """The comparison of the first two; None where there is one source."""
    if len(sources) < 2:
        return None
    first, second = (source.recording.path for source in sources[:2])
    return Step("List the signals that differ, by how much they do", "compare", {"files": [str(second), str(first)]})


def _alignment(sources: Sequence[Source]) -> Section | None:
    rows = [(source.name, source.aligned or "the others are laid onto it") for source in sources]
    return Section("How they are laid over each other", [Table("lp", (), rows)]) if len(sources) > 1 else None


def _stops(sources: Sequence[Source]) -> Section | None:
    """Every stop of an axis: overshoot and settling time of every source."""
    approaches = stops(sources)
    rows = []
    for axis, number in stops_of(approaches):
        seen = [stop_seen(source, own, axis, number) for source, own in zip(sources, approaches, strict=True)]
        cells = [cell for stop in seen for cell in _stop(stop)]
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
    figures = positioning_figures(stop.trace, stop.approach, band=BAND)
    return figure_text(figures["overshoot"])[0], figure_text(figures["settling_time"])[0]


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
            cells.append(figure_text(Figure(value, unit, ""))[0] if name in source.figures and own == unit else "–")
            if k:
                difference = value - first if own == unit else math.nan
                cells.append(_difference(difference, unit))
            if math.isnan(first) and own == unit:
                first = value
        rows.append((code(name), *cells, display_unit(unit)))
    heads = ["Figure", sources[0].name]
    for source in sources[1:]:
        heads += [source.name, "difference"]
    return Section("Figures", [Table("l" + "r" * (len(heads) - 1) + "l", [*heads, "Unit"], rows)])


def _blocks(sources: Sequence[Source]) -> Section | None:
    """Blocks of NC programs side by side, those first that are the furthest from the path in any source."""
    own = [source for source in sources if source.blocks]
    if not own:
        return None
    worst: dict[tuple[str, str], float] = {}
    for source in own:
        for key, (largest, *_) in source.blocks.items():
            worst[key] = max(worst.get(key, 0.0), largest if math.isfinite(largest) else 0.0)
    rows: list[tuple[Text, ...]] = []
    for key in sorted(worst, key=lambda key: -worst[key])[:MOST_BLOCKS]:
        values = [source.blocks.get(key, (math.nan,) * 3) for source in own]
        rows.append(
            (
                key[0],
                code(key[1]),
                *(_cell(value, digits) for entry in values for value, digits in zip(entry, (2, 2, 4), strict=True)),
            )
        )
    heads = [f"{source.name}: {what}" for source in own for what in ("largest [µm]", "rms [µm]", "time [s]")]
    more = f" Of {len(worst)} blocks the {MOST_BLOCKS} worst are listed." if len(worst) > MOST_BLOCKS else ""
    note = f"Distance of the axes from the programmed path; of a block that is worked several times the worst.{more}"
    return Section("Blocks of the NC program", [Table("ll" + "r" * len(heads), ["Line", "Block", *heads], rows, note)])


def _cell(value: float, digits: int) -> str:
    return minus(f"{value:.{digits}f}") if math.isfinite(value) else "–"


def _difference(value: float, unit: str) -> str:
    """As many places as the values have, with a sign; 0 where rounding leaves nothing."""
    if not math.isfinite(value):
        return "–"
    text, _ = figure_text(Figure(abs(value) if abs(value) > 1e-9 else 0.0, unit, ""))
    return text if not any(digit in text for digit in "123456789") else f"{'+' if value > 0 else '−'}{text}"


def _parameters(sources: Sequence[Source]) -> Section | None:
    if sum(bool(source.parameters) for source in sources) < 2:
        return None
    rows: list[tuple[Text, ...]] = [
        (code(name), *map(_readable, values)) for name, values in differing_parameters(sources)
    ]
    if not rows:
        return Section(
            "Parameters that differ", [Bullets(["None: machine, motion, coupling and recording are the same."])]
        )
    heads = ("Parameter", *(source.name for source in sources))
    return Section("Parameters that differ", [Table("l" + "p" * len(sources), heads, rows)])


def details(sources: Sequence[Source]) -> dict[str, Any]:
    """What summary.json has besides the figures."""
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
            for name, values in differing_parameters(sources)
        },
        "inputs": inputs_part(hash_files([("source", file) for file in files_of(sources)])),
    }
