"""Whether the loads of a run are what they are meant to be: by their size ahead, by their energy afterwards."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feedsim.cosim import Run
from feedsim.cosim.loads import LOAD_TAKEN_UP, Acting, at_motor
from feedsim.nc import Program
from feedsim.scenario import Drive, FrictionParameters, Machine, Scenario

# Of F_C: a load that never exceeds it is lost in what friction itself is known to. Newtons read as kilonewtons are.
FELT = 1e-2
# A load that drives: the share of its work that it does on the machine and not the machine on it, net, and the least
# share of the friction work that makes it matter.
DRIVING, MATTERS = 0.5, 0.05
# A load that the recorded motor torque contradicts: the least change of its factor, and the least share of the motor's
# work by which run and record differ while it acts. Below the last factor the record shows little of such a load.
FACTOR_OFF, WORK_OFF, FACTOR_SEEN = 0.5, 0.1, 0.3


def unbalanced(scenario: Scenario, loads: Sequence[Acting]) -> list[str]:
    """The drive's integrators start empty: an axis under load sags before it holds."""
    if scenario.motions[0].held >= LOAD_TAKEN_UP:
        return []
    machine, start = scenario.machine, np.array([0.0, scenario.machine.cycles.T_c])
    sagging = (
        f"is not carried at the start, the axis sags while the drive takes it up; put a dwell of {LOAD_TAKEN_UP:g} s "
        "ahead of the first motion"
    )
    reported = [
        f"axis {name}: the constant load of {axis.M_0:g} N.m {sagging}"
        for name, axis in machine.axes.items()
        if axis.M_0 != 0
    ]
    for acting in loads:
        torque = at_motor(acting.load, float(acting.means(start)[0]), machine)
        friction = machine.axes[acting.load.axis_name].friction if torque is not None else None
        # Friction alone holds what is below F_C.
        if torque is not None and isinstance(friction, FrictionParameters) and abs(torque) > friction.F_C:
            reported.append(
                f"{acting.place}: the load of {torque:.3g} N.m at the motor of {acting.load.axis_name} {sagging}"
            )
    return reported


def sizes(machine: Machine, program: Program, loads: Sequence[Acting]) -> list[str]:
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
            reported.append(
                f"{size}, {abs(torque) / drive.M_max:.3g} times the drive's M_max, {drive.M_max:.4g} N.m: the axis "
                "cannot hold it; are unit, kind and factor right?"
            )
        elif isinstance(friction, FrictionParameters) and abs(torque) < FELT * friction.F_C:
            reported.append(
                f"{size}, {abs(torque) / friction.F_C:.2g} of the Coulomb friction F_C, {friction.F_C:.4g} N.m: next "
                "to nothing feels it; are unit, kind and factor right?"
            )
    return reported


def driving(run: Run) -> list[str]:
    """By the energy: a load that drives the machine, where forces of a process resist its motion."""
    friction = float(np.abs([run.coupling[f"{axis}.friction_work"] for axis in run.scenario.machine.axes]).sum())
    return [
        f"{run.scenario.at('loads', work.load)}: the load {work.words} drives the machine: it has done "
        f"{work.given:.3g} J of work on it and taken {work.taken:.3g} J from it (friction: {friction:.3g} J). The "
        "force of a process resists the motion: if this is one, its sign is wrong, and factor: -1 turns it"
        for work in run.loads
        if work.net > DRIVING * (work.given + work.taken) and work.net > MATTERS * friction
    ]


def contradicted(run: Run) -> list[str]:
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
        reported.append(
            f"{scenario.at('loads', work.load)}: while the load {work.words} acts, the motor of {load.axis_name} does "
            f"{drives.run:.3g} J of work in the run and {drives.record:.3g} J in the record (column "
            f"{column!r}); the load does {drives.load:.3g} J on the machine. If the recorded torque's own sign is "
            f"right, {wrong}; both agree with factor: {factor * load.factor:.3g}"
        )
    return reported
