"""A drawing as a file of its own: SVG with colours as numbers, a size, and words above it; and PNG drawn from that.

The package resvg_py draws the PNG, with the font of this room (a part of DejaVu Sans): text looks alike wherever it is
drawn.
"""

from __future__ import annotations

import re
import textwrap
from contextlib import ExitStack
from html import escape
from importlib import resources

from feedsim.extras import ask
from feedsim.report.chart.polar import BOLD, rectangle, text
from feedsim.report.chart.svg import WIDTH
from feedsim.report.style import MUTED, PAGE_COLOURS

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
    return f'<?xml version="1.0" encoding="utf-8"?>\n{coloured(head + body + inside)}</g></g></svg>\n'


def coloured(drawn: str) -> str:
    """An SVG with colours as numbers."""
    return re.sub(r"var\(--(\w+)\)", lambda match: PAGE_COLOURS[match[1]], drawn)


def png(drawn: str, pixels: float = PIXELS) -> bytes:
    """An SVG file as PNG, with so many pixels for one of it. Raises MissingPackage."""
    ask("a drawing", "figures")
    from resvg_py import svg_to_bytes

    family = "DejaVu Sans"
    with ExitStack() as stack:
        folder = resources.files("feedsim.report") / "fonts"
        fonts = [str(stack.enter_context(resources.as_file(folder / name))) for name in FONTS]
        return bytes(svg_to_bytes(
            svg_string=drawn, zoom=pixels, skip_system_fonts=True, font_files=fonts, font_family=family,
            sans_serif_family=family,
        ))  # fmt: skip
