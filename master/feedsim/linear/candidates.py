"""Many drives of one axis on the same structure: loops judged as in judgement.py, and the torque that noise makes.

What depends on the structure alone is worked out once per frequency and kept. So a further drive of the axis costs
small matrices only.

Noise: a motor encoder whose angle is off by white noise of standard deviation sigma [rad] at every control instant.
The speed is formed from differences over N cycles, N = 1 or the drive's speed_window. With the open-loop gain L of the
speed loop, position loops open, the motor torque answers to the angle by

    G = E C (1 - 1/z^N)/(N T_c) / (1 + L)        sigma_M^2 = sigma^2 T_c/pi Int_0^(pi/T_c) |G|^2 d omega

(Parseval's theorem for sampled signals; E, C as in drive.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from feedsim.linear.drive import LinearDrive
from feedsim.linear.judgement import Bristles, Loop, Sampled
from feedsim.linear.plant import Complexes, Floats, Hold, ModalPlant
from feedsim.linear.stability import GROWTH
from feedsim.scenario import Drive, Machine
from feedsim.structure import Modes

# resonances that show with gains so many times the present ones are looked at closely from the start
MAX_GAIN_RATIO = 4.0
MOTOR = ("current", "R", "L_d", "L_q", "p", "K_t", "ideal_current_loop")  # what the current loop consists of


class Judged(NamedTuple):
    """Speed and position loop of the axis in both states, and the motor torque [N.m] per noise of the angle [rad]."""

    loops: tuple[Loop, ...]
    noise: float

    @property
    def stable(self) -> bool:
        """Whether no solution grows."""
        return not any(loop.growing for loop in self.loops)

    @property
    def gain_margin(self) -> float:
        """Least gain margin [dB]; minus infinity where a solution grows."""
        return 20 * math.log10(min(loop.gain_margin for loop in self.loops)) if self.stable else -math.inf

    @property
    def phase_margin(self) -> float:
        """Least phase margin [deg]; minus infinity where a solution grows."""
        return min(loop.phase_margin for loop in self.loops) if self.stable else -math.inf


@dataclass(eq=False)
class Ports:
    """Speeds and positions per torque (F, A, A) at values of s (F,) whose imaginary parts ascend."""

    s: Complexes
    n: Complexes
    x: Complexes

    def at(self, s: Complexes, plant: Sampled, hold: Hold) -> tuple[Complexes, Complexes]:
        """Those at s; what is not known yet is worked out and kept."""
        at, missing = self._places(s)
        if missing.any():
            new = np.unique(s[missing])
            new = new[np.argsort(new.imag)]
            n, x = Sampled.ports(plant, new, hold)
            order = np.argsort(np.concatenate([self.s, new]).imag, kind="stable")
            self.s = np.concatenate([self.s, new])[order]
            self.n, self.x = np.concatenate([self.n, n])[order], np.concatenate([self.x, x])[order]
            at, _ = self._places(s)
        return self.n[at], self.x[at]

    def _places(
        self, s: Complexes
    ) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], np.ndarray[tuple[int], np.dtype[np.bool_]]]:
        at = np.searchsorted(self.s.imag, s.imag)
        inside = np.minimum(at, len(self.s) - 1)
        known = self.s[inside] == s if len(self.s) else np.zeros(len(s), dtype=bool)
        return inside, ~known


@dataclass(frozen=True, eq=False)
class Structure(Sampled):
    """Loops whose structure is kept: frequencies about resonances, and ports per hold."""

    near: tuple[Floats, Floats]
    kept: dict[Hold, Ports] = field(default_factory=dict)

    def free_resonances(self) -> Floats:
        return self.near[0]

    def locked_resonances(self) -> Floats:
        return self.near[1]

    def ports(self, s: Complexes, hold: Hold) -> tuple[Complexes, Complexes]:
        A = len(self.axes)
        if hold not in self.kept:
            none = np.empty((0, A, A), dtype=np.complex128)
            self.kept[hold] = Ports(np.empty(0, dtype=np.complex128), none, none)
        return self.kept[hold].at(s, self, hold)


class Candidates:
    """Judges drives of one axis of a machine, with the modes of one pose. All drives are shipped ones."""

    def __init__(self, machine: Machine, modes: Modes, axis: str) -> None:
        self.modes = modes
        axes = tuple(machine.axes)
        drives = tuple(
            LinearDrive(machine.shipped_drive(name, "tuning"), machine.cycles, axis.I_P)
            for name, axis in machine.axes.items()
        )
        frictions = machine.shipped_frictions
        bristles = tuple(Bristles.of(frictions[name]) if name in frictions else None for name in axes)
        plant = ModalPlant.of(modes, axes)
        self._index = axes.index(axis)
        own = drives[self._index].drive
        stiff = own.model_copy(update={"K_p": MAX_GAIN_RATIO * own.K_p, "K_v": MAX_GAIN_RATIO * own.K_v})
        wide = Sampled(axes, self._with(drives, stiff), bristles, plant)
        self._base = Structure(axes, drives, bristles, plant, (wide.free_resonances(), wide.locked_resonances()))

    def _with(self, drives: tuple[LinearDrive, ...], drive: Drive) -> tuple[LinearDrive, ...]:
        before = drives[self._index]
        own = replace(before, drive=drive)
        if not drive.ideal_current_loop and all(getattr(drive, n) == getattr(before.drive, n) for n in MOTOR):
            own.__dict__["_motor"] = before._motor  # the same motor: a matrix exponential less
        return (*drives[: self._index], own, *drives[self._index + 1 :])

    def judge(self, drive: Drive) -> Judged:
        """The loops of the axis with another drive. InputError: gains beyond all numbers."""
        changed = replace(self._base, drives=self._with(self._base.drives, drive))
        loops, frequency, levels = changed.judged_with_levels((self._index,))
        return Judged(loops, _noise(changed.drives[self._index], frequency, levels))


def _noise(own: LinearDrive, frequency: Floats, levels: Complexes) -> float:
    """Standard deviation of the motor torque over that of the encoder's angle [N.m/rad], of an axis that moves."""
    s = np.asarray(GROWTH + 2j * np.pi * frequency)
    window = max(1, own.drive.speed_window) * own.cycles.T_c
    torque = own.torque(s)[0] * own.from_speed(s) * -np.expm1(-s * window) / window
    answer = np.abs(torque * levels[0, 1] / levels[0, 0]) ** 2
    return math.sqrt(float(np.trapezoid(answer, frequency)) * 2 * own.cycles.T_c)
