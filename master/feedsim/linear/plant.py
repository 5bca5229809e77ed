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

from feedsim.scenario import Cycles, Drive, Filter
from feedsim.structure import Modes

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Modes at s (F,): their responses q and q' to their own forces, (F, N) each.
Responses = Callable[[Complexes], tuple[Complexes, Complexes]]

# How an input runs between its sample instants; "continuous": it is no sampled signal, but exp(s t).
InputHold = Literal["linear", "held", "continuous"]

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

    def ports(self, s: Complexes, T: float, hold: InputHold, *, tool: bool = True) -> Complexes:
        """Port matrix at s (F,) [rad/s]: (F, 2 A + 3, A + 3), or without the tool (F, 2 A, A).

        Rows: speeds n of the axes [rad/s], positions x of the axes [m], displacements of the tool [m]. Columns: torques
        of the axes [N.m], forces on the tool [N]. All inputs run by `hold` over cycles of T [s].
        """
        axes = self.rotor.shape[1]
        columns = axes + (len(TOOL_DIRECTIONS) if tool else 0)
        speeds, places = self._products[tool]
        result = np.empty((len(s), axes + columns, columns), dtype=np.complex128)
        for start in range(0, len(s), CHUNK):
            part = slice(start, start + CHUNK)
            q, v = self.modal(s[part], T, hold)
            result[part, :axes] = modal_sums(v, speeds).reshape(-1, axes, columns)
            result[part, axes:] = modal_sums(q, places).reshape(-1, columns, columns)
        return result

    @cached_property
    def _products(self) -> dict[bool, tuple[Floats, Floats]]:
        """With the tool or without, (N, outputs * inputs) of speeds and of displacements: products of shapes, so that
        the modal sums are two matrix products."""
        products = {}
        for tool in (True, False):
            into, out = (np.hstack([own, self.tool]) if tool else own for own in (self.rotor, self.scale))
            products[tool] = (
                (self.rotor[:, :, None] * into[:, None, :]).reshape(len(into), -1),
                (out[:, :, None] * into[:, None, :]).reshape(len(into), -1),
            )
        return products

    def modal(self, s: Complexes, T: float, hold: InputHold) -> tuple[Complexes, Complexes]:
        """Responses q and q' of every mode to its own force: (F, N) each."""
        q = np.empty((len(s), len(self.omega_0)), dtype=np.complex128)
        v = np.empty_like(q)
        for which, responses in self._kinds(T, hold):
            q[:, which], v[:, which] = responses(s)
        return q, v

    def _kinds(self, T: float, hold: InputHold) -> list[tuple[slice | NDArray[np.int64], Responses]]:
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
    def _known(self) -> dict[tuple[float, InputHold], list[tuple[slice | NDArray[np.int64], Responses]]]:
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


def _rigid(omega_0: Floats, damping: Floats, T: float, hold: InputHold) -> Responses:
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


def _elastic(omega_0: Floats, damping: Floats, T: float, hold: InputHold) -> Responses:
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


def _double_pole(omega_0: Floats, damping: Floats, T: float, hold: InputHold) -> Responses:
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


def _first_order(pole: Complexes, T: float, hold: InputHold) -> Callable[[Complexes], Complexes]:
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


# --- The sampled drive of one axis, linear: every block as a function of s, z = exp(s T_c) ----------------------------
# Sampling as the drive does it (Wiesauer, Bleicher, 18th CIRP CMMO (2021), section 2.2; instants and order of
# operations in the controller unit's documentation). At the instants t_k of the control cycle T_c, with m = T_pos/T_c:
#
#     n_s  = r + n_add                          r: the position controller's setpoint, ramped or held over T_pos
#     M_s  = S n_s - C n + M_add                S = K_p + I R, C = K_p + I, I = (K_p T_c/T_n)/(1 - 1/z), R: n_ref/n_s
#     n    = n_a, or V x_m                      V = (1 - 1/z^N)/(N T_c I_P): speed from the position over N cycles
#     x_m  = x_a, or I_P J n_a                  J = T_c/2 (z + 1)/(z - 1): position from the motor encoder (indirect)
#     M_a  = E M_s - G_n n_a                    E: current setpoint filters and current loop, G_n: what the EMF leaves
#
# Limits (torque, voltage) are not reached. The motor's equations are linearised about a steady speed and torque.


# a delay this close to a whole number of samples is one: quotients of times are off by some 1e-16
WHOLE_SAMPLE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class OperatingPoint:
    """A steady motion about which the drive is linearised: speed [rad/s] and motor torque [N.m]."""

    n: float = 0.0
    M: float = 0.0


@dataclass(frozen=True, eq=False)
class LinearDrive:
    """Drive parameters with cycles and lead (I_P [m/rad]); its blocks at s (F,) [rad/s] as (F,) arrays."""

    drive: Drive
    cycles: Cycles
    I_P: float
    operating: OperatingPoint = OperatingPoint()

    @property
    def ticks(self) -> int:
        """Control cycles in a position cycle."""
        return round(self.cycles.T_pos / self.cycles.T_c)

    # --- position controller, at the instants of T_pos --------------------------------------------------------------

    @property
    def position_gain(self) -> float:
        """K_v/I_P: speed setpoint per following error [rad/(s.m)]."""
        return self.drive.K_v / self.I_P

    def setpoint_delay(self, s: Complexes) -> Complexes:
        """From x_s to the delayed setpoint that the following error sees [1]."""
        d, T = self.drive, self.cycles.T_pos
        if not d.symmetry_lag:
            return _cubic_delay(s, (d.T_dyn + d.T_sym) / T, T)
        return _cubic_delay(s, d.T_dyn / T, T) * _lag(s, d.T_sym, T)

    def feedforward(self, s: Complexes) -> Complexes:
        """From n_ffw to its part in the speed setpoint [1]."""
        T = self.cycles.T_pos
        return self.drive.k_ffw * _cubic_delay(s, self.drive.T_dyn / T, T)

    def ramp(self, s: Complexes) -> Complexes:
        """From the setpoint computed at the instants of T_pos to the component at s of what the ticks make of it [1].

        Tick j of a cycle gives n_old + (n_new - n_old)(j + 1)/m, or n_new where the setpoint is held. The other
        components lie at s + 2 pi i l/T_pos and are this function's values there.
        """
        m, T_c = self.ticks, self.cycles.T_c
        j = np.arange(m)
        share = (j + 1) / m if self.drive.ramp_speed_setpoint else np.ones(m)
        last_cycle = np.exp(-s * self.cycles.T_pos)[:, None]
        ticks = np.exp(-s[:, None] * j * T_c) * (share + (1 - share) * last_cycle)
        return np.asarray(ticks.sum(axis=1) / m)

    def measured_position(self, s: Complexes, n_a: Complexes, x_a: Complexes) -> Complexes:
        """x_m of responses of n_a and x_a, (F, ...) alike; errors of the measuring system are no part of it."""
        if not self.drive.indirect:
            return x_a
        turned = 0.5 * self.cycles.T_c * self.I_P * (np.exp(s * self.cycles.T_c) + 1) / np.expm1(s * self.cycles.T_c)
        return np.asarray(turned.reshape(-1, *[1] * (n_a.ndim - 1)) * n_a)

    # --- speed controller --------------------------------------------------------------------------------------------

    def integrator(self, s: Complexes) -> Complexes:
        """Integral part per speed error [N.m.s/rad]; takes the error of the present instant in."""
        d, T_c = self.drive, self.cycles.T_c
        if not d.speed_integrator:
            return np.zeros_like(s)
        return np.asarray(d.K_p * T_c / _require_value(d.T_n) / -np.expm1(-s * T_c))

    def reference_model(self, s: Complexes) -> Complexes:
        """n_ref/n_s [1]: PT2 by Tustin without prewarping, dead time linear between samples."""
        d, T_c = self.drive, self.cycles.T_c
        if not d.reference_model:
            return np.ones_like(s)
        omega_0, D = _require_value(d.omega_0), _require_value(d.D)
        denominator = (1.0, 2 * D * omega_0, omega_0**2)
        return _bilinear(s, (0.0, 0.0, omega_0**2), denominator, 2 / T_c, T_c) * _linear_delay(s, d.T_ref / T_c, T_c)

    def speed_of_position(self, s: Complexes) -> Complexes | None:
        """V: speed formed from the measured position [rad/(s.m)]; None where the motor speed is taken."""
        window = self.drive.speed_window * self.cycles.T_c
        return np.asarray(-np.expm1(-s * window) / (window * self.I_P)) if window else None

    def from_speed(self, s: Complexes) -> Complexes:
        """C: torque setpoint per negative speed, K_p + I [N.m.s/rad]."""
        return self.drive.K_p + self.integrator(s)

    def from_setpoint(self, s: Complexes) -> Complexes:
        """S: torque setpoint per speed setpoint, K_p + I R [N.m.s/rad]."""
        return self.drive.K_p + self.integrator(s) * self.reference_model(s)

    def filters(self, s: Complexes) -> Complexes:
        """The current setpoint filters in series [1]."""
        d = self.drive
        result = np.ones_like(s)
        for entry in (d.filter_1, d.filter_2, d.filter_3, d.filter_4):
            if entry.type != "off":
                result = result * _filter(s, entry, self.cycles.T_c)
        return result

    # --- current loop and motor --------------------------------------------------------------------------------------

    def torque(self, s: Complexes) -> tuple[Complexes, Complexes]:
        """E [1] and G_n [N.m.s/rad] with M_a = E M_s - G_n n_a.

        With the ideal current loop M_a is the torque that begins at t_k and is held.
        """
        if self.drive.ideal_current_loop:
            return self.filters(s), np.zeros_like(s)
        per_setpoint, per_speed = self._motor.loop(s)
        return self.filters(s) * per_setpoint, -per_speed

    def blocks(self, s: Complexes) -> Complexes:
        """(4, F): E, G_n, C and S."""
        return np.stack([*self.torque(s), self.from_speed(s), self.from_setpoint(s)])

    @cached_property
    def _motor(self) -> _CurrentLoop:
        return _CurrentLoop.of(self.drive, self.cycles.T_c, self.operating)


def zero_order_hold(A: Floats, T: float) -> tuple[Floats, Floats]:
    """exp(A T) and its integral from 0 to T, of a small matrix A (n, n) [1/s] over T [s].

    Taylor's series over T/2^k, whose norm is at most a half, so that 14 terms reach the last bit; then doubled k times.
    scipy.linalg.expm has the same within rounding, and takes a tenth of a short run to load.
    """
    norm = float(np.abs(A).sum(axis=1).max()) * T
    doublings = max(0, math.ceil(math.log2(2 * norm))) if norm > 0 else 0
    step = T / 2**doublings
    one = np.eye(len(A))
    series = one  # I + M/2 (I + M/3 (I + ...)), the integral over the step
    for k in range(15, 1, -1):
        series = one + A @ series * (step / k)
    Gamma = series * step
    Phi = one + A @ Gamma
    for _ in range(doublings):
        Gamma = Gamma + Phi @ Gamma
        Phi = Phi @ Phi
    return Phi, Gamma


@dataclass(frozen=True, eq=False)
class _CurrentLoop:
    """Current controller with one cycle of computing delay and motor, in deviations (i_d, i_q) from a steady motion.

    Motor over a cycle with voltage u (that of the instant before) and speed n held, exactly:
        i(t_k+1) = Phi i + Gamma (u/L + v n)
    Controller, stored for the next cycle:  u = K (i_s - i) + W i - L v n, the EMF term.
    """

    Phi: Floats  # (2, 2)
    Gamma: Floats  # (2, 2) [s]
    L: Floats  # (2,) [H]
    W: Floats  # (2, 2) decoupling [V/A]
    v: Floats  # (2,) current slope per speed [A/rad]
    per_current: Floats  # (2,) torque per current [N.m/A]
    K_t: float
    K_p: float
    K_i: float
    T_c: float

    @classmethod
    def of(cls, drive: Drive, T_c: float, at: OperatingPoint) -> _CurrentLoop:
        R, L_d, L_q, p = (_require_value(value) for value in (drive.R, drive.L_d, drive.L_q, drive.p))
        current = drive.current
        assert current is not None  # the machine file's check: needed without the ideal current loop
        psi = drive.K_t / (1.5 * p)
        omega, i_q = p * at.n, at.M / drive.K_t
        A = np.array([[-R / L_d, omega * L_q / L_d], [-omega * L_d / L_q, -R / L_q]])
        Phi, Gamma = zero_order_hold(A, T_c)
        return cls(
            Phi=Phi,
            Gamma=Gamma,
            L=np.array([L_d, L_q]),
            W=np.array([[0.0, -omega * L_q], [omega * L_d, 0.0]]),
            v=np.array([p * L_q * i_q / L_d, -p * psi / L_q]),
            per_current=1.5 * p * np.array([(L_d - L_q) * i_q, psi]),
            K_t=drive.K_t,
            K_p=current.K_p,
            K_i=current.K_p * T_c / current.T_n,
            T_c=T_c,
        )

    def loop(self, s: Complexes) -> tuple[Complexes, Complexes]:
        """M_a per torque setpoint behind the filters [1], and per speed [N.m.s/rad]."""
        z = np.exp(s * self.T_c)
        K = self.K_p + self.K_i / -np.expm1(-s * self.T_c)
        drives = self.Gamma / self.L  # current per voltage
        decoupling = drives @ self.W
        # the system's matrix and, by Cramer's rule, what its inverse makes of an input: thousands of 2 x 2 at once
        (a, b), (c, d) = (
            [z * (i == j) - self.Phi[i, j] + (drives[i, j] * K - decoupling[i, j]) / z for j in (0, 1)] for i in (0, 1)
        )
        row = (self.per_current[0] * d - self.per_current[1] * c, self.per_current[1] * a - self.per_current[0] * b)
        determinant = a * d - b * c
        per_setpoint = (row[0] * drives[0, 1] + row[1] * drives[1, 1]) * K / z / self.K_t
        emf = self.Gamma @ self.v
        per_speed = (row[0] * emf[0] + row[1] * emf[1]) * -np.expm1(-s * self.T_c)
        return per_setpoint / determinant, per_speed / determinant


def _require_value(value: float | None) -> float:
    assert value is not None  # the machine file's checks demand what is switched on
    return float(value)


def _bilinear(
    s: Complexes, numerator: tuple[float, ...], denominator: tuple[float, ...], factor: float, T: float
) -> Complexes:
    """A second-order transfer function (coefficients of s^2, s, 1) with s replaced by factor (z - 1)/(z + 1)."""
    difference, total = factor * np.expm1(s * T), np.exp(s * T) + 1
    powers = (difference**2, difference * total, total**2)
    above = sum(c * power for c, power in zip(numerator, powers, strict=True))
    below = sum(c * power for c, power in zip(denominator, powers, strict=True))
    return np.asarray(above / below)


def _filter(s: Complexes, described: Filter, T_c: float) -> Complexes:
    """A current setpoint filter that is on, Tustin prewarped at its frequency."""
    omega = 2 * math.pi * _require_value(described.f)
    denominator = (1.0, 2 * _require_value(described.D_den) * omega, omega**2)
    if described.type == "low_pass":
        numerator = (0.0, 0.0, omega**2)
    else:
        numerator = (1.0, 2 * _require_value(described.D_num) * omega, omega**2)
    return _bilinear(s, numerator, denominator, omega / math.tan(omega * T_c / 2), T_c)


def _cubic_delay(s: Complexes, samples: float, T: float) -> Complexes:
    """A delay of `samples` cycles of T: Lagrange through the ages m-1 ... m+2 about it, 0 ... 3 below one sample."""
    nearest = round(samples)
    if abs(samples - nearest) < WHOLE_SAMPLE_TOLERANCE * max(1, nearest):
        return np.exp(-s * nearest * T)
    ages = max(math.floor(samples) - 1, 0) + np.arange(4)
    # weights that are right for 1, a, a^2, a^3, ages counted from the delayed instant
    weights = np.linalg.solve(np.vander(ages - samples, 4, increasing=True).T, [1.0, 0.0, 0.0, 0.0])
    return np.asarray(np.exp(-s[:, None] * ages * T) @ weights)


def _linear_delay(s: Complexes, samples: float, T: float) -> Complexes:
    """A delay of `samples` cycles of T, linear between two samples."""
    whole = math.floor(samples + WHOLE_SAMPLE_TOLERANCE)
    rest = max(samples - whole, 0.0)
    return np.asarray(np.exp(-s * whole * T) * (1 - rest + rest * np.exp(-s * T)))


def _lag(s: Complexes, time_constant: float, T: float) -> Complexes:
    """1/(1 + s time_constant), exact for an input that is linear between samples of T."""
    if time_constant == 0:
        return np.ones_like(s)
    a = math.exp(-T / time_constant)
    slow = (1 - a) * time_constant / T
    back = np.exp(-s * T)
    return np.asarray((1 - slow + (slow - a) * back) / (1 - a * back))
