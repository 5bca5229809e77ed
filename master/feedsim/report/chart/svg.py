"""A chart as text of an SVG, as the page draws it at first: for readers without script, for print, and for PNG.

Start with svg(), which places the panels; panel.py, polar.py and grid.py draw one. The page's script draws the same
(template/chart_draw.js). Colours are the page's variables.
"""

from __future__ import annotations

from html import escape

from feedsim.report.chart.grid import draw_grid, grid_height
from feedsim.report.chart.layout import BAND, BOTTOM, FILL, GAP, HEIGHT, LEFT, RIGHT, ROUND, TOP
from feedsim.report.chart.model import Band, Chart, Curve, Grid, Panel, Part, Polar
from feedsim.report.chart.panel import Frame, above, draw_panel, frame_of
from feedsim.report.chart.placing import Box
from feedsim.report.chart.polar import draw_polar
from feedsim.report.chart.shapes import circle, fill, line, rectangle, stroke, text

WIDTH = 960.0
FLAT = 360.0  # of a panel beside a polar one, at most


def svg(chart: Chart, stem: str, title: str) -> str:
    """Text of the SVG with ids of its own."""
    parts, top = _legend(chart)
    boxes, height = placed(chart)
    frames = {k: frame_of(part, boxes[k]) for k, part in enumerate(chart.panels) if isinstance(part, Panel)}
    for k, part in enumerate(chart.panels):
        x, y, wide, tall = boxes[k]
        name = f"{stem}-still-{k}"
        if isinstance(part, Polar):
            drawn = draw_polar(part, wide, tall, name)
        elif isinstance(part, Grid):
            drawn = draw_grid(part, wide)
        else:
            drawn = draw_panel(part, boxes[k], _shared(frames, boxes, k), _aside(chart), name)
        parts.append(f'<g transform="translate({x:g} {y + top:g})">{drawn}</g>')
    box = f"0 0 {WIDTH:g} {height + top:g}"
    head = f'<svg role="img" aria-label="{escape(title)}" class="plot" viewBox="{box}" font-size="12">'
    return head + "".join(parts) + "</svg>"


def placed(chart: Chart) -> tuple[list[Box], float]:
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
            lower = min(height, FLAT) if beside_a_circle and isinstance(part, Panel) else height
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
    return HEIGHT * part.height + BOTTOM + above(part) - TOP


def _aside(chart: Chart) -> float:
    """Room beside the curves at the right: panels below one another end alike."""
    second = any(isinstance(part, Panel) and part.y.also is not None for part in chart.panels)
    return LEFT if second else RIGHT


def _shared(frames: dict[int, Frame], boxes: list[Box], k: int) -> Frame:
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
