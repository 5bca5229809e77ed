"""A tuned drive: limits, margins, candidates, errors before and after."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from feedsim.scenario import Drive, Machine, Scenario
from feedsim.scenario.parameter_group import Parameter
from feedsim.tune.drive_program import DriveProgram, Errors
from feedsim.uncertainty import Cloud
from feedsim.variables import parameters

# --- Parameters of drives that differ between two machines of the same axes: what is to be typed ----------------------


@dataclass(frozen=True)
class Changed:
    """A parameter of an axis that has another value.

    machine: name of the machine. parameter: below the axis in a machine file, such as "drive.K_v". old, new: SI, a
    switch, or the name of a filter's type; old None: it had none. unit: SI, "1" of a plain number, "" of a switch.
    """

    machine: str
    axis: str
    parameter: str
    old: Parameter | str | None
    new: Parameter | str
    unit: str

    @property
    def key(self) -> str:
        """Of a scenario."""
        return f"machine.axes.{self.axis}.{self.parameter}"

    @property
    def text(self) -> str:
        """The new value as files have it."""
        if isinstance(self.new, bool):
            return str(self.new).lower()
        if isinstance(self.new, str):
            return self.new
        return f"{self.new!r} {self.unit}".removesuffix(" 1").strip()

    @property
    def setting(self) -> str:
        """KEY=VALUE, as behind --set."""
        return f"{self.key}={self.text}"


def changed_values(before: Machine, after: Machine) -> tuple[Changed, ...]:
    """Parameters of shipped drives whose values differ, by axis, in the order of the unit's table."""
    table = parameters("controller")
    result = []
    for axis in before.axes:
        old, new = before.axes[axis].drive, after.axes[axis].drive
        if not isinstance(old, Drive) or not isinstance(new, Drive):
            continue
        was, now = old.parameters(), new.parameters()
        for name, value in now.items():
            if was.get(name) == value or name not in table:
                continue
            row = table[name]
            if name.endswith(".type"):
                group = name.partition(".")[0]
                types = (getattr(old, group).type, getattr(new, group).type)
                result.append(Changed(before.name, axis, f"drive.{name}", *types, ""))
            else:
                result.append(Changed(before.name, axis, f"drive.{name}", was.get(name), value, row.unit))
    return tuple(result)


WORSE = 1.05  # of an error, from where on it counts as worse
ERROR_FLOOR = 0.05e-6  # [m] of an error: below it nothing counts


@dataclass(frozen=True)
class Limits:
    """What a drive has to keep to: margins [dB], [deg], standard deviation of the encoder's angle [rad]."""

    gain_margin: float
    phase_margin: float
    encoder_noise: float

    def missing(self, margins: Margins) -> float:
        """Shares of the margins asked for that are missing; 0 where both are there, infinite without stability."""
        return max(0.0, 1 - margins.gain / self.gain_margin) + max(0.0, 1 - margins.phase / self.phase_margin)


@dataclass(frozen=True, eq=False)
class Margins:
    """Of a drive, over all poses and modes: least margins [dB], [deg], the loops that have them, and torque noise
    [N.m]."""

    gain: float
    phase: float
    gain_of: str
    phase_of: str
    noise: float


@dataclass(frozen=True, eq=False)
class Point:
    """A candidate that has run: margins, mean ratio of its errors to those of the present drive, largest peak [m]."""

    margins: Margins
    ratio: float
    peak: float
    allowed: bool


@dataclass(frozen=True, eq=False)
class Case:
    """Moves and circles with errors before and after. name: under what."""

    name: str
    program: DriveProgram
    before: Errors
    after: Errors

    @property
    def rows(self) -> Iterator[tuple[str, str, float, float]]:
        """Motion, figure, before and after [m]: the largest distance behind a stop, the peak of a reversal."""
        for k, stop in enumerate(self.program.stops):
            yield stop.text, "miss", float(self.before.miss[k]), float(self.after.miss[k])
        for k, circle in enumerate(self.program.circles):
            yield circle.text, "peak", float(self.before.peak[k]), float(self.after.peak[k])

    @property
    def worse(self) -> list[tuple[str, str, float, float]]:
        """Those that got worse by more than 5 %."""
        return [row for row in self.rows if row[3] > WORSE * row[2] + ERROR_FLOOR]


@dataclass(frozen=True, eq=False)
class Drawn:
    """What the drive does on draws of the machine from the intervals of its identified values.

    margins: of every draw, over all poses and modes. cases: motions of every draw; none where the drive stays as it is.
    """

    cloud: Cloud
    margins: tuple[Margins, ...]
    cases: tuple[Case, ...]

    @property
    def count(self) -> int:
        """Draws."""
        return len(self.margins)


@dataclass(frozen=True, eq=False)
class Tuned:
    """A drive and what it does.

    machine: with it. before, after: margins. searched: what it was searched on. judged: what it was judged on, as the
    machine is first. points: of the search.
    evaluations: closed forms, runs. kept: why the drive stays as it is; "" where it changes. poses: in words.
    drawn: what it does on draws of the machine, where they were asked for.
    """

    scenario: Scenario
    axis: str
    partner: str
    limits: Limits
    machine: Machine
    before: Margins
    after: Margins
    searched: Case
    judged: tuple[Case, ...]
    points: tuple[Point, ...]
    evaluations: tuple[int, int]
    kept: str
    poses: tuple[str, ...]
    elastic: bool
    drawn: Drawn | None = None

    @property
    def changes(self) -> tuple[Changed, ...]:
        """Parameters that differ."""
        return changed_values(self.scenario.machine, self.machine)


def decibels(value: float) -> str:
    """A gain margin [dB] in words."""
    return f"{value:.3g} dB" if math.isfinite(value) else ("no limit of the gain" if value > 0 else "no stability")
