"""report.html of a friction compensation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from feedsim.analysis import Figure
from feedsim.analysis.compensation import Compensation
from feedsim.report.compensate.summary import friction_files, rows_of
from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.provenance import axis_parameters
from feedsim.report.run_tables import motions_table, provenance
from feedsim.report.style import Picture
from feedsim.report.tables import figures_table, files_table, table
from feedsim.report.words import display_unit, minus, powers, typeset


def page(compensation: Compensation, files: dict[str, Path], pictures: Sequence[Picture]) -> str:
    """HTML text of the report. files: axis -> file of its compensation's friction."""
    scenario = compensation.scenario
    return frame(
        f"Friction compensation: {scenario.name}",
        f"{scenario.machine.name} · torque feedforward on {', '.join(compensation.frictions)}",
        warnings=compensation.warnings,
        notes=(scenario.machine.note, scenario.note),
        tiles=list(_tiles(compensation)),
        main=[
            *(picture_section(picture) for picture in pictures),
            _table(compensation) if compensation.table else "",
            _sets(compensation, files),
            figures_table(compensation.figures),
            motions_table(compensation.after),
            provenance(compensation.after),
        ],
        footer='What each figure means stands beside it in the table <a href="#figures">Derived figures</a>; the full '
        "definitions come with the software (docs/figures.md, docs/compensation.md). Values in full precision: "
        "summary.json; time series: result.csv, uncompensated.csv, feedforward.csv.",
    )


def _tiles(compensation: Compensation) -> Iterable[Tile]:
    figures = compensation.figures
    named = [("G", "circular deviation G")]
    named += [(f"glitch_{axis}", f"quadrant glitch, {axis} reverses") for axis in compensation.turn.axes]
    for key, label in named:
        before, after = figures[f"before.{key}"], figures[f"after.{key}"]
        yield Tile(f"{_um(before)} → {_um(after)} µm", label, typeset(f"without and {after.meaning}"))
    for axis in compensation.frictions:
        delay = figures[f"{axis}.delay"]
        yield Tile(minus(f"{delay.value:.3f} ms"), f"{axis}: delay of the feedforward", typeset(delay.meaning))


def _um(figure: Figure) -> str:
    """To 0.01 um; what is smaller to its first digit."""
    small = 0 < abs(figure.value) < 0.01
    return minus(powers(f"{figure.value:.1g}" if small else f"{figure.value:.2f}"))


def _table(compensation: Compensation) -> str:
    """Peaks, dips and G for every error."""
    axes = compensation.turn.axes
    rows = []
    for what, change, unit, quality in rows_of(compensation):
        numbers = [*quality.peak.values(), *quality.dip.values(), quality.G]
        cells = "".join(f'<td class="number">{minus(f"{1e6 * number:.3f}")}</td>' for number in numbers)
        amount = minus(f"{change:+.3g} {unit}") if unit else ""
        rows.append(f'<tr><td>{escape(what)}</td><td class="number">{amount}</td>{cells}</tr>')
    heads = [("Compensation", False), ("Error", True)]
    heads += [(f"peak, {axis} reverses [µm]", True) for axis in axes]
    heads += [(f"dip, {axis} reverses [µm]", True) for axis in axes]
    heads.append(("G [µm]", True))
    note = (
        '<p class="muted">An error of the delay or of a parameter, of all axes at once. Peak and dip: largest and '
        "smallest radius deviation within ±45° of the reversals of an axis, less the median of the turn. Too little "
        "compensation leaves peaks, too much leaves dips.</p>"
    )
    return '<h2 id="errors">What errors cost</h2>\n' + table(heads, rows) + note


def _sets(compensation: Compensation, files: dict[str, Path]) -> str:
    """Parameters of the compensation beside the machine's own."""
    machine = compensation.scenario.machine
    sets = []
    for axis, friction in compensation.frictions.items():
        own = machine.axes[axis]
        sets.append((axis_parameters(own.model_copy(update={"friction": friction})), axis_parameters(own)))
    names = dict.fromkeys(name for pair in sets for part in pair for name in part["friction"])
    rows = []
    for name in names:
        found = [part["friction"].get(name) for pair in sets for part in pair]
        unit = next(value[1] for value in found if value is not None)
        cells = "".join(f'<td class="number">{minus(f"{v[0]:.6g}") if v else "–"}</td>' for v in found)
        rows.append(f"<tr><td><code>{escape(name)}</code></td><td>{escape(display_unit(unit))}</td>{cells}</tr>")
    heads = [("Parameter", False), ("SI unit", False)]
    heads += [(f"{axis}, {whose}", True) for axis in compensation.frictions for whose in ("compensation", "machine")]
    given = files_table(friction_files(files)) if files else ""
    return "<h2>Friction of the compensation and of the machine</h2>\n" + table(heads, rows) + given
