"""Frequency responses of the modal structure, continuous and exactly as sampled.

Everything is a function of the Laplace variable s [rad/s], z = exp(s T): on the imaginary axis a frequency response,
off it what a stability count needs.

Mode k with shape b at an input and c at an output, mass-normalised: q'' + 2 zeta omega_0 q' + omega_0^2 q = b u,
y = c q (displacement) or c q' (speed). Sampled, u is given at the instants t_i = i T and runs linearly between them or
is held. With the mode's poles p, p' the exact response at the instants is the divided difference over the poles of

    h(p) = T (phi_1 - phi_2 + phi_2 z)/(z - exp(p T))     u linear      phi_1(x) = (exp(x) - 1)/x
    h(p) = T phi_1/(z - exp(p T))                         u held        phi_2(x) = (exp(x) - 1 - x)/x^2,  x = p T

which is the response of q' = p q + u (Franklin, Powell, Workman: Digital Control of Dynamic Systems, hold equivalents).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from feedsim.structure import Modes

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# How an input runs between its sample instants; "continuous": it is no sampled signal, but exp(s t).
Hold = Literal["linear", "held", "continuous"]

TOOL_DIRECTIONS = ("X", "Y", "Z")
CHUNK = 128  # values of s worked at a time: what is in between stays in the cache
SERIES_BELOW = 0.5  # |x| up to which phi_2 comes from its series, 16 terms of which leave 0.5^16/18! = 2e-21
# Near critical damping the poles coincide and their divided difference cancels. The response is smooth in the damping
# ratio, so it is taken from ratios EPSILON and twice that above and below, which leaves an error of EPSILON^4.
DOUBLE_POLE = 1e-4
EPSILON = 2e-4


@dataclass(frozen=True, eq=False)
class ModalPlant:
    """Modes with their shapes at the ports.

    Attributes:
        omega_0: (N,) natural frequency [rad/s]; 0 for rigid modes.
        damping: (N,) damping ratio [1].
        rotor: (N, A) shape at the rotors: torque in, speed out [1/(kg^0.5 m)].
        scale: (N, A) shape at the scales: displacement out [1/kg^0.5].
        tool: (N, 3) shape at the tool: force in, displacement out [1/kg^0.5].
    """

    omega_0: Floats
    damping: Floats
    rotor: Floats
    scale: Floats
    tool: Floats

    @classmethod
    def of(cls, modes: Modes, axes: Sequence[str]) -> Self:
        def shapes(names: list[str]) -> Floats:
            return np.column_stack([modes.ports[name] for name in names])

        return cls(
            omega_0=2 * np.pi * modes.frequency,
            damping=np.asarray(modes.damping),
            rotor=shapes([f"n_{axis}" for axis in axes]),
            scale=shapes([f"x_{axis}" for axis in axes]),
            tool=shapes([f"tcp_{direction}" for direction in TOOL_DIRECTIONS]),
        )

    def ports(self, s: Complexes, T: float, hold: Hold) -> Complexes:
        """Port matrix at s (F,) [rad/s]: (F, 2 A + 3, A + 3).

        Rows: speeds n of the axes [rad/s], positions x of the axes [m], displacements of the tool [m]. Columns: torques
        of the axes [N.m], forces on the tool [N]. All inputs run by `hold` over cycles of T [s].
        """
        axes = self.rotor.shape[1]
        into = np.hstack([self.rotor, self.tool])
        columns = into.shape[1]
        # (N, outputs * inputs): products of shapes, so that the modal sums are two matrix products
        speeds = (self.rotor[:, :, None] * into[:, None, :]).reshape(len(into), -1)
        places = (np.hstack([self.scale, self.tool])[:, :, None] * into[:, None, :]).reshape(len(into), -1)
        result = np.empty((len(s), 2 * axes + len(TOOL_DIRECTIONS), columns), dtype=np.complex128)
        for start in range(0, len(s), CHUNK):
            part = slice(start, start + CHUNK)
            q, v = self.modal(s[part], T, hold)
            result[part, :axes] = modal_sums(v, speeds).reshape(-1, axes, columns)
            result[part, axes:] = modal_sums(q, places).reshape(-1, axes + len(TOOL_DIRECTIONS), columns)
        return result

    def modal(self, s: Complexes, T: float, hold: Hold) -> tuple[Complexes, Complexes]:
        """Responses q and q' of every mode to its own force: (F, N) each."""
        q = np.empty((len(s), len(self.omega_0)), dtype=np.complex128)
        v = np.empty_like(q)
        rigid = self.omega_0 == 0
        double = ~rigid & (np.abs(self.damping - 1) < DOUBLE_POLE)
        for which, response in ((rigid, _rigid), (double, _double_pole), (~rigid & ~double, _elastic)):
            if which.any():
                q[:, which], v[:, which] = response(s, self.omega_0[which], self.damping[which], T, hold)
        return q, v


def modal_sums(responses: Complexes, shapes: Floats) -> Complexes:
    """(F, N) complex times (N, K) real, without making the latter complex."""
    result = np.empty((len(responses), shapes.shape[1]), dtype=np.complex128)
    result.real = responses.real @ shapes
    result.imag = responses.imag @ shapes
    return result


def _rigid(s: Complexes, omega_0: Floats, damping: Floats, T: float, hold: Hold) -> tuple[Complexes, Complexes]:
    """The double integrator."""
    if hold == "continuous":
        v = np.asarray(1 / s)
        q = np.asarray(v * v)
    else:
        z = np.exp(s * T)
        less = np.expm1(s * T)  # z - 1, which cancels at low frequencies
        if hold == "linear":
            v = np.asarray(T / 2 * (z + 1) / less)
            q = np.asarray(T**2 / 6 * (z * z + 4 * z + 1) / less**2)
        else:
            v = np.asarray(T / less)
            q = np.asarray(T**2 / 2 * (z + 1) / less**2)
    shape = (len(s), len(omega_0))
    return np.broadcast_to(q[:, None], shape), np.broadcast_to(v[:, None], shape)


def _elastic(s: Complexes, omega_0: Floats, damping: Floats, T: float, hold: Hold) -> tuple[Complexes, Complexes]:
    s = s[:, None]
    if hold == "continuous":
        q = 1 / (s * s + 2 * damping * omega_0 * s + omega_0**2)
        return q, s * q
    root = np.sqrt(np.asarray(damping**2 - 1, dtype=np.complex128))
    first = np.asarray(omega_0 * (-damping + root), dtype=np.complex128)
    second = np.asarray(omega_0 * (-damping - root), dtype=np.complex128)
    z = np.exp(s * T)
    h_1, h_2 = _first_order(z, first, T, hold), _first_order(z, second, T, hold)
    apart = first - second
    return (h_1 - h_2) / apart, (first * h_1 - second * h_2) / apart


def _double_pole(s: Complexes, omega_0: Floats, damping: Floats, T: float, hold: Hold) -> tuple[Complexes, Complexes]:
    def mean(away: float) -> tuple[Complexes, Complexes]:
        above = _elastic(s, omega_0, damping + away, T, hold)
        below = _elastic(s, omega_0, damping - away, T, hold)
        return (above[0] + below[0]) / 2, (above[1] + below[1]) / 2

    near, far = mean(EPSILON), mean(2 * EPSILON)
    return (4 * near[0] - far[0]) / 3, (4 * near[1] - far[1]) / 3


def _first_order(z: Complexes, pole: Complexes, T: float, hold: Hold) -> Complexes:
    """h(p) at z (F, 1) for poles (N,): (F, N)."""
    x = pole * T
    phi_1 = np.expm1(x) / x
    if hold == "held":
        return T * phi_1 / (z - np.exp(x))
    phi_2 = _phi_2(x)
    return T * (phi_1 - phi_2 + phi_2 * z) / (z - np.exp(x))


def _phi_2(x: Complexes) -> Complexes:
    """(exp(x) - 1 - x)/x^2."""
    series = np.zeros_like(x)
    for k in range(17, 1, -1):
        series = series * x + 1 / math.factorial(k)
    small = np.abs(x) < SERIES_BELOW
    return np.asarray(np.where(small, series, (np.expm1(x) - x) / x**2))
