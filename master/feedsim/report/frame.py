"""The frame of every report page: head, style, warnings, notes, tiles, pictures, footer.

One page without external requests, for light and dark screens and for paper.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from feedsim.analysis import Figure
from feedsim.report.formatting import minus, shown
from feedsim.report.style import LARGEST_SVG, Picture, css_variables

# Significant digits of a tile; the table has more.
TILE_DIGITS = 4

STYLE = """
:root { color-scheme: light dark; %(light)s --ground: #ffffff; --card: #f6f8fa; }
@media (prefers-color-scheme: dark) { :root { %(dark)s --ground: #14181d; --card: #1c2229; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1.25rem 3rem; max-width: 72rem; background: var(--ground); color: var(--ink);
  font: 16px/1.5 system-ui, "Segoe UI", Arial, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .7rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .3rem 0; }
.muted, figcaption, footer { color: var(--muted); }
.keys { display: grid; grid-template-columns: repeat(auto-fill, minmax(12rem, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.key { background: var(--card); border: 1px solid var(--grid); border-radius: 8px; padding: .6rem .85rem;
  min-width: 0; overflow-wrap: anywhere; }
.key b { display: block; font-size: 1.35rem; font-weight: 650; line-height: 1.3;
  font-variant-numeric: tabular-nums; }
.key b small { font-size: .72em; font-weight: 500; }
.key b.words { font-size: 1rem; line-height: 2.03rem; }
.key span { color: var(--muted); font-size: .88rem; }
figure { margin: 1rem 0 2rem; }
svg.plot, img.plot { display: block; width: 100%%; min-width: 44rem; height: auto; }
svg.plot * { stroke-linejoin: round; stroke-linecap: butt; }
img.plot { background: #fefefe; border-radius: 6px; }
figcaption { font-size: .92rem; max-width: 62rem; margin-top: .5rem; }
figcaption strong { color: var(--ink); display: block; }
.scroll { overflow-x: auto; }
td.meaning { min-width: 18rem; }
table { border-collapse: collapse; width: 100%%; font-size: .93rem; }
th, td { text-align: left; vertical-align: top; padding: .32rem .8rem .32rem 0; border-bottom: 1px solid var(--grid); }
th { font-weight: 600; color: var(--muted); }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
code { font: .9em ui-monospace, "SFMono-Regular", Consolas, monospace; }
td code { white-space: nowrap; }
.warning { border: 2px solid var(--vermillion); border-radius: 8px; background: var(--card); padding: .5rem .9rem;
  margin: 1rem 0; }
.warning strong { color: var(--vermillion); }
.note { border-left: 4px solid var(--orange); background: var(--card); padding: .55rem .9rem; margin: 1rem 0; }
.provenance table { font-size: .84rem; margin-bottom: .9rem; }
footer { margin-top: 2.5rem; font-size: .85rem; }
@media print {
  :root { %(light)s --ground: #ffffff; --card: #ffffff; }
  body { max-width: none; padding: 0; font-size: 10.5pt; }
  h1 { font-size: 16pt; } h2 { font-size: 12pt; margin: 14pt 0 4pt; } h3 { font-size: 10pt; }
  .note, .warning { padding: 3pt 8pt; margin: 6pt 0; }
  .keys { grid-template-columns: repeat(4, minmax(0, 1fr)); gap: 5pt; margin: 8pt 1px; }
  .key { padding: 3pt 6pt; } .key b { font-size: 12pt; } .key b.words { font-size: 10pt; line-height: 18pt; }
  .key span { font-size: 8pt; line-height: 1.2; display: block; }
  .scroll { overflow: visible; } td.meaning { min-width: 0; }
  figure { margin: 6pt 0 10pt; } figcaption { font-size: 8.5pt; line-height: 1.35; }
  svg.plot, img.plot { min-width: 0; max-height: 150mm; object-fit: contain; }
  table { font-size: 8.5pt; } th, td { padding: 1.5pt 6pt 1.5pt 0; } thead { display: table-header-group; }
  .provenance table, footer { font-size: 7pt; } .provenance table { margin-bottom: 6pt; }
  .provenance th, .provenance td { padding: .6pt 6pt .6pt 0; } .provenance h3 { font-size: 8.5pt; margin: 6pt 0 2pt; }
  main p { font-size: 8.5pt; } .provenance p { font-size: 7pt; margin: 0 0 6pt; }
  h2, h3 { break-after: avoid; } figure, .key, .note, .warning, tr { break-inside: avoid; }
  @page { size: A4; margin: 16mm 15mm; }
}
"""


@dataclass(frozen=True)
class Tile:
    """A number at the top of a page: value with unit, what it is, and its full meaning."""

    value: str
    label: str
    meaning: str


def tile_value(figure: Figure) -> str:
    """Value with unit, to TILE_DIGITS digits at most."""
    value, unit = shown(figure)
    if unit and sum(c.isdigit() for c in value.lstrip("−0.")) > TILE_DIGITS:
        rounded = float(f"{figure.value:.{TILE_DIGITS}g}")
        whole = len(f"{abs(rounded):.0f}") if abs(rounded) >= 1 else 0
        value = minus(f"{rounded:.{max(0, TILE_DIGITS - whole)}f}")
    return f"{value} {unit}".strip()


def frame(
    title: str,
    subtitle: str,
    *,
    warnings: Sequence[str],
    notes: Sequence[str],
    tiles: Sequence[Tile],
    main: Sequence[str],
    footer: str,
) -> str:
    """HTML text of a page. title, subtitle, warnings and notes are plain text; main (sections) and footer are HTML."""
    style = STYLE % {"light": css_variables(dark=False), "dark": css_variables(dark=True)}
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{style}</style>\n</head>\n<body>",
        f"<header>\n<h1>{escape(title)}</h1>",
        f'<p class="muted">{escape(subtitle)}</p>',
        _warnings(warnings),
        *(f'<p class="note">{escape(note)}</p>' for note in dict.fromkeys(notes) if note),
        _tiles(tiles),
        "</header>",
        "<main>",
        *main,
        "</main>",
        f"<footer><p>{footer}</p></footer>",
        "</body>\n</html>\n",
    ]
    return "\n".join(part for part in parts if part)


def picture_section(picture: Picture) -> str:
    """A picture with its title and caption: as SVG, or as PNG where that would be large."""
    if len(picture.svg.encode()) <= LARGEST_SVG:
        image = picture.svg
    else:
        data = base64.b64encode(picture.png).decode("ascii")
        image = f'<img class="plot" alt="{escape(picture.title, quote=True)}" src="data:image/png;base64,{data}">'
    return (
        f'<figure id="{picture.stem}">\n<div class="scroll">{image}</div>\n<figcaption>'
        f"<strong>{escape(picture.title)}</strong>{escape(picture.caption)}</figcaption>\n</figure>"
    )


def _tiles(tiles: Sequence[Tile]) -> str:
    cards = []
    for tile in tiles:
        title = escape(tile.meaning, quote=True)
        words = ' class="words"' if tile.value[-1:].isalpha() and not any(c.isdigit() for c in tile.value) else ""
        cards.append(
            f'<div class="key" title="{title}"><b{words}>{_with_unit(tile.value)}</b>'
            f"<span>{escape(tile.label)}</span></div>"
        )
    return f'<div class="keys">{"".join(cards)}</div>' if cards else ""


def _with_unit(value: str) -> str:
    """HTML of a value, its unit in smaller print."""
    number, blank, unit = value.rpartition(" ")
    if not any(c.isdigit() for c in number) or any(c.isdigit() for c in unit.rstrip("²³")):
        return escape(value)
    return f"{escape(number)}{blank}<small>{escape(unit)}</small>"


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<p><strong>Warning:</strong> {escape(warning)}</p>" for warning in warnings)
    return f'<div class="warning" role="alert">{items}</div>'
