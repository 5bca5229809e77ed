"""Modes of an axis out of measured responses, and what they are to the table of modes of a machine.

The machine's rigid motion stays: shapes of the modes are relative to it, so that neither the torque constant nor the
unit of the input matters. With a_c and b_ck of the fit (rational.py) and the rigid mode n_0, x_0 of the axis,

    n_k = n_0 sqrt(b_motor,k / a_motor)          x_k = (x_0 / n_0) (b_scale,k / a_scale) (a_motor / b_motor,k) n_k
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan, sqrt
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.modal.measured import Measured
from feedsim.modal.neighbours import least, scatter
from feedsim.modal.rational import MOST_MODES, Fitted, extremes, fitted
from feedsim.structure.modes import TOOL_PORTS, Modes
from feedsim.trace.response import Complexes

MOTOR, SCALE = "motor", "scale"
# Share of a mode's frequency within which its peak is: friction alone makes one at low frequencies.
PEAK_DISTANCE = 0.25
OFF = 0.1  # share by which inertia and lead may differ from the machine's without a word
MAX_DEVIATIONS = 3.0, 30.0  # dB and degrees that 90 % of the motor's lines have to be within
HELD = 0.9  # share of the lines that a fit is judged by


@dataclass(frozen=True, eq=False)
class AxisModes:
    """What was found.

    measured, fit: in SI, accelerations over the input. own: output -> (N,) the machine's response at the lines.
    table: the machine's modes with those of the axis in place of all elastic ones; None where a mode cannot be placed.
    deviations: output -> dB and degrees that 90 % of the lines are within. scatter: the same about their neighbours.
    dips, peaks: of the motor [Hz]: of the fit, measured without it, and the standard deviation of that (nan where the
    measurement has none there).
    """

    axis: str
    measured: Measured
    fit: Fitted
    own: Mapping[str, Complexes]
    table: Modes
    deviations: Mapping[str, tuple[float, float]]
    scatter: Mapping[str, tuple[float, float]]
    dips: tuple[tuple[float, float, float], ...]
    peaks: tuple[tuple[float, float, float], ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def ratios(self) -> tuple[float, float, float] | None:
        """(peak/dip)^2 - 1 of the first mode, with light damping the inertia behind it over that of the motor: of the
        fit, measured, and the standard deviation of that; None without dip and peak."""
        first = self.fit.modes[0].frequency if self.fit.modes else nan
        peak = min(self.peaks, key=lambda peak: abs(peak[0] - first), default=None)
        dips = [dip for dip in self.dips if peak is not None and dip[0] < peak[0]]
        if peak is None or not dips:
            return None
        dip = dips[-1]
        square = (peak[1] / dip[1]) ** 2
        return (peak[0] / dip[0]) ** 2 - 1, square - 1, 2 * square * float(np.hypot(peak[2] / peak[1], dip[2] / dip[1]))

    @property
    def inertia_ratio(self) -> float | None:
        """Residue of the first mode over that of rigid motion at the motor: of two inertias, the further one over that
        of the motor, whatever their damping."""
        fit = self.fit
        return fit.modes[0].residues[MOTOR] / fit.rigid[MOTOR] if fit.modes else None


def identify_modes(measured: Measured, machine_modes: Modes, axis: str, modes: int | None = None) -> AxisModes:
    """Fit the responses of an axis. modes: how many; None: by cross-validation. InputError: what `fitted` refuses."""
    fit = fitted(measured.frequency, measured.values, measured.relative, modes)
    frequency = measured.frequency
    remaining = {
        name: _within(np.log(fit.response(name, frequency) / values)) for name, values in measured.values.items()
    }
    decibel, degrees = remaining[MOTOR]
    if decibel > MAX_DEVIATIONS[0] or degrees > MAX_DEVIATIONS[1]:
        raise InputError(
            f"axis {axis}: a rigid body with up to {MOST_MODES} modes and a delay meets 90 % of the lines within "
            f"{decibel:.2g} dB and {degrees:.2g} degrees only; {MAX_DEVIATIONS[0]:g} dB and {MAX_DEVIATIONS[1]:g} "
            "degrees are allowed. Is "
            "the input the torque or current at the motor, and not the setpoint of a closed loop? Else choose lines "
            "(--band)"
        )
    low, high = float(frequency[0]), float(frequency[-1])
    motor = measured.values[MOTOR]
    fine = np.geomspace(low, high, 20000)
    model = np.log(np.abs(fit.response(MOTOR, fine)))
    dips = tuple((f, *least(frequency, motor, f)) for f in extremes(fine, -model))
    peaks = tuple(
        (f, *least(frequency, 1 / motor, f))
        for f in extremes(fine, model)
        if any(abs(f / mode.frequency - 1) < PEAK_DISTANCE for mode in fit.modes)
    )
    warnings, notes = _said(measured, machine_modes, axis, fit)
    return AxisModes(
        axis, measured, fit, responses_of(machine_modes, axis, measured), _table(machine_modes, axis, fit),
        remaining, {name: _within(scatter(frequency, values)) for name, values in measured.values.items()},
        dips, peaks, tuple(warnings), tuple(notes),
    )  # fmt: skip


def responses_of(modes: Modes, axis: str, measured: Measured) -> dict[str, Complexes]:
    """Output -> (N,) acceleration over the motor torque, by a table of modes; without friction and delay."""
    s = 2j * np.pi * measured.frequency
    w = 2 * np.pi * modes.frequency
    shape = s[:, None] ** 2 / (s[:, None] ** 2 + 2 * modes.damping * w * s[:, None] + w**2)
    n = modes.ports[f"n_{axis}"]
    at = {MOTOR: n, SCALE: modes.ports[f"x_{axis}"]}
    # A sensor of another place is compared with the motor.
    result = {name: np.asarray(shape @ (n * at.get(name, n)), dtype=np.complex128) for name in measured.values}
    # Where the scale turns, it is compared as an angle.
    lead = _lead(modes, axis)
    if SCALE in result and not measured.linear[SCALE]:
        result[SCALE] = result[SCALE] / lead
    return result


def _lead(modes: Modes, axis: str) -> float:
    """Travel of the scale per radian of the rotor in rigid motion [m/rad]."""
    n, x = modes.ports[f"n_{axis}"][modes.rigid], modes.ports[f"x_{axis}"][modes.rigid]
    return float(n @ x / (n @ n))


def _within(logarithm: Complexes) -> tuple[float, float]:
    """dB and degrees that 90 % of differences of logarithms are within."""
    parts = 20 / np.log(10) * logarithm.real, np.degrees(logarithm.imag)
    decibel, degrees = (float(np.quantile(np.abs(part), HELD)) for part in parts)
    return decibel, degrees


def _said(measured: Measured, modes: Modes, axis: str, fit: Fitted) -> tuple[list[str], list[str]]:
    """Warnings and notes: senses, units, delays."""
    warnings: list[str] = []
    notes = list(measured.notes)
    if fit.rigid[MOTOR] < 0:
        notes.append(f"axis {axis}: the motor counts against its torque; its sign is turned")
    if SCALE in fit.rigid and fit.rigid[SCALE] * fit.rigid[MOTOR] < 0:
        notes.append(f"axis {axis}: motor and scale count against each other; the scale's sign is turned")
    if measured.input_unit == "N.m":
        J, own = 1 / abs(fit.rigid[MOTOR]), modes.J_tot(axis)
        if abs(J / own - 1) > OFF:
            warnings.append(
                f"axis {axis}: the response has an inertia of {J:.4g} kg.m2, the machine one of {own:.4g} kg.m2; the "
                "modes are written relative to the machine's"
            )
    if SCALE in fit.rigid:
        lead = abs(fit.rigid[SCALE] / fit.rigid[MOTOR])
        usual = abs(_lead(modes, axis)) if measured.linear[SCALE] else 1.0
        if abs(lead / usual - 1) > OFF:
            unit = "m/rad" if measured.linear[SCALE] else "rad/rad"
            warnings.append(
                f"axis {axis}: the scale moves by {lead:.4g} {unit} of the motor at low frequencies, where "
                f"{usual:.4g} {unit} are expected: its unit, or a gear"
            )
    return warnings, notes


def _table(modes: Modes, axis: str, fit: Fitted) -> Modes:
    """The machine's rigid modes, and those of the axis; other axes are rigid in it."""
    rigid = modes.rigid
    n_0 = 1 / sqrt(modes.J_tot(axis))
    x_0 = _lead(modes, axis) * n_0
    ports = {name: list(map(float, column[rigid])) for name, column in modes.ports.items()}
    frequency, damping = [0.0] * int(np.sum(rigid)), [0.0] * int(np.sum(rigid))
    for mode in fit.modes:
        share = mode.residues[MOTOR] / fit.rigid[MOTOR]
        if not share > 0:
            continue
        n = n_0 * sqrt(share)
        # Without a scale the mode is between motor and slide, which moves as orthogonality to the rigid motion asks.
        x_share = mode.residues[SCALE] / fit.rigid[SCALE] / share if SCALE in fit.rigid else -1.0 / share
        x = x_0 / n_0 * x_share * n
        frequency.append(mode.frequency)
        damping.append(mode.damping)
        moved = {f"n_{axis}": n, f"x_{axis}": x, **({f"tcp_{axis}": x} if f"tcp_{axis}" in TOOL_PORTS else {})}
        for name, column in ports.items():
            column.append(moved.get(name, 0.0))
    return Modes(
        Path("modes.csv"), np.array(frequency), np.array(damping), {name: np.array(c) for name, c in ports.items()}
    )
