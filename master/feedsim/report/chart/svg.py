"""A chart as text of an SVG, as the page draws it at first: for readers without script, for print, and for PNG.

Start with svg(), which places the panels; panel.py, polar.py and grid.py draw one. The page's script draws the same
(template/chart_draw.js). Colours are the page's variables.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from html import escape
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.installation import require_extras
from feedsim.report.chart.model import (
    BAND,
    BLOCK,
    BOTTOM,
    CELL_WITH_NAME,
    CELL_WITH_NUMBER,
    CLOSED_TURN_GAP,
    DASHES,
    DEPTH,
    END_ANGLE_SINE,
    FAINT,
    FILL,
    GAP,
    HEIGHT,
    LEADER,
    LEFT,
    LETTER,
    LINE_PITCH,
    OUTER_RADIUS,
    RIGHT,
    ROUND,
    ROW,
    SCALE_STEP,
    SCALE_STEPS,
    SECOND,
    SLANTED_LETTER_WIDTH,
    TICK_HEIGHT,
    TICK_WIDTH,
    TOP,
    Axis,
    Band,
    Chart,
    Curve,
    Grid,
    Level,
    Mark,
    Panel,
    Part,
    Polar,
    Range,
    Ticks,
    axis_measure,
    extremes,
    loop_rows,
    ranges,
    round_step,
    separate_ticks,
    tick_text,
    ticks,
)
from feedsim.report.chart.model import MOST_ROWS as MOST_IN_PAGE
from feedsim.report.formatting import (
    BLUE,
    GRID,
    INK,
    MUTED,
    PAGE_COLOURS,
    VERMILLION,
    Array,
    colour_name,
    minus,
    three_digits,
)

# --- A polar panel of an SVG: deviations about the programmed circle, with rings and the directions of the plane ------


# --- Shapes and words of an SVG as text, in pixels, coloured by the page's variables ----------------------------------


# Words over curves.
HALO = 'font-size="11" paint-order="stroke" stroke="var(--ground)" stroke-width="3" stroke-linejoin="round"'
BOLD = 'font-weight="600"'


def fill(colour: str) -> str:
    """A colour of the palette as a page's variable."""
    return f"var(--{colour_name(colour)})"


def text(x: float, y: float, words: str, look: str = "", colour: str = INK, anchor: str = "start") -> str:
    """Words with their foot at y; nothing where there are none."""
    if not words:
        return ""
    side = f' text-anchor="{anchor}"' if anchor != "start" else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{fill(colour)}"{side} {look}>{escape(words)}</text>'


def turned_text(x: float, y: float, words: str, angle: float, look: str = "") -> str:
    """Words turned about (x, y)."""
    place = f'transform="translate({x:.1f} {y:.1f}) rotate({angle:g})"'
    return f'<text {place} fill="{fill(INK)}" {look}>{escape(words)}</text>' if words else ""


def panel_heading(words: str, x: float, room: float) -> str:
    """The title of a panel, as small as its room makes it."""
    size = min(12.0, 12 * room / (7.6 * len(words) or 1))
    return text(x, 15, words, BOLD + (f' font-size="{size:.1f}"' if size < 12 else ""))


def line(x1: float, y1: float, x2: float, y2: float, look: str) -> str:
    """A straight line."""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {look}/>'


def circle(x: float, y: float, r: float, look: str) -> str:
    """A circle, empty unless `look` fills it."""
    empty = "" if "fill=" in look else ' fill="none"'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}"{empty} {look}/>'


def rectangle(x: float, y: float, wide: float, tall: float, look: str) -> str:
    """A rectangle, empty unless `look` fills it."""
    empty = "" if "fill=" in look else ' fill="none"'
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{tall:.1f}"{empty} {look}/>'


def path(a: Array, b: Array) -> str:
    """Lines through points; they break where one is not finite."""
    known = np.isfinite(a) & np.isfinite(b)
    begins = known & ~np.concatenate([[False], known[:-1]])
    return "".join(
        f"{'M' if begin else 'L'}{x:.1f} {y:.1f}"
        for x, y, begin, there in zip(a.tolist(), b.tolist(), begins.tolist(), known.tolist(), strict=True)
        if there
    )


def stroke(curve: Curve, width: float | None = None) -> str:
    """How a curve is drawn."""
    dash = f' stroke-dasharray="{DASHES[curve.dash]}"' if curve.dash else ""
    faint = f' stroke-opacity="{FAINT}"' if curve.faint else ""
    return f'stroke="{fill(curve.colour)}" stroke-width="{width or curve.width:g}" fill="none"{dash}{faint}'


ROWS = 800  # of a turn


def draw_polar(panel: Polar, width: float, height: float, clip: str) -> str:
    """The panel, the circle in the middle; clip: an id of its own."""
    gap = panel.gap
    half = min(width, height - 24) / 2 - 20
    cx, cy, reach = width / 2, 24 + (height - 24) / 2, panel.ring * panel.rings
    outer = 1 + OUTER_RADIUS * gap * panel.rings
    one = half / outer
    step = round_step(reach / 2.4)
    count = math.floor(reach / step + 1e-9)

    def radius(deviation: float) -> float:
        return one * (1 + gap * deviation / panel.ring)

    parts = [text(4, 15, panel.title, BOLD)]
    for k in range(-count, count + 1):
        look = f'stroke="{fill(GRID)}" stroke-width="0.9"'
        dashed = f'stroke="{fill(MUTED)}" stroke-width="1.1" stroke-dasharray="7 4"'
        parts.append(circle(cx, cy, radius(k * step), look if k else dashed))
    for axis, x, y in ((panel.axes[0], 1.0, 0.0), (panel.axes[1], 0.0, -1.0)):
        for sign, name in ((1, f"{axis}+"), (-1, f"{axis}−")):
            a, b = sign * x, sign * y
            parts.append(line(cx, cy, cx + half * a, cy + half * b, f'stroke="{fill(GRID)}" stroke-width="0.9"'))
            parts.append(text(cx + (half + 11) * a, cy + (half + 11) * b + 4, name, BOLD, anchor="middle"))
    parts.append(f'<clipPath id="{clip}"><circle cx="{cx:g}" cy="{cy:g}" r="{half + 8:.1f}"/></clipPath>'
                 f'<g clip-path="url(#{clip})">')  # fmt: skip
    for curve in panel.curves:
        angle, deviation = curve.x, curve.y
        if len(angle) > ROWS:
            angle, deviation = angle[rows := extremes(deviation, ROWS)], deviation[rows]
        if not len(angle):
            continue
        away = one * np.clip(1 + gap * deviation / panel.ring, 0.0, 2 * outer)
        # Not with start or stop in it, and no arc.
        turned = abs(math.sin((angle[-1] - angle[0]) / 2)) < END_ANGLE_SINE
        closed = "Z" if turned and abs(deviation[-1] - deviation[0]) < CLOSED_TURN_GAP * reach else ""
        way = path(cx + away * np.cos(angle), cy - away * np.sin(angle))
        parts.append(f'<path d="{way}{closed}" {stroke(curve)}/>')
    parts.append("</g>")
    for k in range(-count, count + 1):
        at = radius(k * step) * math.sqrt(0.5)
        words = f"{'+' if k > 0 else ''}{tick_text(k * step)} µm" if k else "0"
        parts.append(text(cx + at, cy - at + 4, words, HALO.replace('"11"', '"10.5"', 1), MUTED, "middle"))
    inside = one * (1 - OUTER_RADIUS * gap)
    for mark in panel.marks:
        right, up = math.cos(mark.x), math.sin(mark.x)
        r = radius(mark.y)
        a, b = cx + r * right, cy - r * up
        to = (cx + inside * right, cy - inside * up)
        if mark.text:
            parts.append(line(a, b, *to, f'stroke="{fill(mark.colour)}" stroke-width="0.9"'))
        parts.append(circle(a, b, 4, f'fill="{fill(mark.colour)}"'))
        side = round(right)
        words_at = (to[0] - 3 * side, to[1] + 4 + 9 * round(up))
        parts.append(text(*words_at, mark.text, HALO, anchor=("start", "middle", "end")[side + 1]))
    for k, words in enumerate(panel.note.split("\n")):
        parts.append(text(cx, cy - 0.3 * one + 14 * k, words, 'font-size="11"', MUTED, "middle"))
    if panel.sense:
        parts.append(_sense(cx, cy + 0.36 * one, 0.16 * one, panel.sense))
    return "".join(parts)


def _sense(x: float, y: float, r: float, sense: int) -> str:
    """An arrow that shows which way the circle is driven."""
    first, last = (math.radians(angle) for angle in ((50, 130) if sense > 0 else (130, 50)))
    (a, b), (c, d) = ((x + r * math.cos(angle), y - r * math.sin(angle)) for angle in (first, last))
    arc = f"M{a:.1f} {b:.1f}A{r:.1f} {r:.1f} 0 0 {0 if sense > 0 else 1} {c:.1f} {d:.1f}"
    tip = f"M{c:.1f} {d:.1f}l{7 * sense} -1l{-2.5 * sense} -5.5Z"
    return (f'<path d="{arc}" fill="none" stroke="{fill(MUTED)}" stroke-width="1.3"/>'
            f'<path d="{tip}" fill="{fill(MUTED)}"/>')  # fmt: skip


# --- A chart as text of an SVG, as the page draws it at first: for readers without script, for print, and for PNG -----


# --- Words within a panel, where no curve is: what curves and words cover, in small squares, and the place of each word
# Sizes are pixels. The page's script places words by the same rules.


Box = tuple[float, float, float, float]  # left, top, width, height
Place = tuple[float, float, float]  # left, foot of the first line, how far it is from what it belongs to
ASCENT, LINE = 10.0, 15.0  # of words; from line to line
OUTSIDE, COVERING, COVERED = (
    1e6,
    120.0,
    10.0,
)  # what it costs: to leave the panel, to cover curves, and a square of them


def width_of(text: str) -> float:
    """About the width of words over curves."""
    return LETTER * max(map(len, text.split("\n"))) + 2


class CoveredSquares:
    """A panel in small squares: which of them curves and words cover."""

    def __init__(self, inner: Box) -> None:
        self.inner = inner
        self.squares: NDArray[np.bool_] = np.zeros(
            (math.ceil(inner[3] / BLOCK) + 1, math.ceil(inner[2] / BLOCK) + 1), dtype=bool
        )

    def box(self, x: float, y: float, wide: float, tall: float) -> None:
        """Cover a rectangle."""
        top, bottom, left, right = self._squares(x, y, wide, tall)
        self.squares[max(0, top) : max(0, bottom), max(0, left) : max(0, right)] = True

    def path(self, x: Array, y: Array, *, dots: bool = False) -> None:
        """Cover points (N,), and unless they are dots the lines between them."""
        points = np.column_stack([x - self.inner[0], y - self.inner[1]]) / BLOCK
        if not dots and len(points) > 1:
            points = np.clip(points, -1e3, 1e4)
            with np.errstate(invalid="ignore"):
                lengths = np.abs(np.diff(points, axis=0)).max(axis=1)
            counts = np.where(np.isfinite(lengths), np.ceil(lengths * 1.3), 0).astype(int) + 1
            first = np.repeat(np.arange(len(counts)), counts)
            share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / np.repeat(
                counts, counts
            )
            points = points[first] + share[:, None] * (points[first + 1] - points[first])
        points = points[np.isfinite(points).all(axis=1)]
        at = np.floor(points).astype(int)
        rows, columns = self.squares.shape
        inside = (at[:, 0] >= 0) & (at[:, 0] < columns) & (at[:, 1] >= 0) & (at[:, 1] < rows)
        self.squares[at[inside, 1], at[inside, 0]] = True

    def put(self, text: str, places: Sequence[Place]) -> tuple[float, float]:
        """The place that covers least and is least far, which is covered then: left, and foot of the first line."""
        left, top, width, height = self.inner
        wide, tall = width_of(text), 12 + LINE * text.count("\n")

        best = (math.inf, 0, left + 4, top + 12)
        for k in sorted(range(len(places)), key=lambda k: places[k][2]):
            x, y, far = places[k]
            if far > best[0]:
                break
            begin, end, first, last = self._squares(x, y - ASCENT, wide, tall)
            if y - ASCENT < top or y - ASCENT + tall > top + height or x < left or x + wide > left + width + 1:
                far += OUTSIDE
            elif count := int(np.count_nonzero(self.squares[begin:end, first:last])):
                far += COVERING + COVERED * count
            best = min(best, (far, k, x, y))
        _, _, x, y = best
        self.box(x, y - ASCENT, wide, tall)
        return x, y

    def _squares(self, x: float, y: float, wide: float, tall: float) -> tuple[int, int, int, int]:
        x, y = (x - self.inner[0]) / BLOCK, (y - self.inner[1]) / BLOCK
        return math.floor(y), math.floor(y + tall / BLOCK) + 1, math.floor(x), math.floor(x + wide / BLOCK) + 1


# --- A panel of an SVG: curves over one pair of axes, with all that is marked in it -----------------------------------


MOST_ROWS = 400  # of a curve: two for a pixel or so
PixelScale = Callable[[Array | float], Array]  # values to pixels


@dataclass(frozen=True)
class Frame:
    """What a panel shows of its curves, its ticks upwards, and the room that these need at the left."""

    across: Range
    up: Range
    heights: Ticks
    left: float

    def beginning(self, left: float) -> Frame:
        """With the curves from there on."""
        return replace(self, left=left)


def room_above(panel: Panel) -> float:
    """Room above the curves."""
    return TOP + (SECOND if panel.x.also is not None else 0)


def frame_of(panel: Panel, box: Box, aside: float) -> Frame:
    """For a box on paper. aside: room at the right."""
    across, up = ranges(panel)
    tall = box[3] - room_above(panel) - BOTTOM
    names, most = panel.y.names, len(panel.y.names) or max(2, int(tall / TICK_HEIGHT))
    heights = ticks(panel.y, up, most)
    beside = max((6.6 * len(name) + (26 if names else 30) for name in names or heights.texts), default=0.0)
    left = min(max(LEFT, beside), 0.45 * box[2])
    if panel.equal:
        wide = box[2] - left - aside
        unit = max((across[1] - across[0]) / wide, (up[1] - up[0]) / tall)
        across, up = (((low + high - unit * size) / 2, (low + high + unit * size) / 2)
                      for (low, high), size in ((across, wide), (up, tall)))  # fmt: skip
        heights = ticks(panel.y, up, most)
    return Frame(across, up, heights, left)


def draw_panel(panel: Panel, box: Box, frame: Frame, aside: float, clip: str) -> str:
    """The panel in its box; aside: room at the right; clip: an id of its own."""
    _, _, width, height = box
    inner: Box = (frame.left, room_above(panel), width - frame.left - aside, height - room_above(panel) - BOTTOM)
    left, top, wide, tall = inner
    right, bottom = left + wide, top + tall
    across = _scale(panel.x, frame.across, left, right)
    up = _scale(panel.y, frame.up, bottom, top)
    begin = 0.0 if panel.y.names else max(0.0, min(left, width - 7.4 * len(panel.title)))
    parts = [panel_heading(panel.title, begin, width - begin), *_axes(panel, frame, inner, across, up, box)]
    inside: list[str] = []
    has_words = bool(panel.note or any(mark.text for mark in panel.marks) or any(level.text for level in panel.levels))
    covered = CoveredSquares(inner) if has_words else None
    inside += [_band(band, frame.across, across, up, bottom) for band in panel.bands]
    inside += [_level(level, inner, across, up) for level in panel.levels]
    for curve in sorted(panel.curves, key=lambda curve: not curve.dots):  # a line through its points, not below them
        inside.append(_curve(curve, panel, frame, (across, up, bottom), covered))
    marks = [(mark, float(across(mark.x)), float(up(mark.y))) for mark in panel.marks]
    marks = [mark for mark in marks if left - 1 <= mark[1] <= right + 1]
    for mark, x, y in marks:
        colour = fill(mark.colour)
        look = f'fill="{"none" if mark.hollow else colour}" stroke="{colour}" stroke-width="1.4"'
        inside.append(circle(x, y, 3.6, look))
        if covered is not None:
            covered.box(x - 4, y - 4, 8, 8)
    words, leaders = _words(panel, inner, across, up, marks, covered) if covered is not None else ([], [])
    frame_look = f'stroke="{fill(MUTED)}" stroke-width="0.8"'
    return "".join([
        *parts, f'<clipPath id="{clip}">{rectangle(*inner, "")}</clipPath><g clip-path="url(#{clip})">', *inside,
        *leaders, "</g>", rectangle(*inner, frame_look), *([f"<g {HALO}>", *words, "</g>"] if words else []),
    ])  # fmt: skip


def _scale(axis: Axis, span: Range, first: float, last: float) -> PixelScale:
    low, high = (float(axis_measure(axis, value)) for value in span)
    per = (last - first) / ((high - low) or 1.0)
    return lambda values: np.asarray(first + (axis_measure(axis, values) - low) * per)


def _axes(panel: Panel, frame: Frame, inner: Box, across: PixelScale, up: PixelScale, box: Box) -> list[str]:
    """Grid, ticks and names of the axes, on all sides that have a scale."""
    (left, top, wide, tall), (_, _, width, height) = inner, box
    right, bottom, parts = left + wide, top + tall, []
    most = max(2, int(wide / max([TICK_WIDTH, *(7 * len(name) + 14 for name in panel.x.names)])))
    along = separate_ticks(lambda n: ticks(panel.x, frame.across, n), lambda at: float(across(at)), most, width)
    ways: dict[bool, list[str]] = {True: [], False: []}  # of the grid: with a text, and without
    for at, words in along.marks:
        x = float(across(at))
        ways[bool(words)].append(f"M{x:.1f} {top:g}V{bottom:g}")
        parts.append(text(min(x, width - 3.6 * len(words)), bottom + 16, words, anchor="middle"))  # the last one inside
    for at, words in frame.heights.marks:
        y = float(up(at))
        ways[bool(words)].append(f"M{left:g} {y:.1f}H{right:g}")
        parts.append(text(left - 6, y + 4, words, anchor="end"))
    for with_text, way in ways.items():
        if way:
            parts.append(
                f'<path d="{"".join(way)}" stroke="{fill(GRID)}" stroke-width="{0.8 if with_text else 0.35}"/>'
            )
    title = along.title(panel.x)
    parts.append(text(min(left + wide / 2, width - 3.4 * len(title)), bottom + 34, title, anchor="middle"))
    if not panel.y.names:
        parts.append(_upright(frame.heights.title(panel.y), 13, inner, height - 8))
    if panel.x.also is not None:
        axis, factor = _second(panel.x)
        span = (frame.across[0] * factor, frame.across[1] * factor)
        result = separate_ticks(lambda n: ticks(axis, span, n), lambda at: float(across(at / factor)),
                      max(2, int(wide / TICK_WIDTH)), math.inf)  # fmt: skip
        parts += [text(float(across(at / factor)), top - 5, words, anchor="middle") for at, words in result.marks]
        parts.append(text(left + wide / 2, top - 20, result.title(axis), anchor="middle"))
    if panel.y.also is not None:
        axis, factor = _second(panel.y)
        result = ticks(axis, (frame.up[0] * factor, frame.up[1] * factor), max(2, int(tall / TICK_HEIGHT)))
        parts += [text(right + 6, float(up(at / factor)) + 4, words) for at, words in result.marks]
        parts.append(_upright(result.title(axis), width - 5, inner, height - 8, right=True))
    return parts


def _second(axis: Axis) -> tuple[Axis, float]:
    """The same quantity in another unit, and the factor."""
    assert axis.also is not None
    label, unit, factor = axis.also
    return Axis(label, unit, axis.log), factor


def _upright(words: str, x: float, inner: Box, most: float, *, right: bool = False) -> str:
    """What stands upright beside a panel: in two lines where one is longer than the panel, smaller where these are."""
    _, top, _, tall = inner
    cut = len(words)
    if 6.4 * len(words) > tall and " " in words:
        cut = min((k for k, letter in enumerate(words) if letter == " "), key=lambda k: abs(k - len(words) / 2))
    lines = [part for part in (words[:cut], words[cut + 1 :]) if part]
    size = max(8.0, min(12.0, 12 * most / (6.4 * max(map(len, lines), default=1))))
    look = 'text-anchor="middle"' + (f' font-size="{size:.1f}"' if size < 12 else "")
    pitch, first = LINE_PITCH * size, 1 - len(lines) if right else (1 - len(lines)) / 6
    return "".join(
        turned_text(x + pitch * (k + first), top + tall / 2, part, -90, look) for k, part in enumerate(lines)
    )


def _band(band: Band, span: Range, across: PixelScale, up: PixelScale, bottom: float) -> str:
    x = np.array(span) if band.x is None else band.x
    low, high = (np.broadcast_to(np.asarray(edge, dtype=float), x.shape) for edge in (band.low, band.high))
    rows = extremes(high, MOST_ROWS) if len(x) > MOST_ROWS else slice(None)
    low, high = (np.clip(np.nan_to_num(up(edge[rows]), nan=bottom), -1e4, 1e4) for edge in (low, high))
    seen = across(x[rows])
    outline = path(np.concatenate([seen, seen[::-1]]), np.concatenate([high, low[::-1]]))
    return f'<path d="{outline}Z" fill="{fill(band.colour)}" fill-opacity="{BAND}"/>'


def _level(level: Level, inner: Box, across: PixelScale, up: PixelScale) -> str:
    left, top, wide, tall = inner
    at = float((across if level.upright else up)(level.at))
    if not math.isfinite(at):
        return ""
    ends = [float((up if level.upright else across)(end)) for end in level.ends or ()]
    first, last = ends or ([top, top + tall] if level.upright else [left, left + wide])
    dash = f' stroke-dasharray="{DASHES[level.dash]}"' if level.dash else ""
    points = (at, first, at, last) if level.upright else (first, at, last, at)
    return line(*points, f'stroke="{fill(level.colour)}"{dash}')


def _curve(
    curve: Curve, panel: Panel, frame: Frame, to: tuple[PixelScale, PixelScale, float], covered: CoveredSquares | None
) -> str:
    """A curve, of what is seen; what it covers is entered."""
    across, up, bottom = to
    x, y = curve.x, curve.y
    if curve.ascending:
        first, last = np.searchsorted(x, frame.across[0], "left"), np.searchsorted(x, frame.across[1], "right")
        x, y = x[max(0, first - 1) : last + 1], y[max(0, first - 1) : last + 1]
    # A loop of which the page keeps more rows than usual is one whose shape is looked at closely.
    most = MOST_ROWS if curve.ascending or curve.most == MOST_IN_PAGE else curve.most
    if curve.dots and not curve.ascending:
        curve = curve.thinned()
        x, y = curve.x, curve.y
    elif len(x) > most and not curve.dots:
        rows = extremes(y, most) if curve.ascending else loop_rows(x, y, 2 * most)
        x, y = x[rows], y[rows]
    if not len(x):
        return ""
    a, b = across(x), up(y)
    if covered is not None:
        covered.path(a, b, dots=curve.dots)
    if curve.dots:
        points = "".join(f"M{p:.1f} {q:.1f}h0" for p, q in zip(a.tolist(), b.tolist(), strict=True)
                         if math.isfinite(p) and math.isfinite(q))  # fmt: skip
        return f'<path d="{points}" {stroke(curve, 2 * curve.width)} stroke-linecap="round"/>'
    if curve.filled:
        zero = min(bottom, float(up(frame.up[0] if panel.y.log else 0.0)))
        way = f"{path(a, b)}V{zero:.1f}H{a[0]:.1f}Z"
        return f'<path d="{way}" fill="{fill(curve.colour)}" fill-opacity="{FILL}"/>'
    return f'<path d="{path(a, b)}" {stroke(curve)}/>'


def _words(
    panel: Panel,
    inner: Box,
    across: PixelScale,
    up: PixelScale,
    marks: Sequence[tuple[Mark, float, float]],
    covered: CoveredSquares,
) -> tuple[list[str], list[str]]:
    """What is said of marks and levels, and the note, where no curve is; and lines from points to words far away."""
    left, top, wide, tall = inner
    right, bottom = left + wide, top + tall
    words, leaders = [], []
    for level in panel.levels:
        if not level.upright and not level.text and math.isfinite(y := float(up(level.at))):
            covered.box(left, y, wide, 0)
    for mark, x, y in marks:
        if not mark.text:
            continue
        a, b = covered.put(mark.text, _point_label_places(x, y, width_of(mark.text), left, right))
        words.append(text(a, b, mark.text))
        to = (min(max(x, a), a + width_of(mark.text)), b + 3 if b < y else b - 10)
        if math.hypot(to[0] - x, to[1] - y) > LEADER:
            leaders.append(line(x, y, *to, f'stroke="{fill(MUTED)}" stroke-width="0.7"'))
    for level in panel.levels:
        at = float((across if level.upright else up)(level.at))
        first, last = (left, right) if level.upright else (top, bottom)
        if level.text and first - 1 <= at <= last + 1:
            places = _along_upright(at, level.text, top, bottom) if level.upright else _level_label_places(
                at, level, left, right, across)  # fmt: skip
            words.append(text(*covered.put(level.text, places), level.text, "", MUTED))
    if panel.note:
        lines = panel.note.split("\n")
        beyond = right - 8 - width_of(panel.note)
        low, high = bottom - 8 - LINE * (len(lines) - 1), top + 16
        corners: list[Place] = []  # the lower left, another corner, else somewhere between
        for foot in np.arange(high, low + 1e-9, LINE).tolist():
            far = 3 + min(low - foot, foot - high)
            corners += [(left + 8, foot, far), (beyond, foot, far + 1)]
        x, y = covered.put(panel.note, [*corners, (left + 8, low, 0.0), (beyond, low, 1.0)])
        words += [text(x, y + LINE * k, value) for k, value in enumerate(lines)]
    return words, leaders


def _point_label_places(x: float, y: float, wide: float, left: float, right: float) -> list[Place]:
    """Places for the label of a point."""
    sides = ((x + 7, 0), (x - 7 - wide, 2), (x - wide / 2, 4), (x - 1.6 * wide, 40), (x + 0.6 * wide, 40))
    return [(min(max(from_, left + 3), right - wide - 3), y - 6 + 13 * k, far + abs(13 * k))
            for k in range(-9, 10) for from_, far in sides]  # fmt: skip


def _along_upright(x: float, words: str, top: float, bottom: float) -> list[Place]:
    """Places for the label of an upright line: beside it, as high as may be."""
    feet = np.arange(top + 12, bottom - 4, 13).tolist()
    sides = ((x + 4, 0), (x - 4 - width_of(words), 3))
    return [(side, foot, foot - top + far) for foot in feet for side, far in sides]


def _level_label_places(y: float, level: Level, left: float, right: float, across: PixelScale) -> list[Place]:
    """Places for the label of a level: above or below it, as far right as may be."""
    begin, end = (min(max(float(across(end)), left), right) for end in level.ends) if level.ends else (left, right)
    last = max(end - 4 - width_of(level.text), left + 4)
    return [
        (x, y - 4 - 12 * k if over else y + 12 + 12 * k, 0.2 * (last - x) + 12 * k + (0 if over else 3))
        for x in np.arange(last, min(begin + 4, last) - 1e-9, -12).tolist()
        for k in range(3)
        for over in (True, False)
    ]


# --- A grid of an SVG: cells coloured by their numbers, and the numbers where there is room; else a scale of colours --


def grid_height(grid: Grid) -> float:
    """With names and title above the cells."""
    return _over(grid) + ROW * len(grid.rows) + 12


def draw_grid(grid: Grid, width: float) -> str:
    """The grid with its names and its title."""
    left, top = min(260.0, 16 + 6.4 * max(map(len, grid.rows))), _over(grid)
    wide, count = width - left - 8, len(grid.columns)
    cell = min(wide / count, (wide - SLANTED_LETTER_WIDTH * len(grid.columns[-1])) / (count - 0.5))
    parts = [panel_heading(grid.title, 4, width - 4)]
    for j in range(0, count, math.ceil(CELL_WITH_NAME / cell)):
        parts.append(turned_text(left + (j + 0.5) * cell, top - 6, grid.columns[j], -40, 'font-size="11"'))
    for i, name in enumerate(grid.rows):
        y = top + ROW * i
        parts.append(text(left - 8, y + 16, name, 'font-size="11"', anchor="end"))
        for j in range(count):
            x, value = left + j * cell, float(grid.values[i, j])
            edge = f'stroke="{fill(GRID)}" stroke-width="0.6"'
            if not math.isfinite(value):
                parts.append(rectangle(x, y, cell, ROW, edge))
                continue
            parts.append(rectangle(x, y, cell, ROW, f"{_paint(value, grid)} {edge}"))
            if cell >= CELL_WITH_NUMBER:
                weight = 'font-weight="700"' if grid.bold is not None and grid.bold[i, j] else ""
                words = three_digits(value) if grid.decimals is None else minus(f"{value:.{grid.decimals}f}")
                parts.append(text(x + cell / 2, y + 16, words, f'font-size="11" {weight}', anchor="middle"))
    if grid.best is not None:
        i, j = grid.best
        frame = f'stroke="{fill(INK)}" stroke-width="2.2"'
        parts.append(rectangle(left + j * cell, top + ROW * i, cell, ROW, frame))
    if cell < CELL_WITH_NUMBER:
        parts.append(_grid_scale(grid, width))
    return "".join(parts)


def _grid_scale(grid: Grid, width: float) -> str:
    low, high = grid.span
    end = width - 8 - 7 * len(tick_text(high, 3))
    begin = end - SCALE_STEPS * SCALE_STEP - 4
    parts = [text(begin - 4, 15, tick_text(low, 3), 'font-size="11"', anchor="end"),
             text(end, 15, tick_text(high, 3), 'font-size="11"')]  # fmt: skip
    for k in range(SCALE_STEPS):
        value = low + (high - low) * (k + 0.5) / SCALE_STEPS
        parts.append(rectangle(begin + k * SCALE_STEP, 6, SCALE_STEP, 10, _paint(value, grid)))
    return "".join(parts)


def _paint(value: float, grid: Grid) -> str:
    """The colour of a cell; about zero that of its sign."""
    low, high = grid.span
    signs = low < 0 < high
    share = abs(value) / max(-low, high) if signs else (value - low) / (high - low or 1)
    deep = DEPTH * min(1.0, max(0.0, share))
    return f'fill="{fill(VERMILLION if signs and value < 0 else BLUE)}" fill-opacity="{deep:.3f}"'


def _over(grid: Grid) -> float:
    return 36 + 4.3 * max(map(len, grid.columns))


WIDTH = 960.0
MAX_PANEL_HEIGHT = 360.0  # of a panel beside a polar one, at most


def svg(chart: Chart, stem: str, title: str) -> str:
    """Text of the SVG with ids of its own."""
    parts, top = _legend(chart)
    boxes, height = place_panels(chart)
    frames = {
        k: frame_of(part, boxes[k], _room_aside(chart))
        for k, part in enumerate(chart.panels)
        if isinstance(part, Panel)
    }
    for k, part in enumerate(chart.panels):
        x, y, wide, tall = boxes[k]
        name = f"{stem}-still-{k}"
        if isinstance(part, Polar):
            drawn = draw_polar(part, wide, tall, name)
        elif isinstance(part, Grid):
            drawn = draw_grid(part, wide)
        else:
            drawn = draw_panel(part, boxes[k], _shared_frame(frames, boxes, k), _room_aside(chart), name)
        parts.append(f'<g transform="translate({x:g} {y + top:g})">{drawn}</g>')
    box = f"0 0 {WIDTH:g} {height + top:g}"
    head = f'<svg role="img" aria-label="{escape(title)}" class="plot" viewBox="{box}" font-size="12">'
    return head + "".join(parts) + "</svg>"


def place_panels(chart: Chart) -> tuple[list[Box], float]:
    """Where every panel goes: boxes, and the height of all."""
    boxes: list[Box] = []
    room = WIDTH - GAP * (len(chart.widths) - 1)
    y = 4.0
    for row in chart.rows():
        widths = [room * share / sum(chart.widths) for share in chart.widths]
        natural = [_height(part, wide) for part, wide in zip(row, widths, strict=False)]
        height, x = max(natural), 0.0
        beside_a_circle = any(isinstance(part, Polar) for part in row)
        for part, wide, own in zip(row, widths, natural, strict=False):
            named = isinstance(part, Panel) and part.y.names
            lower = min(height, MAX_PANEL_HEIGHT) if beside_a_circle and isinstance(part, Panel) else height
            boxes.append((x, y, wide, own if named else lower))
            x += wide + GAP
        y += height + 10
    return boxes, y


def _height(part: Part, wide: float) -> float:
    if isinstance(part, Polar):
        return min(wide, ROUND) + 24
    if isinstance(part, Grid):
        return grid_height(part)
    if part.y.names:
        return TOP + BOTTOM + 26 * len(part.y.names)
    return HEIGHT * part.height + BOTTOM + room_above(part) - TOP


def _room_aside(chart: Chart) -> float:
    """Room beside the curves at the right: panels below one another end alike."""
    second = any(isinstance(part, Panel) and part.y.also is not None for part in chart.panels)
    return LEFT if second else RIGHT


def _shared_frame(frames: dict[int, Frame], boxes: list[Box], k: int) -> Frame:
    """The frame of a panel; those below one another begin alike."""
    left = max(frame.left for j, frame in frames.items() if (boxes[j][0], boxes[j][2]) == (boxes[k][0], boxes[k][2]))
    return frames[k].beginning(left)


def _legend(chart: Chart) -> tuple[list[str], float]:
    """One legend of all panels, and its height."""
    names: dict[str, Curve | Band] = {}
    for part in chart.panels:
        if not isinstance(part, Grid):
            for curve in part.curves:
                names.setdefault(curve.name, curve)
            for band in part.bands if isinstance(part, Panel) else ():
                names.setdefault(band.name, band)
    names.pop("", None)
    parts, x, y = [], 4.0, 14.0
    for name, value in names.items():
        room = 36 + 6.8 * len(name)
        if x + room > WIDTH and x > 4:
            x, y = 4.0, y + 18
        parts.append(_sample(value, x, y - 4) + text(x + 27, y, name))
        x += room
    return parts, y + 8 if parts else 0.0


def _sample(curve: Curve | Band, x: float, y: float) -> str:
    """What a name of the legend looks like."""
    if isinstance(curve, Band) or curve.filled:
        deep = BAND if isinstance(curve, Band) else FILL
        return rectangle(x, y - 4, 22, 8, f'fill="{fill(curve.colour)}" fill-opacity="{deep}"')
    if curve.dots:
        return circle(x + 11, y, max(2.4, curve.width), f'fill="{fill(curve.colour)}"')
    return line(x, y, x + 22, y, stroke(curve, max(1.6, curve.width)))


# --- A drawing as a file of its own: SVG with colours as numbers, a size, and words above it; and PNG drawn from
#     that
# The package resvg_py draws the PNG, with the font of this room (a part of DejaVu Sans): text looks alike wherever it
# is drawn.


FONT = 'system-ui, "Segoe UI", Arial, "DejaVu Sans", sans-serif'
EDGE = 10.0  # pixels about the drawing
FONTS = ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf")
PIXELS = 1.75  # of a PNG for one of the SVG
REMARK_SIZE, CAPTION_SIZE = 8.0, 9.5
CAPTION_WIDTH = 170  # letters of a line


def standalone(drawn: str, title: str, caption: str = "", remark: str = "") -> str:
    """An SVG of a page as text of a file. caption: stands above it, below the title; without it there is neither."""
    words: list[str] = []
    y = 4.0
    for line in remark.split("\n") if remark else ():
        y += REMARK_SIZE + 2
        words.append(text(WIDTH, y, line, f'font-size="{REMARK_SIZE:g}"', MUTED, "end"))
    if caption:
        y += 18
        words.append(text(0, y, title, f'{BOLD} font-size="14"'))
        for line in textwrap.wrap(caption, CAPTION_WIDTH):
            y += CAPTION_SIZE + 4
            words.append(text(0, y, line, f'font-size="{CAPTION_SIZE:g}"', MUTED))
        y += 8
    inside = drawn[drawn.index(">") + 1 : -len("</svg>")]
    known = re.search(r'viewBox="0 0 [\d.]+ ([\d.]+)" (font-size="[\d.]+")', drawn)
    assert known
    wide, tall = WIDTH + 2 * EDGE, float(known[1]) + y + 2 * EDGE
    size = f'width="{wide:g}" height="{tall:g}" viewBox="0 0 {wide:g} {tall:g}" {known[2]}'
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(title)}" {size} '
            f'font-family="{escape(FONT)}">')  # fmt: skip
    ground = rectangle(0, 0, wide, tall, 'fill="var(--ground)"')
    body = f'{ground}<g transform="translate({EDGE:g} {EDGE:g})">{"".join(words)}<g transform="translate(0 {y:g})">'
    return f'<?xml version="1.0" encoding="utf-8"?>\n{resolve_colours(head + body + inside)}</g></g></svg>\n'


def resolve_colours(drawn: str) -> str:
    """An SVG with colours as numbers."""
    return re.sub(r"var\(--(\w+)\)", lambda match: PAGE_COLOURS[match[1]], drawn)


def png(drawn: str, pixels: float = PIXELS) -> bytes:
    """An SVG file as PNG, with so many pixels for one of it. Raises MissingPackage."""
    require_extras("a drawing", "figures")
    from resvg_py import svg_to_bytes

    family = "DejaVu Sans"
    with ExitStack() as stack:
        folder = resources.files("feedsim.report") / "fonts"
        fonts = [str(stack.enter_context(resources.as_file(folder / name))) for name in FONTS]
        return bytes(svg_to_bytes(
            svg_string=drawn, zoom=pixels, skip_system_fonts=True, font_files=fonts, font_family=family,
            sans_serif_family=family,
        ))  # fmt: skip
