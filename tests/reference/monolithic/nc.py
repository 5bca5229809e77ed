"""Setpoints of the reference: jerk-limited path profile, interpolation cycle, one cubic spline, position cycle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Ruckig, Trajectory
from scipy.interpolate import CubicSpline

from .machine import Machine

REST_POINTS = 10  # ahead of the motion and behind it: enough for the spline's ringing (factor 0.27 a point) to die out


@dataclass(frozen=True)
class Setpoints:
    """x_s [m] and n_ffw [rad/s] per axis on the T_pos grid from 0; duration of the motion and its turns [s]."""

    x_s: Mapping[str, NDArray[np.float64]]
    n_ffw: Mapping[str, NDArray[np.float64]]
    duration: float
    turns: tuple[float, ...] = ()


def _profile(length: float, speed: float, machine: Machine) -> Trajectory:
    request = InputParameter(1)
    request.target_position = [length]
    request.max_velocity = [speed]
    request.max_acceleration = [machine.acceleration]
    request.max_jerk = [machine.jerk]
    trajectory = Trajectory(1)
    Ruckig(1).calculate(request, trajectory)
    return trajectory


def _setpoints(
    machine: Machine,
    profile: Trajectory,
    path: Mapping[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]],
    rest: float,
    turns: tuple[float, ...] = (),
) -> Setpoints:
    T = machine.T_ipo
    last = math.ceil((profile.duration + rest) / T) + REST_POINTS
    index = np.arange(-REST_POINTS, last + 1)
    s = np.array([profile.at_time(min(max(i * T, 0.0), profile.duration))[0][0] for i in index])
    m = np.arange(round((profile.duration + rest) / machine.T_pos) + 1)
    x_s, n_ffw = {}, {}
    for name, axis in machine.axes.items():
        points = path[name](s) if name in path else np.full(s.shape, axis.x_0)
        spline = CubicSpline(index * T, points, bc_type="clamped")
        x_s[name] = spline(m * machine.T_pos)
        n_ffw[name] = spline(m * machine.T_pos, 1) / axis.drive["I_P"]
    return Setpoints(x_s, n_ffw, profile.duration, turns)


def move(machine: Machine, axis: str, distance: float, speed: float, rest: float = 1.2) -> Setpoints:
    """Straight move of one axis by `distance` [m] at `speed` [m/s], then `rest` [s]."""
    start, sign = machine.axes[axis].x_0, math.copysign(1.0, distance)
    profile = _profile(abs(distance), speed, machine)
    return _setpoints(machine, profile, {axis: lambda s: start + sign * s}, rest)


def circle(
    machine: Machine, radius: float, speed: float, turns: float, rest: float = 0.25, plane: tuple[str, str] = ("X", "Z")
) -> Setpoints:
    """Counterclockwise circle; the pose is its point at 0 deg. `Setpoints.turns`: start, then the end of each turn."""
    profile = _profile(2 * math.pi * radius * turns, speed, machine)
    a, b = (machine.axes[name].x_0 for name in plane)
    path = {
        plane[0]: lambda s: a + radius * (np.cos(s / radius) - 1),
        plane[1]: lambda s: b + radius * np.sin(s / radius),
    }
    ends = [profile.get_first_time_at_position(0, 2 * math.pi * radius * i) for i in range(int(turns) + 1)]
    ends[0] = 0.0
    if int(turns) == turns:
        ends[-1] = profile.duration
    return _setpoints(machine, profile, path, rest, tuple(float(e) for e in ends))
