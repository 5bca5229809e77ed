"""A polar panel of an SVG: deviations about the programmed circle, with rings and the directions of the plane."""

from __future__ import annotations

import math
from html import escape

import numpy as np

from feedsim.report.chart.layout import CLOSED, DASHES, FAINT, NEXT, OUTER
from feedsim.report.chart.model import Curve, Polar, extremes
from feedsim.report.chart.scales import round_step, tick_text
from feedsim.report.style import GRID, INK, MUTED, Array, named

# --- Shapes and words of an SVG as text, in pixels, coloured by the page's variables ----------------------------------


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


ROWS = 800  # of a turn


def draw_polar(panel: Polar, width: float, height: float, clip: str) -> str:
    """The panel, the circle in the middle; clip: an id of its own."""
    gap = panel.gap
    half = min(width, height - 24) / 2 - 20
    cx, cy, reach = width / 2, 24 + (height - 24) / 2, panel.ring * panel.rings
    outer = 1 + OUTER * gap * panel.rings
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
        turned = abs(math.sin((angle[-1] - angle[0]) / 2)) < NEXT
        closed = "Z" if turned and abs(deviation[-1] - deviation[0]) < CLOSED * reach else ""
        way = path(cx + away * np.cos(angle), cy - away * np.sin(angle))
        parts.append(f'<path d="{way}{closed}" {stroke(curve)}/>')
    parts.append("</g>")
    for k in range(-count, count + 1):
        at = radius(k * step) * math.sqrt(0.5)
        words = f"{'+' if k > 0 else ''}{tick_text(k * step)} µm" if k else "0"
        parts.append(text(cx + at, cy - at + 4, words, HALO.replace('"11"', '"10.5"', 1), MUTED, "middle"))
    inside = one * (1 - OUTER * gap)
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
