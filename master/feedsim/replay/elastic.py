"""Elastic modes of an axis in a record: how many, where they are, and what they are in the units.

What a rigid axis leaves of the position is regressed on the axis' own acceleration a, seen by a resonance:

    x_recorded - x_simulated = c q + d (dq/dt)/w
    d2q/dt2 + 2 D w dq/dt + w^2 q = w^2 a

Frequency and damping are chosen on a grid, one resonance after the other; the quadrature d stands for what the closed
loop does to it. In the units a mode is one of the table of modes, relative to the rigid motion: n_k = u n_0,
x_k = v x_0; frequency, damping, u and v are fitted with the rest (tuning.py), and then the next resonance is looked for
in what the units leave.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.signal import cont2discrete, lfilter, ss2tf

from feedsim.replay.closed_loop import AxisRecord
from feedsim.scenario import Machine
from feedsim.structure import checked_modes
from feedsim.structure.modes import Modes, modes_text
from feedsim.trace.trace import Array

MOST_MODES = 5
RESONANCE_FREQUENCIES = 60  # frequencies
DAMPING = (0.01, 0.03, 0.06, 0.1)
# Below twice the position loop's corner its gains do the same as a mode; above a fifth of the rows' rate nothing shows.
ABOVE_LOOP, BELOW_RATE = 2.0, 0.2
RINGS = 0.2  # [s] behind the motion in which an axis still swings


@dataclass(frozen=True)
class Beside:
    """What a mode of one axis does at the scale of another one.

    axis: the other one. shape: mode shape at its scale over the rigid motion of the mode's own axis [1]. sigma: its
    standard deviation.
    """

    axis: str
    shape: float
    sigma: float


@dataclass(frozen=True)
class ElasticMode:
    """A mode of an axis.

    frequency [Hz], damping [1]; motor, scale: mode shape at rotor and scale over that of the rigid motion [1].
    sigma: standard deviations of the four, in this order; nan where they are not known. beside: other axes that it
    moves.
    """

    frequency: float
    damping: float
    motor: float
    scale: float
    sigma: tuple[float, ...] = (np.nan,) * 4
    beside: tuple[Beside, ...] = ()


@dataclass(frozen=True)
class Resonance:
    """A resonance of the regression: frequency [Hz], damping, and c and d of it together, with the sign of c [s2]."""

    frequency: float
    damping: float
    gain: float


def resonance(axis_record: AxisRecord, simulated: Array, per_row: int, K_v: float) -> Resonance | None:
    """The resonance that takes most of what a simulation leaves; None where the rows are too far apart for any.

    Args:
        simulated: ((N - 1) per_row + 1,) position [m]. K_v: of the position loop [1/s].
    """
    h = axis_record.record.interval
    remaining = axis_record.position - simulated[::per_row]
    behind = np.ones(round(RINGS / h) + 1)
    rows = np.flatnonzero(axis_record.rows & (np.convolve(axis_record.moving, behind)[: len(remaining)] > 0.5))
    acceleration = np.gradient(np.gradient(simulated, h / per_row), h / per_row)
    low, high = ABOVE_LOOP * K_v / (2 * pi), BELOW_RATE / h
    best: tuple[float, Resonance] | None = None
    for f in np.geomspace(low, high, RESONANCE_FREQUENCIES) if low < high else ():
        for D in DAMPING:
            A = resonator(float(f), D, acceleration, h / per_row)[::per_row][rows]
            c = _solved(A, remaining[rows])
            off = float(np.sum((remaining[rows] - A @ c) ** 2))
            if best is None or off < best[0]:
                best = off, Resonance(float(f), D, float(np.copysign(np.hypot(c[0], c[1]), c[0])))
    return best[1] if best is not None else None


def resonator(frequency: float, damping: float, a: Array, h: float) -> Array:
    """(N, 2) q and dq/dt / w of a resonance, by its exact answer to steps of `a`."""
    w = 2 * pi * frequency
    A, B = np.array([[0.0, 1.0], [-(w**2), -2 * damping * w]]), np.array([[0.0], [w**2]])
    discrete = cont2discrete((A, B, np.diag([1.0, 1.0 / w]), np.zeros((2, 1))), h, "zoh")
    numerators, denominator = ss2tf(*discrete[:4])
    return np.column_stack([lfilter(numerator, denominator, a) for numerator in numerators])


def _solved(A: Array, y: Array) -> Array:
    """Least squares by the normal equations of scaled columns: there are few, and many of them are tried."""
    scale = np.linalg.norm(A, axis=0) + 1e-300
    N = (A / scale).T @ (A / scale)
    N[np.diag_indices_from(N)] += 1e-10
    return np.asarray(np.linalg.solve(N, (A / scale).T @ y) / scale)


def with_modes(machine: Machine, axis: str, modes: Sequence[ElasticMode]) -> Machine:
    """The machine with modes of an axis added to its table, which is written beside that of the machine."""
    table = checked_modes(machine)
    n_0 = 1 / sqrt(table.J_tot(axis))
    x_0 = n_0 * machine.axes[axis].I_P
    further = [{f"n_{axis}": mode.motor * n_0, f"x_{axis}": mode.scale * x_0, f"tcp_{axis}": mode.scale * x_0}
               for mode in modes]  # fmt: skip
    whole = Modes(
        machine.modes,
        np.append(table.frequency, [mode.frequency for mode in modes]),
        np.append(table.damping, [mode.damping for mode in modes]),
        {port: np.append(column, [moved.get(port, 0.0) for moved in further]) for port, column in table.ports.items()},
    )
    name = hashlib.sha256(repr(modes).encode()).hexdigest()[:16]
    path = machine.modes.parent / f"modes_{name}.csv"
    path.write_text(modes_text(whole), encoding="utf-8")  # of a temporary folder: no need for a disk
    return machine.model_copy(update={"modes": path})


KEYS = ("mode_f", "mode_D", "mode_u", "mode_v")


def begin_mode(k: int, one: Resonance, sign: float) -> dict[str, float]:
    """Values to begin a fit of the k-th mode with. The product u v is c w^2; motor and scale share it alike at first.
    sign: 1, or -1 where the closed loop turns what the regression sees."""
    product = sign * one.gain * (2 * pi * one.frequency) ** 2
    u = max(sqrt(abs(product)), 1e-3)
    return dict(zip((f"{key}_{k}" for key in KEYS), (one.frequency, one.damping, u, product / u), strict=True))


def modes_of(values: Mapping[str, float]) -> list[ElasticMode]:
    """The modes in values of a fit."""
    elastic_modes = []
    k = 1
    while f"mode_f_{k}" in values:
        f, D, u, v = (values[f"{key}_{k}"] for key in KEYS)
        elastic_modes.append(ElasticMode(f, D, u, v))
        k += 1
    return elastic_modes
