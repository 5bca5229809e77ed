"""A run with what it shows a user to doubt, and a scenario judged before its first step."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim import linear
from feedsim.foundation import units
from feedsim.foundation.errors import Finding
from feedsim.foundation.outputs import cache_answer
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN, Loop, judge
from feedsim.scenario import Drive, ForeignUnit, FrictionParameters, Machine, Scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim
from feedsim.simulation.cosim import Crossings, Run
from feedsim.simulation.cosim.loads import LOAD_TAKEN_UP, ActingLoad, at_motor
from feedsim.simulation.nc import Program
from feedsim.structure import Modes, checked_modes
from feedsim.structure.modes import damped_twice, parse_modes
from feedsim.structure.mounts import read_mounts, scale_elements
from feedsim.structure.pose_change import MIN_POSE_DISTANCE, PoseChange, pose_change, table_mismatch, warnings

if TYPE_CHECKING:
    from feedsim.structure.poses import GridAxis

# --- Whether the loads of a run are what they are meant to be: by their size ahead, by their energy afterwards --------


# Of F_C: a load that never exceeds it is lost in what friction itself is known to. Newtons read as kilonewtons are.
NOTICEABLE_LOAD_SHARE = 1e-2
# A load that drives: the share of its work that it does on the machine and not the machine on it, net, and the least
# share of the friction work that makes it matter.
DRIVING, MATTERS = 0.5, 0.05
# A load that the recorded motor torque contradicts: the least change of its factor, and the least share of the motor's
# work by which run and record differ while it acts. Below the last factor the record shows little of such a load.
FACTOR_OFF, WORK_OFF, FACTOR_SEEN = 0.5, 0.1, 0.3


def warn_unbalanced_loads(scenario: Scenario, loads: Sequence[ActingLoad]) -> list[Finding]:
    """The drive's integrators start empty: an axis under load sags before it holds."""
    if scenario.motions[0].held >= LOAD_TAKEN_UP:
        return []
    machine, start = scenario.machine, np.array([0.0, scenario.machine.cycles.T_c])
    remedy = f"put a dwell of {LOAD_TAKEN_UP:g} s ahead of the first motion"

    def finding(load: str, place: str) -> Finding:
        text = f"{load} is not carried at the start, the axis sags while the drive takes it up; {remedy}"
        return Finding("load-not-carried", "doubt", text, place, remedy)

    reported = [
        finding(f"axis {name}: the constant load of {axis.M_0:g} N.m", name)
        for name, axis in machine.axes.items()
        if axis.M_0 != 0
    ]
    for acting in loads:
        torque = at_motor(acting.load, float(acting.means(start)[0]), machine)
        friction = machine.axes[acting.load.axis_name].friction if torque is not None else None
        # Friction alone holds what is below F_C.
        if torque is not None and isinstance(friction, FrictionParameters) and abs(torque) > friction.F_C:
            where = f"{acting.place}: the load of {torque:.3g} N.m at the motor of {acting.load.axis_name}"
            reported.append(finding(where, acting.place))
    return reported


def sizes(machine: Machine, program: Program, loads: Sequence[ActingLoad]) -> list[Finding]:
    """Loads that the drive cannot hold, and such that nothing feels: of another unit or at another place than meant."""
    reported = []
    for acting in loads:
        peak, name = acting.peak(program.duration), acting.load.axis_name
        torque = at_motor(acting.load, peak, machine)
        if torque is None:
            continue
        drive, friction = machine.axes[name].drive, machine.axes[name].friction
        at_the_motor = "" if acting.load.UNIT == "N.m" else f", {abs(torque):.4g} N.m at the motor of {name}"
        size = f"{acting.place}: the load {acting.load.words} reaches {peak:.4g} {acting.load.UNIT}{at_the_motor}"
        if isinstance(drive, Drive) and abs(torque) > drive.M_max:
            reported.append(Finding(
                "load-too-large", "doubt",
                f"{size}, {abs(torque) / drive.M_max:.3g} times the drive's M_max, {drive.M_max:.4g} N.m: the axis "
                "cannot hold it; are unit, kind and factor right?",
                acting.place,
            ))  # fmt: skip
        elif isinstance(friction, FrictionParameters) and abs(torque) < NOTICEABLE_LOAD_SHARE * friction.F_C:
            reported.append(Finding(
                "load-too-small", "doubt",
                f"{size}, {abs(torque) / friction.F_C:.2g} of the Coulomb friction F_C, {friction.F_C:.4g} N.m: next "
                "to nothing feels it; are unit, kind and factor right?",
                acting.place,
            ))  # fmt: skip
    return reported


def warn_driving_loads(run: Run) -> list[Finding]:
    """By the energy: a load that drives the machine, where forces of a process resist its motion."""
    friction = float(np.abs([run.coupling[f"{axis}.friction_work"] for axis in run.scenario.machine.axes]).sum())
    return [
        Finding(
            "load-drives", "doubt",
            f"{place}: the load {work.words} drives the machine: it has done {work.given:.3g} J of work on it and "
            f"taken {work.taken:.3g} J from it (friction: {friction:.3g} J). The force of a process resists the "
            "motion: if this is one, its sign is wrong, and factor: -1 turns it",
            place, f"loads.{work.load}.factor={-run.scenario.loads[work.load].factor:g}",
        )
        for work in run.loads
        for place in [run.scenario.at("loads", work.load)]
        if work.net > DRIVING * (work.given + work.taken) and work.net > MATTERS * friction
    ]  # fmt: skip


def warn_contradicted_loads(run: Run) -> list[Finding]:
    """By the energy: loads with which the motor of the run does other work than that of the record."""
    scenario, reported = run.scenario, []
    for work in run.loads:
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
        place = scenario.at("loads", work.load)
        reported.append(Finding(
            "load-contradicts-record", "doubt",
            f"{place}: while the load {work.words} acts, the motor of {load.axis_name} does "
            f"{drives.run:.3g} J of work in the run and {drives.record:.3g} J in the record (column "
            f"{column!r}); the load does {drives.load:.3g} J on the machine. If the recorded torque's own sign is "
            f"right, {wrong}; both agree with factor: {factor * load.factor:.3g}",
            place, f"loads.{work.load}.factor={factor * load.factor:.3g}",
        ))  # fmt: skip
    return reported


# --- How far a motion leaves the pose of its plant, or how the plant followed it --------------------------------------


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
    warnings: tuple[Finding, ...] = ()


def pose_use(
    machine: Machine, program: Program, grid: tuple[GridAxis, ...], crossings: Crossings | None = None
) -> PoseUse:
    """How the plant of a machine stands to a motion. grid: the axes that the plant follows.

    Raises:
        InputError: the machine's structure cannot be read.
    """
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    followed = {axis.axis for axis in grid}
    change = pose_change(machine, {axis: reached for axis, reached in ranges.items() if axis not in followed})
    outside = tuple(
        finding
        for axis in grid
        if axis.axis in ranges
        for finding in warn_outside_grid(axis, ranges[axis.axis], machine)
    )
    doubt = None if grid else table_mismatch(machine)  # a plant that follows has modes of its own
    doubts = () if doubt is None else (doubt,)
    return PoseUse(change, grid, crossings, (*doubts, *outside, *warnings(change)))


def warn_outside_grid(axis: GridAxis, reached: tuple[float, float], machine: Machine) -> list[Finding]:
    """The outermost cells reach on without end, but their modes are those of their centres."""
    travel = machine.axes[axis.axis].travel
    first, last = axis.reach
    beyond = max(first - max(reached[0], travel[0]), min(reached[1], travel[1]) - last)
    if beyond <= MIN_POSE_DISTANCE:
        return []
    return [Finding(
        "pose-grid-left", "doubt",
        f"axis {axis.axis} leaves the plant's grid of poses ({first * 1e3:.6g} mm to {last * 1e3:.6g} mm) by "
        f"{beyond * 1e3:.4g} mm: the modes there are those of the last cell; pack a wider grid",
        axis.axis, "pack a wider grid",
    )]  # fmt: skip


# --- Whether the exchange between plant and friction is stable: ahead by their parameters, afterwards by the energy ---


# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 5e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3


def exchange_stability(scenario: Scenario, modes: Modes) -> list[Finding]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h."""
    scheme = SCHEMES[scenario.coupling.scheme]
    step = scenario.machine.cycles.T_c / scenario.coupling.steps(scenario.machine)
    warnings: list[Finding] = []
    unknown = [name for name, axis in scenario.machine.axes.items() if isinstance(axis.friction, ForeignUnit)]
    if unknown:
        warnings.append(Finding(
            "exchange-not-judged", "doubt",
            f"axis {', '.join(unknown)}: how steeply another maker's friction rises with the speed is not known: "
            f"nothing shows ahead whether scheme {scheme.name} is stable with it, the energy residual of the run does",
            ", ".join(unknown),
        ))  # fmt: skip
    for name, axis in scenario.machine.axes.items():
        friction = axis.friction
        if isinstance(friction, ForeignUnit):
            continue
        slope, bound = friction.sigma_1 + friction.sigma_2, 2 * modes.J_inf(name) / step
        if slope > scheme.stable_share * bound:
            warnings.append(Finding(
                "exchange-unstable", "doubt",
                f"axis {name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad is above "
                f"{scheme.stable_share * bound:.4g}, where scheme {scheme.name} becomes unstable at a reversal "
                f"({scheme.stable_share:g} of 2 J_inf/h); use more coupling.substeps",
                name, f"coupling.substeps={2 * scenario.coupling.substeps}",
            ))  # fmt: skip
    return warnings


def warn_coupling_energy(run: Run, loops: Sequence[Loop]) -> list[Finding]:
    """The coupling is blamed where nothing else is known to make an axis chatter."""
    coupling = run.scenario.coupling
    steps = coupling.steps(run.scenario.machine)
    step = run.scenario.machine.cycles.T_c / steps
    if any(loop.growing for loop in loops):
        why, remedy = "that is a consequence of the unstable control loop, and says nothing of the coupling", ""
    else:
        remedy = f"coupling.substeps={2 * steps}"
        why = f"it is unstable or too coarse, and the result is not to be trusted; try coupling.substeps above {steps}"
    return [
        Finding(
            "exchange-loses-energy", "doubt",
            f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
            f"friction work (scheme {coupling.scheme}, exchange step {step * 1e6:.6g} us): {why}",
            axis, remedy,
        )
        for axis in run.scenario.machine.axes
        for residual, work in [(run.coupling[f"{axis}.residual_peak"], abs(run.coupling[f"{axis}.friction_work"]))]
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]  # fmt: skip


# --- Whether the control loops of a machine are stable, and by what margins -------------------------------------------


GAIN = {"speed": ("K_p", "N.m.s/rad", "N.m.s/rad"), "position": ("K_v", "1/s", "(m/min)/mm")}
STATE = {"moving": "while the axis slides", "at rest": "at rest, where friction holds it like a spring"}

CODE = (Path(linear.__file__).parent, Path(__file__))


def loops_of(machine: Machine, modes: Modes) -> tuple[Loop, ...]:
    """The loops as :func:`feedsim.linear.judgement.judge` has them, kept from one process to the next."""
    state = hashlib.sha256(repr((list(modes.ports), modes.frequency.shape)).encode())
    for column in (modes.frequency, modes.damping, *modes.ports.values()):
        state.update(column.tobytes())
    described = repr((machine.axes, machine.cycles))

    def find() -> list[dict[str, Any]]:
        return [asdict(loop) | {"growing": int(loop.growing)} for loop in judge(machine, modes)]

    return tuple(Loop(**loop) for loop in cache_answer("loops", [described, state.hexdigest()], CODE, find))


def warn_control_loops(machine: Machine, loops: Sequence[Loop], program: Program | None = None) -> list[Finding]:
    """Loops that are unstable or have less than the usual margins, with the gain that would do, and those not judged.

    A loop is wrong where it is unstable in a state that the motion brings about: axes that do not move rest. Without a
    program every axis moves.
    """
    result: list[Finding] = []
    for axis, kind in dict.fromkeys((loop.axis, loop.kind) for loop in loops):
        states = [loop for loop in loops if (loop.axis, loop.kind) == (axis, kind)]
        unstable, thin = [loop for loop in states if loop.unstable], [loop for loop in states if loop.thin]
        if not (unstable or thin):
            continue
        now = _gain(kind, states[0].gain)
        advised = [loop.advised for loop in unstable or thin]
        nearest = None if None in advised else _gain(kind, min(filter(None, advised)))
        remedy = f"machine.axes.{axis}.drive.{nearest.replace(' = ', '=')}" if nearest else ""
        usual = f"the usual {_decibels(GAIN_MARGIN):.0f} dB and {PHASE_MARGIN:g} deg"
        better = f"; with {nearest} it has" if nearest else f"; no {GAIN[kind][0]} was found with which it has"
        if not unstable:
            margins = "; ".join(
                f"gain {_decibels(loop.gain_margin):.1f} dB, phase {loop.phase_margin:.0f} deg {STATE[loop.state]}"
                for loop in thin
            )
            text = f"axis {axis}: the {kind} loop has thin margins with {now}: {margins}{better} {usual}"
            result.append(Finding("loop-margins-thin", "doubt", text, axis, remedy))
            continue
        where = "; ".join(map(_describe_stability, states))
        text = (
            f"axis {axis}: the {kind} loop is unstable with {now}: {where}{better} {usual}. The instability is "
            "physical; a smaller step does not remove it"
        )
        met = any(loop.growing and (loop.state == "at rest" or _moves_axis(program, axis)) for loop in unstable)
        result.append(Finding("loop-unstable", "wrong" if met else "doubt", text, axis, remedy))
    if unknown := [name for name, axis in machine.axes.items() if isinstance(axis.drive, ForeignUnit)]:
        others = "; the other axes are judged with its motor free" if loops else ""
        result.append(Finding(
            "loop-not-judged", "doubt",
            f"axis {', '.join(unknown)}: whether the loops are stable is not judged, the drive is another maker's"
            + others,
            ", ".join(unknown),
        ))  # fmt: skip
    return result


def _moves_axis(program: Program | None, axis: str) -> bool:
    if program is None:
        return True
    low, high = program.reached(axis)
    return low < high


def _describe_stability(loop: Loop) -> str:
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


@dataclass(frozen=True, repr=False, kw_only=True)
class JudgedRun(Run):
    """A run, and what a user should know before believing it.

    Attributes:
        pose: how far the motion leaves the plant's pose, or how the plant followed it.
        warnings: findings about it.

    >>> import feedsim as fs
    >>> run: fs.Run = fs.run("z_positioning.yaml").value
    >>> run.trace.unit("Z.M_fr"), run.log
    ('N.m', None)
    """

    pose: PoseUse
    warnings: tuple[Finding, ...]


def wrong_findings(run: JudgedRun) -> list[Finding]:
    """Findings with which nobody may read figures of the run."""
    return [finding for finding in run.warnings if finding.severity == "wrong"]


def judge_run(run: Run, *, keep: bool = True) -> JudgedRun:
    """The run with its doubts: those of its units, of the parameters, of the pose, and what the run itself shows.

    keep: whether the judged loops are kept on disk for the next process; a study has thousands of machines.

    Raises:
        InputError: the machine's table of modes or its structure cannot be read.
    """
    scenario, program = run.scenario, run.program
    modes = checked_modes(scenario.machine)
    loops = loops_of(scenario.machine, modes) if keep else judge(scenario.machine, modes)
    pose = pose_use(scenario.machine, program, run.grid, run.crossings)
    foreseen = _foresee_doubts(scenario, modes, program, loops, run.acting)
    wrong = tuple(finding for finding in foreseen if finding.severity == "wrong")
    shown = (
        *warn_coupling_energy(run, loops),
        *_warn_limits(run),
        *warn_driving_loads(run),
        *warn_contradicted_loads(run),
    )
    # What an unstable run shows besides follows from that.
    warnings = (
        *run.notes, *(wrong or (*foreseen, *pose.warnings, *shown)), *run.executor_notes,
    )  # fmt: skip
    return JudgedRun(**{field.name: getattr(run, field.name) for field in fields(Run)}, pose=pose, warnings=warnings)


def check(scenario: Scenario, program: Program, *, fmus: Path | None = None) -> tuple[Finding, ...]:
    """Judge a scenario without a step; return the warnings that can be given before a run.

    The shipped units judge their parameters. No other program is executed: of another maker's unit counts what its
    archive says of itself, and a warning says what is not checked.

    Raises:
        InputError: what :func:`feedsim.simulation.cosim.run` would refuse before its first step.
    """
    ready = cosim.check(scenario, program, fmus=fmus)
    modes = checked_modes(scenario.machine)
    loops = loops_of(scenario.machine, modes)
    pose = pose_use(scenario.machine, program, ready.grid)
    return (*ready.notes, *_foresee_doubts(scenario, modes, program, loops, ready.acting), *pose.warnings)


def _foresee_doubts(
    scenario: Scenario, modes: Modes, program: Program, loops: Sequence[Loop], acting: Sequence[ActingLoad]
) -> tuple[Finding, ...]:
    """What the parameters and the loads alone show a user to doubt."""
    return (
        *warn_control_loops(scenario.machine, loops, program),
        *exchange_stability(scenario, modes),
        *warn_unbalanced_loads(scenario, acting),
        *sizes(scenario.machine, program, acting),
        *warn_mount_damping(scenario.machine),
    )


def warn_mount_damping(machine: Machine) -> list[Finding]:
    """Damping of mounts that the table of modes has besides."""
    if machine.mounts is None:
        return []
    modes = parse_modes(machine.modes, tuple(machine.axes))
    table = read_mounts(machine.mounts.table, len(modes.frequency))
    return damped_twice(modes, table, scale_elements(table, machine.mounts.parameters()))


def _warn_limits(run: Run) -> list[Finding]:
    """Limits at which a drive was while it was recorded."""
    return [
        Finding(
            "torque-clipped" if limit == "torque_limited" else "voltage-clipped", "doubt",
            f"axis {axis}: {limit.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants", axis,
        )
        for (axis, _, limit), share in ((name.partition("."), share) for name, share in run.limited.items())
        if share > 0
    ]  # fmt: skip
