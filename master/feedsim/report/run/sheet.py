"""Acceptance sheets of a run: readings, conditions, figures in the letters of ISO 230-2 and -4, limits, verdicts.

A figure passes where its magnitude and the uncertainty together keep within the limit, and fails where it exceeds the
limit by more than the uncertainty; between these it is not decided (the decision rule of ISO 14253-1).
Start with sheets_of().
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from feedsim.analysis import AccuracyTask, CircleTask, Figure, contour, tasks
from feedsim.analysis.circularity import Turn
from feedsim.files import sheets
from feedsim.files.trace import Trace
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report.content import Picture
from feedsim.report.formatting import minus
from feedsim.report.run.axis_plots import accuracy_picture, contour_picture
from feedsim.scenario import CircleTest, PositioningAccuracy, Scenario
from feedsim.scenario.model import OF_CIRCLES, OF_POSITIONING, Sheet

if TYPE_CHECKING:
    from feedsim.simulation.cosim import Run

HTML, CSV, XLSX = "sheet.html", "sheet.csv", "sheet.xlsx"
SIMULATED_REMARK = "Simulated by feedsim. Nothing was measured on a machine."
RULE = (
    "A figure passes where its magnitude and the uncertainty U (k = 2) together keep within the limit, and fails where "
    "it exceeds the limit by more than U; between these it is not decided (ISO 14253-1)."
)
# As the standard writes them: letter, place of the arrow.
STANDARD_SYMBOLS = {
    "A": "A", "A_up": "A↑", "A_down": "A↓", "R": "R", "R_up": "R↑", "R_down": "R↓", "B": "B", "B_mean": "B\u0305",
    "E": "E", "E_up": "E↑", "E_down": "E↓", "M": "M",
}  # fmt: skip
PASSES, FAILS, OPEN, NO_LIMIT_TEXT = "pass", "fail", "not decided", "–"
HEADS = ("Sheet", "Part", "Item", "Target [mm]", "Angle [deg]", "Approach", "Run", "Value", "Unit", "Limit", "Verdict")
EVERY, PRINTED = 1.0, 15.0  # [deg] between the readings of a circle: in the files, in print


@dataclass(frozen=True)
class Result:
    """A figure of a sheet: symbol, meaning, value [um], limit [um] (NaN: none), and whether it passes."""

    symbol: str
    meaning: str
    value: float
    limit: float
    verdict: str

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """As the sheet shows them."""
        limit = "–" if math.isnan(self.limit) else f"{self.limit:.2f}"
        return self.symbol, self.meaning, minus(f"{self.value:.2f}"), limit, self.verdict


@dataclass(frozen=True, eq=False)
class FilledSheet:
    """A sheet: title, standard, conditions, uncertainty [um], table of readings, figures, picture.

    Attributes:
        heads, numbers: the table of readings; NaN where a cell is empty. every: how many of its rows there are to one
            that is printed.
        readings: rows of sheet.csv behind "Sheet" and "Part".
    """

    title: str
    standard: str
    conditions: Sequence[tuple[str, str]]
    uncertainty: float
    heads: Sequence[str]
    numbers: Sequence[Sequence[float | str]]
    results: Sequence[Result]
    picture: Picture
    readings: Sequence[Sequence[str]] = field(default=())
    every: int = 1

    @property
    def rows(self) -> list[list[str]]:
        """The table of readings as it is printed."""
        return [
            [
                cell if isinstance(cell, str) else _print_value(cell, ".3f" if column else ".6g")
                for column, cell in enumerate(row)
            ]
            for row in self.numbers[:: self.every]
        ]

    @property
    def verdict(self) -> str:
        """Of all figures with a limit: fail if one fails, else not decided if one is, else pass; "" without limits."""
        outcome = {result.verdict for result in self.results} - {NO_LIMIT_TEXT}
        return next((name for name in (FAILS, OPEN, PASSES) if name in outcome), "")


def sheets_of(run: Run) -> list[FilledSheet]:
    """The sheets that the scenario asks for, one per evaluation with the key `sheet`."""
    result: list[FilledSheet] = []
    for item, task in zip(run.scenario.evaluate, tasks(run.scenario, run.program), strict=True):
        if isinstance(item, PositioningAccuracy) and item.sheet is not None and isinstance(task, AccuracyTask):
            result.append(_fill_positioning_sheet(run, task, item.sheet))
        elif isinstance(item, CircleTest) and item.sheet is not None and isinstance(task, CircleTask):
            result.append(_circle(run, task, item.sheet))
    return result


def in_workbook(scenario: Scenario) -> bool:
    """Whether a sheet asks for sheet.xlsx besides."""
    sheets = [item.sheet for item in scenario.evaluate if isinstance(item, PositioningAccuracy | CircleTest)]
    return any(sheet is not None and sheet.xlsx for sheet in sheets)


def limits_of(run: Run) -> dict[str, float]:
    """Figure -> its limit [um], of all sheets of a run."""
    asked = zip(run.scenario.evaluate, tasks(run.scenario, run.program), strict=True)
    return {
        f"{task.prefix}.{name}": 1e6 * limit
        for item, task in asked
        if isinstance(item, PositioningAccuracy | CircleTest) and item.sheet is not None
        for name, limit in item.sheet.limits.items()
    }


def verdict_line(sheet: FilledSheet) -> str:
    """ "Z: pass after ISO 230-2: A 1.31 um of 6 um"; "" without limits."""
    if not sheet.verdict:
        return ""
    words = {PASSES: "passes", FAILS: "FAILS", OPEN: "is not decided"}[sheet.verdict]
    judged = [result for result in sheet.results if result.verdict != NO_LIMIT_TEXT]
    telling = [result for result in judged if result.verdict == sheet.verdict] if sheet.verdict != PASSES else judged
    parts = [f"{result.symbol} {result.value:.2f} um (limit {result.limit:g} um)" for result in telling]
    return f"{sheet.title} {words} ({sheet.standard}): {', '.join(parts)}."


def judge_figure(value: float, limit: float, uncertainty: float) -> str:
    """Verdict on a figure; all in one unit. A figure that could not be determined is not decided."""
    if math.isnan(limit):
        return NO_LIMIT_TEXT
    if not math.isfinite(value):
        return OPEN
    if abs(value) + uncertainty <= limit:
        return PASSES
    return FAILS if abs(value) - uncertainty > limit else OPEN


def _results(
    figures: Mapping[str, Figure], symbols: Mapping[str, str], sheet: Sheet, known: Sequence[str]
) -> list[Result]:
    results = []
    for name in known:
        if (figure := figures.get(name)) is None:
            continue
        limit = 1e6 * sheet.limits.get(name, math.nan)
        verdict = judge_figure(figure.value, limit, 1e6 * sheet.uncertainty)
        meaning = figure.meaning.replace(" (ISO 230-2)", "").replace("ISO 230-4 ", "")
        results.append(Result(symbols[name], meaning, figure.value, limit, verdict))
    return results


def _fill_positioning_sheet(run: Run, task: AccuracyTask, sheet: Sheet) -> FilledSheet:
    accuracy, visits = task.accuracies(run.trace)[""], task.visits
    prefix = task.prefix
    rests = [visit.end - visit.begin for visit in visits.visits]
    conditions = [
        *_common(run),
        ("Axis under test", prefix.partition("#")[0]),
        ("Position by", "linear scale"),
        ("Targets", f"{len(visits.targets)}, from {1e3 * visits.targets[0]:.6g} to {1e3 * visits.targets[-1]:.6g} mm"),
        ("Approaches", f"{visits.runs} of each side of each target"),
        ("Rest at a target", f"{min(rests):.3g} s; read at its end"),
        *_stated_conditions(sheet),
    ]
    readings = 1e6 * accuracy.deviations
    heads = ("Target [mm]", "Approach", *(f"{k + 1}" for k in range(visits.runs)), "x\u0305 [µm]", "s [µm]", "B [µm]")
    numbers: list[Sequence[float | str]] = []
    csv_rows = []
    for i, target in enumerate(visits.targets):
        for side, arrow in enumerate("↑↓"):
            own = readings[side, i]
            B = float(1e6 * accuracy.B[i]) if side == 0 else math.nan
            numbers.append((float(1e3 * target), arrow, *map(float, own), float(1e6 * accuracy.mean[side, i]),
                            float(1e6 * accuracy.s[side, i]), B))  # fmt: skip
            csv_rows += [("deviation", f"{1e3 * target:.9g}", "", arrow, str(k + 1), f"{value:.6f}", "um")
                     for k, value in enumerate(own)]  # fmt: skip
    results = _results(accuracy.figures, STANDARD_SYMBOLS, sheet, OF_POSITIONING)
    picture = accuracy_picture(prefix, accuracy, f"sheet-{prefix.replace('#', '-')}")
    return FilledSheet(
        f"Positioning of {prefix}",
        "ISO 230-2",
        conditions,
        1e6 * sheet.uncertainty,
        heads,
        numbers,
        results,
        picture,
        csv_rows,
    )


def _circle(run: Run, task: CircleTask, sheet: Sheet) -> FilledSheet:
    turn, figures = task.turn, task.figures(run.trace)
    first, second = turn.axes
    plane = "".join(turn.axes) if turn.sense > 0 else "".join(reversed(turn.axes))
    symbols = {"G": f"G_{plane}", "G_b": f"G(b)_{first}{second}", "F_max": f"F_{plane},max",
               "F_min": f"F_{plane},min", "D": f"D_{first}{second}"}  # fmt: skip
    feed = 2 * math.pi * turn.radius / (turn.end - turn.begin) * 6e4
    conditions = [
        *_common(run),
        ("Plane", f"{first}-{second}"),
        ("Nominal path", f"diameter {2e3 * turn.radius:.6g} mm, feed {feed:.5g} mm/min"),
        ("Centre", ", ".join(f"{axis} {1e3 * at:.6g} mm" for axis, at in zip(turn.axes, turn.centre, strict=True))),
        ("Direction", " and ".join(SENSE_WORDS[turn.sense] for turn in task.turns)),
        ("Position by", "linear scales"),
        *_stated_conditions(sheet),
    ]
    names = [SENSE_WORDS[turn.sense] for turn in task.turns]
    grid = np.arange(0.0, 360.0, EVERY)
    curves = [_deviation(run.trace, turn, grid) for turn in task.turns]
    numbers = [(float(angle), *(float(curve[k]) for curve in curves)) for k, angle in enumerate(grid)]
    csv_rows = [("radial deviation", "", f"{angle:g}", name, "", f"{curve[k]:.6f}", "um")
            for name, curve in zip(names, curves, strict=True) for k, angle in enumerate(grid)]  # fmt: skip
    results = _results(figures, symbols, sheet, OF_CIRCLES)
    stem = f"sheet-{task.prefix.replace('#', '-')}"
    picture = contour_picture(run.trace, turn, stem, task.back, task.diagnosis(run.trace))
    heads = ("Angle [°]", *(f"{name} [µm]" for name in names))
    return FilledSheet(
        f"Circle {task.prefix}",
        "ISO 230-4",
        conditions,
        1e6 * sheet.uncertainty,
        heads,
        numbers,
        results,
        picture,
        csv_rows,
        every=round(PRINTED / EVERY),
    )


def _deviation(trace: Trace, turn: Turn, grid: np.ndarray) -> np.ndarray:
    """Radial deviation [um] at angles [deg] from the first axis."""
    result = contour(trace, turn)
    angle = np.rad2deg(result.angle) % 360.0
    order = np.argsort(angle, kind="stable")
    return np.asarray(np.interp(grid, angle[order], 1e6 * result.deviation[order], period=360.0))


def _common(run: Run) -> list[tuple[str, str]]:
    return [("Machine", run.scenario.machine.name), ("Kind of test", SIMULATED_REMARK), ("Scenario", run.scenario.name)]


def _stated_conditions(sheet: Sheet) -> list[tuple[str, str]]:
    return [*sheet.conditions.items(), ("Uncertainty U (k = 2)", f"{1e6 * sheet.uncertainty:g} µm")]


def _print_value(value: float, digits: str) -> str:
    return "" if math.isnan(value) else minus(f"{value:{digits}}")


def table(filled: Sequence[FilledSheet]) -> str:
    """sheet.csv: conditions, readings and figures, a row each, with the columns HEADS."""
    rows: list[Sequence[str]] = [HEADS]
    for sheet in filled:
        name = f"{sheet.title} ({sheet.standard})"
        rows += [[name, "condition", what, "", "", "", "", how, "", "", ""] for what, how in sheet.conditions]
        rows += [[name, "reading", *row, "", ""] for row in sheet.readings]
        for result in sheet.results:
            limit = "" if math.isnan(result.limit) else f"{result.limit:.9g}"
            verdict = "" if result.verdict == NO_LIMIT_TEXT else result.verdict
            rows.append([name, "figure", result.symbol, "", "", "", "", f"{result.value:.6f}", "um", limit, verdict])
    return sheets.text_of(rows)
