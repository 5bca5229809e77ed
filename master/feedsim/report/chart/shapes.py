"""Shapes and words of an SVG as text, in pixels, coloured by the page's variables."""

from __future__ import annotations

from html import escape

import numpy as np

from feedsim.report.chart.layout import DASHES, FAINT
from feedsim.report.chart.model import Curve
from feedsim.report.style import INK, Array, named

# Words over curves.
HALO = 'font-size="11" paint-order="stroke" stroke="var(--ground)" stroke-width="3" stroke-linejoin="round"'
BOLD = 'font-weight="600"'


def fill(colour: str) -> str:
    """A colour of the palette as a page's variable."""
    return f"var(--{named(colour)})"


def text(x: float, y: float, words: str, look: str = "", colour: str = INK, anchor: str = "start") -> str:
    """Words with their foot at y; nothing where there are none."""
    if not words:
        return ""
    side = f' text-anchor="{anchor}"' if anchor != "start" else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{fill(colour)}"{side} {look}>{escape(words)}</text>'


def turned(x: float, y: float, words: str, angle: float, look: str = "") -> str:
    """Words turned about (x, y)."""
    place = f'transform="translate({x:.1f} {y:.1f}) rotate({angle:g})"'
    return f'<text {place} fill="{fill(INK)}" {look}>{escape(words)}</text>' if words else ""


def heading(words: str, x: float, room: float) -> str:
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
