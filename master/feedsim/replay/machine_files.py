"""A machine folder out of what was identified: machine.yaml, modes.csv, and per axis drive_A.yaml and friction_A.yaml.

The axes move independently: one mode of frequency 0 each, with the inertia that was found. The elastic modes of each
may move the scales of others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, pi, sqrt
from typing import Any

from pydantic.fields import FieldInfo

from feedsim.fields import Quantity
from feedsim.identify import AxisLimits
from feedsim.identify.friction_file import DIGITS, Line, friction_text, interval_text
from feedsim.identify.result import Correlation, Estimate
from feedsim.replay.elastic import ElasticMode
from feedsim.scenario import Drive, Filter, Friction
from feedsim.scenario.parameter_group import ParameterGroup

TOOL_AXES = ("X", "Y", "Z")
CONTROL = 125e-6  # [s] the usual control cycle
ASSUMED = "assumed: the record does not show it"


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
        files[drive_file(axis)] = drive_text(rigid_axis.drive, rigid_axis.estimates, ASSUMED, rigid_axis.head)
        files[friction_file(axis)] = friction_axis_text(
            axis, rigid_axis.values, rigid_axis.estimates, rigid_axis.head, rigid_axis.correlation
        )
    return files


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
        f"name: {_quoted(name)}", f"note: {_quoted(note)}", *([f"control: {of}"] if of else []), "",
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
            entries.append((f"{key}: {_shown(value, info, exact)}", remark))
    column = max(len(entry) for entry, _ in entries) + 3
    lines = [f"# {line}".rstrip() for line in head]
    return (
        "\n".join([*lines, *(f"{entry:<{column}}# {remark}" if remark else entry for entry, remark in entries)]) + "\n"
    )


def _group(group: ParameterGroup, exact: bool) -> str:
    fields = type(group).model_fields
    given = {key: getattr(group, key) for key in fields if getattr(group, key) is not None}
    return ", ".join(f"{key}: {_shown(value, fields[key], exact)}" for key, value in given.items())


def _shown(value: float | int | bool | str, info: FieldInfo, exact: bool) -> str:
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
    identified = _identified(axis, estimates, correlation) if correlation is not None else {}
    return friction_text(lines, identified, head, name=friction_file(axis))


def _identified(axis: str, estimates: Mapping[str, Estimate], correlation: Correlation) -> dict[str, Any]:
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


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
