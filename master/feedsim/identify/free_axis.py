"""A rigid axis with friction that moves under a recorded torque, and what the record lacks of that motion.

The recorded motion gives its first angle and speed only. Start reading at reached().
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, sqrt
from typing import TYPE_CHECKING

import numpy as np

from feedsim.errors import InputError
from feedsim.identify.parameters import level
from feedsim.identify.record import Array, Record
from feedsim.identify.result import Drift
from feedsim.identify.torque import RecordTorque, deflection

if TYPE_CHECKING:
    from feedsim.cosim.friction_law import FrictionLaw

# of the quickest time of bristles and inertia: the longest step of the free axis, which goes explicitly
EXPLICIT_STEP_SHARE = 0.25
MOST_STEPS = 32  # per interval: beyond that the bristles are too stiff for this record
START_FIT = 0.01, 9  # [s], rows, whichever is more: what the cubic for the first speed goes through
OUTLIER = 5.0  # standard deviations from that cubic that no sample of it may lie off
BLOCKS = 10  # stretches of a record whose torque residual may be turned


def reached(record: Record, law: FrictionLaw, values: Mapping[str, float]) -> Array:
    """(N,) angle [rad] that a rigid axis reaches under the record's torque, from the recorded angle and speed on.

    J dn/dt = M_a(t + delay) - M_0 - M_fr - load; the axis goes on by itself, whatever was recorded.

    Args:
        values: every friction parameter, J, M_0, and the delay of the torque [s].

    Raises:
        InputError: a record without a position, parameters that the law refuses, friction that is too stiff for it.
        SimulationError: the motion would be no finite number.
    """
    if record.angle is None:
        raise InputError(f"{record.name}: no position; in open loop it is what is compared")
    steps = substeps(values, record.interval)
    if steps > MOST_STEPS:
        raise InputError(
            f"{record.name}: {steps} steps between rows are needed for this friction in open loop; allowed: up to "
            f"{MOST_STEPS}. sigma_0 or sigma_1 is too large for rows {1e3 * record.interval:.3g} ms apart"
        )
    first, n = first_speed(record.angle, record.interval)
    torque = middle_torque(record, values["delay"])
    z = first_deflection(values, n, float(torque[0]) - values["M_0"])
    parameters = {name: values[name] for name in law.names}
    angle, _ = law.free_axis(parameters, values["J"], values["M_0"], torque, record.interval, n=n, z=z, substeps=steps)
    return np.asarray(first + angle, dtype=np.float64)


def middle_torque(record: Record, delay: float) -> Array:
    """(N - 1,) motor torque less known load [N.m] in the middle of every interval."""
    middle = record.time[:-1] + record.interval / 2
    torque = np.interp(middle + delay, record.time, record.torque)
    if record.load is not None:
        torque = torque - np.interp(middle, record.time, record.load)
    return np.asarray(torque, dtype=np.float64)


class OpenLoop:
    """One record: where the model goes under its torque."""

    def __init__(self, record: Record, model: RecordTorque, change: str) -> None:
        """change: name of the load's change over this record among the values [N.m]."""
        assert record.angle is not None
        self.record, self.model, self.change = record, model, change
        self.duration = record.interval * (len(record) - 1)
        self.angle = record.angle
        first, self.n = first_speed(self.angle, record.interval)
        self.origin = float(first)
        self._torque: tuple[float, Array] | None = None

    def residual(self, values: Mapping[str, float], push: Array | float = 0.0) -> Array:
        """(N,) recorded less reached angle [rad]. push: (N - 1,) added to the torque [N.m]."""
        h = self.record.interval
        drifts = values[self.change] * self._elapsed(self.record.time[:-1] + h / 2)
        torque = self.torque(values["delay"]) - drifts + push
        parameters = {name: values[name] for name in self.model.law.names}
        z = first_deflection(values, self.n, float(torque[0]) - values["M_0"])
        steps = substeps(values, h)
        free_axis = self.model.law.free_axis
        angle, _ = free_axis(parameters, values["J"], values["M_0"], torque, h, n=self.n, z=z, substeps=steps)
        return np.asarray(self.angle - self.origin - angle, dtype=np.float64)

    def torque_residual(self, values: Mapping[str, float]) -> Array:
        """(rows,) model less record at the rows of stage 2 [N.m]."""
        # The state at the begin as shares of what is possible, in the words of the model.
        load = values["M_0"] - values[self.change] / 2
        z = first_deflection(values, self.n, float(self.torque(values["delay"])[0]) - load)
        share = min(max(z / deflection(values), -1.0), 1.0)
        return self.model.residual(values, share, 0.0) + values[self.change] * self._elapsed(
            self.record.time[self.model.rows]
        )

    def _elapsed(self, time: Array) -> Array:
        """Time since the middle of the record, as a share of its duration."""
        return np.asarray((time - self.record.time[0]) / self.duration - 0.5, dtype=np.float64)

    def slope(self, values: Mapping[str, float]) -> float:
        """Change of the load over the record by a regression of the torque residual [N.m]."""
        known = {**values, self.change: 0.0}
        elapsed, speed = self._elapsed(self.record.time[self.model.rows]), self.model.moved(values["delay"])[1]
        columns = np.column_stack([elapsed, np.ones_like(elapsed), np.sign(speed), speed])
        return -float(np.linalg.lstsq(columns, self.torque_residual(known), rcond=None)[0][0])

    def disturbed(self, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """(N,) residual of the position [rad] had the torque been off in another way: by the torque residual that it
        has, with the sign of each of BLOCKS stretches drawn anew."""
        off = np.zeros(len(self.record))
        off[self.model.rows] = self.torque_residual(values)
        turned = np.repeat(rng.choice([-1.0, 1.0], BLOCKS), ceil(len(off) / BLOCKS))[: len(off)]
        return self.residual(values, (turned * off)[:-1])

    def drift(self, before: Array, after: Array) -> Drift:
        return Drift(self.record.name, self.record.time, self.angle - self.origin, before, after)

    def torque(self, delay: float) -> Array:
        """(N - 1,) motor torque less known load [N.m] in the middle of every interval."""
        if self._torque is None or self._torque[0] != delay:
            self._torque = delay, middle_torque(self.record, delay)
        return self._torque[1]


def first_speed(angle: Array, h: float) -> tuple[float, float]:
    """Angle and speed at the first of the instants h apart, by a cubic through the first ones; samples far off it are
    left out."""
    count = min(max(ceil(START_FIT[0] / h), START_FIT[1]), len(angle))
    t = np.arange(count) / max(count - 1, 1)
    columns, first = np.vander(t, 4, increasing=True), angle[:count]

    def through(weights: Array) -> tuple[Array, Array]:
        root = np.sqrt(weights)
        shape = np.linalg.lstsq(columns * root[:, None], first * root, rcond=None)[0]
        return np.asarray(shape, dtype=np.float64), np.asarray(np.abs(first - columns @ shape), dtype=np.float64)

    # Smallest sum of distances, by least squares over and over, so that a sample far off does not bend the cubic.
    weights = np.ones(count)
    least = 1e-9 * max(float(np.ptp(first)), 1e-30)
    for _ in range(30):
        _, off = through(weights)
        weights = least / np.maximum(off, least)
    scatter = float(np.median(off)) / 0.6745
    kept = off <= max(OUTLIER * scatter, 10 * least)
    shape, _ = through(kept.astype(np.float64) if np.count_nonzero(kept) >= 6 else np.ones(count))
    return float(shape[0]), float(shape[1]) / (h * max(count - 1, 1))


def first_deflection(values: Mapping[str, float], n: float, torque: float) -> float:
    """z [rad] at the start. Where the axis moves that far within `START_FIT`, it is that of sliding; else what
    holds the torque [N.m] on it, the transmission half engaged (c = 0), as far as bristles can."""

    def most(side: float) -> float:
        return (1 + values["asymmetry"] * side) * float(level(values, np.array([n]))[0]) / values["sigma_0"]

    if abs(n) * START_FIT[0] > most(float(np.sign(n))):
        return float(np.sign(n)) * most(float(np.sign(n)))
    share = 1.0 if values.get("W", 0.0) == 0 else values["gamma"] + (1 - values["gamma"]) / 2
    return float(np.clip(torque / (share * values["sigma_0"]), -most(-1.0), most(1.0)))


def substeps(values: Mapping[str, float], h: float) -> int:
    """Steps of the free axis per interval: what friction and inertia exchange has to be slow against them."""
    damping = (values["sigma_1"] + values["sigma_2"]) / values["J"]
    stiffness = sqrt(values["sigma_0"] / values["J"])
    return max(1, ceil(h * max(damping, stiffness) / EXPLICIT_STEP_SHARE))
