"""report.html of a machine's structure."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from feedsim.report.formatting import display_unit, minus, typeset
from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.machine.record import MEANINGS, USUAL_EXCHANGE, exchange
from feedsim.report.provenance import hashed, software
from feedsim.report.style import Picture
from feedsim.report.tables import files_table, pairs_table, table
from feedsim.structure.info import MachineInfo


def page(
    info: MachineInfo,
    files: Sequence[tuple[str, Path]],
    pictures: Sequence[Picture],
    animations: Sequence[tuple[bytes, str]],
) -> str:
    """HTML text of the report; animations: content of a GIF and its title."""
    solution = info.solution
    assert solution is not None
    return frame(
        f"Structure: {info.name}",
        f"{info.title} · {solution.shapes.shape[0]} degrees of freedom · modes up to "
        f"{solution.cutoff / (2 * math.pi):g} Hz",
        warnings=info.warnings,
        notes=[info.note],
        tiles=list(_tiles(info)),
        main=[
            *(picture_section(picture) for picture in pictures),
            *(_animation(content, title) for content, title in animations),
            _axes(info),
            _modes(info),
            _provenance(info, files),
        ],
        footer="Values in full precision: summary.json. Pictures: figures/.",
    )


def _animation(content: bytes, title: str) -> str:
    data = base64.b64encode(content).decode("ascii")
    return (
        f'<figure>\n<div class="scroll"><img class="plot" alt="{escape(title, quote=True)}" '
        f'src="data:image/gif;base64,{data}"></div>\n<figcaption><strong>{escape(title)}, in motion</strong>'
        "One period, slowed down and exaggerated.</figcaption>\n</figure>"
    )


def _tiles(info: MachineInfo) -> Iterator[Tile]:
    if math.isfinite(info.total_mass):
        yield Tile(f"{info.total_mass:.0f} kg", "total mass", "Mass of everything")
    elastic = info.modes.frequency[info.modes.frequency > 0]
    if len(elastic):
        yield Tile(f"{elastic[0]:.2f} Hz", "lowest elastic mode", "Frequency of the first mode that is not rigid")
    for axis in info.axes:
        if math.isfinite(axis.moving_mass):
            yield Tile(f"{axis.moving_mass:.0f} kg", f"{axis.name}: moving mass", MEANINGS["moving_mass"][1])


def _axes(info: MachineInfo) -> str:
    rows = []
    for key, (unit, meaning) in MEANINGS.items():
        values = [getattr(axis, key) for axis in info.axes]
        if not any(math.isfinite(value) for value in values):
            continue
        cells = "".join(f'<td class="number">{_number(value)}</td>' for value in values)
        rows.append(f"<tr><td>{escape(typeset(meaning))}</td><td>{escape(display_unit(unit))}</td>{cells}</tr>")
    heads = [("Figure", False), ("Unit", False), *((axis.name, True) for axis in info.axes)]
    share = f"{100 * USUAL_EXCHANGE.stable_share:.0f}"
    note = (
        f'<p class="muted">h = {info.step * 1e6:.6g} µs. The default exchange of plant and friction is stable '
        f"up to {share} % of 2 J_inf/h.</p>"
        + "".join(f'<p class="muted">{escape(typeset(line))}</p>' for line in exchange(info))
    )
    return f"<h2>Axes</h2>\n{table(heads, rows)}{note}" if info.axes else ""


def _modes(info: MachineInfo) -> str:
    assert info.solution is not None
    first_pseudo = len(info.modes.frequency) - info.solution.corrections
    rows = [
        f'<tr><td class="number">{k}</td><td class="number">{f:.3f}</td><td class="number">{100 * d:.3g}</td>'
        f"<td>{escape(('(static correction) ' if k >= first_pseudo else '') + info.moving[k])}</td></tr>"
        for k, (f, d) in enumerate(zip(info.modes.frequency.tolist(), info.modes.damping.tolist(), strict=True))
    ]
    heads = [("Mode", True), ("Frequency [Hz]", True), ("Damping [%]", True), ("What moves", False)]
    return "<h2>Modes</h2>\n" + table(heads, rows) + '<p class="muted">Shares of the kinetic energy.</p>'


def _provenance(info: MachineInfo, files: Sequence[tuple[str, Path]]) -> str:
    solution = info.solution
    assert solution is not None
    rows = [
        ("Eigenproblem", f"{solution.method}; {solution.verification}"),
        ("Dropped", f"{solution.dropped} modes above {solution.cutoff / (2 * math.pi):g} Hz"),
        ("Static correction", f"{solution.corrections} pseudo-modes" if solution.corrections else "none"),
        ("Software", ", ".join(f"{name} {text}" for name, text in software().items())),
    ]
    parts = ['<section class="provenance">\n<h2>Where the numbers come from</h2>', pairs_table(rows)]
    return "\n".join([*parts, files_table(hashed(list(files))), "</section>"])


def _number(value: float) -> str:
    return minus(f"{value:.5g}") if math.isfinite(value) else "–"
