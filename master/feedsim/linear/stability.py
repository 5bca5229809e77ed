"""How many poles of the closed system lie outside the unit circle, by the argument principle.

Open-loop poles lie inside or on the unit circle: damped modes, rigid modes, integrators. The determinants that the two
eliminations of the system solve with, det(1 + torque loop) over T_c and det(1 + position loop) over T_pos, tend to a
constant for z to infinity; along a circle just outside the unit circle each therefore winds around 0 backwards once for
every closed pole outside (the multivariable Nyquist criterion, here of the system lifted over a position cycle).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from feedsim.errors import InputError
from feedsim.linear.margins import grid
from feedsim.linear.plant import Complexes
from feedsim.linear.system import LinearSystem

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
