"""What a control cycle is for the native loop: the operations of :class:`~feedsim.cosim.schedule.Cycle`, line by line.

The two are twins: same calls in the same order, same arithmetic with the same roundings. Tests hold them to the same
bits; change both or none.
"""

from __future__ import annotations

import numpy as np

from feedsim.cosim.exchange import Operations
from feedsim.cosim.schedule import Cycle


def compile_cycle(cycle: Cycle, to: Operations) -> None:
    """Cycle.run(k)."""
    system = cycle.system
    for control in system.controllers:
        to.set(control.measured)
        to.step(control.unit, 0.0, cycle.cycle)
        to.get(control.torque)
        to.get_slopes(control.torque)
    if cycle.scheme.torque_ramp:
        to.line(system.M_a_start, system.M_a_end, -cycle.cycle, system.M_a_slope)
    else:
        to.copy(system.M_a_start, cycle.M_a_before)
        to.copy(system.M_a_slope, np.zeros(len(system.axes)))
        to.copy(cycle.M_a_before, system.M_a_end)
    for j in range(cycle.substeps):
        to.line(system.M_a, system.M_a_start, j * cycle.step, system.M_a_slope)
        _compile_exchange(cycle, j * cycle.step, to)


def _compile_exchange(cycle: Cycle, start: float, to: Operations) -> None:
    """Cycle._exchange(t) from `start` [s] after the beginning of the cycle."""
    system, scheme, h = cycle.system, cycle.scheme, cycle.step
    stepped_again = [system.plant, *(contact.unit for contact in system.contacts)]
    to.copy(system.n_start, system.n_end)
    if scheme.passes > 1:
        to.copy(cycle.M_fr_start, system.M_fr)
        for unit in stepped_again:
            to.keep(unit)
    _compile_step(cycle, start, to)
    for _ in range(1, scheme.passes):
        for unit in stepped_again:
            to.go_back(unit)
        to.copy(system.M_fr, cycle.M_fr_start)
        _compile_step(cycle, start, to)
    to.bond(
        h, M_fr=system.M_fr, n=system.n, n_slope=system.n_slope, assumed_torque=cycle.assumed_torque,
        n_end=system.n_end, residual=cycle.residual, residual_peak=cycle.residual_peak, dissipated=cycle.dissipated,
    )  # fmt: skip


def _compile_step(cycle: Cycle, start: float, to: Operations) -> None:
    """Cycle._step(t)."""
    system, scheme, h = cycle.system, cycle.scheme, cycle.step
    if scheme.friction_first:
        to.copy(system.n, system.n_start)
        _compile_friction(cycle, start, to)
        _compile_plant(cycle, start, to)
        return
    _compile_plant(cycle, start, to)
    if scheme.speed == "within":
        to.copy(system.n, system.n_start)
        to.rate(system.n_slope, system.n_end, system.n_start, h)
    elif scheme.speed == "end":
        to.copy(system.n, system.n_end)
    elif scheme.speed == "start":
        to.copy(system.n, system.n_start)
    else:
        to.copy(system.n, system.n_start)
        to.copy(system.n_slope, system.n_slope_last)
        to.rate(system.n_slope_last, system.n_end, system.n_start, h)
    _compile_friction(cycle, start, to)


def _compile_plant(cycle: Cycle, start: float, to: Operations) -> None:
    """Cycle._step_plant(t)."""
    system, scheme, h = cycle.system, cycle.scheme, cycle.step
    to.set(system.plant_inputs)
    to.set_slopes(system.plant_inputs if scheme.friction_ramp else system.plant_torque)
    to.step(system.plant, start, h)
    to.get(system.plant_outputs)

    if scheme.friction_ramp:
        to.line(cycle.assumed_torque, system.M_fr, h, system.M_fr_slope)
    else:
        to.copy(cycle.assumed_torque, system.M_fr)


def _compile_friction(cycle: Cycle, start: float, to: Operations) -> None:
    """Cycle._step_friction(t)."""
    for contact in cycle.system.contacts:
        to.set(contact.speed)
        to.set_slopes(contact.speed)
        to.step(contact.unit, start, cycle.step)
        to.get(contact.torque)
        to.get_slopes(contact.torque)
