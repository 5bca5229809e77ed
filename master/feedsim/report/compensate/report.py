"""The report on a friction compensation: its page, summary.json and compensation.csv."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from feedsim import sheets
from feedsim.analysis import Figure
from feedsim.analysis.compensation import Compensation
from feedsim.analysis.compensation_errors import Quality
from feedsim.report.compensate.plots import pictures_of
from feedsim.report.content import FOLDER, Report, Section, Table, Text, Tile, code, typed
from feedsim.report.formatting import display_unit, minus, powers, typeset
from feedsim.report.provenance import InputFile, Parameter, axis_parameters, hashed, inputs_part, quantity
from feedsim.report.run.files import summary as summary_of_run
from feedsim.report.run.report import motions_section, provenance
from feedsim.report.sections import figures_footer, figures_section, files_table
from feedsim.report.style import remarked
from feedsim.report.uncertainty import BANDS

RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE = "result.csv", "uncompensated.csv", "feedforward.csv", "compensation.csv"
FILES = (RESULT, UNCOMPENSATED, FEEDFORWARD, TABLE, BANDS)  # besides report.html and summary.json

Row = tuple[str, float, str, Quality]


def report_of(compensation: Compensation, files: Mapping[str, Path]) -> Report:
    """Content of the report. files: axis -> file of its compensation's friction."""
    scenario = compensation.scenario
    with remarked(f"{scenario.machine.name}. {scenario.machine.note}"):
        pictures = pictures_of(compensation)
    return Report(
        f"Friction compensation: {scenario.name}",
        f"{scenario.machine.name} · torque feedforward on {', '.join(compensation.frictions)}",
        answer=answers(compensation),
        warnings=compensation.warnings,
        notes=(scenario.machine.note, scenario.note),
        tiles=list(_tiles(compensation)),
        next_step=(
            "See what becomes of it as the machine wears or warms:\n",
            code(f"feedsim tune feedforward {typed(scenario.file)} --table"),
        )
        if not compensation.table
        else ("Lay it over another run:\n", code(f"feedsim diff {FOLDER} OTHER_FOLDER")),
        main=[
            *pictures,
            _errors(compensation) if compensation.table else None,
            _effects(compensation) if compensation.changed else None,
            _frictions(compensation, files),
            figures_section(compensation.figures),
            motions_section(compensation.after),
        ],
        provenance=provenance(compensation.after),
        footer=figures_footer(
            "Values in full precision: summary.json; time series: result.csv, uncompensated.csv, feedforward.csv.",
            "docs/figures.md, docs/compensation.md",
        ),
    )


def answers(compensation: Compensation) -> list[str]:
    """What the compensation takes away, and what its errors would leave of that."""
    figures = compensation.figures
    named = [("G", "the circular deviation G")]
    named += [(f"glitch_{axis}", f"the quadrant glitch of {axis}") for axis in compensation.turn.axes]
    reported = [
        f"{what} from {_um(figures[f'before.{key}'])} to {_um(figures[f'after.{key}'])} um" for key, what in named
    ]
    lines = [f"Friction compensation takes {', '.join(reported[:-1])} and {reported[-1]}."]
    if compensation.table:
        worst = max(compensation.table, key=lambda variation: variation.quality.G)
        lines.append(
            f"It is as good as its model: {worst.what} wrong by {worst.change:+.3g} {worst.unit} leaves G at "
            f"{1e6 * worst.quality.G:.2f} um."
        )
    if compensation.changed:
        most = max(compensation.changed, key=lambda changed: changed.after.G)
        lines.append(
            f"With {most.words} it takes G from {1e6 * most.before.G:.2f} to {1e6 * most.after.G:.2f} um, the largest "
            "of the effects that were tried."
        )
    return lines


def _tiles(compensation: Compensation) -> Iterable[Tile]:
    figures = compensation.figures
    named = [("G", "circular deviation G")]
    named += [(f"glitch_{axis}", f"quadrant glitch, {axis} reverses") for axis in compensation.turn.axes]
    for key, label in named:
        before, after = figures[f"before.{key}"], figures[f"after.{key}"]
        yield Tile(f"{_um(before)} → {_um(after)} µm", label, typeset(f"without and {after.meaning}"))
    for axis in compensation.frictions:
        delay = figures[f"{axis}.delay"]
        yield Tile(minus(f"{delay.value:.3g} ms"), f"{axis}: delay of the feedforward", typeset(delay.meaning))


def _um(figure: Figure) -> str:
    """To 0.01 um; what is smaller to its first digit."""
    small = 0 < abs(figure.value) < 0.01
    return minus(powers(f"{figure.value:.1g}" if small else f"{figure.value:.2f}"))


def _errors(compensation: Compensation) -> Section:
    """Peaks, dips and G for every error."""
    rows = []
    for what, change, unit, quality in rows_of(compensation):
        numbers = [*quality.peak.values(), *quality.dip.values(), quality.G]
        amount = minus(f"{change:+.3g} {unit}") if unit else ""
        rows.append((what, amount, *(minus(f"{1e6 * number:.3f}") for number in numbers)))
    entry = [f"{kind}, {axis} reverses [µm]" for kind in ("glitch", "dip") for axis in compensation.turn.axes]
    note = (
        "An error of the delay or of a parameter, of all axes at once. Glitch and dip: largest and smallest radius "
        "deviation within ±45° of the reversals of an axis, less the median of the turn. Too little compensation "
        "leaves glitches, too much leaves dips."
    )
    table = Table("lrr" + "r" * len(entry), ("Compensation", "Error", *entry, "G [µm]"), rows, note)
    return Section("What errors cost", [table], "errors")


def _effects(compensation: Compensation) -> Section:
    """G and peaks on changed machines, without and with the same compensation."""
    rows: list[tuple[Text, ...]] = []
    nominal = ("as the machine file has it", compensation.left_before, compensation.left_after)
    for words, before, after in (
        nominal,
        *((entry.words, entry.before, entry.after) for entry in compensation.changed),
    ):
        cells = [1e6 * quality.G for quality in (before, after)]
        cells += [
            1e6 * max(quality.peak[axis], -quality.dip[axis])
            for axis in compensation.turn.axes for quality in (before, after)
        ]  # fmt: skip
        rows.append((words, *(minus(f"{cell:.2f}") for cell in cells)))
    item = ["G without [µm]", "with"]
    for axis in compensation.turn.axes:
        item += [f"peak or dip, {axis} reverses, without [µm]", "with"]
    note = "The same compensation on a changed machine. The sizes are usual ones, not measured ones."
    table = Table("l" + "r" * len(item), ("Machine", *item), rows, note)
    return Section("With other effects of the machine", [table], "effects")


def _cell(value: Parameter) -> str:
    return value if isinstance(value, str) else minus(f"{value:.6g}")


def _frictions(compensation: Compensation, files: Mapping[str, Path]) -> Section:
    """Parameters of the compensation beside the machine's own."""
    machine = compensation.scenario.machine
    sets = []
    for axis, friction in compensation.frictions.items():
        own = machine.axes[axis]
        sets += [axis_parameters(axis)["friction"] for axis in (own.model_copy(update={"friction": friction}), own)]
    rows: list[tuple[Text, ...]] = []
    for name in dict.fromkeys(name for entry in sets for name in entry):
        result = [entry.get(name) for entry in sets]
        unit = next(value[1] for value in result if value is not None)
        rows.append((code(name), display_unit(unit), *(_cell(v[0]) if v else "–" for v in result)))
    whose = [f"{axis}, {whose}" for axis in compensation.frictions for whose in ("compensation", "machine")]
    table = Table("ll" + "r" * len(whose), ("Parameter", "SI unit", *whose), rows)
    given = files_table(friction_files(files)) if files else None
    return Section("Friction of the compensation and of the machine", [table, given])


def rows_of(compensation: Compensation) -> list[Row]:
    """What is compensated with, its error with unit, and what is left: first nothing, then the set as it is."""
    return [
        ("none", 0.0, "", compensation.left_before),
        ("as computed", 0.0, "", compensation.left_after),
        *((variation.what, variation.change, variation.unit, variation.quality) for variation in compensation.table),
    ]


def table_csv(compensation: Compensation) -> str:
    """The table as CSV."""
    axes = compensation.turn.axes
    columns = [f"{kind}_{axis} [um]" for kind in ("peak", "dip") for axis in axes]
    rows: list[Sequence[str]] = [["compensation", "error", "unit of the error", *columns, "G [um]"]]
    for what, change, unit, quality in rows_of(compensation):
        numbers = [*quality.peak.values(), *quality.dip.values(), quality.G]
        rows.append([what, f"{change:.6g}", unit, *(f"{1e6 * number:.6g}" for number in numbers)])
    return sheets.text_of(rows)


def friction_files(files: Mapping[str, Path]) -> list[InputFile]:
    """Files of the frictions that the compensation uses, with their hashes."""
    return hashed([(f"friction of the compensation of {axis}", path) for axis, path in files.items()])


def summary(compensation: Compensation, files: Mapping[str, Path], written: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json: that of the compensated run, with the compensation and both runs' figures."""
    content = summary_of_run(compensation.after, compensation.figures, written)
    machine = compensation.scenario.machine
    content["warnings"] = list(compensation.warnings)
    content["inputs"] += inputs_part(friction_files(files))
    content["compensation"] = {
        "turn": {
            "plane": list(compensation.turn.axes),
            "begin": quantity(compensation.turn.begin, "s"),
            "end": quantity(compensation.turn.end, "s"),
        },
        "axes": {
            axis: {
                "delay": quantity(compensation.delays[axis], "s"),
                "delay_from": "the drive's parameters" if axis in compensation.lags else "given",
                "friction_from": files[axis].name if axis in files else "the machine",
                "friction": {
                    name: quantity(value, unit)
                    for name, (value, unit) in axis_parameters(
                        machine.axes[axis].model_copy(update={"friction": friction})
                    )["friction"].items()
                },
            }
            for axis, friction in compensation.frictions.items()
        },
        "effects": [
            {
                "with": entry.words,
                "G_before": quantity(1e6 * entry.before.G, "um"),
                "G_after": quantity(1e6 * entry.after.G, "um"),
            }
            for entry in compensation.changed
        ],
        "errors": [
            {
                "of": what,
                "change": quantity(change, unit),
                "G": quantity(1e6 * quality.G, "um"),
                **{
                    f"{kind}_{axis}": quantity(1e6 * value, "um")
                    for kind, values in (("peak", quality.peak), ("dip", quality.dip))
                    for axis, value in values.items()
                },
            }
            for what, change, unit, quality in rows_of(compensation)[2:]
        ],
    }
    return content


def summary_line(compensation: Compensation) -> str:
    """G and glitches before and after, in one line."""
    keys = ["G", *(f"glitch_{axis}" for axis in compensation.turn.axes)]
    figures = compensation.figures
    pairs = ((key, figures[f"before.{key}"], figures[f"after.{key}"]) for key in keys)
    return ", ".join(f"{key} {before.value:.3g} -> {after.value:.3g} {after.unit}" for key, before, after in pairs)
