"""Margins and noise of one axis with other drives: at every pose, with elastic modes changed, on draws of the machine.

A judge closes the loops of the axis on one structure. `Candidates` keeps what drives have in common; `checked` is the
judgement that warnings of a run have, and keeps nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from feedsim.linear.candidates import Candidates
from feedsim.linear.judgement import Loop, judge
from feedsim.scenario import Drive, Machine
from feedsim.structure import Modes
from feedsim.structure.modes import with_transmissions
from feedsim.tune.drive_result import Margins
from feedsim.uncertainty import torque_scale, typed_drive, typed_on

FREQUENCY_FACTORS = (1.0, 0.9, 1.1)  # factors on the frequencies of elastic modes
Worst = tuple[tuple[float, str], tuple[float, str]]  # least gain margin [dB] and phase margin [deg], with their loops


@dataclass(frozen=True, eq=False)
class Judge:
    """Judges drives of an axis of a machine on one structure. draw: of the machine, or that machine."""

    candidates: Candidates
    draw: Machine
    machine: Machine
    axis: str

    def least(self, drive: Drive) -> tuple[Worst, float]:
        """Least margins, and torque of noise [N.m/rad] as the machine itself has it."""
        judged = self.candidates.judge(self._on_draw(drive))
        return _least_of(judged.loops), judged.noise / torque_scale(self.machine, self.draw, self.axis)

    def checked(self, machine: Machine) -> Worst:
        """Least margins of the axis of a machine with other drives."""
        changed = typed_on(self.draw, self.machine, machine)
        return _least_of([loop for loop in judge(changed, self.candidates.modes) if loop.axis == self.axis])

    def _on_draw(self, drive: Drive) -> Drive:
        return drive if self.draw is self.machine else typed_drive(self.draw, self.machine, self.axis, drive)


def judges_of(
    machine: Machine, axis: str, poses: Mapping[str, Modes], factors: Sequence[float], draw: Machine | None = None,
    name: str = "",
) -> dict[str, Judge]:  # fmt: skip
    """Name -> judge at every pose with every factor on its modes. poses: name -> modes of structures. name: of a
    draw."""
    own = machine if draw is None else draw
    judges = {}
    for pose, modes in poses.items():
        for factor in factors:
            words = ", ".join(filter(None, [name, pose, "" if factor == 1 else percent("modes", factor)]))
            candidates = Candidates(own, with_transmissions(own, scaled(modes, factor)), axis)
            judges[words] = Judge(candidates, own, machine, axis)
    return judges


def margins_of(judges: Mapping[str, Judge], drive: Drive) -> Margins:
    """Least margins and largest noise over judges."""
    result = {name: value.least(drive) for name, value in judges.items()}
    return _over({name: worst for name, (worst, _) in result.items()}, max(noise for _, noise in result.values()))


def checked(judges: Mapping[str, Judge], machine: Machine, axis: str) -> Margins:
    """Margins of a result, by a second judgement that keeps nothing and knows nothing of the search."""
    noise = margins_of(judges, machine.shipped_drive(axis, "tuning")).noise
    return _over({name: value.checked(machine) for name, value in judges.items()}, noise)


def worse_of(one: Margins, two: Margins) -> Margins:
    """The lesser margins and the larger noise of two."""
    gain, phase = min(one, two, key=lambda margins: margins.gain), min(one, two, key=lambda margins: margins.phase)
    return Margins(gain.gain, phase.phase, gain.gain_of, phase.phase_of, max(one.noise, two.noise))


def scaled(modes: Modes, factor: float) -> Modes:
    """Modes with other frequencies."""
    return modes if factor == 1 else replace(modes, frequency=modes.frequency * factor)


def percent(what: str, factor: float) -> str:
    """A factor in words."""
    return f"{what} {abs(100 * (factor - 1)):.0f} % {'higher' if factor > 1 else 'lower'}"


def _least_of(loops: Sequence[Loop]) -> Worst:
    if any(loop.growing for loop in loops):
        return (-math.inf, "unstable"), (-math.inf, "unstable")
    gain = min(loops, key=lambda loop: loop.gain_margin)
    phase = min(loops, key=lambda loop: loop.phase_margin)
    size = 20 * math.log10(gain.gain_margin) if math.isfinite(gain.gain_margin) else math.inf
    return (size, f"{gain.kind} loop {gain.state}"), (phase.phase_margin, f"{phase.kind} loop {phase.state}")


def _over(result: Mapping[str, Worst], noise: float) -> Margins:
    gain = min(result, key=lambda name: result[name][0][0])
    phase = min(result, key=lambda name: result[name][1][0])
    return Margins(
        result[gain][0][0],
        result[phase][1][0],
        f"{result[gain][0][1]}, {gain}",
        f"{result[phase][1][1]}, {phase}",
        noise,
    )
