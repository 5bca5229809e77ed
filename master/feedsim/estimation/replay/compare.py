"""A replay beside its record: what is left, in numbers, over time, as a spectrum and over the position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf, nan
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from feedsim.analysis import Figure
from feedsim.analysis.circularity import amplitude_spectrum
from feedsim.estimation.identify import RecordedAxis
from feedsim.estimation.identify.open_loop import simulate_angle
from feedsim.estimation.identify.parameters import FRICTION_NAMES
from feedsim.estimation.identify.position_loop import SpeedSetpoint, Taps, rms, setpoint_delay, speed_setpoint
from feedsim.estimation.replay.closed_loop import AxisRecord, Replay, mark_clipped_rows, per_row_of, same_time
from feedsim.estimation.replay.drive import implausible
from feedsim.estimation.replay.moving_lines import Line, in_words, lines_in_motion, same_line, without_outside
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Drive, Machine
from feedsim.simulation.cosim.friction_law import FrictionLaw
from feedsim.structure import checked_modes

TO_RPM = 30 / np.pi
BINS = 60  # of the position
MAX_CHANNEL_DELAY = 5e-3  # [s]: no channel of a control is later than that against another
NEAR_TORQUE_LIMIT = 0.98  # of a torque limit: what the record shows of it, behind its filters
LEAST_STILL = 10  # rows at standstill that make a figure
DELAY_RESIDUAL_SHARE = 0.99  # of what is left without a delay
MAX_WAY_SHARE = 0.05  # of the setpoint's way: what is off by more is another axis, whatever its lag


@dataclass(frozen=True, eq=False)
class Channel:
    """A signal of the record and of the simulation.

    recorded, simulated: (N,) in `unit`. meaning: in words.
    """

    recorded: Array
    simulated: Array
    unit: str
    meaning: str

    @property
    def error(self) -> Array:
        """(N,) simulated less recorded."""
        return self.simulated - self.recorded


@dataclass(frozen=True, eq=False)
class Comparison:
    """An axis of a replay.

    Attributes:
        axis: its name. each: the record, with the rows that count.
        channels: "position" [m], "torque" [N.m] and "speed setpoint" [rad/s] where they are recorded.
        taps, speed: the position loop of the record by regression; None where it does not hold it.
        lag: following error of the record, setpoint less position, rms over the motion [m].
        delay: by how much the torque of the record is later than the simulated one [s], which is taken out; None
            where there is none.
        limit: torque that the simulated drive cannot exceed [N.m]; limited: share of its rows at that limit.
        open_loop: whether the recorded torque drives the axis, in place of a drive.
        outside: lines of the record that come from outside the axis, at rest. moving_lines: others while it moves.
        clipped: findings on torque that the record cuts off: its rows count in no figure of the torque.
        preloaded: whether the run begins with the torque at rest of the record.
    """

    axis: str
    each: AxisRecord
    channels: Mapping[str, Channel]
    taps: Taps | None
    speed: SpeedSetpoint | None
    lag: float
    delay: float | None = None
    limit: float = inf
    limited: float = 0.0
    open_loop: bool = False
    outside: Sequence[Line] = ()
    moving_lines: Sequence[Line] = ()
    clipped: Sequence[Finding] = ()
    preloaded: bool = False

    @property
    def findings(self) -> list[Finding]:
        """Why the replay may say nothing of the record, and what is left that is not the axis' own."""
        unlikely = [] if self.open_loop else implausible(self.each)
        result = [Finding("record-implausible", "wrong", text, self.axis) for text in unlikely]
        torque = self.each.record.torque[self.each.rows] if self.each.record.driven else np.zeros(1)
        recorded = float(np.max(np.abs(torque), initial=0.0))
        if self.limited and not NEAR_TORQUE_LIMIT * self.limit < recorded < self.limit / NEAR_TORQUE_LIMIT:
            result.append(Finding(
                "torque-limit-differs", "wrong",
                f"axis {self.axis}: the simulated drive is at its torque limit, M_max = {self.limit:.4g} N.m, in "
                f"{100 * self.limited:.2g} % of the rows, and that of the record is not; give the limit that the "
                f"drive has (axes.{self.axis}.drive.M_max)",
                self.axis,
            ))  # fmt: skip
        moving = self.each.moving
        off, way = rms(self.channels["position"].error[moving]), float(np.ptp(self.each.setpoint[self.each.rows]))
        if not self.open_loop and off > min(self.lag, MAX_WAY_SHARE * way):
            beside = (
                f"than the recorded one is behind its setpoint ({1e6 * self.lag:.4g} um)"
                if off > self.lag
                else f"than {100 * MAX_WAY_SHARE:.0f} % of the way of {1e3 * way:.4g} mm"
            )
            result.append(Finding(
                "machine-not-of-record", "wrong",
                f"axis {self.axis}: the simulated position is off by more ({1e6 * off:.4g} um rms) {beside}: this is "
                "not the machine of the record",
                self.axis,
            ))  # fmt: skip
        result += self.clipped
        if self.outside:
            result.append(Finding("lines-from-outside", "note", in_words(self.axis, self.outside), self.axis))
        if self.moving_lines:
            text = in_words(self.axis, self.moving_lines, moving=True)
            result.append(Finding("lines-while-moving", "note", text, self.axis))
        return result

    @property
    def figures(self) -> dict[str, Figure]:
        """Figures over the rows in which the axis moves (in open loop over all), by name."""
        rows = self.each.rows if self.open_loop else self.each.moving
        result: dict[str, Figure] = {}
        for name, channel in self.channels.items():
            scale, unit = {"m": (1e6, "um"), "rad/s": (TO_RPM, "rpm")}.get(channel.unit, (1.0, channel.unit))
            error = scale * channel.error[rows & self.each.counted if name == "torque" else rows]
            key = name.replace(" ", "_")
            reported = f"{channel.meaning}: simulated less recorded{'' if self.open_loop else ', while the axis moves'}"
            result[f"{self.axis}.{key}_rms"] = Figure(rms(error), unit, f"{reported}, root mean square")
            result[f"{self.axis}.{key}_largest"] = Figure(
                float(np.max(np.abs(error), initial=0.0)) if len(error) else nan, unit, f"{reported}, largest magnitude"
            )
        still = self.each.rows & ~self.each.moving & self.each.counted
        if self.preloaded:  # it begins with that torque, which shows nothing then
            still &= np.arange(len(still)) >= self.each.first_moving
        if "torque" in self.channels and np.count_nonzero(still) >= LEAST_STILL:
            result[f"{self.axis}.torque_standstill_rms"] = Figure(
                rms(self.channels["torque"].error[still]), "N.m",
                "motor torque: simulated less recorded, while the axis stands still, root mean square",
            )  # fmt: skip
        position = self.channels["position"].error[rows]
        if self.open_loop:
            return result
        result[f"{self.axis}.lag"] = Figure(
            1e3 * self.lag, "mm", "distance of the position behind the setpoint in the record, root mean square"
        )
        result[f"{self.axis}.share_of_lag"] = Figure(
            100 * rms(position) / self.lag if self.lag else nan, "%", "position error as a share of that distance"
        )
        if self.delay is not None:
            result[f"{self.axis}.torque_delay"] = Figure(
                1e3 * self.delay,
                "ms",
                "by how much the record has its torque later than the simulation, which is taken out",
            )
        if self.taps is not None:
            result[f"{self.axis}.setpoint_delay"] = Figure(
                1e3 * self.taps.delay, "ms", "delay of the position setpoint in the control, by regression"
            )
            result[f"{self.axis}.deviation_left"] = Figure(
                1e9 * self.each.I_P * self.taps.rms, "nm",
                "contour deviation of the record that setpoint and position do not explain by that delay, "
                "root mean square",
            )  # fmt: skip
        if self.speed is not None:
            result[f"{self.axis}.K_v"] = Figure(
                0.06 * self.speed.K_v, "(m/min)/mm", "position controller gain of the control, by regression"
            )
            result[f"{self.axis}.speed_setpoint_left"] = Figure(
                1e3 * self.each.I_P * self.speed.rms, "mm/s",
                "speed setpoint of the record that setpoint, position and feedforward do not explain, root mean square",
            )  # fmt: skip
        return result

    def spectrum(self, name: str) -> tuple[Array, Array]:
        """Frequency [Hz] and amplitude spectrum of what is left of a channel over the window, Hann window."""
        rows = np.flatnonzero(self.each.rows)
        return amplitude_spectrum(self.channels[name].error[rows], self.each.record.interval)

    def over_position(self, name: str) -> tuple[Array, Array, Array]:
        """Centres of bins of the position [m] (B,), and the mean of what is left of a channel in either direction,
        forwards (B,) and backwards (B,); nan where the axis has not been."""
        rows = self.each.moving
        x, v, error = self.each.position[rows], self.each.speed[rows], self.channels[name].error[rows]
        edges = np.linspace(np.min(x, initial=0.0), np.max(x, initial=1e-9), BINS + 1) if len(x) else np.arange(2.0)
        bins = np.clip(np.digitize(x, edges) - 1, 0, len(edges) - 2)
        means = []
        for side in (1.0, -1.0):
            own = np.sign(v) == side
            count = np.bincount(bins[own], minlength=len(edges) - 1)
            total = np.bincount(bins[own], weights=error[own], minlength=len(edges) - 1)
            means.append(np.where(count > 0, total / np.maximum(count, 1), nan))
        return 0.5 * (edges[1:] + edges[:-1]), means[0], means[1]


def replay_records(
    machine: Machine,
    records: Mapping[str, AxisRecord],
    fmus: Path | None = None,
    beside: Mapping[str, AxisRecord] | None = None,
) -> dict[str, Comparison]:
    """The records of some axes of a machine through its units, axis by axis beside what was recorded.

    beside: further axes that were recorded at the same time, which may drive a vibration.

    By how much a control logs its torque later than its position is not known ahead: the delay with which it agrees
    best is taken out, and reported.
    """
    per_row = per_row_of(next(iter(records.values())).record.interval, machine)
    limits = {axis: value.drive.M_max for axis, value in machine.axes.items() if isinstance(value.drive, Drive)}
    # A drive of another maker need not say when it is at its limit.
    signals = ("x_a", "M_a", *(("torque_limited",) if limits.keys() >= records.keys() else ()))
    with Replay(machine, records, fmus=fmus) as replay:
        preloaded = replay.preload(machine)
        result = replay.follow(machine, signals, per_row)
    every = {**(beside or {}), **records}
    J = {axis: checked_modes(machine).J_tot(axis) for axis in records}
    comparisons = {
        axis: compare_axis(axis_record, result[axis], per_row, limits.get(axis, inf), J[axis])
        for axis, axis_record in records.items()
    }
    return {
        axis: replace(_with_moving_lines(one, every, J[axis]), preloaded=preloaded) for axis, one in comparisons.items()
    }


def _with_moving_lines(comparison: Comparison, records: Mapping[str, AxisRecord], J: float) -> Comparison:
    """The axis with the lines of its motion that its record at rest does not have."""
    errors = {name: -channel.error for name, channel in comparison.channels.items()}
    axes = [one for one in records.values() if same_time({comparison.axis: comparison.each, one.axis: one})]
    lines = lines_in_motion(comparison.each, errors["position"], errors.get("torque"), axes, J)
    further = [line for line in lines if not any(same_line(line, other) for other in comparison.outside)]
    return replace(comparison, moving_lines=further)


def compare_axis(
    axis_record: AxisRecord,
    simulated: Mapping[str, Array],
    per_row: int = 1,
    limit: float = inf,
    J: float | None = None,
) -> Comparison:
    """An axis beside its record. simulated: x_a [m], M_a [N.m] and where it is known torque_limited [1], `per_row`
    samples from row to row; limit: of the drive's torque [N.m]. J: inertia [kg.m2]."""
    record = axis_record.record
    assert record.setpoint is not None
    taps = speed = None
    with suppress(InputError):  # the record has no deviation, or nothing moves
        taps = setpoint_delay([record])
    with suppress(InputError):
        speed = speed_setpoint([record])
    x_a = simulated["x_a"][::per_row]
    channels = {"position": Channel(axis_record.position, x_a, "m", "position")}
    delay = None
    clipped: tuple[Finding, ...] = ()
    if record.driven:
        delay, torque = _fit_delay(axis_record, simulated["M_a"], per_row)
        axis_record, clipped = mark_clipped_rows(
            axis_record, "the torque of these rows counts in no figure", simulated=torque
        )
        if clipped:
            delay, torque = _fit_delay(axis_record, simulated["M_a"], per_row)
        channels["torque"] = Channel(record.torque, torque, "N.m", "motor torque")
    if speed is not None and record.speed_setpoint is not None:
        asked = speed.of(record.setpoint, x_a / axis_record.I_P, record.feedforward)
        asked[: speed.taps.reach] = record.speed_setpoint[: speed.taps.reach]  # there is no past to form it from
        channels["speed setpoint"] = Channel(record.speed_setpoint, asked, "rad/s", "speed setpoint of the control")
    lag = rms((axis_record.setpoint - axis_record.position)[axis_record.moving])
    limited = simulated.get("torque_limited", np.zeros_like(simulated["x_a"]))
    limited = limited[np.repeat(axis_record.rows, per_row)[per_row - 1 :]]
    return Comparison(
        axis_record.axis, axis_record, channels, taps, speed, lag, delay, limit, float(np.mean(limited)),
        outside=without_outside(axis_record, J)[1], clipped=clipped,
    )  # fmt: skip


def _fit_delay(axis_record: AxisRecord, torque: Array, per_row: int) -> tuple[float, Array]:
    """The delay [s] with which the simulated torque agrees best with the recorded one, and that torque at the rows."""
    time, h = axis_record.record.time, axis_record.record.interval
    fine = time[0] + h / per_row * np.arange(len(torque))
    rows = (axis_record.moving if np.any(axis_record.moving) else axis_record.rows) & axis_record.counted

    def at(delay: float) -> Array:
        return np.asarray(np.interp(time - delay, fine, torque), dtype=np.float64)

    def left(delay: float) -> float:
        return rms((at(delay) - axis_record.record.torque)[rows])

    best = minimize_scalar(
        left, bounds=(-MAX_CHANNEL_DELAY, MAX_CHANNEL_DELAY), method="bounded", options={"xatol": 1e-6}
    ).x
    # A delay that hardly helps is none.
    delay = float(best) if left(float(best)) < DELAY_RESIDUAL_SHARE * left(0.0) else 0.0
    return delay, at(delay)


# --- A record's torque on the simulated axis, without its drive: where inertia, load and friction take the position ---
# The axis is rigid: it begins with the recorded position and speed, and nothing corrects it. The position is then the
# second integral of what friction and load lack, and drifts away from an error of a percent. In closed loop the drive
# hides such an error. Equation and start are those of the identification (estimation/identify/open_loop.py).


def drive_axes(
    machine: Machine, records: Mapping[str, AxisRecord], read: Mapping[str, RecordedAxis], fmus: Path | None = None
) -> dict[str, Comparison]:
    """Each axis under its recorded torque, beside its recorded position.

    read: where the records come from, with the delay of the torque that a mapping gives.

    Raises InputError: a record without torque; an axis whose friction is not the shipped unit's; parameters that the
    friction law refuses.
    """
    comparisons = {}
    with FrictionLaw(fmus) as law:
        for axis, axis_record in records.items():
            if not axis_record.record.driven:
                raise InputError(
                    f"{axis_record.record.name}, axis {axis}: no torque, current or force is recorded; in open loop it "
                    "is what drives the axis"
                )
            friction = machine.shipped_friction(axis, "a replay in open loop")
            values = {name: float(getattr(friction, name)) for name in FRICTION_NAMES}
            values |= {"J": checked_modes(machine).J_tot(axis), "M_0": machine.axes[axis].M_0}
            values["delay"] = read[axis].provenance.torque_delay or 0.0
            rows = np.flatnonzero(axis_record.rows)
            part = axis_record.record.between(int(rows[0]), int(rows[-1]) + 1)
            # The rows ahead of the window are not compared; as many as there are keep their place.
            x = axis_record.position.copy()
            x[rows] = axis_record.I_P * simulate_angle(part, law, values)
            channel = Channel(axis_record.position, x, "m", "position in open loop")
            comparisons[axis] = Comparison(axis, axis_record, {"position": channel}, None, None, 0.0, open_loop=True)
    return comparisons
