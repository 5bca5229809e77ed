"""What the drive's torque ought to be: inertia, load and the friction law on recorded motion, as the log saw it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from feedsim.identify.averages import resolution
from feedsim.identify.motion import MIN_STRETCH_ROWS, Motion, Part, motion, noise_of, parts
from feedsim.identify.record import Array, Record
from feedsim.identify.result import Plateau

if TYPE_CHECKING:
    from feedsim.cosim.friction_law import FrictionLaw


STARTS = ("z", "c")  # state at a record's begin, as shares
START_PRIOR = {"z": 3**-0.5, "c": 12**-0.5}  # standard deviation of what may lie anywhere within its range
QUANTISATION_SHARE = 0.1  # of the noise: steps of samples that are drawn as such; finer ones are white noise
# results of the law kept per record: a difference quotient of another record's start asks for the same again
MAX_CACHED_RESPONSES = 4


def deflection(values: Mapping[str, float]) -> float:
    """Largest bristle deflection at rest, F_S/sigma_0 [rad]."""
    return values["F_S"] / values["sigma_0"]


class RecordTorque:
    """Model of one record's torque, at the rows of its stretches.

    The torque recorded at t is that of t - delay. The motion is looked at earlier by the delay; the noisy torque is
    left as it is. The law runs over the whole record, as it remembers what lies between the stretches too.

    What z and c were when the record began is not known (an axis at rest keeps any of them). They are parameters of
    their own, as shares of what is possible: `z` of F_S/sigma_0, within -1 and 1, `c` of W, within -1/2 and 1/2. How
    much they matter, and for how long, the sensitivities then determine by themselves: after travelling W in one
    direction nothing is left of them.
    """

    def __init__(
        self, record: Record, law: FrictionLaw, *, coarse: bool = False, without: Sequence[Plateau] = ()
    ) -> None:
        """coarse: a step of the law per row, for a first look. without: plateaus whose rows do not count."""
        self.record, self.law = record, law
        self.motion: Motion = motion(record)
        self.count = 1 if coarse else self.motion.parts
        counted = np.ones(len(record), dtype=np.bool_) if record.clipped is None else ~record.clipped
        for plateau in without:
            if plateau.record == record.name:
                counted &= (record.time < plateau.begin) | (record.time > plateau.end)
        moving = [(part, part.first + np.flatnonzero(counted[part.rows])) for part in parts(record, self.motion)]
        moving = [(part, rows) for part, rows in moving if len(rows) >= MIN_STRETCH_ROWS]
        self.parts: tuple[Part, ...] = tuple(part for part, _ in moving)
        chosen = [rows for _, rows in moving]
        self.rows = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.intp)
        # Which stretch a row belongs to.
        self.stretch = np.repeat(np.arange(len(chosen)), [len(rows) for rows in chosen])
        self.measured = record.torque[self.rows]
        self._law: dict[tuple[float, ...], Array] = {}
        self._moved: dict[float, tuple[Array, Array, Array, Array]] = {}

    def recorded_rms(self) -> Array:
        """(stretches,) RMS of the recorded torque [N.m]; never 0, as it is divided by."""
        squares = np.bincount(self.stretch, self.measured**2) / np.bincount(self.stretch)
        return np.asarray(np.sqrt(np.maximum(squares, 1e-30)), dtype=np.float64)

    def friction(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) friction torque [N.m] without its viscous part."""
        key = (*(values[name] for name in self.law.names if name != "sigma_2"), values["delay"], z, c)
        if key not in self._law:
            fine = self.moved(values["delay"])[0]
            # Linear in sigma_2: that part is added outside and costs no run.
            law = {name: values[name] for name in self.law.names} | {"sigma_2": 0.0}
            h, start = self.record.interval / self.count, z * deflection(values)
            result = self.law(law, fine, h, z=start, c=c * values.get("W", 0.0))
            if len(self._law) >= MAX_CACHED_RESPONSES:
                del self._law[next(iter(self._law))]
            self._law[key] = np.asarray(result[:: self.count][self.rows], dtype=np.float64)
        return self._law[key]

    def moved(self, delay: float) -> tuple[Array, Array, Array, Array]:
        """Speed at the law's instants; speed, acceleration and known load at the rows; all `delay` before the log."""
        if delay not in self._moved:
            fine = self.motion.fine(delay)
            step = self.motion.parts
            speed = fine[::step]
            if self.count == 1:
                fine = speed
            load = np.zeros(len(self.rows))
            if self.record.load is not None:
                load = np.interp(self.record.time - delay, self.record.time, self.record.load)[self.rows]
            if len(self._moved) >= MAX_CACHED_RESPONSES:
                del self._moved[next(iter(self._moved))]
            self._moved[delay] = (
                np.ascontiguousarray(fine),
                speed[self.rows],
                self.motion.acceleration(delay)[self.rows],
                load,
            )
        return self._moved[delay]

    def friction_measured(self, values: Mapping[str, float]) -> Array:
        """(rows,) recorded torque less inertia, known and constant load [N.m]."""
        _, _, acceleration, load = self.moved(values["delay"])
        return np.asarray(self.measured - values["J"] * acceleration - load - values["M_0"], dtype=np.float64)

    def friction_model(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) friction torque [N.m]."""
        return self.friction(values, z, c) + values["sigma_2"] * self.moved(values["delay"])[1]

    def residual(self, values: Mapping[str, float], z: float, c: float) -> Array:
        """(rows,) model less record [N.m]."""
        return self.friction_model(values, z, c) - self.friction_measured(values)

    def disturbed(self, rng: np.random.Generator) -> RecordTorque | None:
        """The same rows, had the motion that is taken for true been recorded with the record's noise and in its steps;
        None where it has neither."""
        source = self.motion.source
        samples = getattr(self.record, source)
        noise, step = noise_of(samples), resolution(samples)
        if noise == 0:
            return None
        path = self.motion.speed if source == "speed" else self.motion.speed.antiderivative()
        true = np.asarray(path(self.motion.time), dtype=np.float64)
        # Of steps above the noise the steps are drawn: where the axis is slow, their errors hang together in time.
        seen = true + np.sqrt(max(noise**2 - step**2 / 12, 0.0)) * rng.standard_normal(len(true))
        if step > QUANTISATION_SHARE * noise:
            first = rng.uniform(0, step)
            seen = np.round((seen + first) / step) * step - first
        return self._by(motion(replace(self.record, **{source: seen}), source))

    def smoother(self, factor: float) -> RecordTorque:
        """The same rows with the motion smoothed by a low-pass whose cut-off is lower by the factor."""
        return self._by(motion(self.record, self.motion.source, smoother=factor))

    def _by(self, other: Motion) -> RecordTorque:
        moved = copy(self)
        moved.motion = other
        moved._law, moved._moved = {}, {}
        return moved


def models(
    records: Sequence[Record], law: FrictionLaw, *, coarse: bool = False, without: Sequence[Plateau] = ()
) -> tuple[RecordTorque, ...]:
    """Of the records that move at all."""
    made = (RecordTorque(record, law, coarse=coarse, without=without) for record in records)
    return tuple(model for model in made if len(model.rows))
