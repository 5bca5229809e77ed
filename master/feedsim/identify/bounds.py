"""Cramer-Rao bounds: how well parameters can be told at best, from records or from moves that are only planned.

Which moves tell what (the reasoning behind the recommended sets):

- sigma_0 acts right after every reversal; any move of a few micrometres shows it.
- W and gamma act while the drive train engages anew after a reversal: the travel must cover a good part of W for W,
  nearly all of it for gamma, which else looks like a smaller sigma_0.
- sigma_1 acts on the rate of deflection, sigma_1 dz/dt: it needs speed while the bristles still stick, which is a high
  frequency at a small amplitude.
- A torque channel that is late by tau shifts the torque by -tau dM/dt. In pre-sliding M = k sigma_0 z, so it looks like
  a damping of -tau k sigma_0: for small moves the delay and sigma_1 are one and the same. They part in what makes the
  torque change without deflecting bristles: the inertia of a move that slides. J dn/dt of amplitude J A omega^2 / I_P
  shows the delay as a torque of tau J A omega^3 / I_P, so the frequency counts in the third power. Two things limit it:
  noise is a share of the torque, so that a loud move in the record of the quiet ones drowns those (a record of its own
  does not); and the first mode of the structure, below whose frequency omega_1 alone the axis is an inertia. The mode
  adds a share (omega/omega_1)^2 to J and, by its damping D, a lag of about 2 D (omega/omega_1)^3 of that share, which
  passes for a delay of 2 D omega^2/omega_1^3 times the share of mass that it carries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError
from feedsim.identify.fit import correlation, inverse
from feedsim.identify.record import Record
from feedsim.identify.torque import START_PRIOR, STARTS, Law, RecordTorque

Array = NDArray[np.float64]

DIFFERENCE = 1e-4  # of the scale: the law is smooth but for kinks that move with the parameters
UNIT_SCALE = {"delay": 1e-4, "M_0": 1e-2, "asymmetry": 1e-2, "z": 1e-1, "c": 1e-1}


@dataclass(frozen=True)
class SineMove:
    """A planned sine: amplitude at the slide [m], frequency [Hz], periods in all."""

    amplitude: float
    frequency: float
    periods: float


@dataclass(frozen=True, eq=False)
class Bounds:
    """Covariance (P, P) that no unbiased estimate of `names` from the same data falls below, and their values."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def sigma(self, name: str) -> float:
        """Least standard deviation."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def relative(self, name: str) -> float:
        """Least standard deviation over the value."""
        return self.sigma(name) / abs(float(self.values[self.names.index(name)]))

    @property
    def correlation(self) -> Array:
        """(P, P)."""
        return correlation(self.covariance)


def planned(
    moves: Sequence[SineMove], I_P: float, *, interval: float = 2e-3, rest: float = 0.3, name: str = "planned"
) -> Record:
    """Record (torque 0) of an axis that follows its sines exactly, faded in and out over a period each.

    Args:
        I_P: lead [m/rad]. interval: of the log [s]. rest: between the moves [s].
    """
    if not moves:
        raise InputError(f"{name}: no moves are planned")
    pause = np.zeros(max(1, round(rest / interval)))
    speed, angle = [pause], [pause]
    for move in moves:
        count = max(2, round(move.periods / move.frequency / interval))
        time: Array = np.arange(1, count, dtype=np.float64) * interval
        phase = 2 * pi * move.frequency * time
        fade = _smooth(move.frequency * time) * _smooth(move.periods - move.frequency * time)
        path = np.concatenate([[0.0], move.amplitude / I_P * fade * np.sin(phase), [0.0]])
        angle += [path, pause]
        speed += [np.gradient(path, interval), pause]
    n = np.concatenate(speed)
    commanded = np.concatenate(angle)
    instants: Array = np.arange(len(n), dtype=np.float64) * interval
    return Record(name, instants, np.zeros_like(n), angle=commanded, speed=n, setpoint=commanded)


def _smooth(share: Array) -> Array:
    s = np.clip(share, 0, 1)
    return np.asarray(s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3), dtype=np.float64)


def sensitivities(model: RecordTorque, values: Mapping[str, float], names: Sequence[str]) -> Array:
    """(rows, P) of the torque to `names` (and to the state at the begin, `z`, `c`), by central differences."""
    columns = []
    for name in names:
        step = DIFFERENCE * (UNIT_SCALE.get(name) or abs(values[name]))
        ends = []
        for sign in (1, -1):
            moved = dict(values)
            moved[name] = values.get(name, 0.0) + sign * step
            # The recorded torque does not enter: it is the same at both ends.
            ends.append(model.residual(moved, moved.get("z", 0.0), moved.get("c", 0.0)))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.column_stack(columns)


def torque_rms(model: RecordTorque, values: Mapping[str, float]) -> Array:
    """RMS of the model torque [N.m] per stretch."""
    torque = model.residual(values, 0.0, 0.0) + model.measured
    return np.array([np.sqrt(np.mean(torque[model.stretch == k] ** 2)) for k in range(len(model.parts))])


def bounds(
    records: Sequence[Record],
    law: Law,
    values: Mapping[str, float],
    names: Sequence[str],
    *,
    share: float = 0.05,
    each: bool = False,
    known: Mapping[str, float] | None = None,
    unknown_start: bool = True,
) -> Bounds:
    """Bounds for records, measured or planned, with white noise on the torque.

    Args:
        values: of every friction parameter, J, M_0 and delay. names: what is estimated.
        share: standard deviation of the noise as a share of the torque's RMS over what moves; per record, or of each
            move for itself (`each`).
        known: name -> standard deviation [its unit] known from elsewhere.
        unknown_start: the state of the bristles at each record's begin is estimated too.
    """
    blocks = []
    for k, record in enumerate(records):
        model = RecordTorque(record, law)
        torques = torque_rms(model, values)
        if not each:
            torques = np.full_like(torques, np.sqrt(np.average(torques**2, weights=np.bincount(model.stretch))))
        weight = 1 / (share * torques[model.stretch])
        own = sensitivities(model, values, (*names, *STARTS) if unknown_start else names) * weight[:, None]
        block = np.zeros((len(own), len(names) + 2 * len(records)))
        block[:, : len(names)] = own[:, : len(names)]
        if unknown_start:
            block[:, len(names) + 2 * k : len(names) + 2 * k + 2] = own[:, len(names) :]
        blocks.append(block)
    size = len(names) + 2 * len(records)
    prior = np.zeros((size, size))
    for k, name in enumerate(names):
        if known and name in known:
            prior[k, k] = 1 / known[name]
    for k in range(len(names), size):
        prior[k, k] = 1 / START_PRIOR[STARTS[(k - len(names)) % 2]]
    rows = np.vstack([*blocks, prior])
    scale = np.array([UNIT_SCALE.get(name) or abs(values[name]) for name in names] + [1.0] * (size - len(names)))
    covariance, _ = inverse(rows * scale)
    kept = covariance * np.outer(scale, scale)
    return Bounds(
        tuple(names), np.array([values[name] for name in names]), kept[: len(names), : len(names)].astype(np.float64)
    )
