"""What frequency responses come to, in a few lines: stable or not, margins, bandwidths, trust, what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from feedsim.analysis import Figure
from feedsim.analysis.linear import Margins
from feedsim.analysis.responses import Responses
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN

# Below these a difference of two responses means nothing to anybody.
LEAST_DB, LEAST_DEG = 0.001, 0.01
MARGIN_WORDS = f"the usual {20 * math.log10(GAIN_MARGIN):.0f} dB and {PHASE_MARGIN:g} deg"


def answers(responses: Responses) -> list[str]:
    """The verdict, of stable loops a line per axis with bandwidths and margins, and what that is worth."""
    axes = () if responses.result.unstable_poles else responses.axes
    by_axis = [f"{axis}: {_of_axis(responses.figures, axis)}" for axis in axes]
    return [verdict(responses), *by_axis, _trust(responses)]


def verdict(responses: Responses) -> str:
    """Whether the loops are stable, their least margins and where these are, what that means, and what to do next."""
    if responses.result.unstable_poles:
        return (
            f"The control loops are UNSTABLE ({responses.result.unstable_poles} growing solution(s) of the closed "
            "system): bandwidths and margins below say nothing. Change the gain that the warnings name."
        )
    loops = dict(_loops(responses))
    if not loops:
        return "No control loop is closed: the curves are those of the structure alone."
    gains = [
        (max(gain_crossing.factor, 1 / gain_crossing.factor), gain_crossing.frequency, loop)
        for loop, margins in loops.items()
        for gain_crossing in (margins.gain_margin, margins.gain_reduction)
        if 0 < gain_crossing.factor < math.inf
    ]
    phases = [
        (abs(margins.phase_margin.margin), margins.phase_margin.frequency, loop)
        for loop, margins in loops.items()
        if margins.phase
    ]
    results, thin = [], False
    if gains:
        factor, frequency, loop = min(gains)
        results.append(f"least gain margin {20 * math.log10(factor):.1f} dB ({loop}, {frequency:.3g} Hz)")
        thin |= factor < GAIN_MARGIN
    if phases:
        phase, frequency, loop = min(phases)
        results.append(f"least phase margin {phase:.0f} deg ({loop}, {frequency:.3g} Hz)")
        thin |= phase < PHASE_MARGIN
    meaning = (
        f"Less than {MARGIN_WORDS}: motions ring there. Lower that loop's gain, or damp what resonates there."
        if thin
        else f"All loops meet {MARGIN_WORDS.removeprefix('the usual ')}. No gain needs to be reduced."
    )
    return f"The control loops are stable; {', '.join(results) or 'nothing limits their gains'}. {meaning}"


def _loops(responses: Responses) -> Iterator[tuple[str, Margins]]:
    for axis in responses.axes:
        of_axis = responses.result.axes[axis]
        for kind, loop in (("speed", of_axis.speed), ("position", of_axis.position)):
            if loop is not None:
                yield f"{kind} loop of {axis}", loop.margins


def _trust(responses: Responses) -> str:
    known = "Closed form of the sampled loops without friction and limits (a warning says which loop is worse at rest)"
    if responses.campaign is not None:
        return f"{known}; how near the units come to it, measured, is said under Measured against closed form."
    if responses.result.unstable_poles:
        return f"{known}; nothing was measured."
    return f"{known}; not measured: without --no-measure the units are excited, and the two compared."


def _of_axis(figures: Mapping[str, Figure], axis: str) -> str:
    def number(name: str, digits: int = 3) -> str:
        figure = figures.get(f"{axis}.{name}")
        return f"{figure.value:.{digits}g}" if figure is not None and math.isfinite(figure.value) else "-"

    def within(name: str, least: float) -> str:
        figure = figures.get(f"{axis}.{name}")
        known = figure is not None and math.isfinite(figure.value)
        return f"{max(figure.value, least):.2g}" if known and figure is not None else "-"

    def gain(loop: str) -> str:
        figure = figures.get(f"{axis}.{loop}.gain_margin")
        known = figure is not None and math.isfinite(figure.value)
        return f"{20 * math.log10(figure.value):.1f} dB" if known and figure is not None else "-"

    parts = []
    if f"{axis}.speed.bandwidth_first" in figures:
        parts.append(
            f"speed loop -3 dB first {number('speed.bandwidth_first')} Hz, last {number('speed.bandwidth_last')} Hz, "
            f"margins {number('speed.phase_margin', 2)} deg, {gain('speed')}"
        )
    if f"{axis}.position.bandwidth_first" in figures:
        parts.append(
            f"position loop -3 dB {number('position.bandwidth_first')} Hz, "
            f"margins {number('position.phase_margin', 2)} deg, {gain('position')}"
        )
    if f"{axis}.n_M.measured_magnitude" in figures:
        parts.append(
            f"measured n/M within {within('n_M.measured_magnitude', LEAST_DB)} dB, "
            f"{within('n_M.measured_phase', LEAST_DEG)} deg"
        )
    return "; ".join(parts) or "no loop closed"
