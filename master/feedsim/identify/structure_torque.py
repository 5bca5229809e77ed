"""What a flexible structure takes from the motor beyond its inertia.

At low frequencies the rotor moves the whole axis: M_a - M_fr = J_tot dn/dt. Towards the first modes (a machine bed
rocks from 20 Hz on) the structure answers otherwise, and a sine of 10 Hz already meets 4 % more than J_tot, with a
phase. Bristle stiffness and damping, which are small beside the inertia there, would be off by as much as that. With
the machine's modes the difference is known and is a load like any other:

    M(f) = [1/P(f) - j 2 pi f J_tot] n(f),    P = sum over the modes of b^2 s/(s^2 + 2 zeta omega_0 s + omega_0^2)

with P the mobility n/M at the rotor, the other motors without torque (Wiesauer, Bleicher, 18th CIRP CMMO (2021),
section 2.1).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.identify.motion import motion
from feedsim.identify.record import Array, Record
from feedsim.structure import Modes

# [Hz] Friction's harmonics above are small, noise of the speed is not; and there the structure has modes enough for
# the difference to be anything. It fades out over the upper half.
MAX_CORRECTION_FREQUENCY = 60.0
SETTLE = 2.0  # s by which a record is continued to its beginning, as the transform takes it for periodic


def with_structure(record: Record, modes: Modes, axis: str) -> Record:
    """The record with the structure's torque beyond J_tot dn/dt added to its known load.

    The torque belongs to the same instants as the motion. Raises InputError: the modes do not know the axis.
    """
    if f"n_{axis}" not in modes.ports:
        raise InputError(f"{modes.file}: no mode shapes n_{axis} of axis {axis}")
    extra = structure_torque(motion(record).coarse(), record.interval, modes, axis)
    return replace(record, load=extra if record.load is None else record.load + extra)


def structure_torque(n: Array, interval: float, modes: Modes, axis: str) -> Array:
    """(N,) torque [N.m] of the structure beyond J_tot dn/dt, for the rotor's speed n (N,) [rad/s] every `interval` [s].

    Exact for what lies within half of MAX_CORRECTION_FREQUENCY, and below that of Nyquist's frequency.
    """
    rows = len(n)
    more = round(SETTLE / interval)
    # back to the beginning along half a cosine: a jump would ring
    back = n[-1] + (n[0] - n[-1]) * 0.5 * (1 - np.cos(np.pi * (np.arange(more) + 1) / (more + 1)))
    whole = np.concatenate([n, back])
    frequency = np.fft.rfftfreq(len(whole), interval)
    s = np.asarray(2j * np.pi * frequency[1:], dtype=np.complex128)
    beyond = np.zeros(len(frequency), dtype=np.complex128)
    beyond[1:] = 1 / mobility(s, modes, axis) - s * modes.J_tot(axis)
    highest = min(MAX_CORRECTION_FREQUENCY, 0.5 / interval)
    fading = np.clip((frequency / highest - 0.5) / 0.5, 0.0, 1.0)
    beyond *= 0.5 * (1 + np.cos(np.pi * fading))
    return np.fft.irfft(np.fft.rfft(whole) * beyond, len(whole))[:rows]


def mobility(s: NDArray[np.complex128], modes: Modes, axis: str) -> NDArray[np.complex128]:
    """n/M at the rotor of `axis` [(rad/s)/(N.m)] at s (F,) [rad/s], no other torque acting."""
    omega_0 = 2 * np.pi * modes.frequency
    total = np.zeros(len(s), dtype=np.complex128)
    for b, omega, zeta in zip(modes.ports[f"n_{axis}"], omega_0, modes.damping, strict=True):
        total += b**2 / s if omega == 0 else b**2 * s / (s * s + 2 * zeta * omega * s + omega**2)
    return total
