"""modes.csv, response.csv (measured, fitted), summary.json, report.html and figures of identified modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.modal.rational import MOTOR, AxisModes
from feedsim.files.trace.response import Complexes, FrequencyResponse
from feedsim.files.trace.response_files import write_response
from feedsim.foundation.errors import Finding
from feedsim.report.chart import Axis, Chart, Curve, Panel
from feedsim.report.content import (
    FOLDER,
    Paragraph,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    figures_footer,
    figures_section,
    provenance_section,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import (
    ALTERNATIVE_COLOUR,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    Array,
    minus,
    typeset,
)
from feedsim.report.provenance import finite, hash_files, inputs_part
from feedsim.report.results import Content
from feedsim.scenario import Subject
from feedsim.structure.modes import write_modes

MODES_FILE, RESPONSE_FILE = "modes.csv", "response.csv"
FILES = (MODES_FILE, RESPONSE_FILE)  # besides report.html and summary.json


@dataclass(frozen=True, eq=False)
class ModesReport:
    """What was identified, and what it rests on."""

    found: AxisModes
    file: Path
    subject: Subject
    settings: Mapping[str, str]

    @property
    def axis(self) -> AxisModes:
        """Rigid motion, delays and modes of the axis; ``table`` is the machine's table with them."""
        return self.found

    @property
    def figures(self) -> dict[str, Figure]:
        """By name."""
        axis_modes, axis = self.found, self.found.axis
        fit = axis_modes.fit
        figures: dict[str, Figure] = {}
        for key, meaning, extremes in (
            ("antiresonance", "least response of the motor", axis_modes.dips),
            ("resonance", "largest response of the motor", axis_modes.peaks),
        ):
            for k, (own, measured, sigma) in enumerate(extremes, 1):
                figures[f"{axis}.{key}_{k}"] = Figure(own, "Hz", f"{meaning}: of the fit")
                figures[f"{axis}.{key}_{k}_measured"] = Figure(
                    measured, "Hz", f"{meaning}: of the measured lines{_interval(sigma)}"
                )
        if axis_modes.ratios is not None:
            meaning = "(resonance/antiresonance)^2 - 1"
            own, measured, sigma = axis_modes.ratios
            figures[f"{axis}.ratio"] = Figure(own, "1", f"{meaning}: of the fit")
            figures[f"{axis}.ratio_measured"] = Figure(
                measured, "1", f"{meaning}: of the measured lines{_interval(sigma)}"
            )
        if axis_modes.inertia_ratio is not None:
            figures[f"{axis}.inertia_ratio"] = Figure(
                axis_modes.inertia_ratio, "1", "inertia behind the first mode over that of the motor: of the fit"
            )
        per = f"(rad/s^2)/({axis_modes.measured.input_unit})"
        figures[f"{axis}.rigid"] = Figure(abs(fit.rigid[MOTOR]), per, "acceleration of the motor in rigid motion")
        for name, delay in fit.delay.items():
            figures[f"{axis}.{name}_delay"] = Figure(1e3 * delay, "ms", f"delay of the {name} behind the input")
        for name, (decibel, degrees) in axis_modes.deviations.items():
            figures[f"{axis}.{name}_magnitude_left"] = Figure(
                decibel, "dB", f"{name}: 90 % of the lines are within this of the fit"
            )
            figures[f"{axis}.{name}_phase_left"] = Figure(
                degrees, "deg", f"{name}: 90 % of the lines are within this of the fit"
            )
        for name, (decibel, degrees) in axis_modes.scatter.items():
            meaning = f"{name}: 90 % of the lines are within this of a parabola through their neighbours"
            figures[f"{axis}.{name}_magnitude_scatter"] = Figure(decibel, "dB", meaning)
            figures[f"{axis}.{name}_phase_scatter"] = Figure(degrees, "deg", meaning)
        return figures

    @property
    def warnings(self) -> list[Finding]:
        """What a user should know."""
        return [*self.found.warnings, *self.found.notes]


def files_of(report: ModesReport) -> dict[str, Content]:
    """Name -> content of the files besides report.html and summary.json."""
    axis_modes = report.found
    columns: dict[str, Complexes] = {}
    units: dict[str, str] = {}
    for name, values in axis_modes.measured.values.items():
        unit = f"({'m' if axis_modes.measured.linear[name] else 'rad'}/s^2)/({axis_modes.measured.input_unit})"
        columns |= {f"{name}": values, f"{name} fit": axis_modes.fit.response(name, axis_modes.measured.frequency)}
        units |= {f"{name}": unit, f"{name} fit": unit}
    response = FrequencyResponse(axis_modes.measured.frequency, columns, units)
    return {
        MODES_FILE: partial(write_modes, modes=axis_modes.table),
        RESPONSE_FILE: partial(write_response, response=response),
    }


def report_of(report: ModesReport) -> Report:
    """Content of the report."""
    axis_modes = report.found
    remark = f"{report.file.name}, axis {axis_modes.axis} of {report.subject.machine.name}"
    pictures = with_remark([_bode(axis_modes)], remark)
    rows: list[tuple[Text, ...]] = [
        (f"{mode.frequency:.4g}", f"{NORMAL_95 * mode.frequency_sigma:.2g}", f"{100 * mode.damping:.3g}",
         f"{100 * NORMAL_95 * mode.damping_sigma:.2g}",
         *(minus(f"{mode.residues[name] / axis_modes.fit.rigid[name]:.3g}") for name in axis_modes.fit.outputs))
        for mode in axis_modes.fit.modes
    ]  # fmt: skip
    heads = ("Frequency [Hz]", "±, 95 %", "Damping [%]", "±, 95 %", *(f"Share of {n}" for n in axis_modes.fit.outputs))
    tables: list[Section] = [Section("Modes", [
        Paragraph("Share: residue of the mode over that of the rigid motion; of the motor it is the square of the "
                  "relative mode shape."), Table("r" * len(heads), heads, rows)])]  # fmt: skip
    if axis_modes.fit.predicted:
        chosen = len(axis_modes.fit.modes)
        tables.append(Section("Number of modes", [
            Paragraph("Rms of what lines leave, in their standard deviations, that a fit to the other lines predicts."),
            Table("rrl", ("Modes", "Left of unseen lines", ""),
                  [(str(k), f"{value:.3g}", "taken" if k == chosen else "")
                   for k, value in axis_modes.fit.predicted.items()])]))  # fmt: skip
    return Report(
        f"Modes of {axis_modes.axis}",
        f"identified from {report.file.name}",
        warnings=report.warnings,
        notes=[note for note in report.subject.notes if note],
        answer=answers(report),
        tiles=[
            *(
                Tile(f"{mode.frequency:.4g} Hz", f"mode {k}, {100 * mode.damping:.2g} % damping", "of the fit")
                for k, mode in enumerate(axis_modes.fit.modes, 1)
            ),
        ] + [
            Tile(tile_value(figure), name.partition(".")[2].replace("_", " "), typeset(figure.meaning))
            for name, figure in report.figures.items()
            if name.endswith(("resonance_1", "ratio"))
        ],
        main=[*pictures, *tables, figures_section(report.figures)],
        provenance=provenance_section([("Response", report.file.name), ("Estimate", axis_modes.measured.method)],
                                      hash_files(_files(report))),
        footer=figures_footer(f"Values in full precision: summary.json; what machines take: {MODES_FILE}.",
                              "docs/replay.md"),
        next_step=Step("See the drive on this structure", "frf",
                       {"subject": report.subject.file, "axes": axis_modes.axis, "measure": False,
                        "set": [*report.subject.overrides, "machine.structure=null",
                                f"machine.modes={FOLDER}/{MODES_FILE}"]}),
    )  # fmt: skip


def _bode(axis_modes: AxisModes) -> Picture:
    """Measured lines, the fit, and the machine's own response."""
    frequency = axis_modes.measured.frequency
    panels = []
    scale = abs(axis_modes.fit.rigid[MOTOR]) if axis_modes.measured.input_unit != "N.m" else 0.0

    def curves(name: str, of: Any) -> list[Curve]:
        own = axis_modes.own[name]
        # Over a current, the machine's torque has the scale of the rigid motion.
        factor = scale / np.abs(axis_modes.own[MOTOR][0]) if scale else 1.0
        sign = np.sign(axis_modes.fit.rigid[name]) or 1.0
        return [
            Curve("measured", frequency, of(axis_modes.measured.values[name]), RECORDED_COLOUR, dots=True, width=2.0),
            Curve("fit", frequency, of(axis_modes.fit.response(name, frequency)), SIMULATED_COLOUR),
            Curve("machine", frequency, of(own * factor * sign), ALTERNATIVE_COLOUR, "dashed"),
        ]

    def decibel(values: Any) -> Array:
        return np.asarray(20 * np.log10(np.maximum(np.abs(values), 1e-300)), dtype=np.float64)

    def phase(values: Any) -> Array:
        return np.asarray(np.degrees(np.unwrap(np.angle(values))), dtype=np.float64)

    axis = Axis("frequency", "Hz", log=True)
    for name in axis_modes.fit.outputs:
        panels.append(Panel(f"{name}: acceleration over the input", axis, Axis("magnitude", "dB"),
                            curves(name, decibel), linked="f"))  # fmt: skip
        panels.append(Panel(f"{name}: phase", axis, Axis("phase", "°"), curves(name, phase), linked="f", height=0.8))
    caption = "Measured lines, a rigid body with modes and delays, and the machine's structure without delays."
    return Picture(f"modes-{axis_modes.axis}", f"Axis {axis_modes.axis}: measured, fitted and of the machine", caption,
                   Chart(panels))  # fmt: skip


def _files(report: ModesReport) -> list[tuple[str, Path]]:
    return [("response", report.file), *report.subject.files]


def details(report: ModesReport) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    axis_modes = report.found
    return {
        "settings": dict(report.settings),
        "axis": axis_modes.axis,
        "modes": [
            {
                "frequency": {"value": mode.frequency, "unit": "Hz", "sigma": finite(mode.frequency_sigma)},
                "damping": {"value": mode.damping, "unit": "1", "sigma": finite(mode.damping_sigma)},
                "shares": {name: mode.residues[name] / axis_modes.fit.rigid[name] for name in axis_modes.fit.outputs},
            }
            for mode in axis_modes.fit.modes
        ],
        "predicted": {str(count): value for count, value in axis_modes.fit.predicted.items()},
        "inputs": inputs_part(hash_files(_files(report))),
    }


def _interval(sigma: float) -> str:
    """The 95 % interval in words; empty where none is known."""
    return f", ± {NORMAL_95 * sigma:.2g} (95 %)" if sigma == sigma else ""


def answers(report: ModesReport) -> list[str]:
    """What was found, and how near it is."""
    axis_modes = report.found
    words = [f"{m.frequency:.4g} Hz ({100 * m.damping:.2g} % damping)" for m in axis_modes.fit.modes]
    count = {0: "no mode", 1: "one mode", 2: "two modes", 3: "three modes"}.get(len(words), f"{len(words)} modes")
    modes = f"{count}{': ' if words else ''}{' and '.join(filter(None, [', '.join(words[:-1]), *words[-1:]]))}"
    remaining, scatter = (
        "; ".join(f"{name}: {db:.2g} dB and {deg:.2g} deg" for name, (db, deg) in of.items())
        for of in (axis_modes.deviations, axis_modes.scatter)
    )
    return [
        f"{axis_modes.axis} has {modes}. The fit meets 90 % of the lines within {remaining}.",
        f"About their own neighbours 90 % of the lines are within {scatter}: noise and distortion, which no fit meets.",
        f"Estimate: {axis_modes.measured.method}, {len(axis_modes.measured.frequency)} lines.",
        f"{MODES_FILE} is the machine's table with these modes in place of its elastic ones; other axes are rigid in "
        "it.",
    ]


def summary_lines(report: ModesReport) -> list[str]:
    """For the terminal."""
    lines = [f"  {line}" for line in answers(report)]
    lines += [f"    {name:<34} {figure}" for name, figure in report.figures.items()]
    return lines
