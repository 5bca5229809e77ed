"""Whether a run's result can be trusted: the energy the coupling lost, the stability of the exchange, active limits,
and the plant's pose: how far the motion leaves it, or how the plant followed it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feedsim import units
from feedsim.cosim.loads import Acting, Work, at_motor
from feedsim.cosim.recording import Recording
from feedsim.cosim.schedule import Cycle
from feedsim.cosim.system import System
from feedsim.findings import Wrong
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN, Loop
from feedsim.nc import Program
from feedsim.scenario import Drive, ForeignUnit, Friction, Machine, Scenario
from feedsim.scenario.coupling import SCHEMES
from feedsim.structure import Modes
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.pose_change import MIN_POSE_DISTANCE, PoseChange, pose_change, warnings
from feedsim.structure.poses_file import GridAxis, read_grid
from feedsim.structure.table_check import table_mismatch
from feedsim.trace import Trace

# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 5e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3
GAIN = {"speed": ("K_p", "N.m.s/rad", "N.m.s/rad"), "position": ("K_v", "1/s", "(m/min)/mm")}
STATE = {"moving": "while the axis slides", "at rest": "at rest, where friction holds it like a spring"}
LOAD_TAKEN_UP = 1.0  # s; position and speed controller together settle in some tenths of it
# Of F_C: a load that never exceeds it is lost in what friction itself is known to. Newtons read as kilonewtons are.
FELT = 1e-2
# A load that drives: the share of its work that it does on the machine and not the machine on it, net, and the least
# share of the friction work that makes it matter.
DRIVING, MATTERS = 0.5, 0.05
# A load that the recorded motor torque contradicts: the least change of its factor, and the least share of the motor's
# work by which run and record differ while it acts. Below the last factor the record shows little of such a load.
FACTOR_OFF, WORK_OFF, FACTOR_SEEN = 0.5, 0.1, 0.3
# Of its travel: an axis that is off by more has left its setpoint; at rapid traverse without feedforward it is off by
# 1 %.
SETPOINT_LEFT_SHARE = 0.02


def energies(cycle: Cycle) -> dict[str, float]:
    """Per axis "A.residual", "A.residual_peak" and "A.friction_work" [J]; see feedsim.cosim.operations.Bond."""
    bond = cycle.bond
    kinds = {"residual": bond.residual, "residual_peak": bond.residual_peak, "friction_work": bond.dissipated}
    return {f"{axis}.{kind}": float(kinds[kind][i]) for i, axis in enumerate(cycle.system.axes) for kind in kinds}


def foreseen(
    scenario: Scenario, modes: Modes, program: Program, loops: Sequence[Loop], loads: Sequence[Acting] = ()
) -> tuple[str, ...]:
    """What the parameters and the loads alone tell a user to doubt, a sentence each."""
    return (
        *control(scenario.machine, loops, program), *exchange_stability(scenario, modes),
        *_unbalanced_loads(scenario, loads), *_sizes_of_loads(scenario.machine, program, loads),
    )  # fmt: skip


def found(
    scenario: Scenario, cycle: Cycle, recording: Recording, loops: Sequence[Loop], loads: Sequence[Work] = ()
) -> tuple[str, ...]:
    """What the run itself tells a user to doubt, a sentence each."""
    lost = _energy(scenario, cycle, loops)
    told = (*_driving_loads(scenario, cycle, loads), *_contradicted_loads(scenario, loads))
    return (*lost, *_limits(recording), *told)


def control(machine: Machine, loops: Sequence[Loop], program: Program | None = None) -> list[str]:
    """Loops that are unstable or have less than the usual margins, with the gain that would do, and those not judged.

    A loop is wrong where it is unstable in a state that the motion brings about: axes that do not move rest. Without a
    program every axis moves.
    """
    found: list[str] = []
    for axis, kind in dict.fromkeys((loop.axis, loop.kind) for loop in loops):
        states = [loop for loop in loops if (loop.axis, loop.kind) == (axis, kind)]
        unstable, thin = [loop for loop in states if loop.unstable], [loop for loop in states if loop.thin]
        if not (unstable or thin):
            continue
        now = _gain(kind, states[0].gain)
        advised = [loop.advised for loop in unstable or thin]
        nearest = None if None in advised else _gain(kind, min(filter(None, advised)))
        usual = f"the usual {_decibels(GAIN_MARGIN):.0f} dB and {PHASE_MARGIN:g} deg"
        better = f"; with {nearest} it has" if nearest else f"; no {GAIN[kind][0]} was found with which it has"
        if not unstable:
            margins = "; ".join(
                f"gain {_decibels(loop.gain_margin):.1f} dB, phase {loop.phase_margin:.0f} deg {STATE[loop.state]}"
                for loop in thin
            )
            found.append(f"axis {axis}: the {kind} loop has thin margins with {now}: {margins}{better} {usual}")
            continue
        where = "; ".join(map(_where, states))
        text = (
            f"axis {axis}: the {kind} loop is unstable with {now}: {where}{better} {usual}. A run shows this "
            "instability, whatever coupling.substeps are"
        )
        met = any(loop.growing and (loop.state == "at rest" or _moves(program, axis)) for loop in unstable)
        found.append(Wrong(text) if met else text)
    if unknown := [name for name, axis in machine.axes.items() if isinstance(axis.drive, ForeignUnit)]:
        others = "; the other axes are judged with its motor free" if loops else ""
        found.append(
            f"axis {', '.join(unknown)}: whether the loops are stable is not judged, the drive is another maker's"
            + others
        )
    return found


def _moves(program: Program | None, axis: str) -> bool:
    if program is None:
        return True
    low, high = program.reached(axis)
    return low < high


def _where(loop: Loop) -> str:
    """In which state a loop is stable, and from which gain on it is not."""
    if loop.limit is None:
        bound = ""
    elif loop.unstable:
        bound = f", stable {'below' if loop.limit < loop.gain else 'above'} {_gain(loop.kind, loop.limit)}"
    else:
        bound = f" {'up' if loop.limit > loop.gain else 'down'} to {_gain(loop.kind, loop.limit)}"
    return f"{'un' * loop.unstable}stable {STATE[loop.state]}{bound}"


def _decibels(factor: float) -> float:
    return 20 * math.log10(factor)


def _gain(kind: str, value: float) -> str:
    name, unit, shown = GAIN[kind]
    return f"{name} = {units.convert(value, unit, shown):.4g} {shown}"


def exchange_stability(scenario: Scenario, modes: Modes) -> list[str]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h."""
    scheme = SCHEMES[scenario.coupling.scheme]
    step = scenario.machine.cycles.T_c / scenario.coupling.substeps
    warnings: list[str] = []
    unknown = [name for name, axis in scenario.machine.axes.items() if isinstance(axis.friction, ForeignUnit)]
    if unknown:
        warnings.append(
            f"axis {', '.join(unknown)}: how steeply another maker's friction rises with the speed is not known: "
            f"nothing tells ahead whether scheme {scheme.name} is stable with it, the energy residual of the run does"
        )
    for name, axis in scenario.machine.axes.items():
        friction = axis.friction
        if isinstance(friction, ForeignUnit):
            continue
        slope, bound = friction.sigma_1 + friction.sigma_2, 2 * modes.J_inf(name) / step
        if slope > scheme.stable_share * bound:
            warnings.append(
                f"axis {name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad is above "
                f"{scheme.stable_share * bound:.4g}, where scheme {scheme.name} becomes unstable at a reversal "
                f"({scheme.stable_share:g} of 2 J_inf/h); use more coupling.substeps"
            )
    return warnings


def _unbalanced_loads(scenario: Scenario, loads: Sequence[Acting]) -> list[str]:
    """The drive's integrators start empty: an axis under load sags before it holds."""
    if scenario.motions[0].held >= LOAD_TAKEN_UP:
        return []
    machine, start = scenario.machine, np.array([0.0, scenario.machine.cycles.T_c])
    sagging = (
        f"is not carried at the start, the axis sags while the drive takes it up; put a dwell of {LOAD_TAKEN_UP:g} s "
        "ahead of the first motion"
    )
    told = [
        f"axis {name}: the constant load of {axis.M_0:g} N.m {sagging}"
        for name, axis in machine.axes.items()
        if axis.M_0 != 0
    ]
    for each in loads:
        torque = at_motor(each.load, float(each.means(start)[0]), machine)
        friction = machine.axes[each.load.axis_name].friction if torque is not None else None
        # Friction alone holds what is below F_C.
        if torque is not None and isinstance(friction, Friction) and abs(torque) > friction.F_C:
            told.append(f"{each.place}: the load of {torque:.3g} N.m at the motor of {each.load.axis_name} {sagging}")
    return told


def _sizes_of_loads(machine: Machine, program: Program, loads: Sequence[Acting]) -> list[str]:
    """Loads that the drive cannot hold, and such that nothing feels: of another unit or at another place than meant."""
    told = []
    for each in loads:
        peak, name = each.peak(program.duration), each.load.axis_name
        torque = at_motor(each.load, peak, machine)
        if torque is None:
            continue
        drive, friction = machine.axes[name].drive, machine.axes[name].friction
        at_the_motor = "" if each.load.UNIT == "N.m" else f", {abs(torque):.4g} N.m at the motor of {name}"
        size = f"{each.place}: the load {each.load.words} reaches {peak:.4g} {each.load.UNIT}{at_the_motor}"
        if isinstance(drive, Drive) and abs(torque) > drive.M_max:
            told.append(
                f"{size}, {abs(torque) / drive.M_max:.3g} times the drive's M_max, {drive.M_max:.4g} N.m: the axis "
                "cannot hold it; are unit, kind and factor right?"
            )
        elif isinstance(friction, Friction) and abs(torque) < FELT * friction.F_C:
            told.append(
                f"{size}, {abs(torque) / friction.F_C:.2g} of the Coulomb friction F_C, {friction.F_C:.4g} N.m: next "
                "to nothing feels it; are unit, kind and factor right?"
            )
    return told


def _driving_loads(scenario: Scenario, cycle: Cycle, loads: Sequence[Work]) -> list[str]:
    """By the energy: a load that drives the machine, where forces of a process resist its motion."""
    friction = float(np.abs(cycle.bond.dissipated).sum())
    return [
        f"{scenario.at('loads', work.load)}: the load {work.words} drives the machine: it has done {work.given:.3g} J "
        f"of work on it and taken {work.taken:.3g} J from it (friction: {friction:.3g} J). The force of a process "
        "resists the motion: if this is one, its sign is wrong, and factor: -1 turns it"
        for work in loads
        if work.net > DRIVING * (work.given + work.taken) and work.net > MATTERS * friction
    ]


def _contradicted_loads(scenario: Scenario, loads: Sequence[Work]) -> list[str]:
    """By the energy: loads with which the motor of the run does other work than that of the record."""
    told = []
    for work in loads:
        drives = work.drives
        if drives is None or (factor := drives.factor) is None or abs(factor - 1) < FACTOR_OFF:
            continue
        if abs(drives.run - drives.record) < WORK_OFF * drives.turned:
            continue
        load = scenario.loads[work.load]
        column = load.motor_torque.column if load.motor_torque is not None else ""
        if abs(factor) < FACTOR_SEEN:
            wrong = "the record shows little or nothing of it: its size, kind or time is wrong"
        else:
            wrong = "its sign is wrong" if factor < 0 else "its size is wrong: unit, kind or factor"
        told.append(
            f"{scenario.at('loads', work.load)}: while the load {work.words} acts, the motor of {load.axis_name} does "
            f"{drives.run:.3g} J of work in the run and {drives.record:.3g} J in the record (column "
            f"{column!r}); the load does {drives.load:.3g} J on the machine. If the recorded torque's own sign is "
            f"right, {wrong}; both agree with factor: {factor * load.factor:.3g}"
        )
    return told


def _energy(scenario: Scenario, cycle: Cycle, loops: Sequence[Loop]) -> list[str]:
    """The coupling is blamed where nothing else is known to make an axis chatter."""
    bond = cycle.bond
    if any(loop.growing for loop in loops):
        why = "that is a consequence of the unstable control loop, and tells nothing of the coupling"
    else:
        why = (
            "it is unstable or too coarse, and the result is not to be trusted; try coupling.substeps above "
            f"{scenario.coupling.substeps}"
        )
    return [
        f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
        f"friction work (scheme {cycle.scheme.name}, exchange step {cycle.step * 1e6:.6g} us): {why}"
        for axis, residual, work in zip(cycle.system.axes, bond.residual_peak, np.abs(bond.dissipated), strict=True)
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]


def _limits(recording: Recording) -> list[str]:
    return [
        f"axis {axis}: {flag.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants"
        for axis, _, flag in (limit.partition(".") for limit in recording.limited)
        if (share := recording.share(f"{axis}.{flag}")) > 0
    ]


@dataclass(frozen=True)
class Crossings:
    """What happened where the plant changed cells, over a whole run.

    Attributes:
        count: crossings.
        kinetic_lost, elastic_lost: energy before less energy after, summed up [J].
        held: largest jump of an axis position that was taken back [m].
        jump_x_a, jump_tool: largest jump of an axis position, of the tool [m].
        jump_n_a: of a motor speed [rad/s].
    """

    count: int
    kinetic_lost: float
    elastic_lost: float
    held: float
    jump_x_a: float
    jump_n_a: float
    jump_tool: float


@dataclass(frozen=True)
class PoseUse:
    """How the plant of a run stands to the positions that its axes reached.

    Attributes:
        change: the axes whose pose the plant does not follow.
        grid: the axes that it follows; none where it has one pose.
        crossings: None before a run, and where the plant has one pose.
    """

    change: PoseChange
    grid: tuple[GridAxis, ...] = ()
    crossings: Crossings | None = None
    warnings: tuple[str, ...] = ()


def pose_use(machine: Machine, program: Program, system: System) -> PoseUse:
    """Of a system that is built; with the crossings so far, where the plant follows its axes."""
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    grid = _grid(system)
    followed = {axis.axis for axis in grid}
    change = pose_change(machine, {axis: reached for axis, reached in ranges.items() if axis not in followed})
    left = tuple(
        sentence for axis in grid if axis.axis in ranges for sentence in left_grid(axis, ranges[axis.axis], machine)
    )
    doubt = None if grid else table_mismatch(machine)  # a plant that follows has modes of its own
    doubts = () if doubt is None else (doubt,)
    return PoseUse(change, grid, _crossings(system) if grid else None, (*doubts, *left, *warnings(change)))


def _grid(system: System) -> tuple[GridAxis, ...]:
    if system.plant_modes_file is not None:
        return ()
    file = system.plant.archive.directory / POSES_IN_ARCHIVE
    return read_grid(file, system.plant_axes) if file.is_file() else ()


def left_grid(axis: GridAxis, reached: tuple[float, float], machine: Machine) -> list[str]:
    """The outermost cells reach on without end, but their modes are those of their centres."""
    travel = machine.axes[axis.axis].travel
    first, last = axis.reach
    beyond = max(first - max(reached[0], travel[0]), min(reached[1], travel[1]) - last)
    if beyond <= MIN_POSE_DISTANCE:
        return []
    return [
        f"axis {axis.axis} leaves the plant's grid of poses ({first * 1e3:.6g} mm to {last * 1e3:.6g} mm) by "
        f"{beyond * 1e3:.4g} mm: the modes there are those of the last cell; pack a wider grid"
    ]


def _crossings(system: System) -> Crossings:
    names = ("crossings", "E_kin_lost", "E_el_lost", "held", "jump_x_a", "jump_n_a", "jump_tool")
    count, *values = (system.plant.value(f"pose.{name}") for name in names)
    return Crossings(round(count), *values)


def left_first(trace: Trace, program: Program, machine: Machine) -> str:
    """Which axis was the first to leave its setpoint, for the message of a run that has failed; "" where none has.

    trace: the rows so far. The unit that fails first is often that of another axis, which the structure has dragged
    along. An axis has left its setpoint where it is off by more than SETPOINT_LEFT_SHARE of its travel; of axes that
    leave in the same row it is the one that is off the furthest, each as a share of its travel.
    """
    found: list[tuple[float, float, str, float]] = []
    for name, axis in machine.axes.items():
        if (column := f"{name}.x_a") not in trace.columns:
            continue
        setpoint = np.interp(trace.time, program.time, program.x_s[name])
        with np.errstate(invalid="ignore"):
            off = np.nan_to_num(np.abs(np.asarray(trace[column]) - setpoint), nan=np.inf)
        share = off / (axis.travel[1] - axis.travel[0])
        if (rows := np.flatnonzero(share > SETPOINT_LEFT_SHARE)).size:
            row = int(rows[0])
            found.append((float(trace.time[row]), -float(share[row]), name, float(off[row])))
    if not found:
        return ""
    at, _, name, largest = min(found)
    return f"; axis {name} left its setpoint first: {largest * 1e3:.3g} mm off at {at:.9g} s"
