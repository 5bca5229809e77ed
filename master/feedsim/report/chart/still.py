"""A chart drawn once, as SVG: for readers without script, and previews. Simpler than what the page draws by itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape

import numpy as np

from feedsim.report.chart.model import Axis, Chart, Curve, Grid, Panel, Polar, extremes
from feedsim.report.chart.scales import bent, ranges, ticks
from feedsim.report.formatting import minus, three
from feedsim.report.style import INK, MUTED, Array, named

STILL_WIDTH, STILL_HEIGHT, ROUND = 960.0, 250.0, 430.0
LEFT, RIGHT, TOP, BOTTOM = 62.0, 12.0, 26.0, 42.0
MOST_ROWS = 400  # of a curve: two for a pixel or so
SLANTED = 4.8  # that a letter of a slanted name takes across
DASHES = {"": "", "dashed": ' stroke-dasharray="6 3"', "dotted": ' stroke-dasharray="2 3"'}
Scaled = Callable[[Array | float], Array]  # values to pixels


def still(chart: Chart, stem: str, title: str) -> str:
    """Text of the SVG, colours as the page's variables, ids of its own."""
    parts, y = _legend(chart)
    total = sum(chart.widths)
    for n, row in enumerate(chart.rows()):
        height = max(_height(part) for part in row)
        x = 0.0
        for k, (part, share) in enumerate(zip(row, chart.widths, strict=False)):
            width = STILL_WIDTH * share / total
            parts.append(
                f'<g transform="translate({x:g} {y:g})">{_part(part, width, height, f"{stem}-still-{n}-{k}")}</g>'
            )
            x += width
        y += height + 10
    box = f"0 0 {STILL_WIDTH:g} {y:g}"
    head = f'<svg role="img" aria-label="{escape(title)}" class="plot" viewBox="{box}" font-size="12">'
    return head + "".join(parts) + "</svg>"


def _height(part: Panel | Polar | Grid) -> float:
    if isinstance(part, Polar):
        return ROUND
    if isinstance(part, Grid):
        return _over(part) + 24.0 * len(part.rows) + 10
    return TOP + BOTTOM + (26.0 * len(part.y.names) if part.y.names else (STILL_HEIGHT - TOP - BOTTOM) * part.height)


def _legend(chart: Chart) -> tuple[list[str], float]:
    parts, x, y = [], 4.0, 14.0
    for name, curve in chart.legend.items():
        room = 36 + 6.8 * len(name)
        if x + room > STILL_WIDTH and x > 4:
            x, y = 4.0, y + 18
        parts.append(f'<path d="M{x:g} {y - 4:g}h22" {_stroke(curve)}/>{_text(x + 27, y, name)}')
        x += room
    return parts, y + 12 if parts else 4.0


def _part(part: Panel | Polar | Grid, width: float, height: float, name: str) -> str:
    if isinstance(part, Polar):
        return _polar(part, width, height)
    if isinstance(part, Grid):
        return _grid(part, width)
    return _panel(part, width, _height(part) if part.y.names else height, name)


def _panel(panel: Panel, width: float, height: float, name: str) -> str:
    left = max(LEFT, max((6.6 * len(each) + 20 for each in panel.y.names), default=0.0))
    right, bottom = width - RIGHT, height - BOTTOM
    curves = [each for each in panel.curves if len(each.x)]
    across_span, up_span = ranges(panel)
    parts = [_text(left if not panel.y.names else 2, 15, panel.title, "font-weight='600'")]

    def across(x: Array | float) -> Array:
        return _scaled(x, across_span, left, right, panel.x.log)

    def up(y: Array | float) -> Array:
        if within := panel.y.symlog:
            low, high = (float(bent(within, each)) for each in up_span)
            return _scaled(bent(within, y), (low, high), bottom, TOP, False)
        return _scaled(y, up_span, bottom, TOP, panel.y.log)

    grid = []
    for at, text in ticks(panel.x, across_span, (right - left) / 74):
        grid.append(f"M{float(across(at)):.1f} {TOP:g}V{bottom:g}")
        seen = min(float(across(at)), width - 3.6 * len(text))  # the last one stays inside
        parts.append(_text(seen, bottom + 16, text, "text-anchor='middle'"))
    for at, text in ticks(panel.y, up_span, (bottom - TOP) / 34):
        grid.append(f"M{left:g} {float(up(at)):.1f}H{right:g}")
        parts.append(_text(left - 6, float(up(at)) + 4, text, "text-anchor='end'"))
    parts.append(f'<path d="{"".join(grid)}" stroke="var(--grid)" stroke-width=".8" fill="none"/>')
    parts.append(_text((left + right) / 2, bottom + 34, _named(panel.x), "text-anchor='middle'"))
    if not panel.y.names:
        middle = f"text-anchor='middle' transform='translate(13 {(TOP + bottom) / 2:g}) rotate(-90)'"
        parts.append(_text(0, 0, _named(panel.y), middle))
    box = f'x="{left:g}" y="{TOP:g}" width="{right - left:g}" height="{bottom - TOP:g}"'
    inside = [f'<clipPath id="{name}"><rect {box}/></clipPath>',
              f'<g clip-path="url(#{name})" fill="none">']  # fmt: skip
    for band in panel.bands:
        x = np.array(across_span) if band.x is None else band.x
        low, high = (np.broadcast_to(np.asarray(edge, dtype=float), x.shape) for edge in (band.low, band.high))
        rows = extremes(high, MOST_ROWS) if len(x) > MOST_ROWS else slice(None)
        low, high = (np.clip(np.nan_to_num(up(edge[rows]), nan=bottom), -1e4, 1e4) for edge in (low, high))
        outline = _path(np.concatenate([across(x[rows]), across(x[rows])[::-1]]), np.concatenate([high, low[::-1]]))
        inside.append(f'<path d="{outline}Z" fill="var(--{named(band.colour)})" fill-opacity=".18"/>')
    for level in panel.levels:
        first, last = level.ends or (up_span if level.upright else across_span)
        way = (f"M{float(across(level.at)):.1f} {float(up(first)):.1f}V{float(up(last)):.1f}" if level.upright
               else f"M{float(across(first)):.1f} {float(up(level.at)):.1f}H{float(across(last)):.1f}")  # fmt: skip
        inside.append(f'<path d="{way}" stroke="var(--{named(level.colour)})"{DASHES[level.dash]}/>')
    for curve in sorted(curves, key=lambda each: not each.dots):  # a line through its points, not below them
        inside.append(
            _curve(curve, across_span, across, up, float(up(max(0.0, up_span[0]) if not panel.y.log else up_span[0])))
        )
    for mark in panel.marks:
        a, b = float(across(mark.x)), float(up(mark.y))
        fill = "none" if mark.hollow else f"var(--{named(mark.colour)})"
        inside.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.6" fill="{fill}" stroke="var(--{named(mark.colour)})"/>')
        far = a > right - 6.5 * len(mark.text)
        inside.append(
            _text(
                a + (-7 if far else 7),
                b - 6,
                mark.text,
                f"font-size='11' text-anchor='{'end' if far else 'start'}'",
            )
        )
    notes = [
        _text(left + 8, bottom - 8 - 15 * k, line, "font-size='11'")
        for k, line in enumerate(reversed(panel.note.split("\n")))
    ]
    frame = f'<rect {box} fill="none" stroke="var(--muted)" stroke-width=".8"/>'
    return "".join([*parts, *inside, "</g>", frame, *notes])


def _named(axis: Axis) -> str:
    """What stands along an axis, and what it is in the other unit."""
    return axis.title + (f", 1 {axis.unit} is {axis.also[2]:.4g} {axis.also[1]}" if axis.also is not None else "")


def _curve(curve: Curve, span: tuple[float, float], across: Scaled, up: Scaled, zero: float) -> str:
    x, y = curve.x, curve.y
    if curve.ascending:
        first, last = np.searchsorted(x, span[0], "left"), np.searchsorted(x, span[1], "right")
        x, y = x[max(0, first - 1) : last + 1], y[max(0, first - 1) : last + 1]
    if len(x) > MOST_ROWS and not curve.dots:
        rows = extremes(y, MOST_ROWS) if curve.ascending else np.unique(
            np.concatenate([extremes(x, MOST_ROWS), extremes(y, MOST_ROWS)]))  # fmt: skip
        x, y = x[rows], y[rows]
    a, b = across(x), up(y)
    if curve.dots:
        points = "".join(f"M{p:.1f} {q:.1f}h0" for p, q in zip(a, b, strict=True) if math.isfinite(q))
        return f'<path d="{points}" {_stroke(curve, 2 * curve.width)} stroke-linecap="round"/>'
    if curve.filled:
        way = f"{_path(a, b)}V{zero:.1f}H{a[0]:.1f}Z"
        return f'<path d="{way}" fill="var(--{named(curve.colour)})" fill-opacity=".5"/>'
    return f'<path d="{_path(a, b)}" {_stroke(curve)}/>'


def _polar(panel: Polar, width: float, height: float) -> str:
    gap = panel.gap
    half = min(width, height - 24) / 2 - 20
    cx, cy, one = width / 2, 24 + (height - 24) / 2, half / (1 + 1.16 * gap * panel.rings)
    parts = [_text(4, 15, panel.title, "font-weight='600'")]
    for k in range(-panel.rings, panel.rings + 1):
        look = 'stroke="var(--grid)"' if k else 'stroke="var(--muted)" stroke-dasharray="7 4"'
        parts.append(f'<circle cx="{cx:g}" cy="{cy:g}" r="{one * (1 + gap * k):.1f}" fill="none" {look}/>')
    parts.append(
        f'<path d="M{cx - half:g} {cy:g}H{cx + half:g}M{cx:g} {cy - half:g}V{cy + half:g}" stroke="var(--grid)"/>'
    )
    for axis, x, y in ((panel.axes[0], 1, 0), (panel.axes[1], 0, -1)):
        for sign, text in ((1, f"{axis}+"), (-1, f"{axis}−")):
            parts.append(
                _text(
                    cx + sign * x * (half + 11),
                    cy + sign * y * (half + 11) + 4,
                    text,
                    "text-anchor='middle' font-weight='600'",
                )
            )
    for curve in panel.curves:
        rows = extremes(curve.y, MOST_ROWS) if len(curve.y) > MOST_ROWS else slice(None)
        r = one * np.maximum(0.0, 1 + gap * curve.y[rows] / panel.ring)
        parts.append(
            f'<path d="{_path(cx + r * np.cos(curve.x[rows]), cy - r * np.sin(curve.x[rows]))}" {_stroke(curve)}/>'
        )
    for mark in panel.marks:
        away = one * (1 + gap * mark.y / panel.ring)
        a, b = cx + away * math.cos(mark.x), cy - away * math.sin(mark.x)
        side = round(math.cos(mark.x))
        parts.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="4" fill="var(--{named(mark.colour)})"/>')
        inner = 0.42 * one
        parts.append(_text(cx + inner * math.cos(mark.x), cy - inner * math.sin(mark.x) + 4, mark.text,
                           f"font-size='11' text-anchor='{('start', 'middle', 'end')[side + 1]}'"))  # fmt: skip
    for k in range(-panel.rings, panel.rings + 1):
        at = one * (1 + gap * k) * math.sqrt(0.5)
        text = minus(f"{k * panel.ring:+g} µm") if k else "0"
        parts.append(_text(cx + at, cy - at + 4, text, "text-anchor='middle' font-size='10.5'", MUTED))
    for k, line in enumerate(panel.note.split("\n")):
        parts.append(_text(cx, cy + 14 * k - 4, line, "text-anchor='middle' font-size='11'", MUTED))
    return "".join(parts)


def _grid(grid: Grid, width: float) -> str:
    left, top = min(260.0, 16 + 6.4 * max(map(len, grid.rows))), _over(grid)
    wide, count = width - left - 8, len(grid.columns)
    cell = min(wide / count, (wide - SLANTED * len(grid.columns[-1])) / (count - 0.5))
    parts = [_text(4, 15, grid.title, "font-weight='600'")]
    for j, name in enumerate(grid.columns):
        parts.append(
            _text(
                0,
                0,
                name,
                f"font-size='11' transform='translate({left + (j + 0.5) * cell:.1f} {top - 6:g}) rotate(-40)'",
            )
        )
    for i, name in enumerate(grid.rows):
        parts.append(_text(left - 8, top + 24 * i + 16, name, "font-size='11' text-anchor='end'"))
        for j in range(len(grid.columns)):
            value = float(grid.values[i, j])
            if not math.isfinite(value):
                continue
            deep, negative = share_of(value, grid)
            colour = "vermillion" if negative else "blue"
            box = f'x="{left + j * cell:.1f}" y="{top + 24 * i:g}" width="{cell:.1f}" height="24"'
            parts.append(f'<rect {box} fill="var(--{colour})" fill-opacity="{deep:.2f}" stroke="var(--grid)"/>')
            if cell >= 30:
                weight = " font-weight='700'" if grid.bold is not None and grid.bold[i, j] else ""
                parts.append(_text(left + (j + 0.5) * cell, top + 24 * i + 16, cell_text(value, grid),
                                   f"font-size='11' text-anchor='middle'{weight}"))  # fmt: skip
    if grid.best is not None:
        i, j = grid.best
        box = f'x="{left + j * cell:.1f}" y="{top + 24 * i:g}" width="{cell:.1f}" height="24"'
        parts.append(f'<rect {box} fill="none" stroke="var(--ink)" stroke-width="2.2"/>')
    return "".join(parts)


def share_of(value: float, grid: Grid) -> tuple[float, bool]:
    """How deep the colour of a cell is, from 0 to 1, and whether it is that of negative values."""
    low, high = grid.span
    signs = low < 0 < high
    share = abs(value) / max(-low, high) if signs else (value - low) / (high - low or 1)
    return 0.75 * min(1.0, max(0.0, share)), signs and value < 0


def cell_text(value: float, grid: Grid) -> str:
    """The number of a cell."""
    return three(value) if grid.decimals is None else minus(f"{value:.{grid.decimals}f}")


def _over(grid: Grid) -> float:
    return 36 + 4.3 * max(map(len, grid.columns))


def _scaled(value: Array | float, span: tuple[float, float], first: float, last: float, log: bool) -> Array:
    v, (low, high) = np.asarray(value, dtype=float), span
    if log:
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.log10(np.where(v > 0, v, np.nan))
        low, high = math.log10(low), math.log10(high)
    return np.asarray(first + (v - low) / ((high - low) or 1.0) * (last - first))


def _path(a: Array, b: Array) -> str:
    known = np.isfinite(a) & np.isfinite(b)
    begins = known & ~np.concatenate([[False], known[:-1]])
    return "".join(
        f"{'M' if begin else 'L'}{x:.1f} {y:.1f}"
        for x, y, begin, there in zip(a.tolist(), b.tolist(), begins.tolist(), known.tolist(), strict=True)
        if there
    )


def _stroke(curve: Curve, width: float | None = None) -> str:
    faint = ' stroke-opacity=".4"' if curve.faint else ""
    look = f'stroke="var(--{named(curve.colour)})" stroke-width="{width or curve.width:g}"'
    return f'{look} fill="none"{DASHES[curve.dash]}{faint}'


def _text(x: float, y: float, text: str, look: str = "", colour: str = INK) -> str:
    if not text:
        return ""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="var(--{named(colour)})" {look}>{escape(text)}</text>'
