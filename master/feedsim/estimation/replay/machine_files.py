"""A machine folder out of what was identified: machine.yaml, modes.csv, and per axis drive_A.yaml and friction_A.yaml.

The axes move independently: one mode of frequency 0 each, with the inertia that was found. The elastic modes of each
may move the scales of others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, pi, sqrt
from typing import Any

import numpy as np
from pydantic.fields import FieldInfo
from scipy.signal import cont2discrete, lfilter, ss2tf

from feedsim.estimation.identify import AxisLimits
from feedsim.estimation.identify.friction_file import DIGITS, Line, friction_text, interval_text
from feedsim.estimation.identify.result import Correlation, Estimate
from feedsim.estimation.replay.closed_loop import AxisRecord
from feedsim.files.fields import Quantity
from feedsim.files.trace.trace import Array
from feedsim.scenario import Drive, Filter, Friction, Machine
from feedsim.scenario.axis_units import ParameterGroup
from feedsim.structure import checked_modes
from feedsim.structure.modes import Modes, table_of_modes

# --- Elastic modes of an axis in a record: how many, where they are, and what they are in the units -------------------
# What a rigid axis leaves of the position is regressed on the axis' own acceleration a, seen by a resonance:
#
#     x_recorded - x_simulated = c q + d (dq/dt)/w
#     d2q/dt2 + 2 D w dq/dt + w^2 q = w^2 a
#
# Frequency and damping are chosen on a grid, one resonance after the other; the quadrature d stands for what the closed
# loop does to it. In the units a mode is one of the table of modes, relative to the rigid motion: n_k = u n_0,
# x_k = v x_0; frequency, damping, u and v are fitted with the rest (tuning.py), and then the next resonance is looked
# for in what the units leave.


MOST_MODES = 5
RESONANCE_FREQUENCIES = 60  # frequencies
DAMPING_RATIOS = (0.01, 0.03, 0.06, 0.1)
# Below twice the position loop's corner its gains do the same as a mode; above a fifth of the rows' rate nothing shows.
ABOVE_LOOP, BELOW_RATE = 2.0, 0.2
RINGS = 0.2  # [s] behind the motion in which an axis still swings


@dataclass(frozen=True)
class CoupledShape:
    """What a mode of one axis does at the scale of another one.

    axis: the other one. shape: mode shape at its scale over the rigid motion of the mode's own axis [1]. sigma: its
    standard deviation.
    """

    axis: str
    shape: float
    sigma: float


@dataclass(frozen=True)
class ElasticMode:
    """A mode of an axis.

    frequency [Hz], damping [1]; motor, scale: mode shape at rotor and scale over that of the rigid motion [1].
    sigma: standard deviations of the four, in this order; nan where they are not known. beside: other axes that it
    moves.
    """

    frequency: float
    damping: float
    motor: float
    scale: float
    sigma: tuple[float, ...] = (np.nan,) * 4
    beside: tuple[CoupledShape, ...] = ()


@dataclass(frozen=True)
class Resonance:
    """A resonance of the regression: frequency [Hz], damping, and c and d of it together, with the sign of c [s2]."""

    frequency: float
    damping: float
    gain: float


def resonance(axis_record: AxisRecord, simulated: Array, per_row: int, K_v: float) -> Resonance | None:
    """The resonance that takes most of what a simulation leaves; None where the rows are too far apart for any.

    Args:
        simulated: ((N - 1) per_row + 1,) position [m]. K_v: of the position loop [1/s].
    """
    h = axis_record.record.interval
    remaining = axis_record.position - simulated[::per_row]
    behind = np.ones(round(RINGS / h) + 1)
    rows = np.flatnonzero(axis_record.rows & (np.convolve(axis_record.moving, behind)[: len(remaining)] > 0.5))
    acceleration = np.gradient(np.gradient(simulated, h / per_row), h / per_row)
    low, high = ABOVE_LOOP * K_v / (2 * pi), BELOW_RATE / h
    best: tuple[float, Resonance] | None = None
    for f in np.geomspace(low, high, RESONANCE_FREQUENCIES) if low < high else ():
        for D in DAMPING_RATIOS:
            A = resonator(float(f), D, acceleration, h / per_row)[::per_row][rows]
            c = _solve_least_squares(A, remaining[rows])
            off = float(np.sum((remaining[rows] - A @ c) ** 2))
            if best is None or off < best[0]:
                best = off, Resonance(float(f), D, float(np.copysign(np.hypot(c[0], c[1]), c[0])))
    return best[1] if best is not None else None


def resonator(frequency: float, damping: float, a: Array, h: float) -> Array:
    """(N, 2) q and dq/dt / w of a resonance, by its exact answer to steps of `a`."""
    w = 2 * pi * frequency
    A, B = np.array([[0.0, 1.0], [-(w**2), -2 * damping * w]]), np.array([[0.0], [w**2]])
    discrete = cont2discrete((A, B, np.diag([1.0, 1.0 / w]), np.zeros((2, 1))), h, "zoh")
    numerators, denominator = ss2tf(*discrete[:4])
    return np.column_stack([lfilter(numerator, denominator, a) for numerator in numerators])


def _solve_least_squares(A: Array, y: Array) -> Array:
    """Least squares by the normal equations of scaled columns: there are few, and many of them are tried."""
    scale = np.linalg.norm(A, axis=0) + 1e-300
    N = (A / scale).T @ (A / scale)
    N[np.diag_indices_from(N)] += 1e-10
    return np.asarray(np.linalg.solve(N, (A / scale).T @ y) / scale)


def with_modes(machine: Machine, axis: str, modes: Sequence[ElasticMode]) -> Machine:
    """The machine with modes of an axis added to its table."""
    table = checked_modes(machine)
    n_0 = 1 / sqrt(table.J_tot(axis))
    x_0 = n_0 * machine.axes[axis].I_P
    further = [{f"n_{axis}": mode.motor * n_0, f"x_{axis}": mode.scale * x_0, f"tcp_{axis}": mode.scale * x_0}
               for mode in modes]  # fmt: skip
    whole = Modes(
        machine.modes.file,
        np.append(table.frequency, [mode.frequency for mode in modes]),
        np.append(table.damping, [mode.damping for mode in modes]),
        {port: np.append(column, [moved.get(port, 0.0) for moved in further]) for port, column in table.ports.items()},
    )
    return machine.model_copy(update={"modes": table_of_modes(whole, machine.modes.file)})


KEYS = ("mode_f", "mode_D", "mode_u", "mode_v")


def begin_mode(k: int, one: Resonance, sign: float) -> dict[str, float]:
    """Values to begin a fit of the k-th mode with. The product u v is c w^2; motor and scale share it alike at first.
    sign: 1, or -1 where the closed loop turns what the regression sees."""
    product = sign * one.gain * (2 * pi * one.frequency) ** 2
    u = max(sqrt(abs(product)), 1e-3)
    return dict(zip((f"{key}_{k}" for key in KEYS), (one.frequency, one.damping, u, product / u), strict=True))


def modes_of(values: Mapping[str, float]) -> list[ElasticMode]:
    """The modes in values of a fit."""
    elastic_modes = []
    k = 1
    while f"mode_f_{k}" in values:
        f, D, u, v = (values[f"{key}_{k}"] for key in KEYS)
        elastic_modes.append(ElasticMode(f, D, u, v))
        k += 1
    return elastic_modes


# --- A machine folder out of what was identified: machine.yaml, modes.csv, and per axis drive_A.yaml and
#     friction_A.yaml


TOOL_AXES = ("X", "Y", "Z")
CONTROL = 125e-6  # [s] the usual control cycle
ASSUMED_REMARK = "assumed: the record does not show it"


def simple_drive(values: Mapping[str, float], torque: float) -> Drive:
    """A drive with what a record determines, and without what it does not: no reference model, no filters, an ideal
    current loop. values: K_v, k_ffw, T_dyn, T_sym, K_p, K_i = K_p/T_n. torque: limit [N.m]."""
    same = {name: values[name] for name in ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p")}
    assumed = {"ramp_speed_setpoint": False, "reference_model": False, "ideal_current_loop": True, "K_t": 1.0}
    return Drive.model_validate({**same, "T_n": values["K_p"] / values["K_i"], "M_max": torque, **assumed})


@dataclass(frozen=True)
class RigidAxis:
    """An axis as it goes into the folder.

    limits: as start.limits gives them. values: of the friction, J and M_0, SI; estimates: of what was determined.
    setpoints: limits that its setpoints keep, where moves show them.
    """

    pitch: float
    position: float
    limits: Mapping[str, float]
    drive: Drive
    values: Mapping[str, float]
    estimates: Mapping[str, Estimate]
    head: Sequence[str] = ()
    modes: Sequence[ElasticMode] = ()
    correlation: Correlation | None = None
    setpoints: AxisLimits | None = None


def control_cycle(interval: float) -> float:
    """The usual control cycle, or the nearest that rows `interval` [s] apart are whole multiples of."""
    return interval / max(round(interval / CONTROL), 1)


def machine_files(
    name: str, note: str, axes: Mapping[str, RigidAxis], interval: float, position_cycle: float, control: str = ""
) -> dict[str, str]:
    """File name -> text, of the whole folder. interval: of the record's rows [s]. control: that the record is of."""
    files = {"machine.yaml": _machine(name, note, axes, interval, position_cycle, control), "modes.csv": _modes(axes)}
    for axis, rigid_axis in axes.items():
        files[drive_file(axis)] = drive_text(rigid_axis.drive, rigid_axis.estimates, ASSUMED_REMARK, rigid_axis.head)
        files[friction_file(axis)] = friction_axis_text(
            axis, rigid_axis.values, rigid_axis.estimates, rigid_axis.head, rigid_axis.correlation
        )
    return files


def file_names(axes: Sequence[str]) -> list[str]:
    """Names of all files that the folder of these axes may have."""
    return ["machine.yaml", "modes.csv", *(file for axis in axes for file in (drive_file(axis), friction_file(axis)))]


def drive_file(axis: str) -> str:
    return f"drive_{axis}.yaml"


def friction_file(axis: str) -> str:
    return f"friction_{axis}.yaml"


def _modes(axes: Mapping[str, RigidAxis]) -> str:
    ports = [f"{kind}_{axis}" for kind in ("n", "x") for axis in axes] + [f"tcp_{axis}" for axis in TOOL_AXES]
    lines = [",".join(["mode", "frequency [Hz]", "damping ratio [1]", *ports])]
    rows: list[tuple[float, float, dict[str, float]]] = []
    for axis, rigid_axis in axes.items():
        n = 1.0 / sqrt(rigid_axis.values["J"])
        x = n * rigid_axis.pitch / (2 * pi)
        moved = {f"n_{axis}": n, f"x_{axis}": x, f"tcp_{axis}": x}
        rows.append((0.0, 0.0, moved))
    for axis, rigid_axis in axes.items():
        n = 1.0 / sqrt(rigid_axis.values["J"])
        x = n * rigid_axis.pitch / (2 * pi)
        for mode in rigid_axis.modes:
            moved = {f"n_{axis}": mode.motor * n, f"x_{axis}": mode.scale * x, f"tcp_{axis}": mode.scale * x}
            for other in mode.beside:
                moved |= {f"x_{other.axis}": other.shape * x, f"tcp_{other.axis}": other.shape * x}
            rows.append((mode.frequency, mode.damping, moved))
    for k, (frequency, damping, moved) in enumerate(rows):
        numbers = (frequency, damping, *(moved.get(port, 0.0) for port in ports))
        lines.append(",".join([str(k), *(repr(float(number)) for number in numbers)]))
    return "\n".join(lines) + "\n"


def _machine(
    name: str, note: str, axes: Mapping[str, RigidAxis], interval: float, position_cycle: float, of: str
) -> str:
    pose = ", ".join(f"{axis}: {_text(1e3 * rigid_axis.position)} mm" for axis, rigid_axis in axes.items())
    control = control_cycle(interval)
    lines = [
        f"name: {_quote_text(name)}", f"note: {_quote_text(note)}", *([f"control: {of}"] if of else []), "",
        "modes: modes.csv", f"pose: {{{pose}}}", "",
        f"cycles: {{control: {_text(1e6 * control)} us, position: {_text(1e6 * position_cycle)} us, "
        f"interpolation: {_text(1e6 * interval)} us}}",
        f"path: {{jerk: {_text(max(axis.limits['jerk'] for axis in axes.values()))} m/s^3, "
        f"acceleration: {_text(max(axis.limits['acceleration'] for axis in axes.values()))} m/s^2}}",
        "", "# Travel, speed and acceleration are those of the record with a reserve of a half.", "axes:",
    ]  # fmt: skip
    for axis, value in axes.items():
        own = value.limits
        lines += [
            f"  {axis}:",
            f"    pitch: {_text(1e3 * value.pitch)} mm",
            f"    travel: [{_text(1e3 * own['low'])} mm, {_text(1e3 * own['high'])} mm]",
            f"    max_speed: {_text(own['speed'])} m/s",
            f"    max_acceleration: {_text(own['acceleration'])} m/s^2",
            *(
                [f"    max_jerk: {_text(value.setpoints.jerk)} m/s^3  # of the setpoints, {value.setpoints.words}"]
                if value.setpoints is not None
                else []
            ),
            "    limits_from: that of the record and a reserve of a half; the axis itself may have more",
            f"    constant_load: {_text(value.values['M_0'])} N.m{_remark(value.estimates.get('M_0'))}",
            f"    drive: {drive_file(axis)}",
            f"    friction: {friction_file(axis)}",
        ]
    return "\n".join(lines) + "\n"


def drive_text(
    drive: Drive, estimates: Mapping[str, Estimate], rest: str, head: Sequence[str] = (), *, exact: bool = False
) -> str:
    """Text of a drive file: what was found with its interval; all else as the drive has it, with the remark `rest`.

    exact: with the digits that give every value back to the last bit.
    """
    entries: list[tuple[str, str]] = []
    for key, info in Drive.model_fields.items():
        value = getattr(drive, key)
        remark = _remark(estimates[key]).removeprefix("  # ") if key in estimates else rest
        if isinstance(value, ParameterGroup):
            if not (isinstance(value, Filter) and value.type == "off"):
                entries.append((f"{key}: {{{_group(value, exact)}}}", remark))
        elif value is not None:
            entries.append((f"{key}: {_value_text(value, info, exact)}", remark))
    column = max(len(entry) for entry, _ in entries) + 3
    lines = [f"# {line}".rstrip() for line in head]
    return (
        "\n".join([*lines, *(f"{entry:<{column}}# {remark}" if remark else entry for entry, remark in entries)]) + "\n"
    )


def _group(group: ParameterGroup, exact: bool) -> str:
    fields = type(group).model_fields
    given = {key: getattr(group, key) for key in fields if getattr(group, key) is not None}
    return ", ".join(f"{key}: {_value_text(value, fields[key], exact)}" for key, value in given.items())


def _value_text(value: float | int | bool | str, info: FieldInfo, exact: bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    quantity = Quantity.of(info)
    if quantity is None or isinstance(value, str):
        return str(value)
    number = repr(value) if exact else _number(value)
    return f"{number} {quantity.unit}".removesuffix(" 1")


def friction_axis_text(
    axis: str, values: Mapping[str, float], estimates: Mapping[str, Estimate], head: Sequence[str] = (),
    correlation: Correlation | None = None,
) -> str:  # fmt: skip
    """Text of a friction file: what was found with its interval.

    Its group `identified` has intervals and correlations of drive, inertia and friction, which one fit has found.
    """
    lines = {
        name: Line(values[name], _remark(estimates.get(name)).removeprefix("  # "))
        for name in Friction.model_fields
        if name in values
    }
    identified = _identified_group(axis, estimates, correlation) if correlation is not None else {}
    return friction_text(lines, identified, head, name=friction_file(axis))


def _identified_group(axis: str, estimates: Mapping[str, Estimate], correlation: Correlation) -> dict[str, Any]:
    """The group `identified`, as that of friction.yaml; values of the drive by names such as "drive.K_p"."""
    beside = {"M_0": "constant_load", "J": "inertia"}

    def named(name: str) -> str:
        return name if name in Friction.model_fields or name in (*beside, "delay") else f"drive.{name}"

    known = {name: estimate for name, estimate in estimates.items() if name in correlation.names}
    ends = {
        name: [
            float(f"{end:.8g}") if estimate.unit == "1" else f"{end:.8g} {estimate.unit}" for end in estimate.interval
        ]
        for name, estimate in known.items()
    }
    parts = {name: {"status": estimate.status, "interval": ends[name]} for name, estimate in known.items()}
    matrix = [[round(float(value), 4) for value in row] for row in correlation.matrix]
    return {
        "axis": axis,
        **{key: parts[name] for name, key in beside.items() if name in parts},
        "parameters": {named(name): part for name, part in parts.items() if name not in (*beside, "delay")},
        "correlation": {"names": [named(name) for name in correlation.names], "matrix": matrix},
    }


def _remark(estimate: Estimate | None) -> str:
    if estimate is None:
        return ""
    interval = interval_text(estimate)
    remark = f"95 %: {interval}" if interval else ""
    if estimate.status == "undetermined":
        remark = f"not determined: {estimate.reason}" + (f" ({remark})" if remark else "")
    return f"  # {remark}" if remark else ""


def _number(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def _text(value: float) -> str:
    """To a number of digits that a person reads; without an exponent."""
    assert isfinite(value)
    return f"{float(f'{value:.6g}'):.10f}".rstrip("0").rstrip(".")


def _quote_text(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
