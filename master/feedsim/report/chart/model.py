"""What a chart is: panels with curves over axes with units, polar panels of a circle, grids of cells.

Values are in the units that are shown; nothing here draws.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from feedsim.report.formatting import BLUE, MUTED, PALETTE, SUPERSCRIPTS, Array, colour_name, minus

# --- What the page and the SVG draw alike: sizes [pixels], dashes, steps of ticks. The page's script is handed
#     LAYOUT


LEFT, RIGHT, TOP, BOTTOM = 62.0, 14.0, 28.0, 44.0  # beside the curves of a panel
SECOND = 34.0  # above them, of a second scale
HEIGHT, ROUND, GAP = 235.0, 520.0, 18.0  # of a panel without what is below, of a polar one, between columns
ROW, CELL_WITH_NUMBER, CELL_WITH_NAME = 24.0, 30.0, 12.0  # of a grid: height; least widths
SCALE_STEPS, SCALE_STEP = 12, 10.0  # of a grid without numbers: colours of its scale, and the width of each
SLANTED_LETTER_WIDTH = 4.8  # that a letter of a slanted name takes across
LINE_PITCH = 1.15  # from line to line of words, in heights of a letter
LETTER = 6.3  # of words over curves
BLOCK = 4  # how finely a panel is looked at for room
LEADER = 24.0  # distance of a label from its point from which a line leads to it
FILL, BAND = 0.5, 0.18  # opacity of filled areas and bands
DEPTH = 0.75  # opacity of the deepest cell
CLOSED_TURN_GAP = 0.02  # of the outermost ring: ends of a turn as close as this are one
END_ANGLE_SINE = 0.05  # sine of half the angle between the ends of a turn, at most
FAINT = 0.4  # opacity of faint curves
RING_GAPS = {1: 0.36, 2: 0.24}  # between rings, by their number to either side; the programmed circle's radius is 1
OUTER_RADIUS = 1.16  # outermost radius, in gaps beyond the outermost ring
DASHES = {"": "", "dashed": "6 3", "dotted": "2 3"}
SAMPLE_STEP = 2**0.5 - 1  # multiples of it, less whole numbers, fill an interval evenly
CURVE_MARGIN = 0.07  # of their range, above and below the curves
MIN_TICKS, TICK_WIDTH, TICK_HEIGHT = 3, 74.0, 34.0
MAX_DIGITS = 7  # of a tick; with more, what ticks have in common stands at the axis
PHASES = (15, 30, 45, 90, 180, 360, 720, 1440)
MIN_RELATIVE_SPAN = 4e-9  # span against the largest value: 4 nm of 1 m
# Unit -> factors and units in which its values are written where their ticks would have powers of ten, coarse to fine.
UNITS_WITH_PREFIX = {
    "m": ((1, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm")), "mm": ((1e-3, "m"), (1, "mm"), (1e3, "µm"), (1e6, "nm")),
    "µm": ((1e-6, "m"), (1e-3, "mm"), (1, "µm"), (1e3, "nm"), (1e6, "pm")),
    "s": ((1, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")), "ms": ((1e-3, "s"), (1, "ms"), (1e3, "µs"), (1e6, "ns")),
    "Hz": ((1e-6, "MHz"), (1e-3, "kHz"), (1, "Hz"), (1e3, "mHz"), (1e6, "µHz")),
    "N": ((1e-6, "MN"), (1e-3, "kN"), (1, "N"), (1e3, "mN"), (1e6, "µN")),
    "N·m": ((1e-6, "MN·m"), (1e-3, "kN·m"), (1, "N·m"), (1e3, "mN·m"), (1e6, "µN·m")),
    "A": ((1e-3, "kA"), (1, "A"), (1e3, "mA"), (1e6, "µA")), "rad": ((1, "rad"), (1e3, "mrad"), (1e6, "µrad")),
    "mm/min": ((1e-3, "m/min"), (1, "mm/min"), (1e3, "µm/min"), (1e6, "nm/min")),
    "m/s": ((1, "m/s"), (1e3, "mm/s"), (1e6, "µm/s")), "mm/s": ((1e-3, "m/s"), (1, "mm/s"), (1e3, "µm/s")),
    "rad/s": ((1, "rad/s"), (1e3, "mrad/s"), (1e6, "µrad/s")),
    "m/s²": ((1, "m/s²"), (1e3, "mm/s²"), (1e6, "µm/s²")),
    "N/m": ((1e-9, "GN/m"), (1e-6, "MN/m"), (1e-3, "kN/m"), (1, "N/m")),
    "N·m/rad": ((1e-9, "GN·m/rad"), (1e-6, "MN·m/rad"), (1e-3, "kN·m/rad"), (1, "N·m/rad")),
    "m/N": ((1, "m/N"), (1e3, "mm/N"), (1e6, "µm/N"), (1e9, "nm/N")),
    "µm/N": ((1, "µm/N"), (1e3, "nm/N"), (1e6, "pm/N")),
}  # fmt: skip

LAYOUT: dict[str, Any] = {name: value for name, value in globals().items() if name.isupper() and name != "LAYOUT"}


# --- What a chart is: panels with curves over axes with units, polar panels of a circle, grids of cells ---------------


Dash = Literal["", "dashed", "dotted"]

# Rows that a curve has in a page at most: each bin of 2 rows less keeps its least and its largest value.
MOST_ROWS = 3000


@dataclass(frozen=True)
class Axis:
    """What is shown along one side of a panel.

    Attributes:
        label: quantity; unit: as it is printed, "" for a plain number.
        log: logarithmic. span: shown at first; None: all of the curves.
        names: of the values 0, 1, 2, ..., where they are no numbers.
        symlog: logarithmic in both directions, linear within this distance from zero.
        also: quantity and unit at the other side of the panel, and its factor.
    """

    label: str
    unit: str = ""
    log: bool = False
    span: tuple[float, float] | None = None
    names: Sequence[str] = ()
    symlog: float = 0.0
    also: tuple[str, str, float] | None = None

    @property
    def title(self) -> str:
        """Quantity and unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve: (N,) abscissae and ordinates; where they are not ascending, a loop.

    Attributes:
        name: in the legend; curves of one name in a chart are shown and hidden together.
        colour: of the palette. dots: points in place of a line; faint: paler than the others.
        filled: the area down to zero, steps of a histogram.
        most: rows that the page has at most.
    """

    name: str
    x: Array
    y: Array
    colour: str = BLUE
    dash: Dash = ""
    width: float = 1.4
    dots: bool = False
    faint: bool = False
    filled: bool = False
    most: int = MOST_ROWS

    @property
    def ascending(self) -> bool:
        """Whether it is a function of its abscissa."""
        return bool(np.all(np.diff(self.x) >= 0))

    def thinned(self) -> Curve:
        """The same curve in at most ``most`` rows (and its ends), keeping the extremes of every bin; of points in no
        order a part of them."""
        if len(self.x) <= self.most:
            return self
        if self.ascending:
            rows = extremes(self.y, self.most)
        else:
            rows = (sample_rows if self.dots else loop_rows)(self.x, self.y, self.most)
        return replace(self, x=self.x[rows], y=self.y[rows])


@dataclass(frozen=True)
class Level:
    """A line across a panel, at an ordinate, or (upright) at an abscissa. ends: where it does not go all the way."""

    at: float
    text: str = ""
    upright: bool = False
    colour: str = MUTED
    dash: Dash = "dashed"
    ends: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Band:
    """Ground between two curves, or between two ordinates all the way (x is None)."""

    name: str
    low: Array | float
    high: Array | float
    x: Array | None = None
    colour: str = BLUE


@dataclass(frozen=True)
class Mark:
    """A point with what it is; hollow: its inside is empty."""

    x: float
    y: float
    text: str = ""
    colour: str = BLUE
    hollow: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over one pair of axes.

    Attributes:
        linked: panels of one chart with the same word are zoomed together along their abscissae.
        note: said in a corner. height: against the usual one. equal: a unit is as long on both axes; the shorter span
            is widened about its middle.
    """

    title: str
    x: Axis
    y: Axis
    curves: Sequence[Curve] = ()
    levels: Sequence[Level] = ()
    bands: Sequence[Band] = ()
    marks: Sequence[Mark] = ()
    linked: str = ""
    note: str = ""
    height: float = 1.0
    equal: bool = False


@dataclass(frozen=True, eq=False)
class Polar:
    """Deviations of a radius [um] over the angle [rad], magnified about the programmed circle.

    Attributes:
        axes: of the plane. radius: [mm]. ring: distance of the rings at first [um]; rings: to either side.
        curves: x angle, y deviation. marks: the same. sense: +-1 the way it is driven, 0 for both.
    """

    title: str
    axes: tuple[str, str]
    radius: float
    ring: float
    rings: int
    curves: Sequence[Curve]
    marks: Sequence[Mark] = ()
    sense: int = 0
    note: str = ""

    @property
    def gap(self) -> float:
        """Distance of the rings as drawn, where the programmed circle's radius is 1."""
        return RING_GAPS[self.rings]

    @property
    def magnification(self) -> float:
        """How many times larger than the circle its deviations are drawn."""
        return self.gap / self.ring * 1e3 * self.radius


@dataclass(frozen=True, eq=False)
class Grid:
    """Numbers in cells, coloured by their size; a number that is not finite leaves its cell empty.

    span: the values of the palest and the deepest colour; about zero, signs have colours of their own. decimals: of the
    numbers; None: three digits that count. bold: cells that stand out. best: row and column of the cell that is looked
    for, which has a frame.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[str]
    values: Array
    span: tuple[float, float]
    decimals: int | None = None
    bold: NDArray[np.bool_] | None = None
    best: tuple[int, int] | None = None


Part = Panel | Polar | Grid


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels side by side, row by row. widths: of the columns against one another; one column where it is empty."""

    panels: Sequence[Part]
    widths: Sequence[float] = (1.0,)

    def rows(self) -> Iterator[Sequence[Part]]:
        """The panels of each row."""
        for k in range(0, len(self.panels), len(self.widths)):
            yield self.panels[k : k + len(self.widths)]


def column_of(panels: Sequence[Panel | None]) -> Chart | None:
    """Panels below one another; None where there is none."""
    there = [panel for panel in panels if panel is not None]
    return Chart(there) if there else None


def extremes(y: Array, most: int) -> NDArray[np.intp]:
    """Rows that keep the least and the largest value of every bin, and both ends: most + 2 at most, ascending.

    What is not finite counts as the least.
    """
    bins = max(1, most // 2)
    width = -(-len(y) // bins)
    whole = len(y) // width * width
    finite = np.where(np.isfinite(y), y, -np.inf)
    folded = finite[:whole].reshape(-1, width)
    first = np.arange(len(folded)) * width
    keep = [first + folded.argmin(axis=1), first + folded.argmax(axis=1), np.array([0, len(y) - 1])]
    if whole < len(y):
        rest = finite[whole:]
        keep.append(whole + np.array([rest.argmin(), rest.argmax()]))
    return np.unique(np.concatenate(keep))


def loop_rows(x: Array, y: Array, most: int) -> NDArray[np.intp]:
    """Rows of a loop: the extremes of both coordinates in every bin, and the ends of its pieces, in their order."""
    gaps = np.flatnonzero(~np.isfinite(x))
    ends = np.clip(np.concatenate([gaps - 1, gaps, gaps + 1]), 0, len(x) - 1)
    return np.unique(np.concatenate([extremes(x, most // 2), extremes(y, most // 2), ends]))


def sample_rows(x: Array, y: Array, most: int) -> NDArray[np.intp]:
    """Rows of points in no order: a part of them, as dense as they are, and the extremes of both coordinates; most + 4
    at most. Every row has its place in a sequence that fills an interval evenly, so that no grid of rows shows."""
    chosen = (np.arange(len(x)) * SAMPLE_STEP) % 1 < (most - 1) / len(x)
    for values in (x, y):
        finite = np.flatnonzero(np.isfinite(values))
        if len(finite):
            chosen[[finite[values[finite].argmin()], finite[values[finite].argmax()]]] = True
    return np.flatnonzero(chosen)


def spans(values: Sequence[Array]) -> tuple[float, float] | None:
    """Least and largest finite value; None without any."""
    finite = [value[np.isfinite(value)] for value in values]
    finite = [values for values in finite if len(values)]
    if not finite:
        return None
    return float(min(values.min() for values in finite)), float(max(values.max() for values in finite))


# --- The charts of a page as one text of JSON, with the numbers of their curves in 32 bits each -----------------------
# Along a linear axis every BLOCK_ROWS rows have a middle and a step of their own, and a value is a whole number of
# steps
# from that middle: of an axis of 2 m far less than 1 nm, wherever one zooms in; a 32-bit float has 0.1 um there.
# Along a
# logarithmic axis they are floats.


QUANTISATION_STEPS = 2**31 - 1  # to either side of the middle; one more is no number
BLOCK_ROWS = 256  # rows; chart_use.js knows it, too


def embed_charts(charts: Mapping[str, Chart]) -> str:
    """JSON of charts by their stems, for an element of a page: nothing in it ends the element."""
    pool = _Pool()
    content = {
        "charts": {stem: {"widths": list(chart.widths), "panels": [_part(part, pool) for part in chart.panels]}
                   for stem, chart in charts.items()},
        "palette": {name: colour for name, colour, _ in PALETTE} | {"ground": "#ffffff"},
        "arrays": pool.arrays,
    }  # fmt: skip
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


class _Pool:
    """Arrays of a page, each once."""

    def __init__(self) -> None:
        self.arrays: list[tuple[int, str]] = []
        self._known: dict[tuple[int, bytes], int] = {}

    def __call__(self, values: Array, axis: Axis | None = None, *, cells: bool = False) -> int:
        """The number of an array; axis: along which it is shown; cells: numbers of a table, of any sizes."""
        whole = not cells and (axis is None or not (axis.log or axis.symlog))
        content = (BLOCK_ROWS, steps(values)) if whole else (0, np.asarray(values).astype("<f4").tobytes())
        count = self._known.setdefault(content, len(self.arrays))
        if count == len(self.arrays):
            self.arrays.append((content[0], base64.b64encode(content[1]).decode("ascii")))
        return count


def steps(values: Array) -> bytes:
    """Values (N,) as middle + step * k: middle and step of each block as doubles, behind them all k as 32-bit integers.

    What is not finite has the least k.
    """
    values = np.asarray(values, dtype=np.float64)
    blocks = -(-len(values) // BLOCK_ROWS)
    padded = np.full(blocks * BLOCK_ROWS, np.nan)
    padded[: len(values)] = np.where(np.isfinite(values), values, np.nan)
    rows = padded.reshape(blocks, BLOCK_ROWS)
    finite = np.isfinite(rows)
    low = np.where(finite, rows, np.inf).min(axis=1, initial=np.inf)
    high = np.where(finite, rows, -np.inf).max(axis=1, initial=-np.inf)
    empty = low > high
    low, high = np.where(empty, 0.0, low), np.where(empty, 0.0, high)
    middle, half = low / 2 + high / 2, high / 2 - low / 2
    step = half / QUANTISATION_STEPS
    step[step == 0] = 1.0
    whole = np.where(
        finite,
        np.clip(np.rint((rows - middle[:, None]) / step[:, None]), -QUANTISATION_STEPS, QUANTISATION_STEPS),
        -QUANTISATION_STEPS - 1,
    )
    return (
        np.column_stack([middle, step]).astype("<f8").tobytes() + whole.ravel()[: len(values)].astype("<i4").tobytes()
    )


def _part(part: Part, pool: _Pool) -> dict[str, Any]:
    if isinstance(part, Polar):
        return {
            "kind": "polar", "title": part.title, "axes": list(part.axes), "radius": part.radius, "ring": part.ring,
            "rings": part.rings, "curves": [_curve(curve, pool) for curve in part.curves],
            "marks": [_mark(mark) for mark in part.marks], "sense": part.sense, "note": part.note,
        }  # fmt: skip
    if isinstance(part, Grid):
        return {
            "kind": "grid", "title": part.title, "columns": list(part.columns), "rows": list(part.rows),
            "values": pool(part.values.ravel(), cells=True), "span": list(part.span), "decimals": part.decimals,
            **({} if part.bold is None else {"bold": np.flatnonzero(part.bold).tolist()}),
            **({} if part.best is None else {"best": list(part.best)}),
        }  # fmt: skip
    return {
        "kind": "xy", "title": part.title, "x": _axis(part.x), "y": _axis(part.y),
        "curves": [_curve(curve, pool, part) for curve in part.curves],
        "levels": [_level(level) for level in part.levels],
        "bands": [_band(band, pool, part) for band in part.bands], "marks": [_mark(mark) for mark in part.marks],
        "linked": part.linked, "note": part.note, "height": part.height,
        **({"equal": True} if part.equal else {}),
    }  # fmt: skip


def _axis(axis: Axis) -> dict[str, Any]:
    span = list(axis.span) if axis.span is not None else None
    more = {name: value for name, value in (("symlog", axis.symlog), ("also", list(axis.also or ()))) if value}
    return {"label": axis.label, "unit": axis.unit, "log": axis.log, "span": span, "names": list(axis.names), **more}


def _curve(curve: Curve, pool: _Pool, panel: Panel | None = None) -> dict[str, Any]:
    kept = curve.thinned()
    x, y = (None, None) if panel is None else (panel.x, panel.y)
    return {
        "name": kept.name,
        "x": pool(kept.x, x),
        "y": pool(kept.y, y),
        "colour": colour_name(kept.colour),
        "dash": kept.dash,
        "width": kept.width,
        "dots": kept.dots,
        "faint": kept.faint,
        "filled": kept.filled,
        "ascending": kept.ascending,
    }


def _level(level: Level) -> dict[str, Any]:
    ends = list(level.ends) if level.ends is not None else None
    return {"at": level.at, "text": level.text, "upright": level.upright, "colour": colour_name(level.colour),
            "dash": level.dash, "ends": ends}  # fmt: skip


def _band(band: Band, pool: _Pool, panel: Panel) -> dict[str, Any]:
    edges = {name: edge if isinstance(edge, float) else {"array": pool(edge, panel.y)}
             for name, edge in (("low", band.low), ("high", band.high))}  # fmt: skip
    return {
        "name": band.name,
        "x": None if band.x is None else pool(band.x, panel.x),
        "colour": colour_name(band.colour),
        **edges,
    }


def _mark(mark: Mark) -> dict[str, Any]:
    return {"x": mark.x, "y": mark.y, "text": mark.text, "colour": colour_name(mark.colour), "hollow": mark.hollow}


# --- What a panel shows at first: the ranges of its axes, and the ticks along them. The page's script does the same ---


Range = tuple[float, float]
EXPONENT_BELOW, EXPONENT_FROM = 1e-4, 1e7  # of a number that is written digit by digit


@dataclass(frozen=True)
class Ticks:
    """Marks along an axis.

    Attributes:
        marks: value and text of each; without text it is a thin line.
        common: what stands at the axis because all texts are added to it.
        unit: of the texts, where it is not that of the axis.
    """

    marks: list[tuple[float, str]] = field(default_factory=list)
    common: str = ""
    unit: str = ""

    def title(self, axis: Axis) -> str:
        """What stands along the axis."""
        if self.common:
            return f"{axis.label} − {self.common}{f' [{self.unit}]' if self.unit else ''}"
        return replace(axis, unit=self.unit).title if self.unit else axis.title

    @property
    def texts(self) -> list[str]:
        """Those that are not empty."""
        return [text for _, text in self.marks if text]

    @property
    def has_powers(self) -> bool:
        """Whether a text has a power of ten."""
        return any("×" in text for text in self.texts)


def ranges(panel: Panel) -> tuple[Range, Range]:
    """Abscissae and ordinates that are shown: as the axes say, else those of curves and marks, with room about them."""
    across = panel.x.span or _whole_range(panel)
    return across, panel.y.span or _heights(panel, across)


def _whole_range(panel: Panel) -> Range:
    low, high = spans([_drawable_values(panel.x, curve.x) for curve in panel.curves]) or (0.0, 1.0)
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _heights(panel: Panel, across: Range) -> Range:
    axis = panel.y
    heights = [_visible_values(curve, across) for curve in panel.curves]
    heights.append(np.array([mark.y for mark in panel.marks if across[0] <= mark.x <= across[1]]))
    result = spans([_drawable_values(axis, height) for height in heights])
    if result is None:
        return (0.1, 10.0) if axis.log else (-1.0, 1.0)
    low, high = result
    if axis.log:
        return low / 1.3, high * 1.3
    if axis.symlog:  # room in the measure of the axis, on either side of zero
        more = 0.0 if high > low else axis.symlog
        return low - 3 * CURVE_MARGIN * abs(low) - more, high + 3 * CURVE_MARGIN * abs(high) + more
    if high > low and high - low < (least := MIN_RELATIVE_SPAN * max(abs(low), abs(high))):
        low, high = (low + high - least) / 2, (low + high + least) / 2
    room = CURVE_MARGIN * (high - low) or 0.05 * abs(high) or 1.0
    on_ground = low == 0 and any(curve.filled for curve in panel.curves)
    return low - (0.0 if on_ground else room), high + room


def _drawable_values(axis: Axis, values: Array) -> Array:
    return np.where(values > 0, values, np.nan) if axis.log else values


def _visible_values(curve: Curve, span: Range) -> Array:
    inside = curve.y[(curve.x >= span[0]) & (curve.x <= span[1])]
    return np.append(inside, 0.0) if curve.filled else inside


def axis_measure(axis: Axis, values: Array | float) -> Array:
    """Values in the measure of an axis, which is linear on paper; not finite where a logarithmic axis has none."""
    values = np.asarray(values, dtype=float)
    if axis.symlog:  # linear within this distance from zero
        return np.asarray(np.sign(values) * np.log10(1 + np.abs(values) / axis.symlog))
    if axis.log:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log10(np.where(values > 0, values, np.nan))
    return values


def ticks(axis: Axis, span: Range, most: float) -> Ticks:
    """Where an axis is marked, and with what: some `most` round values, angles in parts of a turn.

    Where a text would have a power of ten, the texts are in the first unit with a prefix in which none has one, from
    that on in which the largest value is 1 or more.
    """
    result = _marks(axis, span, most)
    if result.common or axis.names or not result.has_powers:
        return result
    known = UNITS_WITH_PREFIX.get(axis.unit, ((1, axis.unit),))
    for factor, unit in known[known.index(_with_prefix(known, max(map(abs, span)))) :]:
        scaled = replace(axis, unit=unit, symlog=axis.symlog * factor)
        there = _marks(scaled, (span[0] * factor, span[1] * factor), most)
        if not there.has_powers:
            return Ticks([(at / factor, text) for at, text in there.marks], unit=unit)
    return result


def _with_prefix(known: Sequence[tuple[float, str]], size: float) -> tuple[float, str]:
    """Factor and unit in which a size is 1 or more, else the finest that is known."""
    return next((pair for pair in known if size * pair[0] >= 1), known[-1])


def _marks(axis: Axis, span: Range, most: float) -> Ticks:
    low, high = span
    if axis.names:
        every = math.ceil(len(axis.names) / max(1.0, most))
        return Ticks([(float(k), name) for k, name in enumerate(axis.names) if k % every == 0 and low <= k <= high])
    if axis.symlog and len(marks := _both_ways(axis.symlog, span)) > 1:
        return Ticks(marks)
    if axis.log and high / low > 8:
        return Ticks(_decades(span, most))
    turns = axis.unit == "°" and high - low > 60
    step = (
        float(next((number for number in PHASES if (high - low) / number <= most), 3600))
        if turns
        else round_step((high - low) / most)
    )
    while (count := _count_marks(span, step)) < MIN_TICKS:  # one or two ticks are no scale
        finer = _finer(step, turns)
        if not finer or (count > 1 and _count_marks(span, finer) > most + 2):
            break
        step = finer
    return _step_ticks(axis, span, step)


def _both_ways(within: float, span: Range) -> list[tuple[float, str]]:
    low, high = span
    first, last = math.ceil(math.log10(2 * within) - 1e-9), math.floor(math.log10(max(-low, high, within)) + 1e-9)
    decades = [10.0**k for k in range(first, last + 1)]
    marks = [*(-decade for decade in reversed(decades)), 0.0, *decades]
    return [(at, tick_text(at)) for at in marks if low <= at <= high]


def _decades(span: Range, most: float) -> list[tuple[float, str]]:
    low, high = span
    decades = math.log10(high / low)
    few, every = decades < 2.2, max(1, math.floor(decades / most + 0.5))
    return [
        (at, tick_text(at) if (part == 1 and k % every == 0) or (few and part in (2, 5)) else "")
        for k in range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
        for part in range(1, 10)
        if low * 0.9999 <= (at := part * 10.0**k) <= high * 1.0001
    ]


def round_step(rough: float) -> float:
    decade: float = 10.0 ** math.floor(math.log10(rough)) if rough > 0 else 1.0
    return decade * next((entry for entry in (1, 2, 5) if entry * decade >= 0.999 * rough), 10)


def _count_marks(span: Range, step: float) -> int:
    return math.floor(span[1] / step + 1e-9) - math.ceil(span[0] / step - 1e-9) + 1


def _finer(step: float, turns: bool) -> float:
    """The next smaller round step; 0 without one."""
    if turns:
        return float(max((number for number in PHASES if number < step), default=0))
    decade: float = 10.0 ** math.floor(math.log10(step) + 1e-9)
    return decade * {1: 0.5, 2: 1, 5: 2}[round(step / decade)]


def _step_ticks(axis: Axis, span: Range, step: float) -> Ticks:
    """Ticks a step apart, with as many digits as the step asks for."""
    low, high = span
    power = math.floor(math.log10(step) + 1e-9)
    values = []
    k = math.ceil(low / step - 1e-9)
    while k * step <= high + 1e-9 * step:
        values.append(k * step)
        k += 1
    digits = [max(6, math.floor(math.log10(abs(at) or step)) - power + 1) for at in values]
    if max(digits, default=0) <= MAX_DIGITS:
        return Ticks([(at, tick_text(at, n)) for at, n in zip(values, digits, strict=True)])
    whole = 10.0 ** math.ceil(math.log10(high - low) - 1e-9)
    common = math.floor(low / whole + 1e-9) * whole
    factor, unit = _with_prefix(UNITS_WITH_PREFIX.get(axis.unit, ((1, axis.unit),)), high - common)
    marks = [(at, tick_text(round((at - common) / step) * step * factor, 4)) for at in values]
    count = math.floor(math.log10(abs(common) or 1)) - math.floor(math.log10(whole) + 1e-9) + 1
    return Ticks(marks, f"{tick_text(common, max(1, count))}{f' {axis.unit}' if axis.unit else ''}", unit)


def tick_text(value: float, digits: int = 6) -> str:
    """A number with at most so many digits that count."""
    rounded = float(f"{value:.{digits}g}")
    if not rounded or EXPONENT_BELOW <= abs(rounded) < EXPONENT_FROM:
        return minus(repr(rounded).removesuffix(".0"))
    mantissa, _, power = f"{Decimal(repr(rounded)).normalize():e}".partition("e")
    return minus(f"{mantissa}×10{str(int(power)).translate(SUPERSCRIPTS)}")


def separate_ticks(found_of: Callable[[int], Ticks], place: Callable[[float], float], most: int, end: float) -> Ticks:
    """Ticks whose texts do not touch: fewer of them, in the end every second one without its text.

    found_of: ticks of which there are some number; place: where a value stands [pixels]; end: of the last text.
    """

    def touching(all_of: Ticks) -> bool:
        middles = [(min(place(at), end - 3.6 * len(text)), len(text)) for at, text in all_of.marks if text]
        return any(abs(b - a) < 3.5 * (n + m) + 6 for (a, n), (b, m) in pairwise(middles))

    result = found_of(most)
    while most > 2 and touching(result):
        most -= 1
        result = found_of(most)
    for _ in range(3):
        if touching(result):
            with_text = [at for at, text in result.marks if text]
            kept = set(with_text[::2])
            result = replace(result, marks=[(at, text if at in kept else "") for at, text in result.marks])
    return result
