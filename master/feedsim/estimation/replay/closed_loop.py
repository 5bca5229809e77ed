"""A record's setpoints through the simulated axes: the same motion asked for, by the units in closed loop.

The run begins ahead of the record. An axis stands where the record begins, until friction has taken up the constant
load and the speed controller carries the rest, or until it rests with the torque of the record (preload.py). Where the
record begins in motion, a run-in from rest leads to its speed. What is compared lies within a window of the record; the
run covers the record from BEFORE ahead of it, so that the state of drive and friction there is what the motion before
has made it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import inf, isinf, pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from feedsim.estimation.identify import Record, RecordedAxis
from feedsim.estimation.identify.clipping import without_clipped
from feedsim.estimation.identify.inertia import Inertia, inertia
from feedsim.estimation.identify.parameters import EXCESS
from feedsim.estimation.identify.read import read_records
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files.columns import Columns
from feedsim.files.trace import Mark, Recording, read_recording
from feedsim.files.trace.trace import Array
from feedsim.foundation import units
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import BlockResource
from feedsim.motions.profile import speed_change
from feedsim.scenario import Coupling, Friction, Machine
from feedsim.scenario.loads import MotorLoad, SlideLoad
from feedsim.simulation.cosim import Follower
from feedsim.simulation.cosim.loads import ActingLoad
from feedsim.simulation.nc import Program

# --- The torque at rest ahead of a record's first motion: what friction holds of it, and a way there ------------------
# What an axis did before a record is not in it, but for the torque that it rests with: M = M_0 + friction, which is
# anything up to the static friction. A run-in leaves the bristles with that torque. The axis slides one way, so that
# they
# are bent all through, and turns back by an angle d. With g = F_S/sigma_0 the LuGre law says at slow motion
#     z = g (2 exp(-d/g) - 1)          M_fr = k sigma_0 z,    k by the engaging zone (src/friction_fmu/tem.h)


MAX_SHARE = 0.98  # of the static friction
SLIDES = 6.0  # in g, beyond the engaging zone: bristles are bent all through then
TURN_BACK_ANGLES = 400  # at which the law is evaluated
# Of the time at rest ahead of a record: when the axis slides away, comes back beyond the begin, and turns back to it.
INSTANTS = (0.15, 0.35, 0.6, 0.75)


def run_in(friction: Friction, torque_held: float, time: Array) -> Array:
    """(N,) motor angle [rad] off where the record begins, over `time` (N,), from 0 at its begin to 1 at the first row.

    torque_held: torque [N.m] that friction is to hold in the end.
    """
    g = float(friction.F_S) / float(friction.sigma_0)
    back, slid = _turned_back(friction, g, torque_held), SLIDES * g + float(friction.W)
    angles = 0.0, back - slid, back, 0.0
    s = [np.clip((time - a) / (b - a), 0.0, 1.0) for a, b in pairwise(INSTANTS)]
    steps = (step**3 * (10 - 15 * step + 6 * step**2) for step in s)
    return np.asarray(sum(jump * step for jump, step in zip(np.diff(angles), steps, strict=True)))


def _turned_back(friction: Friction, g: float, torque_held: float) -> float:
    """Angle [rad] by which an axis that has slid forwards turns back, for friction to hold that torque."""
    static, W, gamma = float(friction.F_S), float(friction.W), float(friction.gamma)
    d = np.unique(np.concatenate([np.linspace(0.0, end, TURN_BACK_ANGLES) for end in (SLIDES * g, SLIDES * g + W)]))
    z, c = g * (2 * np.exp(-d / g) - 1), np.maximum(W / 2 - d, -W / 2)
    engaged = (W / 2 + np.where(z >= 0, c, -c)) / W if W > 0 else np.ones_like(d)
    torque = (gamma + engaged * (1 - gamma)) * z * static / g
    share = np.clip(torque_held, -MAX_SHARE * static, MAX_SHARE * static)
    return float(np.interp(-share, -torque, d))


Mask = NDArray[np.bool_]
Rows = NDArray[np.int64]

SETTLING_TIME = 0.6  # [s] at rest ahead of the record
LEAD_IN_TIME = 2.0  # [s] of the record ahead of a window that are run, too
# The state of drive and friction is not known where a record begins in motion; it has died away after that.
START_TRANSIENT = 0.1  # [s]
MAX_REPLAY_ROWS = 2_000_000  # of a record that are run
CYCLES_BEHIND = 4  # position cycles that the program goes on behind the last row
# [s] of rest that are run ahead of the first motion and behind the last one, where only motion is asked for. Behind it
# that is more than a torque may be late.
REST_AHEAD, REST_BEHIND = 0.1, 0.01
# The setpoint moves where its speed is more than a share of the top speed; the axis follows for a while behind.
MOVES, FOLLOWS = 1e-4, 0.02  # share, [s]
CLEARLY_NEARER = 0.5  # of the sum of squares that is off
REST_TIME, MIN_REST_ROWS = 0.1, 3  # [s] of the torque ahead of the first motion, whose mean counts; rows of it


@dataclass(frozen=True, eq=False)
class AxisRecord:
    """A stretch of one axis without gaps, at the slide.

    Attributes:
        axis: name in the machine. record: motor side. I_P: lead [m/rad].
        rows: (N,) which rows count: within the window.
    """

    axis: str
    record: Record
    I_P: float
    rows: Mask

    @property
    def setpoint(self) -> Array:
        """(N,) [m]."""
        assert self.record.setpoint is not None
        return self.I_P * self.record.setpoint

    @property
    def position(self) -> Array:
        """(N,) measured [m]."""
        assert self.record.angle is not None
        return self.I_P * self.record.angle

    @property
    def speed(self) -> Array:
        """(N,) measured, by central differences [m/s]."""
        return np.asarray(np.gradient(self.position, self.record.interval), dtype=np.float64)

    @property
    def counted(self) -> Mask:
        """(N,) bool: rows whose torque counts, as it is not cut off."""
        clipped = self.record.clipped
        return np.ones(len(self.record), dtype=bool) if clipped is None else ~clipped

    @property
    def first_moving(self) -> int:
        """Row at which the setpoint moves first; their number where it never does."""
        speed = np.abs(np.gradient(self.setpoint, self.record.interval))
        return int(np.argmax(np.append(speed > MOVES * np.max(speed), True)))

    @property
    def at_rest(self) -> Rows:
        """Rows ahead of the first motion whose torque counts; few or none where the record begins in motion."""
        rows = np.arange(min(self.first_moving, max(round(REST_TIME / self.record.interval), MIN_REST_ROWS)))
        return np.asarray(rows[self.counted[rows]] if self.record.driven else rows[:0])

    @property
    def moving(self) -> Mask:
        """(N,) bool: rows within the window in which the axis moves."""
        speed = np.abs(np.gradient(self.setpoint, self.record.interval))
        asked = speed > MOVES * float(np.max(speed, initial=0.0))
        behind = np.ones(round(FOLLOWS / self.record.interval) + 1)
        return np.asarray(self.rows & (np.convolve(asked, behind)[: len(asked)] > 0.5))


def read_axes(
    file: Path | Recording, axes: Sequence[str], machine: Machine | None = None, mapping: Columns | None = None
) -> dict[str, RecordedAxis]:
    """The record of each axis. InputError: as read_records; no position setpoint, or no position."""
    recording = file if isinstance(file, Recording) else read_recording(file)
    result: dict[str, RecordedAxis] = {}
    for axis in axes:
        read = read_records(recording, mapping, axis, machine, driven=False)
        missing = [
            name
            for name, role in (("position setpoint", "setpoint"), ("position", "angle"))
            if any(getattr(record, role) is None for record in read.records)
        ]
        if missing:
            columns = ", ".join(f"{role} {name!r}" for role, name in read.provenance.columns.items())
            raise InputError(
                f"{recording.path}, axis {axis}: no {' and no '.join(missing)} is read ({columns}); a replay needs "
                "both; name them in a mapping file: setpoint: {column: ..., unit: mm}"
            )
        result[axis] = read
    return result


def cut_window(axis: str, read: RecordedAxis, window: tuple[float, float] | None) -> AxisRecord:
    """The stretch of an axis that holds the window, from BEFORE ahead of it on; without one the longest stretch.

    window: begin and end [s]; an end of inf is that of the stretch.

    Of a stretch that begins in motion the first START_TRANSIENT do not count.

    Raises InputError: no stretch without a gap holds the window, or less than ten rows of it, or too many.
    """
    pitch = read.provenance.pitch
    if pitch is None:
        raise InputError(f"{read.provenance.file}, axis {axis}: its pitch is needed: pitch: 10 mm in a mapping file")
    if window is None:
        record = max(read.records, key=len)
        begin, end = float(record.time[0]), float(record.time[-1])
    else:
        begin, end = window
        slack = 0.5 * read.records[0].interval
        holding = [
            record
            for record in read.records
            if record.time[0] <= begin + slack and record.time[-1] >= (begin if isinf(end) else end) - slack
        ]
        if not holding:
            stretches = ", ".join(f"{record.time[0]:.6g} to {record.time[-1]:.6g} s" for record in read.records)
            raise InputError(
                f"{read.provenance.file}: no stretch without a gap holds the window {begin:.6g} to {end:.6g} s; there "
                f"is {stretches}"
            )
        record = holding[0]
        end = min(end, float(record.time[-1]))
    first = int(np.searchsorted(record.time, begin - LEAD_IN_TIME))
    last = int(np.searchsorted(record.time, end + 0.5 * record.interval))
    record = record.between(first, last)
    slack = 0.5 * record.interval
    rows = np.asarray((record.time >= begin - slack) & (record.time <= end + slack))
    if _begins_in_motion(record):
        rows &= np.asarray(record.time >= record.time[0] + START_TRANSIENT)
    if np.count_nonzero(rows) < 10:
        raise InputError(f"{read.provenance.file}: {np.count_nonzero(rows)} rows in the window; at least 10 are needed")
    if len(record) > MAX_REPLAY_ROWS:
        raise InputError(
            f"{read.provenance.file}: {len(record):,} rows, {len(record) * record.interval / 60:.4g} min; allowed: up "
            f"to {MAX_REPLAY_ROWS:,}. Give a part of it ({spell_argument('window')})"
        )
    return AxisRecord(axis, record, pitch / (2 * np.pi), rows)


def mark_clipped_rows(
    each: AxisRecord, left_out: str, J: float | None = None, simulated: Array | None = None
) -> tuple[AxisRecord, tuple[Finding, ...]]:
    """The record with the rows marked at which its torque is cut off, and findings on them.

    left_out: what becomes of these rows. J: inertia [kg.m2], where it is known. simulated: (N,) torque [N.m] of the
    machine on this motion, where there is one.
    """
    if not each.record.driven:
        return each, ()
    (record,), said = without_clipped([each.record], J, left_out, None if simulated is None else [simulated])
    return replace(each, record=record), tuple(
        replace(finding, text=f"axis {each.axis}: {finding}", place=each.axis) for finding in said
    )


def _begins_in_motion(record: Record) -> bool:
    """Whether the setpoint moves at the first row."""
    assert record.setpoint is not None
    speed = np.abs(np.gradient(record.setpoint, record.interval))
    return bool(speed[0] > MOVES * np.max(speed))


def same_time(records: Mapping[str, AxisRecord]) -> bool:
    """Whether records of several axes have rows at the same instants."""
    first, *others = (axis_record.record.time for axis_record in records.values())
    return all(np.array_equal(first, time) for time in others)


class Replay(BlockResource):
    """Records of some axes of a machine, and what its units make of them; the other axes are held where they are.

    Units stay open from one machine to the next, until it is closed.

    Attributes:
        records: axis -> its record; all over the same time.
        lead: time that the run begins ahead of its first row [s].
        run: rows that are run, the first and the last one.
        preloaded: whether axes rest with the torque of their records ahead of the first motion; else friction takes up
            what the constant load leaves it.

    Raises InputError: rows that no control cycle meets; records over unlike times.
    """

    def __init__(
        self,
        machine: Machine,
        records: Mapping[str, AxisRecord],
        *,
        coupling: Coupling | None = None,
        fmus: Path | None = None,
        only_motion: bool = False,
    ) -> None:
        """only_motion: rests ahead of the first motion and behind the last one are not run; the axes have in these rows
        what they have where the run begins and ends."""
        self.records = dict(records)
        self._open = partial(Follower, coupling=coupling, fmus=fmus)
        self._idle: list[Follower] = []  # as many as have been at work at once
        one = next(iter(records.values())).record
        self.time, self.interval = one.time, one.interval
        if not same_time(records):
            stretches = ", ".join(
                f"{axis} {axis_record.record.time[0]:.6g} to {axis_record.record.time[-1]:.6g} s"
                for axis, axis_record in records.items()
            )
            raise InputError(
                f"{one.name}: the stretches without a gap differ from axis to axis: {stretches}; give a window that is "
                "without one in all of them, or one axis at a time"
            )
        T_c = machine.cycles.T_c
        if abs(self.interval / T_c - round(self.interval / T_c)) > 1e-6 * self.interval / T_c:
            raise InputError(
                f"{one.name}: {1e3 * self.interval:.6g} ms between rows are no whole multiple of the control cycle of "
                f"{machine.name}, {1e6 * T_c:.6g} us; set machine.cycles.control"
            )
        self.run = self._rows_in_motion(machine) if only_motion else (0, len(self.time) - 1)
        self.pose = dict(machine.pose)
        self._into = {}
        for axis, value in records.items():
            speed = float(self._spline(value)(0.0, 1)) if _begins_in_motion(value.record) else 0.0
            limits = machine.axes[axis].max_acceleration, machine.path.jerk
            self._into[axis] = speed_change(speed, *limits)
            self.pose[axis] = float(value.setpoint[self.run[0]]) - self._into[axis].distance
        run_in = max(change.duration for change in self._into.values())
        self.lead = self.interval * np.ceil((SETTLING_TIME + run_in) / self.interval)
        self.preloaded = False
        self._torques = {
            axis: float(np.mean(value.record.torque[rows]))
            for axis, value in records.items()
            if len(rows := value.at_rest) >= MIN_REST_ROWS and isinstance(machine.axes[axis].friction, Friction)
        }
        self._programs: dict[float, Program] = {}
        self._loads = [
            self._load(axis_record) for axis_record in records.values() if axis_record.record.load is not None
        ]

    def _rows_in_motion(self, machine: Machine) -> tuple[int, int]:
        """The first and the last row of a run of what moves, and of some rest; the first at the begin of a cycle."""
        first = min(record.first_moving for record in self.records.values()) - round(REST_AHEAD / self.interval)
        last = max(int(np.max(np.flatnonzero(record.moving), initial=0)) for record in self.records.values())
        per_cycle = max(round(machine.cycles.T_pos / self.interval), 1)
        last = min(last + math.ceil(REST_BEHIND / self.interval), len(self.time) - 1)
        first = max(first, 0) // per_cycle * per_cycle
        return (first, last) if first < last else (0, len(self.time) - 1)

    @staticmethod
    def _spline(axis_record: AxisRecord) -> CubicSpline:
        return CubicSpline(axis_record.record.time - axis_record.record.time[0], axis_record.setpoint)

    def _load(self, axis_record: AxisRecord) -> ActingLoad:
        """The known load of a record over the time of the run; ahead of the record it is that of the first row."""
        record = axis_record.record
        assert record.load is not None
        first = self.run[0]
        time = np.concatenate([[0.0], self.time[first:] - self.time[first] + self.lead])
        torque = np.concatenate([record.load[first : first + 1], record.load[first:]])
        place = f"load of {record.name}"
        if record.load_on_slide:  # a force counts in the direction of the axis there
            return ActingLoad(place, SlideLoad.model_construct(axis=axis_record.axis), time, -torque / axis_record.I_P)
        return ActingLoad(place, MotorLoad.model_construct(axis=axis_record.axis), time, torque)

    def preload(self, machine: Machine, scale: float = 1.0) -> bool:
        """Decide on `preloaded`: whether the torques at rest are clearly nearer to those of the records so."""
        if not self._torques:
            return False
        self.preloaded = False
        by_itself = self._off_at_rest(machine, scale)
        self.preloaded = True
        self.preloaded = self._off_at_rest(machine, scale) < CLEARLY_NEARER * by_itself
        return self.preloaded

    def _off_at_rest(self, machine: Machine, scale: float) -> float:
        """Sum of squares [(N.m)2] of what the torques ahead of the first motion are off."""
        simulated = self.follow(machine, ("M_a",), scale=scale)
        return sum(
            float(np.sum((scale * simulated[axis]["M_a"] - value.record.torque)[value.at_rest] ** 2))
            for axis, value in self.records.items()
        )

    def program(self, machine: Machine, scale: float = 1.0) -> Program:
        """The setpoints at the position cycle of a machine. scale: as of :meth:`follow`."""
        T_pos = machine.cycles.T_pos
        if T_pos not in self._programs:
            self._programs[T_pos] = self._planned(machine, T_pos)
        program = self._programs[T_pos]
        if not self.preloaded:
            return program
        x_s, n_ffw = dict(program.x_s), dict(program.n_ffw)
        for axis, torque in self._torques.items():
            own, friction = machine.axes[axis], machine.shipped_friction(axis, "a replay from a torque at rest")
            # Behind the lead the angle stays: a point there, and one for the difference over it.
            begin = int(np.searchsorted(program.time, self.lead)) + 2
            angle = run_in(friction, torque / scale - own.M_0, program.time[:begin] / self.lead)
            x_s[axis], n_ffw[axis] = x_s[axis] + own.I_P * angle[-1], n_ffw[axis] + 0.0
            x_s[axis][:begin] = program.x_s[axis][:begin] + own.I_P * angle
            n_ffw[axis][:begin] += np.gradient(angle, T_pos)
        return Program(program.time, x_s, n_ffw)

    def _planned(self, machine: Machine, T_pos: float) -> Program:
        begin, end = (float(self.time[row] - self.time[0]) for row in self.run)
        count = int(np.ceil((self.lead + (end - begin)) / T_pos)) + CYCLES_BEHIND
        time = T_pos * np.arange(count + 1, dtype=np.float64)
        x_s = {axis: np.full(len(time), position) for axis, position in machine.pose.items()}
        n_ffw = {axis: np.zeros(len(time)) for axis in machine.axes}
        for axis, axis_record in self.records.items():
            spline, into = self._spline(axis_record), self._into[axis]
            own = time - self.lead
            within = np.clip(own + begin, begin, end)
            x, v = spline(within), spline(within, 1)
            ahead, behind = own < 0, own > end - begin
            covered, v[ahead] = into.at(own[ahead] + into.duration)
            x[ahead] = covered - into.distance + float(axis_record.setpoint[self.run[0]])
            # Nothing is compared behind the last row: the axis goes on as it was.
            x[behind] += v[behind] * (own[behind] - (end - begin))
            x_s[axis], n_ffw[axis] = x, v / machine.axes[axis].I_P
        return Program(time, x_s, n_ffw)

    def follow(
        self, machine: Machine, signals: Sequence[str], per_row: int = 1, scale: float = 1.0
    ) -> dict[str, dict[str, Array]]:
        """Axis -> signal -> (N,) at the rows of the record, of the units with the parameters of `machine`.

        per_row: samples from one row to the next; ((N - 1) per_row + 1,) then. scale: by which the torques of `machine`
        are less than they are meant; so are the loads.

        Several threads may call it at once, each with units of its own.

        Raises SimulationError: a unit failed, as with a drive that is unstable.
        """
        machine = machine.model_copy(update={"pose": machine.pose | self.pose})
        columns = [f"{axis}.{signal}" for axis in self.records for signal in signals]
        loads = [replace(load, values=load.values / scale) for load in self._loads]
        program = self.program(machine, scale)
        try:
            follower = self._idle.pop()
        except IndexError:
            follower = self._open()
        try:
            trace = follower.follow(machine, program, columns, self.interval / per_row, loads=loads)
        finally:
            self._idle.append(follower)
        begin, end = self.run
        first = round(self.lead / self.interval) * per_row
        rows = slice(first, first + (end - begin) * per_row + 1)
        beside = begin * per_row, (len(self.time) - 1 - end) * per_row
        return {
            axis: {signal: np.pad(trace[f"{axis}.{signal}"][rows], beside, "edge") for signal in signals}
            for axis in self.records
        }

    def close(self) -> None:
        while self._idle:
            self._idle.pop().close()


def per_row_of(interval: float, machine: Machine) -> int:
    """Samples of a simulation per row of a record that a delay between the rows can be separated from: up to four."""
    cycles = round(interval / machine.cycles.T_c)
    return max(entry for entry in (1, 2, 4) if cycles % entry == 0)


# --- The part of a record that counts: from one instant or block of its program to another ----------------------------


_TIME = re.compile(r"[-+.\d]")  # what a time begins with; a block of a program does not
_COUNTED_NAME = re.compile(r"(.*?)\s*#(\d+)")
MAX_MARKS_NAMED = 12


def window(text: str, marks: Sequence[Mark]) -> tuple[float, float]:
    """Begin and end [s] of "BEGIN..END", each a time or a block of the program; of "BLOCK" alone that block.

    A block is named by what its line begins with, "N130" or "G0 AX", and where several begin so by its number among
    them, "N130 #2". It lasts until the next one; the last one has no end: inf.

    Raises InputError: not of this form; a time that is none; a block that is not there, or there several times.
    """
    begin, dots, end = (part.strip() for part in text.partition(".."))
    if not begin or (dots and not end) or (not dots and _TIME.match(begin)):
        raise InputError("BEGIN..END is needed, such as '0.5 s..2 s', or the name of a block of the record")
    first, last = _span(begin, marks)[0], _span(end or begin, marks)[1]
    if not first < last:
        raise InputError("the begin is not ahead of the end")
    return first, last


def _span(part: str, marks: Sequence[Mark]) -> tuple[float, float]:
    """Begin and end [s] of a part of what was typed."""
    if _TIME.match(part):
        at = units.parse(part, "s", "0.5 s")
        return at, at
    counted = _COUNTED_NAME.fullmatch(part)
    name, number = (counted[1], int(counted[2])) if counted else (part, None)
    indexes = [i for i, mark in enumerate(marks) if _begins_with(mark.text, name)]
    if not indexes or (number is not None and not 1 <= number <= len(indexes)):
        there = (
            "; ".join(dict.fromkeys(_shorten_text(mark.text) for mark in marks))
            if len(marks) <= MAX_MARKS_NAMED
            else ""
        )
        known = f"there is {there}" if there else _list_marks(marks)
        how_often = f"{name!r} begins {len(indexes)} of them" if indexes else f"none begins with {name!r}"
        raise InputError(f"of the {len(marks)} blocks of the record {how_often}; {known}")
    if number is None and len(indexes) > 1:
        times = ", ".join(f"{marks[i].time:.6g} s" for i in indexes[:MAX_MARKS_NAMED])
        raise InputError(
            f"{len(indexes)} blocks of the record begin with {name!r}, at {times}; say which, for example {name} #2"
        )
    i = indexes[(number or 1) - 1]
    return marks[i].time, marks[i + 1].time if i + 1 < len(marks) else math.inf


def _begins_with(text: str, name: str) -> bool:
    """Whether a block begins with a name, which ends where a word of it does: N1 is not N10."""
    own, asked = " ".join(text.split()).lower(), " ".join(name.split()).lower()
    rest = own[len(asked) :]
    return own.startswith(asked) and not (asked[-1].isalnum() and rest[:1].isalnum())


def _shorten_text(text: str) -> str:
    return text if len(text) <= 24 else f"{text[:20]} ..."


def _list_marks(marks: Sequence[Mark]) -> str:
    first = dict.fromkeys(text.split()[0] for mark in marks if (text := mark.text.strip()))
    shown = [_shorten_text(name) for name in first][:MAX_MARKS_NAMED]
    return f"they begin with {', '.join(shown)}{' ...' if len(first) > len(shown) else ''}" if shown else "it has none"


# --- What a record alone says of an axis: values to begin with, and a machine of rigid axes to begin on ---------------


BANDWIDTH = 50.0  # [Hz] of a speed loop to begin with: K_p = 2 pi f J
INTEGRAL = 10e-3  # [s] T_n to begin with
PRESLIDING_TRAVEL = 5e-6  # [m] of travel after which friction is full
ZONE = 0.06  # [rad] width of an engaging zone
RESERVE = 1.5  # what the machine may do beyond what the record shows
# Shares of the mean torque that friction may have of it, where the record does not separate it from the constant load.
FRICTION_SHARES = (0.05, 0.15, 0.4)
LEAST_TRAVEL = 0.01  # rad: a motor that turns less determines no drive
ONE_PHASE_DEVIATION = 1.0  # of the logarithm of an inertia by a torque that is known once a position cycle
CLIPPED_DEVIATION = 0.3  # of the logarithm of an inertia to which rows belong whose torque is cut off
# Relative half width of F_C below which the rigid line separates friction from the constant load
SEPARATING_HALF_WIDTH = 0.5
# A torque limit that is not known must not act: gentle moves determine nothing of the torque of rapid ones.
TORQUE_LIMIT_RATIO = 20.0


@dataclass(frozen=True)
class FitStart:
    """Where fits of an axis begin.

    starts: parameters of drive and friction, a fit each. one_way: what the record determines of constant load and
    friction where it does not separate them, in words; empty where it does.
    """

    starts: Sequence[Mapping[str, float]]
    one_way: str = ""


def start_values(each: AxisRecord) -> FitStart:
    """Parameters of drive and friction to begin fits with, by the rigid line of the record.

    Motion in one direction determines only the sum of constant load and friction. Little motion in the other one
    determines hardly more. Then friction has several shares of that torque, each of which is a start: from a wrong one
    a fit does not come back.

    Raises InputError: the axis does not move or does not accelerate.
    """
    if float(np.ptp(each.setpoint[each.rows])) < LEAST_TRAVEL * each.I_P:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: the setpoint moves by "
            f"{1e6 * float(np.ptp(each.setpoint[each.rows])):.3g} um; a drive is identified from motion of "
            f"{1e6 * LEAST_TRAVEL * each.I_P:.3g} um at least"
        )
    rows = np.flatnonzero(each.rows)
    try:
        found, J_sigma = _rigid_line(each.record.between(int(rows[0]), int(rows[-1]) + 1))
    except InputError as error:
        raise InputError(f"axis {each.axis}: {error}; --axes names the axes that move, --window a part of it") from None
    line = {name: one.value for name, one in found.estimates.items()}
    J = line["J"]
    if not J > 0:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: the inertia comes out as {J:.3g} kg.m2; "
            "the torque's sign or unit is wrong"
        )
    moving = each.moving
    torque = float(np.sqrt(np.mean(each.record.torque[moving] ** 2)))
    least = 0.01 * torque
    spread = {name: NORMAL_95 * one.sigma for name, one in found.estimates.items() if one.status == "estimated"}
    J_sigma = max(J_sigma, found.J.sigma / J)
    if max(spread["F_C"], spread.get("M_0", inf)) <= SEPARATING_HALF_WIDTH * line["F_C"]:
        return FitStart([_values(each, J, J_sigma, line["M_0"], max(line["F_C"], least), line["sigma_2"])])
    # The direction in which it moves further.
    way = -1.0 if float(np.sum(each.speed[moving])) < 0 else 1.0
    there = moving & (way * each.speed > 0)
    n = float(np.mean(each.speed[there])) / each.I_P
    load = line["M_0"] + way * line["F_C"] + line["sigma_2"] * n
    starts = [_values(each, J, J_sigma, load - way * share * abs(load), share * abs(load)) for share in FRICTION_SHARES]
    if way * load > 0:  # friction alone may do it
        starts.append(_values(each, J, J_sigma, 0.0, max(abs(load), least)))
    if line["F_C"] > 0 and "M_0" in spread:
        starts.append(_values(each, J, J_sigma, line["M_0"], max(line["F_C"], least), line["sigma_2"]))
    sign = "+" if way > 0 else "-"
    rows_left = "motion in one direction" if each.record.clipped is None else "torque that is not cut off"
    only = f"{rows_left} determines only M_0 {sign} friction: {load:.3g} N.m at {1e3 * n * each.I_P:.3g} mm/s"
    return FitStart(starts, only)


def of_cycle(start: Mapping[str, float], cycle: float, interval: float) -> dict[str, float]:
    """A start for a position loop of that cycle, of a record with rows at that interval [s].

    Where the record has the torque once a cycle, a held speed setpoint makes the torque ripple within that cycle, and
    the record shows one phase of the ripple: the torque that accelerates comes out too small, and with it the inertia
    of the rigid line.
    """
    return {**start, "J_sigma": ONE_PHASE_DEVIATION} if cycle > 0.5 * interval else dict(start)


def _rigid_line(record: Record) -> tuple[Inertia, float]:
    """The rigid line, and the deviation of the inertia's logarithm by which it may be off besides its own.

    Where too few rows are left whose torque is not cut off, it is one through all rows: too small, but a start.
    """
    try:
        return inertia([record]), 0.0
    except InputError:
        if record.clipped is None:
            raise
        return inertia([replace(record, clipped=None)]), CLIPPED_DEVIATION


def _values(
    each: AxisRecord, J: float, J_sigma: float, M_0: float, F_C: float, sigma_2: float = 0.0
) -> dict[str, float]:
    """All values to begin with. J_sigma: deviation of the inertia's logarithm by which a fit may leave it."""
    top = float(np.max(np.abs(each.speed))) / each.I_P
    return {
        "J": J,
        "J_sigma": J_sigma,
        "M_0": M_0,
        "F_C": F_C,
        "sigma_2": max(sigma_2, 0.1 * F_C / top),
        "K_p": 2 * pi * BANDWIDTH * J,
        "K_i": 2 * pi * BANDWIDTH * J / INTEGRAL,
        "sigma_0": F_C * each.I_P / PRESLIDING_TRAVEL,
        "sigma_1": 1e-4 * F_C * each.I_P / PRESLIDING_TRAVEL,
        "v_s": 1e-2 * top,
        "W": ZONE,
        "gamma": 1.0,
        EXCESS: 0.0,
        "F_log": 0.0,
        "asymmetry": 0.0,
        "K_v": 30.0,
        "k_ffw": 1.0,
        "T_sym": 0.5e-3,
        "T_dyn": 2 * each.record.interval,
        "delay": 0.0,
    }


def limits(each: AxisRecord) -> Mapping[str, float]:
    """Top speed [m/s], acceleration [m/s2], jerk [m/s3], lowest and highest position [m], torque [N.m] of the record,
    with a reserve."""
    h = each.record.interval
    speed = np.gradient(each.setpoint, h)
    acceleration = np.gradient(speed, h)
    jerk = np.gradient(acceleration, h)
    low, high = float(np.min(each.position)), float(np.max(each.position))
    reserve = (RESERVE - 1.0) * (high - low)
    return {
        "speed": RESERVE * float(np.max(np.abs(speed))),
        "acceleration": RESERVE * float(np.max(np.abs(acceleration))),
        "jerk": RESERVE * float(np.max(np.abs(jerk))),
        "low": low - reserve, "high": high + reserve,
        "torque": TORQUE_LIMIT_RATIO * float(np.max(np.abs(each.record.torque))),
    }  # fmt: skip
