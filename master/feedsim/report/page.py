"""report.html: one page without external requests, for light and dark screens and for paper."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Mapping, Sequence
from html import escape

from feedsim.analysis import Figure
from feedsim.report.style import LARGEST_SVG, Picture, css_variables
from feedsim.report.summary import HEADER, Run, is_leading, real_time_factor, software

DISPLAY_UNITS = {"um": "µm", "N.m": "N·m", "1": ""}

STYLE = """
:root { color-scheme: light dark; %(light)s --ground: #ffffff; --card: #f6f8fa; }
@media (prefers-color-scheme: dark) { :root { %(dark)s --ground: #14181d; --card: #1c2229; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1.25rem 3rem; max-width: 72rem; background: var(--ground); color: var(--ink);
  font: 16px/1.5 system-ui, "Segoe UI", Arial, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .7rem; }
p { margin: .3rem 0; }
.muted, figcaption, footer { color: var(--muted); }
.keys { display: grid; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.key { background: var(--card); border: 1px solid var(--grid); border-radius: 8px; padding: .6rem .85rem; }
.key b { display: block; font-size: 1.35rem; font-weight: 650; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
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
.note { border-left: 4px solid var(--orange); background: var(--card); padding: .55rem .9rem; margin: 1rem 0; }
footer { margin-top: 2.5rem; font-size: .85rem; }
@media print {
  :root { %(light)s --ground: #ffffff; --card: #ffffff; }
  body { max-width: none; padding: 0; font-size: 10.5pt; }
  svg.plot, img.plot { min-width: 0; } h2 { break-after: avoid; } figure, .key, tr { break-inside: avoid; }
  @page { size: A4; margin: 16mm 15mm; }
}
"""


def page(run: Run, figures: Mapping[str, Figure], pictures: Sequence[Picture], warnings: Sequence[str] = ()) -> str:
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
        *(f'<p class="note">{escape(note)}</p>' for note in notes),
        *(f'<p class="note">Warning: {escape(warning)}</p>' for warning in warnings),
        _keys(figures),
        "</header>",
        "<main>",
        *(_figure(picture) for picture in pictures),
        _figures_table(figures),
        _motions_table(run),
        _provenance(run),
        "</main>",
        _footer(run),
        "</body>\n</html>\n",
    ]
    return "\n".join(part for part in parts if part)


def shown(figure: Figure) -> tuple[str, str]:
    """Value and unit for display; an en dash where the value is not determined."""
    unit = DISPLAY_UNITS.get(figure.unit, figure.unit)
    if not math.isfinite(figure.value):
        return "–", unit
    digits = {"um": 2, "ms": 1, "Hz": 2, "N.m": 3, "s": 4}.get(figure.unit)
    text = f"{figure.value:.{digits}f}" if digits is not None else f"{figure.value:.5g}"
    return text.replace("-", "−"), unit


def _keys(figures: Mapping[str, Figure]) -> str:
    cards = []
    for name, figure in figures.items():
        if is_leading(name, HEADER):
            value, unit = shown(figure)
            label = name.replace(".", " ").replace("_", " ").replace("#", " no. ")
            title = escape(_typeset(figure.meaning), quote=True)
            cards.append(
                f'<div class="key" title="{title}"><b>{value} {escape(unit)}</b><span>{escape(label)}</span></div>'
            )
    return f'<div class="keys">{"".join(cards)}</div>' if cards else ""


def _typeset(text: str) -> str:
    return re.sub(r"\bum\b", "µm", text.replace("+-", "±"))


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


def _figures_table(figures: Mapping[str, Figure]) -> str:
    if not figures:
        return ""
    rows = []
    for name, figure in figures.items():
        value, unit = shown(figure)
        rows.append(
            f'<tr><td><code>{escape(name)}</code></td><td class="number">{value}</td><td>{escape(unit)}</td>'
            f'<td class="meaning">{escape(_typeset(figure.meaning))}</td></tr>'
        )
    return (
        '<h2>Derived figures</h2>\n<div class="scroll"><table><thead><tr><th>Figure</th>'
        f'<th class="number">Value</th><th>Unit</th><th>Meaning</th></tr></thead>\n'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _motions_table(run: Run) -> str:
    rows = "".join(
        f'<tr><td class="number">{segment.index}</td><td>{escape(segment.description)}</td>'
        f'<td class="number">{segment.start:.4f}</td><td class="number">{segment.end:.4f}</td></tr>'
        for segment in run.program.segments[:200]
    )
    more = len(run.program.segments) - 200
    tail = f'<p class="muted">and {more} more</p>' if more > 0 else ""
    return (
        '<h2>Motions</h2>\n<div class="scroll"><table><thead><tr><th class="number">No.</th><th>Motion</th>'
        f'<th class="number">Start [s]</th><th class="number">End [s]</th></tr></thead>\n'
        f"<tbody>{rows}</tbody></table></div>{tail}"
    )


def _provenance(run: Run) -> str:
    scenario, machine = run.scenario, run.scenario.machine
    cycles = machine.cycles
    rows = [
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Changed from outside", ", ".join(scenario.overrides) or "nothing"),
        ("Machine", machine.name),
        ("Cycles", f"T_c {cycles.T_c * 1e6:g} µs, T_pos {cycles.T_pos * 1e3:g} ms, T_ipo {cycles.T_ipo * 1e3:g} ms"),
        ("Coupling", f"{scenario.coupling.scheme}, {scenario.coupling.substeps} exchange step(s) per control cycle"),
        ("Recording", f"every {scenario.recording.interval * 1e6:g} µs, {len(run.trace)} rows"),
        *(
            (f"Unit {name}", f"version {unit.get('version', '?')}, GUID {unit.get('guid', '?')}")
            for name, unit in run.units.items()
        ),
        *((f"Coupling energy {name}", f"{value:.4g} J") for name, value in run.coupling.items()),
        *((name, text) for name, text in software().items()),
    ]
    body = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows)
    return f'<h2>Where the numbers come from</h2>\n<div class="scroll"><table><tbody>{body}</tbody></table></div>'


def _footer(run: Run) -> str:
    factor = real_time_factor(run)
    speed = f" ({factor:.2g} times real time)" if factor is not None else ""
    return (
        f"<footer><p>Definitions of the figures: docs/figures.md. Values in full precision: "
        f"summary.json; time series: result.csv. {run.program.duration:.4g} s simulated "
        f"in {run.wall_time:.3g} s{speed}.</p></footer>"
    )
