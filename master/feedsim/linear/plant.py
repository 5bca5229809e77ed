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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from feedsim.structure import Modes

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Modes at s (F,): their responses q and q' to their own forces, (F, N) each.
Responses = Callable[[Complexes], tuple[Complexes, Complexes]]

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
        columns = axes + len(TOOL_DIRECTIONS)
        speeds, places = self._products
        result = np.empty((len(s), axes + columns, columns), dtype=np.complex128)
        for start in range(0, len(s), CHUNK):
            part = slice(start, start + CHUNK)
            q, v = self.modal(s[part], T, hold)
            result[part, :axes] = modal_sums(v, speeds).reshape(-1, axes, columns)
            result[part, axes:] = modal_sums(q, places).reshape(-1, columns, columns)
        return result

    @cached_property
    def _products(self) -> tuple[Floats, Floats]:
        """(N, outputs * inputs) of speeds and of displacements: products of shapes, so that the modal sums are two
        matrix products."""
        into = np.hstack([self.rotor, self.tool])
        speeds = (self.rotor[:, :, None] * into[:, None, :]).reshape(len(into), -1)
        places = (np.hstack([self.scale, self.tool])[:, :, None] * into[:, None, :]).reshape(len(into), -1)
        return speeds, places

    def modal(self, s: Complexes, T: float, hold: Hold) -> tuple[Complexes, Complexes]:
        """Responses q and q' of every mode to its own force: (F, N) each."""
        q = np.empty((len(s), len(self.omega_0)), dtype=np.complex128)
        v = np.empty_like(q)
        for which, responses in self._kinds(T, hold):
            q[:, which], v[:, which] = responses(s)
        return q, v

    def _kinds(self, T: float, hold: Hold) -> list[tuple[slice | NDArray[np.int64], Responses]]:
        """The modes of each kind with their responses: what does not depend on s is worked out once."""
        if (T, hold) not in self._known:
            rigid = self.omega_0 == 0
            double = ~rigid & (np.abs(self.damping - 1) < DOUBLE_POLE)
            self._known[T, hold] = [
                (_places(which), kind(self.omega_0[which], self.damping[which], T, hold))
                for which, kind in ((rigid, _rigid), (double, _double_pole), (~rigid & ~double, _elastic))
                if which.any()
            ]
        return self._known[T, hold]

    @cached_property
    def _known(self) -> dict[tuple[float, Hold], list[tuple[slice | NDArray[np.int64], Responses]]]:
        return {}


def _places(which: NDArray[np.bool_]) -> slice | NDArray[np.int64]:
    """Where a mask holds: a slice where it can be one, which numpy writes to several times as fast."""
    at = np.flatnonzero(which)
    return slice(int(at[0]), int(at[-1]) + 1) if at[-1] - at[0] == len(at) - 1 else at


def modal_sums(responses: Complexes, shapes: Floats) -> Complexes:
    """(F, N) complex times (N, K) real, without making the latter complex."""
    result = np.empty((len(responses), shapes.shape[1]), dtype=np.complex128)
    result.real = responses.real @ shapes
    result.imag = responses.imag @ shapes
    return result


def _rigid(omega_0: Floats, damping: Floats, T: float, hold: Hold) -> Responses:
    """The double integrator."""

    def responses(s: Complexes) -> tuple[Complexes, Complexes]:
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

    return responses


def _elastic(omega_0: Floats, damping: Floats, T: float, hold: Hold) -> Responses:
    def continuous(s: Complexes) -> tuple[Complexes, Complexes]:
        s = s[:, None]
        q = 1 / (s * s + 2 * damping * omega_0 * s + omega_0**2)
        return q, s * q

    if hold == "continuous":
        return continuous
    root = np.sqrt(np.asarray(damping**2 - 1, dtype=np.complex128))
    first = np.asarray(omega_0 * (-damping + root), dtype=np.complex128)
    second = np.asarray(omega_0 * (-damping - root), dtype=np.complex128)
    h_1, h_2 = _first_order(first, T, hold), _first_order(second, T, hold)
    # real or imaginary: to multiply by it is to divide by their distance
    apart = 1 / (first - second)

    def sampled(s: Complexes) -> tuple[Complexes, Complexes]:
        z = np.exp(s[:, None] * T)
        v, less = h_1(z), h_2(z)
        q = v - less
        np.multiply(first, v, out=v)
        v -= np.multiply(second, less, out=less)
        q *= apart
        v *= apart
        return q, v

    return sampled


def _double_pole(omega_0: Floats, damping: Floats, T: float, hold: Hold) -> Responses:
    near, far = (
        [_elastic(omega_0, damping + away, T, hold) for away in (distance, -distance)]
        for distance in (EPSILON, 2 * EPSILON)
    )

    def responses(s: Complexes) -> tuple[Complexes, Complexes]:
        (q_near, v_near), (q_far, v_far) = (
            [(one + other) / 2 for one, other in zip(above(s), below(s), strict=True)] for above, below in (near, far)
        )
        return (4 * q_near - q_far) / 3, (4 * v_near - v_far) / 3

    return responses


def _first_order(pole: Complexes, T: float, hold: Hold) -> Callable[[Complexes], Complexes]:
    """h(p) for poles (N,), a function of z (F, 1): (F, N)."""
    x = pole * T
    exp_x, phi_1 = np.exp(x), np.expm1(x) / x
    if hold == "held":
        return lambda z: T * phi_1 / (z - exp_x)
    phi_2 = _phi_2(x)
    rest = phi_1 - phi_2

    def h(z: Complexes) -> Complexes:
        # rounded as T (phi_1 - phi_2 + phi_2 z)/(z - exp(x)), with no array in between that is thrown away
        values = np.asarray(phi_2 * z)
        values += rest
        values *= T
        values /= z - exp_x
        return values

    return h


def _phi_2(x: Complexes) -> Complexes:
    """(exp(x) - 1 - x)/x^2."""
    series = np.zeros_like(x)
    for k in range(17, 1, -1):
        series = series * x + 1 / math.factorial(k)
    small = np.abs(x) < SERIES_BELOW
    return np.asarray(np.where(small, series, (np.expm1(x) - x) / x**2))
