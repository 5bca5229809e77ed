"""What the frequency responses of a machine say: resonances, bandwidths, margins, as results and as figures. Names of
the room `linear` stand here, too, for who evaluates it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from feedsim.analysis.figures import Figure
from feedsim.foundation.parallel import Reporter, in_parallel
from feedsim.linear import loops
from feedsim.linear.loops import (
    compliance,
    names,
    position_gain,
    position_reference,
    response,
    scale_response,
    speed_controlled_system,
    speed_gain,
    speed_reference,
    structure,
    unstable_poles,
)
from feedsim.linear.margins import (
    Bandwidth,
    Extreme,
    GainCrossing,
    Margins,
    Pair,
    PhaseCrossing,
    bandwidth,
    crossings,
    delay,
    extremes,
    grid,
    margins,
    pairs,
    peak,
)
from feedsim.linear.plant import TOOL_DIRECTIONS, Complexes, Floats, OperatingPoint
from feedsim.linear.system import ClosedLoop, LinearSystem

__all__ = [
    "AxisResult", "Bandwidth", "ClosedLoop", "Extreme", "GainCrossing", "LinearResult", "LinearSystem", "Margins",
    "OperatingPoint", "Pair", "PhaseCrossing", "PositionLoop", "SpeedLoop", "bandwidth", "compliance", "crossings",
    "delay", "evaluate", "extremes", "figures", "grid", "margins", "names", "pairs", "peak", "position_gain",
    "position_reference", "response", "scale_response", "speed_controlled_system", "speed_gain", "speed_reference",
    "structure", "unstable_poles",
]  # fmt: skip

LOWEST_FREQUENCY = 1.0  # [Hz]
LOW_BAND = 5.0  # [Hz] up to here the axis is its inertia
DELAY_AT = 0.1  # [Hz] low against every mode and loop; the phase's curvature is removed anyway
MIN_RESONANCE_RISE = 1.0  # [dB] least rise from anti-resonance to resonance that is reported
RESONANCE_MARGIN = 1.05  # resonances are looked for up to this multiple of the highest mode's frequency
BELOW_MIRROR = 0.999  # of 1/(2 T): at the mirror frequency itself a sampled loop gain is real, whatever the loop


@dataclass(frozen=True)
class SpeedLoop:
    """The speed loop of an axis, its position loop open, other loops as they are.

    Attributes:
        bandwidth: -3 dB of n_a/n_s.
        peak: highest maximum of |n_a/n_s| [dB]; None where there is none.
        delay: of n_a behind n_s at low frequencies [s].
        margins: of the open-loop gain.
        unstable_poles: of the system with the position loop of the axis open.
    """

    bandwidth: Bandwidth
    peak: Extreme | None
    delay: float
    margins: Margins
    unstable_poles: int


@dataclass(frozen=True)
class PositionLoop:
    """The position loop of an axis.

    Attributes:
        bandwidth: -3 dB of x_a/x_s without feedforward.
        bandwidth_feedforward: the same with it.
        peak: highest maximum of |x_a/x_s| without feedforward [dB]; None where there is none.
        margins: of the sampled open-loop gain.
    """

    bandwidth: Bandwidth
    bandwidth_feedforward: Bandwidth
    peak: Extreme | None
    margins: Margins


@dataclass(frozen=True)
class AxisResult:
    """An axis.

    Attributes:
        J_tot: inertia that a slow torque accelerates [kg.m2].
        low_deviation: largest deviation of |n/M| J_tot omega from 1, LOWEST_FREQUENCY to LOW_BAND [1].
        pairs: of |n/M| J_tot omega [dB], speed-controlled system as measured: other loops as they are.
        structure_pairs: the same of the structure alone, other motors without torque.
        speed: None where the axis has no control.
        position: None where its position loop is open.
    """

    J_tot: float
    low_deviation: float
    pairs: tuple[Pair, ...]
    structure_pairs: tuple[Pair, ...]
    speed: SpeedLoop | None
    position: PositionLoop | None


@dataclass(frozen=True)
class LinearResult:
    """All axes, and per direction the tool's compliance.

    Attributes:
        compliance: direction -> highest maximum of |x_d/F_d| [m/N], loops as they are; None where there is none.
        structure_compliance: the same with motors without torque.
        unstable_poles: of the system as it is; the other figures presume 0.
    """

    axes: Mapping[str, AxisResult]
    compliance: Mapping[str, Extreme | None]
    structure_compliance: Mapping[str, Extreme | None]
    unstable_poles: int


def evaluate(system: LinearSystem, axes: Sequence[str] | None = None) -> LinearResult:
    """Evaluate the system with the loops that it has closed; of the axes, only those named where any are. Behind the
    first axis, which finds what all of them share, as many at once as there are cores.

    Raises:
        InputError: a pole lies on the limit of stability.
    """
    highest = 0.5 / system.machine.cycles.T_c * BELOW_MIRROR
    modal = system.modes.frequency.max() * RESONANCE_MARGIN
    frequency = grid(system.modes, LOWEST_FREQUENCY, min(modal, highest) if modal > LOWEST_FREQUENCY else highest)
    structure = system.closing("none")
    names = tuple(system.axes if axes is None else axes)

    def one(axis: str, say: Reporter) -> AxisResult:
        return _axis(system, axis, frequency)

    of_axes = [_axis(system, axis, frequency) for axis in names[:1]]
    of_axes += in_parallel([partial(one, axis) for axis in names[1:]])
    return LinearResult(
        axes=dict(zip(names, of_axes, strict=True)),
        compliance={d: _compliance(system, d, frequency) for d in TOOL_DIRECTIONS},
        structure_compliance={d: _compliance(structure, d, frequency) for d in TOOL_DIRECTIONS},
        unstable_poles=unstable_poles(system),
    )


def _axis(system: LinearSystem, axis: str, frequency: Floats) -> AxisResult:
    J_tot = system.modes.J_tot(axis)
    free = system.loops[axis] == "none"

    def structure(f: Floats) -> Floats:
        return _decibels(loops.structure(system, f, f"{axis}.n_a", axis) * 2 * np.pi * f * J_tot)

    def measured(f: Floats) -> Floats:
        if free:
            response = system.transfer(f, f"{axis}.n_a", f"{axis}.M_a")
        else:
            response = loops.speed_controlled_system(system, axis, f)
        return _decibels(response * 2 * np.pi * f * J_tot)

    low = measured(np.geomspace(LOWEST_FREQUENCY, LOW_BAND, 200))
    return AxisResult(
        J_tot=J_tot,
        low_deviation=float(np.max(np.abs(10 ** (low / 20) - 1))),
        pairs=tuple(pairs(measured, frequency, MIN_RESONANCE_RISE)),
        structure_pairs=tuple(pairs(structure, frequency, MIN_RESONANCE_RISE)),
        speed=None if free else _evaluate_speed_loop(system, axis),
        position=_evaluate_position_loop(system, axis) if system.position_gains[system.axes.index(axis)] > 0 else None,
    )


def _evaluate_speed_loop(system: LinearSystem, axis: str) -> SpeedLoop:
    frequency = grid(system.modes, LOWEST_FREQUENCY, 0.5 / system.machine.cycles.T_c * BELOW_MIRROR)

    def reference(f: Floats) -> Complexes:
        return loops.speed_reference(system, axis, f)

    return SpeedLoop(
        bandwidth=bandwidth(reference, frequency),
        peak=peak(lambda f: _decibels(reference(f)), frequency),
        delay=delay(reference, DELAY_AT),
        margins=margins(lambda f: loops.speed_gain(system, axis, _s(f)), frequency),
        unstable_poles=unstable_poles(system.closing({axis: "speed"})),
    )


def _evaluate_position_loop(system: LinearSystem, axis: str) -> PositionLoop:
    frequency = grid(system.modes, LOWEST_FREQUENCY, 0.5 / system.machine.cycles.T_pos * BELOW_MIRROR)

    def reference(f: Floats) -> Complexes:
        return loops.position_reference(system, axis, f)

    return PositionLoop(
        bandwidth=bandwidth(reference, frequency),
        bandwidth_feedforward=bandwidth(
            lambda f: loops.position_reference(system, axis, f, feedforward=True), frequency
        ),
        peak=peak(lambda f: _decibels(reference(f)), frequency),
        margins=margins(lambda f: loops.position_gain(system, axis, _s(f)), frequency),
    )


def _compliance(system: LinearSystem, direction: str, frequency: Floats) -> Extreme | None:
    return peak(lambda f: np.abs(loops.compliance(system, direction, f)), frequency)


def _s(frequency: Floats) -> Complexes:
    return np.asarray(2j * np.pi * frequency, dtype=np.complex128)


def _decibels(response: Complexes) -> Floats:
    return np.asarray(20 * np.log10(np.abs(response)))


def figures(result: LinearResult | LinearSystem) -> dict[str, Figure]:
    """Figures of an evaluated system, or of a system, which is evaluated first. NaN where something does not occur.

    Raises:
        InputError: a pole lies on the limit of stability.
    """
    if isinstance(result, LinearSystem):
        result = evaluate(result)
    results = {
        "unstable_poles": Figure(
            float(result.unstable_poles), "1", "growing solutions of the closed system; the other figures presume 0"
        )
    }
    for axis, of_axis in result.axes.items():
        results |= {f"{axis}.{name}": figure for name, figure in _axis_figures(of_axis).items()}
    for drives, responses in (("as they are", result.compliance), ("without torque", result.structure_compliance)):
        prefix = "tool" if responses is result.compliance else "tool.free"
        for direction, top in responses.items():
            name = f"{prefix}.compliance_{direction}"
            what = f"highest maximum of |x_{direction}/F_{direction}| at the tool, drives {drives}"
            results[name] = Figure(top.value * 1e6 if top else math.nan, "um/N", what)
            results[f"{name}.frequency"] = Figure(top.frequency if top else math.nan, "Hz", f"frequency of the {what}")
    return results


def _axis_figures(result: AxisResult) -> dict[str, Figure]:
    results = {
        "J_tot": Figure(result.J_tot, "kg.m2", "inertia that a slow motor torque accelerates"),
        "n_M.low_deviation": Figure(
            100 * result.low_deviation,
            "%",
            f"largest deviation of |n/M| J_tot omega from 1, {LOWEST_FREQUENCY:g} to {LOW_BAND:g} Hz",
        ),
    }
    for prefix, found_pairs, system in (
        ("n_M", result.pairs, "speed-controlled system, other loops as they are"),
        ("structure", result.structure_pairs, "structure alone, other motors without torque"),
    ):
        for i, pair in enumerate(found_pairs, start=1):
            rise = pair.resonance.value - pair.antiresonance.value
            results |= {
                f"{prefix}.antiresonance_{i}": Figure(
                    pair.antiresonance.frequency, "Hz", f"minimum {i} of |n/M| omega, {system}"
                ),
                f"{prefix}.resonance_{i}": Figure(
                    pair.resonance.frequency, "Hz", f"maximum of |n/M| omega after minimum {i}, {system}"
                ),
                f"{prefix}.rise_{i}": Figure(rise, "dB", f"from minimum {i} to the maximum of |n/M| omega, {system}"),
            }
    if result.speed is not None:
        results |= {f"speed.{name}": figure for name, figure in _speed_figures(result.speed).items()}
    if result.position is not None:
        results |= {f"position.{name}": figure for name, figure in _position_figures(result.position).items()}
    return results


def _speed_figures(loop: SpeedLoop) -> dict[str, Figure]:
    return {
        "bandwidth_first": Figure(loop.bandwidth.first, "Hz", "n_a/n_s falls below -3 dB for the first time"),
        "bandwidth_last": Figure(loop.bandwidth.last, "Hz", "n_a/n_s falls below -3 dB for the last time"),
        **_peak_figures(loop.peak, "|n_a/n_s|"),
        "delay": Figure(1e3 * loop.delay, "ms", "delay of n_a behind n_s at low frequencies; 2 D/omega_0 + T_ref"),
        **_margin_figures(loop.margins, "speed loop", "K_p"),
        "unstable_poles": Figure(float(loop.unstable_poles), "1", "growing solutions, the axis' position loop open"),
    }


def _position_figures(loop: PositionLoop) -> dict[str, Figure]:
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
        **_peak_figures(loop.peak, "|x_a/x_s| without feedforward"),
        **_margin_figures(loop.margins, "position loop", "K_v"),
    }


def _peak_figures(peak: Extreme | None, what: str) -> dict[str, Figure]:
    return {
        "peak": Figure(peak.value if peak else math.nan, "dB", f"highest maximum of {what}"),
        "peak.frequency": Figure(peak.frequency if peak else math.nan, "Hz", f"frequency of the maximum of {what}"),
    }


def _margin_figures(margins: Margins, loop: str, gain: str) -> dict[str, Figure]:
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
