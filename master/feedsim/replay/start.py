"""What a record alone says of an axis: values to begin with, and a machine of rigid axes to begin on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from feedsim.errors import InputError
from feedsim.estimation.interval import NORMAL_95
from feedsim.identify.inertia import Inertia, inertia
from feedsim.identify.parameters import EXCESS
from feedsim.identify.record import Record
from feedsim.replay.closed_loop import AxisRecord

BANDWIDTH = 50.0  # [Hz] of a speed loop to begin with: K_p = 2 pi f J
INTEGRAL = 10e-3  # [s] T_n to begin with
PRESLIDING = 5e-6  # [m] of travel after which friction is full
ZONE = 0.06  # [rad] width of an engaging zone
RESERVE = 1.5  # what the machine may do beyond what the record shows
# Shares of the mean torque that friction may have of it, where the record does not separate it from the constant load.
FRICTION_SHARES = (0.05, 0.15, 0.4)
LEAST_TRAVEL = 0.01  # rad: a motor that turns less determines no drive
ONE_PHASE_DEVIATION = 1.0  # of the logarithm of an inertia by a torque that is known once a position cycle
CLIPPED_DEVIATION = 0.3  # of the logarithm of an inertia to which rows belong whose torque is cut off
SEPARATED = 0.5  # relative half width of F_C below which the rigid line separates friction from the constant load
# A torque limit that is not known must not act: gentle moves determine nothing of the torque of rapid ones.
TORQUE_LIMIT_RATIO = 20.0


@dataclass(frozen=True)
class Begin:
    """Where fits of an axis begin.

    starts: parameters of drive and friction, a fit each. one_way: what the record determines of constant load and
    friction where it does not separate them, in words; empty where it does.
    """

    starts: Sequence[Mapping[str, float]]
    one_way: str = ""


def start_values(each: AxisRecord) -> Begin:
    """Parameters of drive and friction to begin fits with, by the rigid line of the record.

    Motion in one direction determines only the sum of constant load and friction. Little motion in the other one
    determines hardly more. Then friction has several shares of that torque, each of which is a start: from a wrong one
    a fit does not come back.

    Raises InputError: the axis does not move or does not accelerate.
    """
    if float(np.ptp(each.setpoint[each.rows])) < LEAST_TRAVEL * each.I_P:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: the setpoint moves by "
            f"{1e6 * float(np.ptp(each.setpoint[each.rows])):.3g} um; a drive is identified from motion of "
            f"{1e6 * LEAST_TRAVEL * each.I_P:.3g} um at least"
        )
    rows = np.flatnonzero(each.rows)
    try:
        found, J_sigma = _rigid_line(each.record.between(int(rows[0]), int(rows[-1]) + 1))
    except InputError as error:
        raise InputError(f"axis {each.axis}: {error}; --axes names the axes that move, --window a part of it") from None
    line = {name: one.value for name, one in found.estimates.items()}
    J = line["J"]
    if not J > 0:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: the inertia comes out as {J:.3g} kg.m2; "
            "the torque's sign or unit is wrong"
        )
    moving = each.moving
    torque = float(np.sqrt(np.mean(each.record.torque[moving] ** 2)))
    least = 0.01 * torque
    spread = {name: NORMAL_95 * one.sigma for name, one in found.estimates.items() if one.status == "estimated"}
    J_sigma = max(J_sigma, found.J.sigma / J)
    if max(spread["F_C"], spread.get("M_0", inf)) <= SEPARATED * line["F_C"]:
        return Begin([_values(each, J, J_sigma, line["M_0"], max(line["F_C"], least), line["sigma_2"])])
    # The direction in which it moves further.
    way = -1.0 if float(np.sum(each.speed[moving])) < 0 else 1.0
    there = moving & (way * each.speed > 0)
    n = float(np.mean(each.speed[there])) / each.I_P
    load = line["M_0"] + way * line["F_C"] + line["sigma_2"] * n
    starts = [_values(each, J, J_sigma, load - way * share * abs(load), share * abs(load)) for share in FRICTION_SHARES]
    if way * load > 0:  # friction alone may do it
        starts.append(_values(each, J, J_sigma, 0.0, max(abs(load), least)))
    if line["F_C"] > 0 and "M_0" in spread:
        starts.append(_values(each, J, J_sigma, line["M_0"], max(line["F_C"], least), line["sigma_2"]))
    sign = "+" if way > 0 else "-"
    rows_left = "motion in one direction" if each.record.clipped is None else "torque that is not cut off"
    only = f"{rows_left} determines only M_0 {sign} friction: {load:.3g} N.m at {1e3 * n * each.I_P:.3g} mm/s"
    return Begin(starts, only)


def of_cycle(start: Mapping[str, float], cycle: float, interval: float) -> dict[str, float]:
    """A start for a position loop of that cycle, of a record with rows at that interval [s].

    Where the record has the torque once a cycle, a held speed setpoint makes the torque ripple within that cycle, and
    the record shows one phase of the ripple: the torque that accelerates comes out too small, and with it the inertia
    of the rigid line.
    """
    return {**start, "J_sigma": ONE_PHASE_DEVIATION} if cycle > 0.5 * interval else dict(start)


def _rigid_line(record: Record) -> tuple[Inertia, float]:
    """The rigid line, and the deviation of the inertia's logarithm by which it may be off besides its own.

    Where too few rows are left whose torque is not cut off, it is one through all rows: too small, but a start.
    """
    try:
        return inertia([record]), 0.0
    except InputError:
        if record.clipped is None:
            raise
        return inertia([replace(record, clipped=None)]), CLIPPED_DEVIATION


def _values(
    each: AxisRecord, J: float, J_sigma: float, M_0: float, F_C: float, sigma_2: float = 0.0
) -> dict[str, float]:
    """All values to begin with. J_sigma: deviation of the inertia's logarithm by which a fit may leave it."""
    top = float(np.max(np.abs(each.speed))) / each.I_P
    return {
        "J": J, "J_sigma": J_sigma, "M_0": M_0, "F_C": F_C, "sigma_2": max(sigma_2, 0.1 * F_C / top),
        "K_p": 2 * pi * BANDWIDTH * J, "K_i": 2 * pi * BANDWIDTH * J / INTEGRAL,
        "sigma_0": F_C * each.I_P / PRESLIDING, "sigma_1": 1e-4 * F_C * each.I_P / PRESLIDING, "v_s": 1e-2 * top,
        "W": ZONE, "gamma": 1.0, EXCESS: 0.0, "F_log": 0.0, "asymmetry": 0.0,
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
        "torque": TORQUE_LIMIT_RATIO * float(np.max(np.abs(each.record.torque))),
    }  # fmt: skip
