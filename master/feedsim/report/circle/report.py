"""The report of recorded circles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Diagnosis, Figure, answer
from feedsim.analysis.circle import CircleUnderTest, TurnedPath
from feedsim.analysis.circle.records import RecordedCircle
from feedsim.analysis.circularity import axis_letters
from feedsim.analysis.evaluate import about, both_directions, cause_figures
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report import sections
from feedsim.report.changes import changes_section
from feedsim.report.chart import Dash
from feedsim.report.content import Bullets, Report, Section, Tile, code, tile_value, typed
from feedsim.report.control import control_section
from feedsim.report.formatting import counted, typeset
from feedsim.report.picture import Picture
from feedsim.report.provenance import figures_part, hashed, inputs_part, quantity, software
from feedsim.report.run import circle_plots
from feedsim.report.run.diagnosis import diagnosis_part, diagnosis_section
from feedsim.report.style import RECORDED, SIMULATED, Array
from feedsim.tune import of_circle

FORMAT = 1
DASHES: dict[int, Dash] = {1: "", -1: "dashed"}  # by the sense of the turn
TILES = {"G": "circular deviation G", "G_b": "bidirectional deviation G(b)", "H": "circular hysteresis H"}
FULL_TURN_FIGURES = {
    "G": "ISO 230-4 circular deviation",
    "G_b": "ISO 230-4 bidirectional circular deviation",
    "D": "ISO 230-4 mean bidirectional radial deviation",
    "H": "ISO 230-4 circular hysteresis",
}


@dataclass(frozen=True, eq=False)
class _Centred:
    """A turn about the centre that is fitted to all."""

    angle: Array
    deviation: Array
    sense: int


def answers(diagnosis: Diagnosis) -> list[str]:
    """Why the circle is not round, in a sentence."""
    return [f"{axis_letters(diagnosis.circle.axes)}: {answer(diagnosis)}"]


def figures_of(recorded: RecordedCircle, diagnosis: Diagnosis) -> dict[str, Figure]:
    """Figures of the circle, named as those of a run."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    centre = "the fitted centre" if recorded.centred else "the programmed centre"
    if diagnosis.arc is not None:
        about_arc = (
            f"range of the radial deviation on an arc of {math.degrees(diagnosis.arc):.0f} deg, about its circle"
        )
        figures = {
            name: Figure(math.nan, "um", f"{meaning}: needs a full turn") for name, meaning in FULL_TURN_FIGURES.items()
        }
        figures["arc_range"] = Figure(diagnosis.G * 1e6, "um", about_arc)
        return _prefixed(prefix, figures | cause_figures(diagnosis))
    figures = {"G": Figure(diagnosis.G * 1e6, "um", f"range of the radial deviation of all turns, about {centre}")}
    for sense in (1, -1):
        if sense not in diagnosis.senses:
            return _prefixed(prefix, figures | cause_figures(diagnosis))
    one = next(turn.path for turn in recorded.turns if turn.path.sense > 0)
    other = next(turn.path for turn in recorded.turns if turn.path.sense < 0)
    curves = [(one.angle, one.deviation), (other.angle, other.deviation)]
    return _prefixed(prefix, figures | both_directions(curves, circle.radius, circle.axes) | cause_figures(diagnosis))


def _prefixed(prefix: str, figures: Mapping[str, Figure]) -> dict[str, Figure]:
    # Nobody knows here where a position was read: by scales, or at the tool.
    return {
        f"{prefix}.{name}": Figure(figure.value, figure.unit, figure.meaning.removesuffix(", by the linear scales"))
        for name, figure in figures.items()
    }


def report_of(
    recorded: RecordedCircle, diagnosis: Diagnosis, figures: Mapping[str, Figure], files: Sequence[Path]
) -> Report:
    """Content of the report."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    labels = {"G": TILES["G"]} if diagnosis.arc is None else {"arc_range": "range of the deviation on the arc"}
    peaks = {
        f"peak_{axis}": f"reversal peak, {axis} reverses" for axis in circle.axes if f"{prefix}.peak_{axis}" in figures
    }
    labels |= dict(sorted(peaks.items(), key=lambda entry: -abs(figures[f"{prefix}.{entry[0]}"].value)))
    labels |= TILES if diagnosis.arc is None else {}
    own = {key: figures.get(f"{prefix}.{key}") for key in labels}
    tiles = [Tile(tile_value(figure), labels[key], typeset(figure.meaning)) for key, figure in own.items() if figure]
    rows = [
        ("Radius", f"{circle.radius * 1e3:.6g} mm"),
        ("Path speed", f"{circle.speed * 6e4:.5g} mm/min"),
        ("Centre", "fitted to the turns" if recorded.centred else "as given"),
    ]
    return Report(
        f"Recorded circle {prefix}",
        f"{', '.join(file.name for file in files)} · {counted(len(recorded.turns), 'turn')}",
        answer=answers(diagnosis),
        warnings=list(recorded.doubts),
        tiles=tiles,
        next_step=("Lay a simulated circle over it:\n", code(f"feedsim diff {typed(files[0])} FOLDER_OF_A_RUN"))
        if diagnosis.arc is None
        else "",
        main=[
            picture(circle, recorded, diagnosis),
            diagnosis_section(prefix, diagnosis),
            sections.figures_section(figures),
            changes_section(of_circle(diagnosis, None, None)),
            control_section(),
            Section("How the files were read", [Bullets(recorded.notes)]),
        ],
        provenance=sections.provenance_section(rows, hashed([("record", file) for file in files])),
        footer=sections.figures_footer("Values in full precision: summary.json."),
    )


def picture(circle: CircleUnderTest, recorded: RecordedCircle, diagnosis: Diagnosis) -> Picture:
    """All turns over each other, magnified, and what the model says of them."""
    turns = _centred([turn.path for turn in recorded.turns], circle, diagnosis, recorded.centred)
    on = circle_plots.circle(circle, max(float(np.abs(turn.deviation).max()) for turn in turns))
    fitted = _centred(
        [TurnedPath(a, e, s) for (a, e), s in zip(diagnosis.rest, diagnosis.senses, strict=True)],
        circle, diagnosis, recorded.centred,
    )  # fmt: skip
    plane = f"{circle.axes[0]}-{circle.axes[1]}"
    caption = (
        f"Radius {circle.radius * 1e3:.6g} mm. Radius deviation magnified "
        f"{on.magnification:,.0f} times; rings at ±{on.ring:g} µm about the "
        f"circle{', about its fitted centre' if recorded.centred else ''}. Dotted: the fitted model without peaks."
    )
    curves = [
        circle_plots.turned(SENSE_WORDS[turn.sense], RECORDED, turn.angle, turn.deviation, DASHES[turn.sense])
        for turn in turns
    ]
    curves += [
        circle_plots.turned("model without peaks", SIMULATED, centred.angle, centred.deviation, "dotted", 1.1)
        for centred in fitted
    ]
    title = f"Recorded circle in the plane {plane}"
    return Picture(f"circle-{plane}", title, caption, circle_plots.circle_chart(on, curves))


def _centred(
    paths: Sequence[TurnedPath], circle: CircleUnderTest, diagnosis: Diagnosis, centred: bool
) -> list[_Centred]:
    centre = np.array(diagnosis.centre if centred else (0.0, 0.0))
    return [_Centred(*about(path.angle, path.deviation, circle.radius, centre), path.sense) for path in paths]


def summary(
    recorded: RecordedCircle,
    diagnosis: Diagnosis,
    figures: Mapping[str, Figure],
    files: Sequence[Path],
    names: Sequence[str],
) -> dict[str, Any]:
    """Content of summary.json."""
    circle = recorded.circle
    prefix = axis_letters(circle.axes)
    return {
        "format": FORMAT,
        "answer": answers(diagnosis),
        "figures": figures_part(figures),
        "diagnosis": {prefix: diagnosis_part(diagnosis)},
        "circle": {
            "axes": list(circle.axes),
            "radius": quantity(circle.radius, "m"),
            "speed": quantity(circle.speed, "m/s"),
            "centre_fitted": recorded.centred,
            "arc": None if diagnosis.arc is None else quantity(diagnosis.arc, "rad"),
            "turns": [turn.name for turn in recorded.turns],
        },
        "inputs": inputs_part(hashed([("record", file) for file in files])),
        "software": software(),
        "files": list(names),
    }
