"""The functions of frequency that a drive is judged by, each with its definition and its name.

Names are output/input: "Z.n_a/Z.M_a" speed-controlled system, "Z.x_a/Z.M_a" linear scale over motor torque,
"Z.n_a/Z.n_s" speed reference, "Z.x_a/Z.x_s" position reference (without feedforward), "tool.x_X/tool.F_X" compliance at
the tool; "Z.speed_loop" and "Z.position_loop" are open-loop gains. Definitions: docs/figures.md.

"Other loops as they are" means: the other axes keep the loops that the given system has closed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from feedsim.foundation.errors import InputError
from feedsim.linear.margins import grid
from feedsim.linear.plant import TOOL_DIRECTIONS, Complexes, Floats
from feedsim.linear.system import LinearSystem
from feedsim.linear.system import unit_of as unit_of_response

LOOP_QUANTITIES = {  # of an axis: part of a figure's name -> response, what it is
    "n_M": ("{0}.n_a/{0}.M_a", "n/M"),
    "x_M": ("{0}.x_a/{0}.M_a", "x/M"),
    "n_n": ("{0}.n_a/{0}.n_s", "n_a/n_s"),
    "x_x": ("{0}.x_a/{0}.x_s", "x_a/x_s"),
}
COMPLIANCE = "tool.x_{0}/tool.F_{0}"
LOOPS = ("speed_loop", "position_loop")


def names(axes: Sequence[str], *, tool: bool) -> tuple[str, ...]:
    """Responses of these axes that have a closed form, and those at the tool."""
    own = [name.format(axis) for axis in axes for name, _ in LOOP_QUANTITIES.values()]
    gains = [f"{axis}.{loop}" for axis in axes for loop in LOOPS]
    return (*own, *gains, *((COMPLIANCE.format(d) for d in TOOL_DIRECTIONS) if tool else ()))


def unit_of(name: str) -> str:
    """Unit of a response, by its name."""
    output, _, source = name.partition("/")
    return unit_of_response(output, source) if source else "1"


def figure_key(name: str) -> str:
    """First part of a figure's name for a response: "Z.n_M", "tool.compliance_X"."""
    axis = name.partition(".")[0]
    for key, (known, _) in LOOP_QUANTITIES.items():
        if name == known.format(axis):
            return f"{axis}.{key}"
    return f"tool.compliance_{name[-1]}" if axis == "tool" else name


def response(system: LinearSystem, name: str, frequency: Floats) -> Complexes:
    """A response in closed form, by its name. InputError: no such response."""
    axis, _, rest = name.partition(".")
    if name in (COMPLIANCE.format(direction) for direction in TOOL_DIRECTIONS):
        return compliance(system, name[-1], frequency)
    if axis in system.axes:
        s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
        if rest == "speed_loop":
            return speed_gain(system, axis, s)
        if rest == "position_loop":
            return position_gain(system, axis, s)
        functions = (speed_controlled_system, scale_response, speed_reference, position_reference)
        for key, function in zip(LOOP_QUANTITIES, functions, strict=True):
            if name == LOOP_QUANTITIES[key][0].format(axis):
                return function(system, axis, frequency)
    known = ", ".join(names(system.axes, tool=True))
    raise InputError(f"no frequency response '{name}'; there are {known}")


def speed_controlled_system(system: LinearSystem, axis: str, frequency: Floats) -> Complexes:
    """n_a/M_a [(rad/s)/(N.m)] as measured: both excited by M_add of the axis, its position loop open, other loops as
    they are. What n_add instead of M_add finds is the same."""
    return system.closing({axis: "speed"}).ratio(frequency, f"{axis}.n_a", f"{axis}.M_a", f"{axis}.M_add")


def scale_response(system: LinearSystem, axis: str, frequency: Floats) -> Complexes:
    """x_a/M_a [m/(N.m)], otherwise as :func:`speed_controlled_system`."""
    return system.closing({axis: "speed"}).ratio(frequency, f"{axis}.x_a", f"{axis}.M_a", f"{axis}.M_add")


def structure(system: LinearSystem, frequency: Floats, output: str, axis: str) -> Complexes:
    """`output` over the motor torque of the axis, every other motor without torque: the structure alone, sampled."""
    return system.closing("none").transfer(frequency, output, f"{axis}.M_a")


def compliance(system: LinearSystem, direction: str, frequency: Floats) -> Complexes:
    """Displacement of the tool per force on it, x_d/F_d [m/N], with the loops that the system has closed."""
    return system.transfer(frequency, f"tool.x_{direction}", f"tool.F_{direction}")


def speed_reference(system: LinearSystem, axis: str, frequency: Floats) -> Complexes:
    """n_a/n_s [1]: reference frequency response of the speed controller, position loop of the axis open, other loops as
    they are."""
    return system.closing({axis: "speed"}).transfer(frequency, f"{axis}.n_a", f"{axis}.n_add")


def position_reference(system: LinearSystem, axis: str, frequency: Floats, *, feedforward: bool = False) -> Complexes:
    """x_a/x_s [1] of the closed position loop; with feedforward, n_ffw is the setpoint's derivative over the lead."""
    closed = system.closing({axis: "position"})
    to_x_s, to_n_ffw = closed.transfers(frequency, f"{axis}.x_a", (f"{axis}.x_s", f"{axis}.n_ffw"))
    if not feedforward:
        return to_x_s
    speed = 2j * np.pi * np.asarray(frequency) / system.machine.axes[axis].I_P
    return np.asarray(to_x_s + speed * to_n_ffw)


def measuring_error(system: LinearSystem, axis: str, frequency: Floats) -> Complexes:
    """How the closed position loop follows an error e of the measured position, -x_a/e [1], slowly 1. Measured
    indirectly, the error is that of the motor encoder, whose speed errs by its derivative."""
    drive = system.drives[_index(system, axis)]
    s = np.asarray(2j * np.pi * np.asarray(frequency))
    closed = system.closing({axis: "position"})
    to_x_s, to_torque = closed.transfers(frequency, f"{axis}.x_a", (f"{axis}.x_s", f"{axis}.M_add"))
    result = to_x_s / drive.setpoint_delay(s)
    if drive.drive.indirect:
        result = result + to_torque * drive.from_speed(s) * s / drive.I_P
    return np.asarray(result)


def speed_gain(system: LinearSystem, axis: str, s: Complexes) -> Complexes:
    """Open-loop gain of the speed loop at s (F,) [rad/s]: cut at the speed ahead of the speed controller, the axis's
    position loop open, other loops as they are: what a control finds that measures one axis and holds the others. A
    gain margin is the factor that K_p stands."""
    i = _index(system, axis)
    cut = system.closing({axis: "none"})
    drive = system.drives[i]
    axes = len(system.axes)
    per_torque = cut.at(s)[:, :, 2 * axes + i]
    n_a = per_torque[:, i]
    V = drive.speed_of_position(s)
    n = n_a if V is None else V * drive.measured_position(s, n_a, per_torque[:, axes + i])
    E, G_n = drive.torque(s)
    return np.asarray(E * drive.from_speed(s) * n / (1 + G_n * n_a))


def position_gain(system: LinearSystem, axis: str, s: Complexes) -> Complexes:
    """Open-loop gain of the sampled position loop at s (F,) [rad/s], below 1/(2 T_pos): cut at x_a as the position
    controller samples it; other loops as they are. A gain margin is the factor that K_v stands."""
    i = _index(system, axis)
    closed = system.closing({axis: "position"})
    loop = closed.position_gains[:, None] * closed.position_level(s)
    others = [j for j in range(len(system.axes)) if j != i]
    result = loop[:, i, i]
    if others:
        inner = np.eye(len(others)) + loop[:, others][:, :, others]
        answer = np.linalg.solve(inner, loop[:, others, i][:, :, None])[:, :, 0]
        result = result - np.einsum("fj,fj->f", loop[:, i][:, others], answer)
    return np.asarray(result)


def _index(system: LinearSystem, axis: str) -> int:
    if axis not in system.axes:
        raise InputError(f"linear system: no axis '{axis}'; there are {', '.join(system.axes)}")
    return system.axes.index(axis)


# --- How many poles of the closed system lie outside the unit circle, by the argument principle -----------------------
# Open-loop poles lie inside or on the unit circle: damped modes, rigid modes, integrators. The determinants that the
# two eliminations of the system solve with, det(1 + torque loop) over T_c and det(1 + position loop) over T_pos, tend
# to a constant for z to infinity; along a circle just outside the unit circle each therefore winds around 0 backwards
# once for every closed pole outside (the multivariable Nyquist criterion, here of the system lifted over a position
# cycle).


GROWTH = 1e-2  # [1/s] what grows more slowly counts as stable: the contour passes integrators at this distance
MAX_PHASE_STEP = 0.6  # [rad] and
MAX_LOG_STEP = 1.0  # largest steps of the logarithm's parts between neighbours on the contour
MAX_REFINEMENTS = 40


def unstable_poles(system: LinearSystem) -> int:
    """Number of growing solutions (faster than GROWTH) of the system with the loops that it has closed.

    Raises:
        InputError: the contour cannot be followed: a pole lies on it.
    """
    axes = len(system.axes)
    cycles = system.machine.cycles

    def torque_loop(s: Complexes) -> Complexes:
        loop = system.torque_loop(s, system.ports(s))
        return np.asarray(np.linalg.det(np.eye(axes) + loop[:, :, :axes]))

    def position_loop(s: Complexes) -> Complexes:
        return np.asarray(np.linalg.det(np.eye(axes) + system.position_gains[:, None] * system.position_level(s)))

    outside = -_windings(torque_loop, system, cycles.T_c)
    if system.position_gains.any():
        outside -= _windings(position_loop, system, cycles.T_pos)
    return outside


def _windings(function: Callable[[Complexes], Complexes], system: LinearSystem, T: float) -> int:
    """How often a function of s winds around 0 as z = exp(s T) runs once around the circle of growth GROWTH."""
    highest = 0.5 / T
    slow = np.geomspace(GROWTH * 1e-3, 1.0, 200, endpoint=False)  # around the integrators
    frequency = np.concatenate([[0.0], slow, grid(system.modes, 1.0, highest)])
    values = function(GROWTH + 2j * np.pi * frequency)
    for _ in range(MAX_REFINEMENTS):
        steps = np.log(values[1:] / values[:-1])
        wide = np.flatnonzero((np.abs(steps.imag) > MAX_PHASE_STEP) | (np.abs(steps.real) > MAX_LOG_STEP))
        if not wide.size:
            # the other half of the circle is the mirror image
            return round(float(np.sum(steps.imag)) / np.pi)
        between = 0.5 * (frequency[wide] + frequency[wide + 1])
        values = np.insert(values, wide + 1, function(GROWTH + 2j * np.pi * between))
        frequency = np.insert(frequency, wide + 1, between)
    at = frequency[wide[0]]
    raise InputError(f"linear system: at the limit of stability near {at:.6g} Hz; its unstable poles cannot be counted")
