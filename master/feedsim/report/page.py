"""report.html: one page without external requests, for light and dark screens and for paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape

from feedsim.analysis import Figure
from feedsim.report.style import LARGEST_SVG, Picture, css_variables
from feedsim.report.summary import HEADER, Run, is_leading, real_time_factor
from feedsim.report.tables import figures_table, minus, motions_table, provenance, shown, typeset

# Significant digits of a tile; the table has more.
TILE_DIGITS = 4
TILES = {
    "overshoot": "overshoot",
    "settling_time": "settling time",
    "duration": "duration of the motion",
    "peak_torque": "largest motor torque",
    "plateau_torque": "motor torque at constant speed",
    "rest_torque": "friction torque at rest",
    "ringing_frequency": "ringing frequency",
    "G": "circular deviation G",
    "F_max": "largest radial deviation F max",
    "F_min": "smallest radial deviation F min",
    "mean": "mean radius deviation",
}

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
.keys { display: grid; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.key { background: var(--card); border: 1px solid var(--grid); border-radius: 8px; padding: .6rem .85rem; }
.key b { display: block; font-size: 1.35rem; font-weight: 650; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
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


def page(run: Run, figures: Mapping[str, Figure], pictures: Sequence[Picture]) -> str:
    """HTML text of the report."""
    scenario, machine = run.scenario, run.scenario.machine
    style = STYLE % {"light": css_variables(dark=False), "dark": css_variables(dark=True)}
    notes = [*dict.fromkeys(note for note in (machine.note, scenario.note) if note)]
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(scenario.name)}</title>\n<style>{style}</style>\n</head>\n<body>",
        f"<header>\n<h1>{escape(scenario.name)}</h1>",
        f'<p class="muted">{escape(machine.name)} · {len(scenario.motions)} motion(s), '
        f"{run.program.duration:.4g} s</p>",
        _warnings(run.warnings),
        *(f'<p class="note">{escape(note)}</p>' for note in notes),
        _keys(figures),
        "</header>",
        "<main>",
        *(_figure(picture) for picture in pictures),
        figures_table(figures),
        motions_table(run),
        provenance(run),
        "</main>",
        _footer(run, figures),
        "</body>\n</html>\n",
    ]
    return "\n".join(part for part in parts if part)


def tile(name: str, figure: Figure) -> tuple[str, str]:
    """Value with unit, to TILE_DIGITS digits at most, and label of a figure's tile."""
    value, unit = shown(figure)
    if unit and sum(c.isdigit() for c in value.lstrip("−0.")) > TILE_DIGITS:
        rounded = float(f"{figure.value:.{TILE_DIGITS}g}")
        whole = len(f"{abs(rounded):.0f}") if abs(rounded) >= 1 else 0
        value = minus(f"{rounded:.{max(0, TILE_DIGITS - whole)}f}")
    prefix, _, key = name.partition(".")
    label = f"quadrant glitch, {key[7:]} reverses" if key.startswith("glitch_") else TILES.get(key, key)
    return f"{value} {unit}".strip(), f"{prefix.replace('#', ' no. ')}: {label}"


def _keys(figures: Mapping[str, Figure]) -> str:
    cards = []
    for name, figure in figures.items():
        if is_leading(name, HEADER):
            value, label = tile(name, figure)
            title = escape(typeset(figure.meaning), quote=True)
            words = ' class="words"' if value[-1:].isalpha() and not any(c.isdigit() for c in value) else ""
            cards.append(
                f'<div class="key" title="{title}"><b{words}>{escape(value)}</b><span>{escape(label)}</span></div>'
            )
    return f'<div class="keys">{"".join(cards)}</div>' if cards else ""


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<p><strong>Warning:</strong> {escape(warning)}</p>" for warning in warnings)
    return f'<div class="warning" role="alert">{items}</div>'


def _figure(picture: Picture) -> str:
    if len(picture.svg.encode()) <= LARGEST_SVG:
        image = picture.svg
    else:
        data = base64.b64encode(picture.png).decode("ascii")
        image = f'<img class="plot" alt="{escape(picture.title, quote=True)}" src="data:image/png;base64,{data}">'
    return (
        f'<figure id="{picture.stem}">\n<div class="scroll">{image}</div>\n<figcaption>'
        f"<strong>{escape(picture.title)}</strong>{escape(picture.caption)}</figcaption>\n</figure>"
    )


def _footer(run: Run, figures: Mapping[str, Figure]) -> str:
    factor = real_time_factor(run)
    speed = f" ({factor:.2g} times real time)" if factor is not None else ""
    defined = (
        'What each figure means stands beside it in the table <a href="#figures">Derived figures</a>; the full '
        "definitions come with the software (docs/figures.md). "
    )
    return (
        f"<footer><p>{defined if figures else ''}Values in full precision: summary.json; time series: result.csv. "
        f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}.</p></footer>"
    )
