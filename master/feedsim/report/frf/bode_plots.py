"""Bode plots of a machine's feed drives, one picture per quantity and a column per axis.

Like Figs. 4 and 5 of Wiesauer, Bleicher, 18th CIRP CMMO (2021): the speed-controlled system n/M and the reference
frequency response of the speed controller; besides these the loops around them, and what the structure does.
Start with pictures_of: which quantity is drawn, with which curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from feedsim.analysis import linear
from feedsim.analysis.responses import Responses
from feedsim.linear.loops import COMPLIANCE, LOOP_QUANTITIES
from feedsim.linear.margins import Bandwidth, Margins, Pair
from feedsim.linear.plant import TOOL_DIRECTIONS
from feedsim.report.content import Picture
from feedsim.report.frf.bode import (
    Column,
    Curve,
    Marks,
    Ordinate,
    bandwidth_marks,
    bode_chart,
    margin_marks,
    pair_marks,
)

Columns = Mapping[str, Sequence[Curve]]  # by axis or direction
Span = tuple[float, float] | None  # frequencies shown [Hz]; None: all

MOST_COLUMNS = 3
LOWEST_GAIN_DB = -40.0  # of a loop: what is below says nothing about it
LOWEST_CLOSED_DB = -45.0  # of a closed loop

RESPONSE_KINDS = {
    "closed form": "Lines: closed form. ",
    "measured": "Points: measured on the units, faded where the coherence is below 0.99. ",
    "overlaid": "Dashed curves: laid over. ",
}

MOST_PAIRS = 3  # annotated per axis, besides the first one
LABEL_GAP = 0.24  # of the logarithm of their frequencies: labels of two resonances do not touch


def speed_controlled_pictures(columns: Columns, span: Span) -> list[Picture]:
    """n_a/M_a per axis, magnitude and phase (the paper's Fig. 4). Values [(rad/s)/(N.m)]."""
    return _pictures(
        columns, "speed-controlled-system", Ordinate("|n_a/M_a|", "dB re 1 (rad/s)/(N·m)"), span,
        "Speed-controlled system n/M of {}",
        "Motor speed over motor torque, the position loop left out. At low frequencies the line falls as 1/(J ω) with "
        "the total inertia J; above, the structure shows. ",
    )  # fmt: skip


def inertia_pictures(
    columns: Columns, J_tot: Mapping[str, float], pairs: Mapping[str, Sequence[Pair]], span: Span
) -> list[Picture]:
    """|n_a/M_a| J_tot omega per axis: 0 dB where the machine is a rigid inertia.

    J_tot: [kg.m2]; pairs: anti-resonances and resonances to be annotated.
    """

    return _pictures(
        {axis: [c.scaled(2 * np.pi * c.frequency * J_tot[axis]) for c in curves] for axis, curves in columns.items()},
        "inertia-view", Ordinate("|n_a/M_a| J_tot ω"), span,
        "Speed-controlled system of {} against a rigid inertia",
        "The speed-controlled system multiplied by the total inertia and the angular frequency: 0 dB where the machine "
        "moves as one rigid mass, more where the motor feels less inertia. Annotated: the most marked pairs of "
        "anti-resonance (hollow) and resonance (full), in Hz. ",
        phase=False,
        marked=lambda axis, curve: pair_marks(curve, pairs.get(axis, ())),
    )  # fmt: skip


def speed_reference_pictures(columns: Columns, bandwidths: Mapping[str, Bandwidth], span: Span) -> list[Picture]:
    """n_a/n_s per axis with its -3 dB line and crossings (the paper's Fig. 5)."""
    what = "Reference frequency response of the speed controller n_a/n_s of {}"
    about = "Motor speed over speed setpoint, the position loop open. "
    return _closed_loops(columns, bandwidths, "speed-reference", "|n_a/n_s|", what, about, span)


def position_reference_pictures(columns: Columns, bandwidths: Mapping[str, Bandwidth], span: Span) -> list[Picture]:
    """x_a/x_s per axis with its -3 dB line and crossings."""
    what = "Reference frequency response of the position controller x_a/x_s of {}"
    about = "Position at the linear scale over position setpoint, the speed feedforward left out. "
    return _closed_loops(columns, bandwidths, "position-reference", "|x_a/x_s|", what, about, span)


def loop_pictures(
    columns: Columns, margins: Mapping[str, Margins], loop: Literal["speed", "position"], span: Span
) -> list[Picture]:
    """Open-loop gain of the speed or the position loop per axis, its margins marked."""
    cut = {
        "speed": "cut at the motor speed, the axis' position loop open, others closed; the gain margin is the factor "
        "that K_p stands",
        "position": "cut at the scale's position as the controller samples it; the gain margin is the factor that K_v "
        "stands",
    }[loop]

    return _pictures(
        columns, f"{loop}-loop", Ordinate("open-loop gain"), span, f"Open-loop gain of the {loop} loop of {{}}",
        f"Loop gain {cut}. Marked: the gain margin (vertical line from the curve to 0 dB) and the phase margin (from "
        "the curve to ±180°, where a loop of gain 1 would be at its limit). ",
        floor=LOWEST_GAIN_DB,
        marked=lambda axis, curve: margin_marks(curve, margins[axis]) if axis in margins else Marks(),
    )  # fmt: skip


def scale_pictures(columns: Columns, span: Span) -> list[Picture]:
    """x_a/M_a per axis. Values [m/(N.m)], shown in um/(N.m)."""
    return _pictures(
        columns, "scale-response", Ordinate("|x_a/M_a|", "µm/(N·m)", decibel=False, scale=1e6), span,
        "From motor torque to linear scale, x/M of {}",
        "Position at the linear scale over motor torque, the position loop left out: what the drive train and the "
        "structure put between motor and scale. ",
    )  # fmt: skip


def compliance_pictures(columns: Columns, span: Span) -> list[Picture]:
    """Tool compliance per direction. Values [m/N], shown in um/N."""
    return _pictures(
        columns, "tool-compliance", Ordinate("|x_tool/F|", "µm/N", decibel=False, scale=1e6), span,
        "Dynamic compliance at the tool",
        "Displacement of the tool against the workpiece over the force between them, all loops closed. ",
        of="Direction",
    )  # fmt: skip


def _closed_loops(
    columns: Columns, bandwidths: Mapping[str, Bandwidth], stem: str, ordinate: str, title: str, about: str, span: Span
) -> list[Picture]:

    caption = (
        f"{about}Dashed line: −3 dB. A curve with an anti-resonance can fall through it, return and fall again: full "
        "marker, first crossing; hollow marker, last crossing. "
    )
    return _pictures(columns, stem, Ordinate(ordinate), span, title, caption, floor=LOWEST_CLOSED_DB,
                     marked=lambda axis, _: bandwidth_marks(bandwidths.get(axis)))  # fmt: skip


def _pictures(
    columns: Columns,
    stem: str,
    ordinate: Ordinate,
    span: Span,
    title: str,
    caption: str,
    *,
    marked: Callable[[str, Curve], Marks] | None = None,
    phase: bool = True,
    floor: float | None = None,
    of: str = "Axis",
) -> list[Picture]:
    """A picture per group of columns.

    title: {} in it are the names of the columns. shown: what is marked in a column, by its name and its first curve.
    of: what the columns are.
    """

    def picture(part: Columns, name: str) -> Picture:
        shown = [Column(f"{of} {text}", curves) for text, curves in part.items()]
        marks = {c.title: marked(text, c.curves[0]) for text, c in zip(part, shown, strict=True)} if marked else {}
        chart = bode_chart(shown, ordinate, marks, phase=phase, span=span, floor=floor)
        return Picture(name, title.format(_axes(part)), caption + _kinds(part), chart)

    return [picture(part, name) for part, name in _parts(columns, stem)]


def _parts(columns: Columns, stem: str) -> list[tuple[dict[str, Sequence[Curve]], str]]:
    """Groups of at most MOST_COLUMNS columns with curves, and the stem of each group's picture."""
    names = [name for name, curves in columns.items() if curves]
    groups = [names[k : k + MOST_COLUMNS] for k in range(0, len(names), MOST_COLUMNS)]
    return [
        ({name: columns[name] for name in group}, stem if len(groups) == 1 else f"{stem}-{'-'.join(group)}")
        for group in groups
    ]


def _axes(part: Mapping[str, object]) -> str:
    names = list(part)
    return f"axis {names[0]}" if len(names) == 1 else f"axes {', '.join(names[:-1])} and {names[-1]}"


def _kinds(part: Columns) -> str:
    """What the styles mean, where there is more than one."""
    there = {curve.kind for curves in part.values() for curve in curves}
    return "".join(RESPONSE_KINDS[kind] for kind in RESPONSE_KINDS if kind in there) if len(there) > 1 else ""


def pictures_of(responses: Responses) -> list[Picture]:
    """All pictures, the paper's Figs. 4 and 5 first."""
    machine, band, axes = responses.machine, responses.band, responses.axes
    of_axis = {axis: responses.result.axes[axis] for axis in axes}
    slow = 0.5 / machine.cycles.T_pos  # the position controller knows no frequencies above

    def columns(quantity: str) -> dict[str, list[Curve]]:
        return {axis: curves_of(responses, LOOP_QUANTITIES[quantity][0].format(axis)) for axis in axes}

    def loops(name: str) -> dict[str, list[Curve]]:
        return {axis: curves_of(responses, f"{axis}.{name}") for axis in axes}

    tool = {direction: curves_of(responses, COMPLIANCE.format(direction)) for direction in TOOL_DIRECTIONS}
    speed = {axis: result.speed for axis, result in of_axis.items() if result.speed is not None}
    position = {axis: result.position for axis, result in of_axis.items() if result.position is not None}
    below = (band[0], min(band[1], slow))
    return [
        *speed_controlled_pictures(columns("n_M"), band),
        *inertia_pictures(
            columns("n_M"),
            {axis: result.J_tot for axis, result in of_axis.items()},
            {axis: most_marked(result.pairs, band) for axis, result in of_axis.items()},
            band,
        ),
        *speed_reference_pictures(columns("n_n"), {axis: loop.bandwidth for axis, loop in speed.items()}, band),
        *loop_pictures(loops("speed_loop"), {axis: loop.margins for axis, loop in speed.items()}, "speed", None),
        *position_reference_pictures(columns("x_x"), {axis: loop.bandwidth for axis, loop in position.items()}, below),
        *loop_pictures(
            loops("position_loop"), {axis: loop.margins for axis, loop in position.items()}, "position", below
        ),
        *scale_pictures(columns("x_M"), band),
        *compliance_pictures(tool, band),
    ]


def nearest_to_its_limit(responses: Responses) -> Picture | None:
    """The position loop of the axis with the least gain margin, gain above phase; None without any margin."""
    figures = responses.figures
    gains = {
        axis: figures[name].value for axis in responses.axes if (name := f"{axis}.position.gain_margin") in figures
    }
    known = [axis for axis in gains if math.isfinite(gains[axis])]
    if not known:
        return None
    axis = min(known, key=gains.__getitem__)
    loop = responses.result.axes[axis].position
    band = (responses.band[0], min(responses.band[1], 0.5 / responses.machine.cycles.T_pos))
    curves = {axis: curves_of(responses, f"{axis}.position_loop")}
    pictures = loop_pictures(curves, {} if loop is None else {axis: loop.margins}, "position", band)
    which = ", which has the least gain margin" if len(known) > 1 else ""
    return next(
        (replace(picture, stem=f"{picture.stem}-first", title=picture.title + which) for picture in pictures), None
    )


def curves_of(responses: Responses, name: str) -> list[Curve]:
    """The curves of a response: closed form, measured, laid over; empty where there is none.

    A response that is zero throughout (the tool's on rigid axes) is none: no logarithmic scale shows it.
    """
    closed = responses.closed
    curves = [Curve("closed form", "closed form", closed.frequency, closed[name])] if name in closed else []
    if responses.campaign is not None and name in responses.campaign.response:
        measured = responses.campaign.response
        curves.append(Curve("measured", "measured", measured.frequency, measured[name], measured.coherence.get(name)))
    for overlay in responses.overlays:
        if overlay.name == name:
            frequency_response = overlay.response
            curves.append(
                Curve(
                    "overlaid",
                    overlay.file.name,
                    frequency_response.frequency,
                    frequency_response[name],
                    frequency_response.coherence.get(name),
                )
            )
    return [curve for curve in curves if np.any(curve.value)]


def most_marked(pairs: Sequence[linear.Pair], band: tuple[float, float]) -> list[linear.Pair]:
    """The first pair within the band, and the MOST_PAIRS that rise most, each LABEL_GAP from the others."""
    inside = [pair for pair in pairs if band[0] <= pair.antiresonance.frequency and pair.resonance.frequency <= band[1]]

    def rise(pair: linear.Pair) -> float:
        return pair.resonance.value - pair.antiresonance.value

    chosen = inside[:1]
    for pair in sorted(inside[1:], key=rise, reverse=True):
        peaks = (pair.resonance.frequency for pair in chosen)
        if len(chosen) <= MOST_PAIRS and all(abs(math.log(pair.resonance.frequency / f)) > LABEL_GAP for f in peaks):
            chosen.append(pair)
    return chosen
