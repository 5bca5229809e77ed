"""The pictures of a report on frequency responses: which quantity is drawn, with which curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from feedsim.analysis import linear
from feedsim.analysis.linear.loops import COMPLIANCE, QUANTITIES
from feedsim.analysis.linear.plant import TOOL_DIRECTIONS
from feedsim.analysis.responses import Responses
from feedsim.report.frf.bode import Curve
from feedsim.report.frf.bode_plots import (
    compliance_pictures,
    inertia_pictures,
    loop_pictures,
    position_reference_pictures,
    scale_pictures,
    speed_controlled_pictures,
    speed_reference_pictures,
)
from feedsim.report.style import Picture

MOST_PAIRS = 3  # annotated per axis, besides the first one
APART = 0.24  # of the logarithm of their frequencies: labels of two resonances do not touch


def pictures_of(responses: Responses) -> list[Picture]:
    """All pictures, the paper's Figs. 4 and 5 first."""
    machine, band, axes = responses.machine, responses.band, responses.axes
    of_axis = {axis: responses.result.axes[axis] for axis in axes}
    slow = 0.5 / machine.cycles.T_pos  # the position controller knows no frequencies above

    def columns(quantity: str) -> dict[str, list[Curve]]:
        return {axis: curves_of(responses, QUANTITIES[quantity][0].format(axis)) for axis in axes}

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


def curves_of(responses: Responses, name: str) -> list[Curve]:
    """The curves of a response: closed form, measured, laid over; empty where there is none."""
    closed = responses.closed
    curves = [Curve("closed form", "closed form", closed.frequency, closed[name])] if name in closed else []
    if responses.campaign is not None and name in responses.campaign.response:
        measured = responses.campaign.response
        curves.append(Curve("measured", "measured", measured.frequency, measured[name], measured.coherence.get(name)))
    for overlay in responses.overlays:
        if overlay.name == name:
            found = overlay.response
            curves.append(Curve("overlaid", overlay.file.name, found.frequency, found[name], found.coherence.get(name)))
    return curves


def most_marked(pairs: Sequence[linear.Pair], band: tuple[float, float]) -> list[linear.Pair]:
    """The first pair within the band, and the MOST_PAIRS that rise most, each APART from the others."""
    inside = [pair for pair in pairs if band[0] <= pair.antiresonance.frequency and pair.resonance.frequency <= band[1]]

    def rise(pair: linear.Pair) -> float:
        return pair.resonance.value - pair.antiresonance.value

    chosen = inside[:1]
    for pair in sorted(inside[1:], key=rise, reverse=True):
        peaks = (each.resonance.frequency for each in chosen)
        if len(chosen) <= MOST_PAIRS and all(abs(math.log(pair.resonance.frequency / f)) > APART for f in peaks):
            chosen.append(pair)
    return chosen
