"""Frequency responses measured on the units themselves: a periodic excitation, the loops closed, every cycle recorded.

As on the machine: the excitation is added to the torque or the speed setpoint of a drive, or acts on the tool; all axes
are under control, and one may move at constant speed. Friction can be left out, which no machine can.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from feedsim.files.trace import Trace
from feedsim.files.trace.trace import suggest_name
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.installation import fmus_directory
from feedsim.motions.kind import Peaks
from feedsim.motions.profile import speed_change
from feedsim.scenario import Coupling, Machine
from feedsim.scenario.model import SCHEMES
from feedsim.simulation.cosim import worker
from feedsim.simulation.cosim.exchange import any_foreign, choose_native_loop
from feedsim.simulation.cosim.excitation import Excitation
from feedsim.simulation.cosim.loads import LOAD_TAKEN_UP
from feedsim.simulation.cosim.operations import DueCycles, Operation, copy, get_row, set_real, set_slopes
from feedsim.simulation.cosim.schedule import Cycle, Loop, Progress, Setpoints
from feedsim.simulation.cosim.system import TOOL_FORCES, System, controller
from feedsim.simulation.cosim.unit import Floats, Log, Port
from feedsim.simulation.cosim.worker import deliver
from feedsim.simulation.nc import Program, violations
from feedsim.structure.modes import checked_modes

Input = Literal["M_add", "n_add", "tool.F_X", "tool.F_Y", "tool.F_Z"]

DRIVE_INPUTS = ("M_add", "n_add")
DRIVE_SIGNALS = ("n_s", "n_ref", "torque_limited", "voltage_limited")
TOOL_SIGNALS = ("tool.x_X", "tool.x_Y", "tool.x_Z")
LIMITS = {"torque_limited": ("M_max", "N.m"), "voltage_limited": ("u_max", "V")}
# Periods that differ by more than this share of the signal have not settled: 0.01 dB.
PERIOD_TOLERANCE = 1e-3
UNREACHED_MOTION_SHARE = 1e-9  # of the largest motion in the same unit


@dataclass(frozen=True, eq=False)
class Measurement:
    """Whole periods of a steady response.

    Attributes:
        trace: a row per control cycle, `periods` times the rows of the excitation. Columns: the excitation; per axis A
            A.x_a, A.n_a, A.M_a, A.n_s, A.n_ref, with friction A.M_fr; tool.x_X, tool.x_Y, tool.x_Z. A row holds the
            values at one instant t_k: n_s and n_ref are what the controller worked out at t_k (in the trace of a run
            they are shown one cycle later), M_a is the torque at t_k, with an ideal current loop that which begins
            there.
        axis: whose drive is excited, or moves.
        reference: column of the excitation, such as "Z.M_add" or "tool.F_X".
        excitation: one period of it.
        unsettled: difference of the last two periods, RMS as a share of the signal's, the largest of all columns; 0
            with one period.
        wall_time: duration of the cycle loop [s].
        units: per instance, GUID and version of its archive.
        warnings: what a user should know before believing the result.
    """

    trace: Trace
    axis: str
    reference: str
    excitation: Excitation
    periods: int
    unsettled_share: float
    wall_time: float
    units: Mapping[str, Mapping[str, str]]
    warnings: tuple[Finding, ...]


def measure(
    machine: Machine,
    axis: str,
    excitation: Excitation,
    *,
    inject: str = "M_add",
    friction: bool = False,
    offset_speed: float | None = None,
    periods: int = 2,
    settle: int = 2,
    fmus: Path | None = None,
    progress: Progress | None = None,
    native: bool | None = None,
    call_limit: float = Coupling().call_limit,
) -> Measurement:
    """Excite the machine and record its steady response.

    Args:
        axis: whose drive is excited, and which moves at the offset speed.
        excitation: a period of the signal, in the unit of the input.
        inject: input that is excited: M_add [N.m] or n_add [rad/s] of the axis's drive at every sample instant, or a
            force on the tool, tool.F_X, tool.F_Y, tool.F_Z [N], that runs linearly between the instants.
        friction: with the friction units; without them M_fr is 0.
        offset_speed: motor speed [rad/s] at which the axis moves during the measurement; in the middle of the
            excitation it passes its pose, or comes as near to it as its travel allows. None: it stands. A moving axis,
            and one that carries a load, get a second to become steady before the excitation starts.
        periods: recorded; two at least where the axis moves, so that its travel can be separated from its response.
        settle: periods of excitation ahead of those.
        fmus: folder of the archives; default :func:`fmus_directory`.
        progress: called now and then with (cycles done, cycles in all).
        native: whether the native cycle loop is to work; see :func:`~feedsim.simulation.cosim.run.run`.
        call_limit: time [s] after which a call of another maker's unit is ended.

    Raises:
        InputError: an argument that does not fit the machine, the travel is too short, a drive met a limit, so that the
            response is not the linear one; the message gives the amplitude and the limit.
        SimulationError: a unit failed.
    """
    fmus = fmus or fmus_directory()
    given = (machine, axis, excitation, inject, friction, offset_speed, periods, settle, fmus, native)
    if any_foreign(machine, fmus):
        return worker.call(_measure_in_process, *given, limit=call_limit, progress=progress)
    return _measure_in_process(*given, progress=progress)


def _measure_in_process(
    machine: Machine, axis: str, excitation: Excitation, inject: str, friction: bool, offset_speed: float | None,
    periods: int, settle: int, fmus: Path, native: bool | None, *, progress: Progress | None = None,
) -> Measurement:  # fmt: skip
    """The same in this process."""
    _check(machine, axis, excitation, inject, offset_speed, periods, settle)
    checked_modes(machine)
    cycles = machine.cycles
    ratio, rows = round(cycles.T_pos / cycles.T_c), len(excitation.samples)
    loaded = any(described.M_0 != 0 for described in machine.axes.values())
    wait = LOAD_TAKEN_UP if loaded or offset_speed else 0.0
    duration = (settle + periods) * rows * cycles.T_c
    machine, program, first = _setpoints(machine, axis, offset_speed or 0.0, wait, duration)
    kept = first * ratio + settle * rows
    total = kept + periods * rows
    library, notes = choose_native_loop(native, fmus)
    with System(machine, fmus, friction=friction) as system:
        cycle = Cycle(system, SCHEMES["extrapolated"], cycles.T_c, 1)
        record = _Record(system, periods * rows, DueCycles(first=kept))
        drives = Setpoints(system, program, ratio)
        before = [*drives.operations] if offset_speed else []
        before += [*_excite(system, axis, inject, excitation, DueCycles(first=first * ratio)), *record.before]
        loop = Loop(cycle, before, record.after, library, (drives,) if offset_speed else ())
        system.initialise(program, stop=total * cycles.T_c)
        begun = time.perf_counter()
        loop.run(total, progress)
        wall_time = time.perf_counter() - begun
        reference = inject if inject.startswith("tool.") else f"{axis}.{inject}"
        _refuse_limits(machine, record, inject, excitation, system)
        columns, units = record.columns()
        columns = {reference: np.tile(excitation.samples, periods)} | columns
        units[reference] = _unit(system, axis, inject)
        trace = Trace((kept + np.arange(periods * rows, dtype=np.float64)) * cycles.T_c, columns, units)
        unsettled = _unsettled_share(trace, rows, periods)
        doubts = (*_doubts(trace, axis, friction, offset_speed, unsettled), *notes)
        done = Measurement(
            trace=trace,
            axis=axis,
            reference=reference,
            excitation=excitation,
            periods=periods,
            unsettled_share=unsettled,
            wall_time=wall_time,
            units=system.archives,
            warnings=(*system.warnings, *doubts),
        )
        deliver(done)
    return replace(done, warnings=(*system.warnings, *doubts))  # with what units have said at their end


def usual_rms(machine: Machine, axis: str, inject: str) -> float:
    """An RMS [unit of the input] that stirs the machine well within its limits: 5 % of the torque limit at the motor.

    As a speed it is that torque over the speed controller's gain, as a force what balances it.
    """
    described, drive = machine.axes[axis], machine.shipped_drive(axis, "the usual amplitude")
    torque = 0.05 * drive.M_max
    if inject == "M_add":
        return torque
    if inject == "n_add":
        return torque / max(drive.K_p, 1e-9)
    return torque / described.I_P / 10  # a tenth: the force meets compliances that the torque does not


def _check(
    machine: Machine, axis: str, excitation: Excitation, inject: str, speed: float | None, periods: int, settle: int
) -> None:
    if axis not in machine.axes:
        raise InputError(f"no axis {axis!r}{suggest_name(axis, machine.axes)}")
    inputs = (*DRIVE_INPUTS, *TOOL_FORCES)
    if inject not in inputs:
        raise InputError(f"no input {inject!r} to excite{suggest_name(inject, inputs)}; there is {', '.join(inputs)}")
    for name in machine.axes:
        machine.shipped_drive(name, "a measured frequency response")
    T_c, T_pos = machine.cycles.T_c, machine.cycles.T_pos
    if not math.isclose(excitation.cycle, T_c, rel_tol=1e-9):
        raise InputError(
            f"the excitation has a cycle of {excitation.cycle:.9g} s; the machine's control cycle is {T_c:.9g} s"
        )
    if len(excitation.samples) % round(T_pos / T_c):
        raise InputError(
            f"the excitation's period of {excitation.period:.9g} s is no whole multiple of the position cycle, "
            f"{T_pos:.9g} s; the response would not be periodic"
        )
    if speed is not None and not math.isfinite(speed):
        raise InputError(f"offset speed {speed} rad/s: must be finite")
    least = 2 if speed else 1
    if periods < least:
        moving = " while the axis moves" if speed else ""
        raise InputError(f"{periods} periods to be recorded; at least {least} are needed{moving}")
    if settle < 0:
        raise InputError(f"{settle} periods to settle; 0 or more are needed")


def _setpoints(machine: Machine, axis: str, speed: float, wait: float, duration: float) -> tuple[Machine, Program, int]:
    """The machine at its start, setpoints, and the position cycle at which the excitation starts."""
    T_pos = machine.cycles.T_pos
    described = machine.axes[axis]
    v = speed * described.I_P
    acceleration = min(machine.path.acceleration, described.max_acceleration)
    ramp = speed_change(v, acceleration, machine.path.jerk)
    first = math.ceil((ramp.duration + wait) / T_pos - 1e-6)
    count = first + round(duration / T_pos)
    t = np.arange(count + 1, dtype=np.float64) * T_pos
    pose = dict(machine.pose)
    travelled, velocity = np.zeros(count + 1), np.zeros(count + 1)
    if speed:
        during = math.ceil(ramp.duration / T_pos)
        travelled[:during], velocity[:during] = ramp.at(t[:during])
        travelled[during:] = ramp.distance + v * (t[during:] - ramp.duration)
        velocity[during:] = v
        low, high = described.travel
        if abs(travelled[-1]) > high - low:
            raise InputError(
                f"axis {axis} travels {abs(travelled[-1]) * 1e3:.5g} mm in a measurement of {t[-1]:.4g} s at "
                f"{speed:.5g} rad/s; there are {(high - low) * 1e3:.5g} mm: take fewer or shorter periods, or move "
                "slower"
            )
        pose[axis] = _start(axis, machine, float(travelled[-1]), float(travelled[first]))
        reached = pose[axis] + travelled
        peaks = Peaks(reached.min(), reached.max(), abs(v), acceleration)
        problems = violations(axis, described, math.nan, peaks)
        if problems:
            raise InputError(f"offset speed {speed:.5g} rad/s: {'; '.join(problems)}")
    x_s = {name: np.full(count + 1, pose[name]) for name in machine.axes}
    n_ffw = {name: np.zeros(count + 1) for name in machine.axes}
    x_s[axis] = pose[axis] + travelled
    n_ffw[axis] = velocity / described.I_P
    return machine.model_copy(update={"pose": pose}), Program(t, x_s, n_ffw), first


def _start(axis: str, machine: Machine, distance: float, before: float) -> float:
    """Where the axis starts: the middle of what it travels under excitation lies at the pose, if the travel allows."""
    low, high = machine.axes[axis].travel
    start = machine.pose[axis] - (before + distance) / 2
    return min(max(start, low - min(distance, 0.0)), high - max(distance, 0.0))


def _excite(system: System, axis: str, inject: str, excitation: Excitation, when: DueCycles) -> list[Operation]:
    """What sets the input for the control cycles, a sample each."""
    samples = excitation.samples.reshape(-1, 1)
    if inject in DRIVE_INPUTS:
        return set_real(Port(system.units[controller(axis)], [inject]), samples, when)
    force = Port(system.plant, [inject])
    slopes = (np.roll(samples, -1) - samples) / excitation.cycle
    return [*set_real(force, samples, when), *set_slopes(force, slopes, when)]


class _Record:
    """What is known at t_k before the cycle is run, and what the controllers have worked out at t_k after it."""

    def __init__(self, system: System, rows: int, when: DueCycles) -> None:
        self.system = system
        axes = len(system.axes)
        self.measured = np.zeros((rows, 2 * axes))  # x_a, n_a of every axis
        self.M_a = np.zeros((rows, axes))
        self.M_fr = np.zeros((rows, axes))
        self.tool = Log(system.plant, TOOL_SIGNALS, rows)
        self.drives = [Log(control.unit, DRIVE_SIGNALS, rows) for control in system.controllers]

        self.before = [copy(self.measured, system.measured, when), copy(self.M_fr, system.M_fr, when)]
        self.before += get_row(self.tool, when)
        self.after = [copy(self.M_a, system.M_a_start, when)]
        self.after += [operation for log in self.drives for operation in get_row(log, when)]

    def columns(self) -> tuple[dict[str, Floats], dict[str, str]]:
        """Values and units by column."""
        columns: dict[str, Floats] = {}
        units: dict[str, str] = {}
        plant = self.system.plant.archive
        for i, axis in enumerate(self.system.axes):
            own = {"x_a": self.measured[:, 2 * i], "n_a": self.measured[:, 2 * i + 1], "M_a": self.M_a[:, i]}
            if self.system.friction:
                own["M_fr"] = self.M_fr[:, i]
            units |= {f"{axis}.{signal}": plant.unit_of(f"{axis}.{signal}") for signal in own}
            drive = self.drives[i]
            for signal, values in drive.columns().items():
                if signal not in LIMITS:
                    own[signal] = values
                    units[f"{axis}.{signal}"] = drive.unit.archive.unit_of(signal)
            columns |= {f"{axis}.{signal}": values for signal, values in own.items()}
        columns |= self.tool.columns()
        units |= {signal: plant.unit_of(signal) for signal in TOOL_SIGNALS}
        return columns, units


def _unit(system: System, axis: str, inject: str) -> str:
    unit = system.units[controller(axis)] if inject in DRIVE_INPUTS else system.plant
    return unit.archive.unit_of(inject)


def _refuse_limits(machine: Machine, record: _Record, inject: str, excitation: Excitation, system: System) -> None:
    problems = []
    unit = _unit(system, system.axes[0], inject)
    for (name, axis), log in zip(machine.axes.items(), record.drives, strict=True):
        flags = log.columns()
        for flag, (parameter, its_unit) in LIMITS.items():
            if share := float(np.mean(flags[flag])):
                problems.append(
                    f"axis {name}: {flag.replace('_', ' ')} in {100 * share:.2g} % of the instants ({parameter} "
                    f"{getattr(axis.drive, parameter):.6g} {its_unit}); {inject} has {excitation.rms:.4g} {unit} RMS, "
                    f"{excitation.peak:.4g} {unit} at its peak: take less"
                )
    if problems:
        raise InputError.of("the measurement runs into limits, its response is not linear", problems)


def _unsettled_share(trace: Trace, rows: int, periods: int) -> float:
    if periods < 2:
        return 0.0
    moved = {name: float(np.std(trace[name][-rows:] - _line(trace[name][-rows:]))) for name in trace}
    largest = 0.0
    for name in trace:
        last, before = trace[name][-rows:], trace[name][-2 * rows : -rows]
        # What is far below the resolution of the values themselves says nothing, nor does rounding of an axis that the
        # excitation does not reach.
        reached = max(moved[other] for other in trace if trace.unit(other) == trace.unit(name))
        if moved[name] > max(1e-12 * float(np.max(np.abs(last))), UNREACHED_MOTION_SHARE * reached):
            largest = max(largest, float(np.std(last - before)) / moved[name])
    return largest


def _line(values: Floats) -> Floats:
    """The straight line of least squares."""
    t = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(values.mean() + t * (values @ t) / (t @ t))


def _doubts(trace: Trace, axis: str, friction: bool, speed: float | None, unsettled: float) -> list[Finding]:
    doubts = []
    if friction and not speed:
        doubts.append(Finding(
            "axis-held-by-friction", "doubt",
            f"axis {axis} stands still with friction on: its bristles hold it like a spring, and n/M reads far too low "
            "at low frequencies; give an offset speed, or leave friction out",
            axis, "give an offset speed, or leave friction out",
        ))  # fmt: skip
    if friction and speed and np.any(trace[f"{axis}.n_a"] * speed <= 0):
        slowest = float(np.min(trace[f"{axis}.n_a"] * np.sign(speed)))
        doubts.append(Finding(
            "axis-reverses", "doubt",
            f"axis {axis} reverses under the excitation, down to {slowest:.3g} rad/s "
            f"at an offset speed of {abs(speed):.4g} rad/s: friction is not linear there; take less, or move faster",
            axis, "take less, or move faster",
        ))  # fmt: skip
    if unsettled > PERIOD_TOLERANCE:
        doubts.append(Finding(
            "not-settled", "doubt",
            f"the last two periods differ by {100 * unsettled:.2g} % of the signal: the response has not settled, or "
            "is not periodic; let more periods settle",
            axis, "let more periods settle",
        ))  # fmt: skip
    return doubts
