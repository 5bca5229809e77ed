"""A chart as a file of its own: SVG with colours as numbers, a size, and words above it; and PNG drawn from that.

The package resvg_py draws the PNG, with the font that matplotlib brings: text looks alike wherever it is drawn.
"""

from __future__ import annotations

import re
import textwrap
from html import escape
from importlib.util import find_spec
from pathlib import Path

from feedsim.extras import ask
from feedsim.report.chart.model import Chart
from feedsim.report.chart.shapes import BOLD, rectangle, text
from feedsim.report.chart.svg import WIDTH, svg
from feedsim.report.style import MUTED, PAGE_COLOURS

FONT = 'system-ui, "Segoe UI", Arial, "DejaVu Sans", sans-serif'
EDGE = 10.0  # pixels about the drawing
PIXELS = 1.75  # of a PNG for one of the SVG
REMARK_SIZE, CAPTION_SIZE = 8.0, 9.5
CAPTION_WIDTH = 170  # letters of a line


def standalone(chart: Chart, stem: str, title: str, caption: str = "", remark: str = "") -> str:
    """Text of an SVG file. caption: stands above the chart, below the title; without it there is neither."""
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
    drawn = svg(chart, stem, title)
    inside = drawn[drawn.index(">") + 1 : -len("</svg>")]
    wide, tall = WIDTH + 2 * EDGE, float(drawn.split('viewBox="')[1].split('"')[0].split()[-1]) + y + 2 * EDGE
    size = f'width="{wide:g}" height="{tall:g}" viewBox="0 0 {wide:g} {tall:g}"'
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(title)}" {size} font-size="12" '
            f'font-family="{escape(FONT)}">')  # fmt: skip
    ground = rectangle(0, 0, wide, tall, 'fill="var(--ground)"')
    body = f'{ground}<g transform="translate({EDGE:g} {EDGE:g})">{"".join(words)}<g transform="translate(0 {y:g})">'
    return f'<?xml version="1.0" encoding="utf-8"?>\n{coloured(head + body + inside)}</g></g></svg>\n'


def coloured(drawn: str) -> str:
    """An SVG with colours as numbers."""
    return re.sub(r"var\(--(\w+)\)", lambda match: PAGE_COLOURS[match[1]], drawn)


def png(drawn: str) -> bytes:
    """An SVG file as PNG. Raises MissingPackage."""
    ask("a drawing", "figures")
    from resvg_py import svg_to_bytes

    family = "DejaVu Sans"
    return bytes(svg_to_bytes(
        svg_string=drawn, zoom=PIXELS, skip_system_fonts=True, font_files=[str(file) for file in _fonts()],
        font_family=family, sans_serif_family=family,
    ))  # fmt: skip


def _fonts() -> list[Path]:
    """Plain and bold, of matplotlib's data: nothing of it is imported."""
    module_spec = find_spec("matplotlib")
    assert module_spec is not None
    assert module_spec.submodule_search_locations is not None
    folder = Path(module_spec.submodule_search_locations[0]) / "mpl-data" / "fonts" / "ttf"
    return [folder / "DejaVuSans.ttf", folder / "DejaVuSans-Bold.ttf"]
