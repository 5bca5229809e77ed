"""Closed forms of a drive that proposals rest on: lags of slow motions, neutral T_sym, gain of the reference model.

With H(s) from the position setpoint to the position, the slope of its phase at 0 Hz is the lag of slow motions (derived
in cosim/feedforward.py, exact for the sampled drive):

    T = T_dyn + T_sym + (1 - k_ffw)/K_v
"""

from __future__ import annotations

from feedsim.errors import InputError
from feedsim.scenario import Cycles, Drive, Machine


def check_controlled(machine: Machine, axis: str) -> None:
    """InputError: the drive of an axis is another maker's, or does not hold the axis at its setpoint."""
    drive = machine.shipped_drive(axis, "tuning")
    for name, value in (("K_v", drive.K_v), ("K_p", drive.K_p)):
        if value <= 0:
            raise InputError(
                f"axis {axis}: {name} is 0; tuning needs a drive that holds its axis: give it a value above 0"
            )


def axis_lag(drive: Drive) -> float:
    """Lag [s] of an axis behind its position setpoint, of slow motions; infinite without position control."""
    return drive.T_dyn + drive.T_sym + feedforward_lag(drive)


def feedforward_lag(drive: Drive) -> float:
    """The part of it [s] that missing speed feedforward makes, (1 - k_ffw)/K_v."""
    missing = 1 - drive.k_ffw
    return missing / drive.K_v if drive.K_v > 0 else (float("inf") if missing else 0.0)


def loop_lag(drive: Drive, cycles: Cycles, J: float) -> float:
    """Lag [s] of the speed loop, from the position controller's output to the speed.

    J: inertia that a slow torque accelerates [kg.m2]. The integral part makes the speed follow the reference model,
    whose lag is 2 D/omega_0 + T_ref; without a model it follows the setpoint itself; a P controller alone lags by
    J/K_p. The setpoint ramp adds T_pos - T_c, the held setpoint half of that. A speed from differences of the position
    is late by half its window, so that the axis is early by that.
    """
    if not drive.speed_integrator:
        own = J / drive.K_p if drive.K_p > 0 else float("inf")
    elif drive.reference_model and drive.omega_0 and drive.D is not None:
        own = 2 * drive.D / drive.omega_0 + drive.T_ref
    else:
        own = 0.0
    ramp = cycles.T_pos - cycles.T_c
    return own + (ramp if drive.ramp_speed_setpoint else ramp / 2) - drive.speed_window * cycles.T_c / 2


def model_gain(drive: Drive, J: float) -> float | None:
    """The K_p [N.m.s/rad] that the reference model stands for; None where the drive has no such model.

    The model is to be what the speed loop does with its P part alone, whose lag is J/K_p; the model's is 2 D/omega_0.
    """
    if not (drive.speed_integrator and drive.reference_model and drive.omega_0 and drive.D):
        return None
    return J * drive.omega_0 / (2 * drive.D)


def torque_response(drive: Drive) -> float:
    """Angle per torque [rad/(N.m)] by which an axis gives way to friction that turns round; infinite without control.

    Behind a step M of the torque the speed loop gives way by the integral of its speed, M T_n/K_p, as s goes to 0 in
    1/(J s^2 + K_p s + K_p/T_n). The position controller draws it back meanwhile: its integral over T_n at the rate K_v
    makes that M/(K_p (1/T_n + K_v)). Without integral part it is the stiffness of the loops, M/(K_p K_v).
    """
    rate = drive.K_v + (1 / drive.T_n if drive.speed_integrator and drive.T_n else 0.0)
    return 1 / (drive.K_p * rate) if drive.K_p > 0 and rate > 0 else float("inf")
