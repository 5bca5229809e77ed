"""The results of the linear system as named figures with units and meanings."""

from __future__ import annotations

import math

from feedsim.analysis.figures import Figure
from feedsim.analysis.linear.evaluate import (
    LOW_BAND,
    LOWEST,
    AxisResult,
    LinearResult,
    PositionLoop,
    SpeedLoop,
    evaluate,
)
from feedsim.analysis.linear.margins import Margins
from feedsim.analysis.linear.search import Extreme
from feedsim.analysis.linear.system import LinearSystem


def figures(result: LinearResult | LinearSystem) -> dict[str, Figure]:
    """Figures of an evaluated system, or of a system, which is evaluated first. NaN where something does not occur.

    Raises:
        InputError: a pole lies on the limit of stability.
    """
    if isinstance(result, LinearSystem):
        result = evaluate(result)
    found = {
        "unstable_poles": Figure(
            float(result.unstable_poles), "1", "growing solutions of the closed system; the other figures presume 0"
        )
    }
    for axis, of_axis in result.axes.items():
        found |= {f"{axis}.{name}": figure for name, figure in _axis(of_axis).items()}
    for drives, compliance in (("as they are", result.compliance), ("without torque", result.structure_compliance)):
        prefix = "tool" if compliance is result.compliance else "tool.free"
        for direction, peak in compliance.items():
            name = f"{prefix}.compliance_{direction}"
            what = f"highest maximum of |x_{direction}/F_{direction}| at the tool, drives {drives}"
            found[name] = Figure(peak.value * 1e6 if peak else math.nan, "um/N", what)
            found[f"{name}.frequency"] = Figure(peak.frequency if peak else math.nan, "Hz", f"frequency of the {what}")
    return found


def _axis(result: AxisResult) -> dict[str, Figure]:
    found = {
        "J_tot": Figure(result.J_tot, "kg.m2", "inertia that a slow motor torque accelerates"),
        "n_M.low_deviation": Figure(
            100 * result.low_deviation,
            "%",
            f"largest deviation of |n/M| J_tot omega from 1, {LOWEST:g} to {LOW_BAND:g} Hz",
        ),
    }
    for prefix, pairs, system in (
        ("n_M", result.pairs, "speed-controlled system, other loops as they are"),
        ("structure", result.structure_pairs, "structure alone, other motors without torque"),
    ):
        for i, pair in enumerate(pairs, start=1):
            rise = pair.resonance.value - pair.antiresonance.value
            found |= {
                f"{prefix}.antiresonance_{i}": Figure(
                    pair.antiresonance.frequency, "Hz", f"minimum {i} of |n/M| omega, {system}"
                ),
                f"{prefix}.resonance_{i}": Figure(
                    pair.resonance.frequency, "Hz", f"maximum of |n/M| omega after minimum {i}, {system}"
                ),
                f"{prefix}.rise_{i}": Figure(rise, "dB", f"from minimum {i} to the maximum of |n/M| omega, {system}"),
            }
    if result.speed is not None:
        found |= {f"speed.{name}": figure for name, figure in _speed(result.speed).items()}
    if result.position is not None:
        found |= {f"position.{name}": figure for name, figure in _position(result.position).items()}
    return found


def _speed(loop: SpeedLoop) -> dict[str, Figure]:
    return {
        "bandwidth_first": Figure(loop.bandwidth.first, "Hz", "n_a/n_s falls below -3 dB for the first time"),
        "bandwidth_last": Figure(loop.bandwidth.last, "Hz", "n_a/n_s falls below -3 dB for the last time"),
        **_peak(loop.peak, "|n_a/n_s|"),
        "delay": Figure(1e3 * loop.delay, "ms", "delay of n_a behind n_s at low frequencies; 2 D/omega_0 + T_ref"),
        **_margins(loop.margins, "speed loop", "K_p"),
        "unstable_poles": Figure(float(loop.unstable_poles), "1", "growing solutions, every position loop open"),
    }


def _position(loop: PositionLoop) -> dict[str, Figure]:
    with_feedforward = loop.bandwidth_feedforward
    return {
        "bandwidth_first": Figure(loop.bandwidth.first, "Hz", "x_a/x_s falls below -3 dB for the first time"),
        "bandwidth_last": Figure(loop.bandwidth.last, "Hz", "x_a/x_s falls below -3 dB for the last time"),
        "feedforward.bandwidth_first": Figure(
            with_feedforward.first, "Hz", "x_a/x_s with speed feedforward falls below -3 dB for the first time"
        ),
        "feedforward.bandwidth_last": Figure(
            with_feedforward.last, "Hz", "x_a/x_s with speed feedforward falls below -3 dB for the last time"
        ),
        **_peak(loop.peak, "|x_a/x_s| without feedforward"),
        **_margins(loop.margins, "position loop", "K_v"),
    }


def _peak(peak: Extreme | None, what: str) -> dict[str, Figure]:
    return {
        "peak": Figure(peak.value if peak else math.nan, "dB", f"highest maximum of {what}"),
        "peak.frequency": Figure(peak.frequency if peak else math.nan, "Hz", f"frequency of the maximum of {what}"),
    }


def _margins(margins: Margins, loop: str, gain: str) -> dict[str, Figure]:
    upper, lower, phase = margins.gain_margin, margins.gain_reduction, margins.phase_margin
    return {
        "gain_margin": Figure(upper.factor, "1", f"{loop}: factor on {gain} that leads to the limit of stability"),
        "gain_margin.frequency": Figure(upper.frequency, "Hz", f"{loop}: frequency of the gain margin"),
        "gain_reduction": Figure(
            lower.factor, "1", f"{loop}: factor below 1 on {gain} that leads to the limit of stability; 0: none"
        ),
        "phase_margin": Figure(phase.margin, "deg", f"{loop}: phase left to -180 degrees, crossing nearest to it"),
        "phase_margin.frequency": Figure(phase.frequency, "Hz", f"{loop}: frequency of the phase margin"),
        "crossover": Figure(margins.crossover, "Hz", f"{loop}: open-loop gain passes 1 for the first time"),
        "crossover_last": Figure(margins.last_crossover, "Hz", f"{loop}: open-loop gain passes 1 for the last time"),
    }
