"""What a record alone says of an axis: values to begin with, and a machine of rigid axes to begin on."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from feedsim.errors import InputError
from feedsim.identify.inertia import inertia
from feedsim.replay.closed_loop import AxisRecord

BANDWIDTH = 50.0  # [Hz] of a speed loop to begin with: K_p = 2 pi f J
INTEGRAL = 10e-3  # [s] T_n to begin with
PRESLIDING = 5e-6  # [m] of travel after which friction is full
ZONE = 0.06  # [rad] width of an engaging zone
RESERVE = 1.5  # what the machine may do beyond what the record shows
# A torque limit that is not known must not act: gentle moves tell nothing of the torque of rapid ones.
NO_LIMIT = 20.0


def start_values(each: AxisRecord) -> dict[str, float]:
    """Parameters of drive and friction to begin a fit with, by the rigid line of the record.

    Raises InputError: the axis does not accelerate.
    """
    line = {name: each.value for name, each in inertia([each.record]).estimates.items()}
    J = line["J"]
    if not J > 0:
        raise InputError(
            f"{each.record.name}: the inertia comes out as {J:.3g} kg.m2; the torque's sign or unit is wrong"
        )
    torque = float(np.sqrt(np.mean(each.record.torque[each.moving] ** 2)))
    F_C = max(line["F_C"], 0.01 * torque)
    top = float(np.max(np.abs(each.speed))) / each.I_P
    return {
        "J": J, "M_0": line["M_0"], "F_C": F_C, "sigma_2": max(line["sigma_2"], 0.1 * F_C / top),
        "K_p": 2 * pi * BANDWIDTH * J, "K_i": 2 * pi * BANDWIDTH * J / INTEGRAL,
        "sigma_0": F_C * each.I_P / PRESLIDING, "sigma_1": 1e-4 * F_C * each.I_P / PRESLIDING, "v_s": 1e-2 * top,
        "W": ZONE, "gamma": 1.0, "excess": 0.0, "F_log": 0.0, "asymmetry": 0.0,
        "K_v": 30.0, "k_ffw": 1.0, "T_sym": 0.5e-3, "T_dyn": 2 * each.record.interval, "delay": 0.0,
    }  # fmt: skip


def limits(each: AxisRecord) -> Mapping[str, float]:
    """Top speed [m/s], acceleration [m/s2], jerk [m/s3], lowest and highest position [m], torque [N.m] of the record,
    with a reserve."""
    h = each.record.interval
    speed = np.gradient(each.setpoint, h)
    acceleration = np.gradient(speed, h)
    jerk = np.gradient(acceleration, h)
    low, high = float(np.min(each.position)), float(np.max(each.position))
    reserve = (RESERVE - 1.0) * (high - low)
    return {
        "speed": RESERVE * float(np.max(np.abs(speed))),
        "acceleration": RESERVE * float(np.max(np.abs(acceleration))),
        "jerk": RESERVE * float(np.max(np.abs(jerk))),
        "low": low - reserve, "high": high + reserve,
        "torque": NO_LIMIT * float(np.max(np.abs(each.record.torque))),
    }  # fmt: skip
