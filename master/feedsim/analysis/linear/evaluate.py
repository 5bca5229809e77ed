"""What the frequency responses of a machine say: resonances, bandwidths, margins, per axis and at the tool."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.linear import loops
from feedsim.analysis.linear.margins import Bandwidth, Margins, bandwidth, delay, margins
from feedsim.analysis.linear.plant import TOOL_DIRECTIONS
from feedsim.analysis.linear.search import Extreme, Pair, grid, pairs, peak
from feedsim.analysis.linear.stability import unstable_poles
from feedsim.analysis.linear.system import Closed, LinearSystem

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LOWEST = 1.0  # [Hz]
LOW_BAND = 5.0  # [Hz] up to here the axis is its inertia
DELAY_AT = 0.1  # [Hz] low against every mode and loop; the phase's curvature is removed anyway
RISE = 1.0  # [dB] least rise from anti-resonance to resonance that is reported
BEYOND = 1.05  # resonances are looked for up to this multiple of the highest mode's frequency
BELOW_MIRROR = 0.999  # of 1/(2 T): at the mirror frequency itself a sampled loop gain is real, whatever the loop


@dataclass(frozen=True)
class SpeedLoop:
    """The speed loop of an axis, its position loop open.

    Attributes:
        bandwidth: -3 dB of n_a/n_s.
        peak: highest maximum of |n_a/n_s| [dB]; None where there is none.
        delay: of n_a behind n_s at low frequencies [s].
        margins: of the open-loop gain.
        unstable_poles: of the system with every position loop open.
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
        low_deviation: largest deviation of |n/M| J_tot omega from 1, LOWEST to LOW_BAND [1].
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
    """Evaluate the system with the loops that it has closed; of the axes, only those named where any are.

    Raises:
        InputError: a pole lies on the limit of stability.
    """
    highest = 0.5 / system.machine.cycles.T_c * BELOW_MIRROR
    modal = system.modes.frequency.max() * BEYOND
    frequency = grid(system.modes, LOWEST, min(modal, highest) if modal > LOWEST else highest)
    structure = system.closing("none")
    return LinearResult(
        axes={axis: _axis(system, axis, frequency) for axis in (system.axes if axes is None else axes)},
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

    low = measured(np.geomspace(LOWEST, LOW_BAND, 200))
    return AxisResult(
        J_tot=J_tot,
        low_deviation=float(np.max(np.abs(10 ** (low / 20) - 1))),
        pairs=tuple(pairs(measured, frequency, RISE)),
        structure_pairs=tuple(pairs(structure, frequency, RISE)),
        speed=None if free else _speed(system, axis),
        position=_position(system, axis) if system.position_gains[system.axes.index(axis)] > 0 else None,
    )


def _speed(system: LinearSystem, axis: str) -> SpeedLoop:
    frequency = grid(system.modes, LOWEST, 0.5 / system.machine.cycles.T_c * BELOW_MIRROR)

    def reference(f: Floats) -> Complexes:
        return loops.speed_reference(system, axis, f)

    open_position: dict[str, Closed] = {
        each: "none" if loop == "none" else "speed" for each, loop in system.loops.items()
    }
    return SpeedLoop(
        bandwidth=bandwidth(reference, frequency),
        peak=peak(lambda f: _decibels(reference(f)), frequency),
        delay=delay(reference, DELAY_AT),
        margins=margins(lambda f: loops.speed_gain(system, axis, _s(f)), frequency),
        unstable_poles=unstable_poles(system.closing(open_position)),
    )


def _position(system: LinearSystem, axis: str) -> PositionLoop:
    frequency = grid(system.modes, LOWEST, 0.5 / system.machine.cycles.T_pos * BELOW_MIRROR)

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
