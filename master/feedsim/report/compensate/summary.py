"""summary.json and compensation.csv of a friction compensation, and the result in one line."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from feedsim.analysis.compensation import Compensation, Quality
from feedsim.report.provenance import InputFile, axis_parameters, hashed
from feedsim.report.run.summary import summary as summary_of_run
from feedsim.report.summary import inputs_part, quantity

Row = tuple[str, float, str, Quality]


def rows_of(compensation: Compensation) -> list[Row]:
    """What is compensated with, its error with unit, and what is left: first nothing, then the set as it is."""
    return [
        ("none", 0.0, "", compensation.left_before),
        ("as computed", 0.0, "", compensation.left_after),
        *((each.what, each.change, each.unit, each.quality) for each in compensation.table),
    ]


def table_csv(compensation: Compensation) -> str:
    """The table as CSV."""
    axes = compensation.turn.axes
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [f"{kind}_{axis} [um]" for kind in ("peak", "dip") for axis in axes]
    writer.writerow(["compensation", "error", "unit of the error", *columns, "G [um]"])
    for what, change, unit, left in rows_of(compensation):
        numbers = [*left.peak.values(), *left.dip.values(), left.G]
        writer.writerow([what, f"{change:.6g}", unit, *(f"{1e6 * number:.6g}" for number in numbers)])
    return text.getvalue()


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
        "errors": [
            {
                "of": what,
                "change": quantity(change, unit),
                "G": quantity(1e6 * left.G, "um"),
                **{
                    f"{kind}_{axis}": quantity(1e6 * value, "um")
                    for kind, values in (("peak", left.peak), ("dip", left.dip))
                    for axis, value in values.items()
                },
            }
            for what, change, unit, left in rows_of(compensation)[2:]
        ],
    }
    return content


def summary_line(compensation: Compensation) -> str:
    """G and glitches before and after, in one line."""
    keys = ["G", *(f"glitch_{axis}" for axis in compensation.turn.axes)]
    figures = compensation.figures
    pairs = ((key, figures[f"before.{key}"], figures[f"after.{key}"]) for key in keys)
    return ", ".join(f"{key} {before.value:.3g} -> {after.value:.3g} {after.unit}" for key, before, after in pairs)
