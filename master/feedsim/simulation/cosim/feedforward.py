"""Torque feedforward: torques over time that are added to the torque setpoints of the drives (their input M_add).

Friction compensation is one: the friction law itself, driven by the speed that the axis is about to have. The axis
follows its speed setpoint with a lag, and its torque follows the torque setpoint with another; the law must see the
setpoint later by the first and earlier by the second:

    M_ff(t_k) = M_fr[n_ffw(t - T_ff)] at t = t_k,    T_ff = T_axis - T_torque

Both are the lags of slow motions, the slopes of the phase at 0 Hz, and exact for the sampled drive.

T_axis, from n_ffw to n_a. The position controller compares x_a(t_k) with x_s(t_k - T_dyn - T_sym), whose derivative is
n_ffw I_P. With H = (K_v e^{-s T_sym} + k_ffw s) G/(s + K_v G), G the speed loop, the slope of the phase at 0 does not
depend on G:

    T_axis = T_dyn + T_sym + (1 - k_ffw)/K_v

With the neutral T_sym the following error is 0, H = G e^{-s T_dyn}, and T_axis is the lag of the speed loop itself:
T_dyn + 2 D/omega_0 + T_pos - T_c, with the held speed setpoint T_dyn + 2 D/omega_0 + (T_pos - T_c)/2.

T_torque, from M_s to M_a. A PI current controller on R and L follows a ramp of the current setpoint with the slope of
the voltage, R di/dt, over its integral gain K_p/T_n; one cycle of computing delay, the hold of the voltage and the
cancelled EMF do not add to that. M_a is linear over the cycle, so no hold is left:

    T_torque = R T_n/K_p + sum over the filters of (D_den - D_num) T_c/tan(pi f T_c)      (low-pass: D_den alone)

With the ideal current loop the torque is held over a cycle: T_c/2 in place of the first term.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from feedsim.files.trace.trace import suggest_name
from feedsim.foundation.errors import InputError
from feedsim.scenario import Cycles, Drive, FrictionParameters, Machine
from feedsim.scenario.axis_units import FILTER_TYPES, Filter
from feedsim.simulation.cosim.operations import Operation, set_real
from feedsim.simulation.cosim.system import System, controller
from feedsim.simulation.cosim.unit import Floats, Port
from feedsim.simulation.nc import Program

TorqueFeedforward = Mapping[str, Floats]
Law = Callable[[Mapping[str, float], Floats, float], Floats]

LOW_PASS = FILTER_TYPES["low_pass"]


@dataclass(frozen=True)
class Lag:
    """Lags of slow motions [s]: of the axis behind its speed setpoint n_ffw, of its torque behind the torque setpoint.

    delay: by how much a torque feedforward is to follow n_ffw, so that it acts when the axis moves.
    """

    axis: float
    torque: float

    @property
    def delay(self) -> float:
        return self.axis - self.torque


def lag_of(drive: Drive, cycles: Cycles) -> Lag:
    """Lags of an axis from its drive's parameters.

    Raises:
        InputError: the drive has no position or no current control, so that it has none.
    """
    if drive.K_v <= 0:
        raise InputError("K_v is 0: without position control the lag of the axis is not that of its setpoint filters")
    return Lag(axis=drive.T_dyn + drive.T_sym + (1 - drive.k_ffw) / drive.K_v, torque=_torque_lag(drive, cycles.T_c))


def friction_feedforward(
    machine: Machine,
    program: Program,
    frictions: Mapping[str, FrictionParameters],
    delays: Mapping[str, float],
    laws: Callable[[FrictionParameters], Law],
) -> dict[str, Floats]:
    """Friction torque over time for the axes that `frictions` and `delays` name.

    Args:
        frictions: axis -> parameters of a law.
        delays: axis -> delay T_ff [s] behind n_ffw; below 0 it looks ahead in the program.
        laws: the law of a set of parameters: friction torque [N.m] from parameters, speed (N+1,) [rad/s] and its
            interval [s]; starts with z = c = 0, as the friction units do.

    Returns:
        axis -> (cycles + 1,) [N.m] at the instants k T_c. At rest it stays where the motion left it, as friction does.
    """
    T_c = machine.cycles.T_c
    count = (len(program.time) - 1) * round(machine.cycles.T_pos / T_c) + 1
    t = np.arange(count, dtype=np.float64) * T_c
    return {
        # Linear between the setpoints, as the drive ramps them: a motion at rest stays exactly at rest.
        axis: laws(friction)(
            {name: float(value) for name, value in friction.parameters().items()},
            np.interp(t - delays[axis], program.time, program.n_ffw[axis]),
            T_c,
        )
        for axis, friction in frictions.items()
    }


def feeders(system: System, torques: TorqueFeedforward, instants: int) -> list[Operation]:
    """What hands over the torques of instant k to the drives.

    Raises:
        InputError: an unknown axis, or torques that are not one finite number per instant.
    """
    sends: list[Operation] = []
    for axis, torque in torques.items():
        if axis not in system.axes:
            raise InputError(f"torque feedforward: no axis {axis!r}{suggest_name(axis, system.axes)}")
        if torque.shape != (instants,) or not np.all(np.isfinite(torque)):
            raise InputError(
                f"torque feedforward of axis {axis}: {instants} finite values are needed, one per control cycle and "
                f"one for the end; there are {torque.shape}, {np.count_nonzero(np.isfinite(torque))} of them finite"
            )
        role = system.roles[controller(axis)]
        if "M_add" not in role.signals:
            raise InputError(
                f"{role}: no input of it stands for M_add, to which a torque feedforward is added; name one under "
                f"axes.{axis}.drive.inputs"
            )
        port = Port(system.units[controller(axis)], ["M_add"])
        sends += set_real(port, port.to_own(torque.reshape(-1, 1)))
    return sends


def _torque_lag(drive: Drive, T_c: float) -> float:
    filters = sum(_filter_lag(entry, T_c) for entry in (drive.filter_1, drive.filter_2, drive.filter_3, drive.filter_4))
    if drive.ideal_current_loop:
        return filters + T_c / 2
    if drive.current is None or drive.R is None or drive.current.K_p <= 0:
        raise InputError("the current controller has no gain: the torque does not follow its setpoint")
    return filters + drive.R * drive.current.T_n / drive.current.K_p


def _filter_lag(filter_: Filter, T_c: float) -> float:
    kind = FILTER_TYPES[filter_.type]
    if kind == 0 or filter_.f is None or filter_.D_den is None:
        return 0.0
    numerator = 0.0 if kind == LOW_PASS else filter_.D_num or 0.0
    return (filter_.D_den - numerator) * T_c / math.tan(math.pi * filter_.f * T_c)
