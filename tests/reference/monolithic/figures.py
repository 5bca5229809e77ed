"""Figures of the reference runs: what "right" looks like for the positioning move and the circle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .machine import Machine
from .nc import Setpoints

Result = Mapping[str, NDArray[np.float64]]


def positioning(result: Result, setpoints: Setpoints, axis: str = "Z") -> dict[str, float]:
    """Figures of a move in the positive direction, positions in um, times in s or ms, torques in N.m."""
    t, x = result["time"], result[f"{axis}.x_a"]
    M_a, M_fr, n_a = (result[f"{axis}.{name}"] for name in ("M_a", "M_fr", "n_a"))
    end, target = setpoints.duration, setpoints.x_s[axis][-1]
    error = (x - target) * 1e6
    late = (t >= end + 0.03) & (t <= end + 0.4)
    signal, times = n_a[late], t[late]
    up = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    crossings = times[up] - signal[up] * (times[up + 1] - times[up]) / (signal[up + 1] - signal[up])
    return {
        "duration s": end,
        "peak torque N.m": float(np.max(np.abs(M_a))),
        "plateau torque N.m": float(np.mean(M_a[(t >= 0.5) & (t <= 1.1)])),
        "overshoot um": float(np.max(error)),
        "settling ms": float((t[np.abs(error) > 1][-1] - end) * 1e3),
        "ringing Hz": float((len(crossings) - 1) / (crossings[-1] - crossings[0])),
        "M_fr 1 s after N.m": float(np.interp(end + 1, t, M_fr)),
        "tool overshoot um": float(np.max((result[f"tool.x_{axis}"] + x[0] - target) * 1e6)),
    }


def contour(
    result: Result, machine: Machine, radius: float, turn: tuple[float, float], tool: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Time [s], angle [rad] and contour error [m] over one turn, from the scales or from the tool point."""
    inside = (result["time"] >= turn[0]) & (result["time"] < turn[1])
    a, b = machine.axes["X"].x_0, machine.axes["Z"].x_0
    x, z = (result["tool.x_X"] + a, result["tool.x_Z"] + b) if tool else (result["X.x_a"], result["Z.x_a"])
    u, w = x[inside] - (a - radius), z[inside] - b
    return result["time"][inside], np.arctan2(w, u), np.hypot(u, w) - radius


def circle(
    result: Result, machine: Machine, radius: float, turn: tuple[float, float], tool: bool = False
) -> dict[str, float]:
    """Glitches, G and radius figures of one turn, all in um."""
    _, phi, error = contour(result, machine, radius, turn, tool)
    middle = np.median(error)

    def glitch(*centres: float) -> float:
        return max(
            float(np.max(error[np.abs(np.angle(np.exp(1j * (phi - c)))) <= np.pi / 4]) - middle) for c in centres
        )

    return {
        "glitch X um": glitch(0.0, np.pi) * 1e6,
        "glitch Z um": glitch(np.pi / 2, -np.pi / 2) * 1e6,
        "G um": float(np.ptp(error)) * 1e6,
        "mean um": float(np.mean(error)) * 1e6,
        "median um": float(middle) * 1e6,
    }
