"""Figures of a positioning move: how an axis comes to rest on its target, and the torque that it took.

Definitions: docs/figures.md. Everything refers to the programmed target and to the end of the NC motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.analysis.figures import Array, Figure
from feedsim.files.trace import Trace
from feedsim.files.trace.trace import find_rows, require_column
from feedsim.foundation.errors import InputError
from feedsim.motions.positioning_cycle import Visits
from feedsim.structure.modes import checked_modes, table_of_modes, with_mounts
from feedsim.structure.mounts import read_mounts

if TYPE_CHECKING:
    from feedsim.simulation.cosim import Run
    from feedsim.simulation.cosim.schedule import Progress

RINGING_WINDOW = (0.030, 0.400)  # s after the end of the NC motion: the first swing is left out, it is a forced one
REST_DELAY = 1.0  # s after the end of the NC motion
# An axis' ringing is 20 Hz and more (the default Z axis' 21 Hz): over one period of it the first swing, which makes the
# overshoot, is seen whole, and an axis that stays within its band so long does not just pass through it.
MIN_REST_TIME = 0.050  # s
SHORTEST_PLATEAU = 0.125  # s: 40 to 90 % of it then begin and last a period of a ringing of 20 Hz
PLATEAU = (0.4, 0.9)  # share of the constant-speed phase: its begin still rings from the acceleration


@dataclass(frozen=True)
class Approach:
    """One axis of one programmed motion.

    axis: name; start, end: of the NC motion [s]; until: last instant that belongs to it [s] (the start of the axis'
    next motion, or the end of the program); origin, target: programmed positions [m]; steady: constant-speed phase [s]
    or None.
    """

    axis: str
    start: float
    end: float
    until: float
    origin: float
    target: float
    steady: tuple[float, float] | None

    def __post_init__(self) -> None:
        if self.origin == self.target:
            raise InputError(f"positioning: axis {self.axis} does not move; its target is its start, {self.target:g} m")

    @property
    def sense(self) -> float:
        """+1 towards larger positions, -1 towards smaller ones."""
        return math.copysign(1.0, self.target - self.origin)


def positioning_figures(trace: Trace, approach: Approach, *, band: float = 1e-6) -> dict[str, Figure]:
    """Figures of ``approach``: overshoot, settling time to ``band`` [m], ringing, torques; by scale and by tool point.

    Overshoot, settling and ringing are NaN where less than MIN_REST_TIME of the rest behind the motion is recorded,
    overshoot also where the axis is still under way at its end; the plateau's torque where the plateau is short. Torque
    and tool-point figures are present where M_a, M_fr and tcp.x_<axis> are recorded. Raises InputError where the axis'
    position is not recorded, or not up to the end of the motion.
    """
    axis = approach.axis
    figures = {
        "duration": Figure(approach.end - approach.start, "s", "duration of the NC motion, from rest to rest"),
        **_stop(trace, approach, f"{axis}.x_a", band, f"axis {axis} by the linear scale"),
    }
    if f"{axis}.n_a" in trace.columns:
        figures["ringing_frequency"] = _ringing_figure(
            trace.time, approach.sense * trace[f"{axis}.n_a"], approach, f"motor speed of axis {axis}"
        )
    if f"{axis}.M_a" in trace.columns:
        figures |= _torques(trace, approach)
    if f"{axis}.M_fr" in trace.columns:
        figures["rest_torque"] = _rest_torque(trace, approach)
    if f"tcp.x_{axis}" in trace.columns:
        by_tool = _stop(trace, approach, f"tcp.x_{axis}", band, f"axis {axis} by the tool point")
        figures |= {f"tool.{name}": figure for name, figure in by_tool.items()}
    return figures


CLAMPING_FACTOR = 1000.0  # times as stiff as they are in the modes: mounts that hold still


def with_clamped(run: Run, fmus: Path | None = None, progress: Progress | None = None) -> Run:
    """A run with the positions of a second one on mounts that hold still, linear springs CLAMPED times as stiff.

    The run itself where all mounts are springs, or one of another maker's units has a part in it.

    Raises SimulationError: a unit failed.
    """
    from feedsim.simulation import cosim  # what reads records alone does without the units

    scenario, machine = run.scenario, run.scenario.machine
    if machine.mounts is None or machine.plant is not None or machine.foreign_units:
        return run
    bare = checked_modes(machine.model_copy(update={"mounts": None}))
    table = read_mounts(machine.mounts.table, len(bare.frequency))
    K_lin, x_2 = table.element[:, 0], table.element[:, 3]
    none = np.zeros(len(K_lin))
    stiff = with_mounts(bare, table, np.column_stack([K_lin, CLAMPING_FACTOR * K_lin, none, x_2, none, none]))
    columns = tuple(f"{axis}.x_a" for axis in machine.axes)
    recording = scenario.recording.model_copy(update={"variables": columns})
    changes = {"mounts": None, "structure": None, "modes": table_of_modes(stiff, machine.modes.file)}
    second = scenario.model_copy(
        update={"machine": machine.model_copy(update=changes), "recording": recording, "logging": None}
    )
    return replace(run, clamped=cosim.run(second, program=run.program, fmus=fmus, progress=progress).trace)


def mounts_share(clamped: Trace, approach: Approach, settling: Figure, band: float) -> Figure:
    """The part of a settling time [ms] that the mounts make: less that of the run `clamped`; NaN where either is."""
    without = _stop(clamped, approach, f"{approach.axis}.x_a", band, "")["settling_time"].value
    meaning = f"part of the settling time that the mounts make: on mounts that hold still it is {without:.3g} ms"
    return Figure(settling.value - without, "ms", meaning)


def deviation(trace: Trace, approach: Approach, name: str) -> tuple[Array, Array]:
    """Time [s] and distance beyond the target [m], positive past it, from the motion's start to its last instant."""
    rows = _rows(trace, approach)
    return trace.time[rows], approach.sense * (require_column(trace, name, "positioning")[rows] - approach.target)


def ringing_frequency(time: Array, speed: Array) -> float:
    """Mean frequency [Hz] between the first and the last up-crossing of zero; NaN with fewer than two of them.

    Speed, not position: at rest the axis creeps to its target, and crossings of a drifting signal come late.
    """
    crossings = up_crossings(time, speed)
    return (len(crossings) - 1) / float(crossings[-1] - crossings[0]) if len(crossings) > 1 else math.nan


def _rest_is_seen(time: Array, approach: Approach, since: float) -> bool:
    """Whether the rest behind the motion is recorded, at ``time`` (N,) [s], for MIN_REST_TIME after ``since`` [s]."""
    interval = float(np.median(np.diff(time))) if len(time) > 1 else 0.0  # the end may lie between two samples
    return min(approach.until, float(time[-1]) + interval) - since >= MIN_REST_TIME


def _rows(trace: Trace, approach: Approach) -> slice:
    """The motion and what follows it, as far as it is recorded."""
    until = max(approach.end, min(approach.until, float(trace.time[-1]))) if len(trace) else approach.until
    return find_rows(trace, approach.start, until, f"positioning of axis {approach.axis}")


def _stop(trace: Trace, approach: Approach, name: str, band: float, what: str) -> dict[str, Figure]:
    time, beyond = deviation(trace, approach, name)
    after = time >= approach.end
    if not after.any():
        raise InputError(
            f"positioning of axis {approach.axis}: nothing is recorded after the end of the motion at "
            f"{approach.end:.6g} s"
        )
    # a largest distance at the last instant may be outdone, unless the axis is at its target there
    arrived = int(beyond.argmax()) < len(beyond) - 1 or abs(float(beyond[-1])) <= band
    seen = _rest_is_seen(time, approach, approach.end) and arrived
    settled = max(last_outside(time[after], beyond[after], band), approach.end)
    width = f"{band * 1e6:g} um"
    return {
        "overshoot": Figure(
            max(float(beyond.max()), 0.0) * 1e6 if seen else math.nan,
            "um",
            f"largest distance beyond the target, {what}",
        ),
        "settling_time": Figure(
            (settled - approach.end) * 1e3 if _rest_is_seen(time, approach, settled) else math.nan,
            "ms",
            f"last instant outside +-{width} about the target, counted from the end of the NC motion, {what}",
        ),
        "ringing_frequency": _ringing_figure(
            time, np.gradient(beyond, time), approach, f"rate of change of the position, {what}"
        ),
    }


def _ringing_figure(time: Array, speed: Array, approach: Approach, what: str) -> Figure:
    begin, end = (approach.end + delay for delay in RINGING_WINDOW)
    inside = (time >= begin) & (time <= min(end, approach.until))
    seen = _rest_is_seen(time, approach, approach.end)
    return Figure(
        ringing_frequency(time[inside], speed[inside]) if seen else math.nan,
        "Hz",
        f"{what}: mean frequency of its up-crossings of zero, 30 to 400 ms after the end of the NC motion",
    )


def _torques(trace: Trace, approach: Approach) -> dict[str, Figure]:
    torque = require_column(trace, f"{approach.axis}.M_a", "positioning")
    rows = _rows(trace, approach)
    figures = {"peak_torque": Figure(float(np.abs(torque[rows]).max()), "N.m", "largest magnitude of the motor torque")}
    if approach.steady is not None:
        begin, end = (approach.steady[0] + share * (approach.steady[1] - approach.steady[0]) for share in PLATEAU)
        inside = (trace.time >= begin) & (trace.time <= end)
        long_enough = approach.steady[1] - approach.steady[0] >= SHORTEST_PLATEAU
        figures["plateau_torque"] = Figure(
            float(torque[inside].mean()) if inside.any() and long_enough else math.nan,
            "N.m",
            f"mean motor torque at constant speed, {begin:.3f} to {end:.3f} s",
        )
    return figures


def _rest_torque(trace: Trace, approach: Approach) -> Figure:
    instant = approach.end + REST_DELAY
    reached = instant <= min(approach.until, float(trace.time[-1]))
    torque = require_column(trace, f"{approach.axis}.M_fr", "positioning")
    return Figure(
        float(np.interp(instant, trace.time, torque)) if reached else math.nan,
        "N.m",
        f"friction torque at rest, {REST_DELAY:g} s after the end of the NC motion",
    )


# --- Accuracy and repeatability of positioning a linear axis, in the letters of ISO 230-2 (docs/figures.md) -----------
# Every target is approached several times from below and from above. Of the deviations at rest come a mean and a
# standard deviation per target and side, and of those the figures of an acceptance sheet; "two standard deviations" is
# the standard's coverage factor of 2.


SIDES = ("up", "down")  # of an approach: towards larger positions, and towards smaller ones


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Deviations at the targets of an axis.

    Attributes:
        targets: (M,) programmed [m], from the lowest to the highest.
        deviations: (2, M, N) measured less programmed [m]: approached upwards, then downwards; N runs.
    """

    targets: Sequence[float]
    deviations: Array

    @property
    def mean(self) -> Array:
        """(2, M) mean unidirectional deviations [m]."""
        return np.asarray(self.deviations.mean(axis=2))

    @property
    def s(self) -> Array:
        """(2, M) standard deviations of the approaches, with N - 1 [m]."""
        return np.asarray(self.deviations.std(axis=2, ddof=1))

    @property
    def B(self) -> Array:
        """(M,) reversal value: mean upwards less mean downwards [m]."""
        up, down = self.mean
        return np.asarray(up - down)

    @property
    def R(self) -> Array:
        """(M,) bidirectional repeatability [m]: the largest of 4 s of either side, and of 2 s of both with |B|."""
        up, down = self.s
        return np.asarray(np.max([2 * up + 2 * down + np.abs(self.B), 4 * up, 4 * down], axis=0))

    @property
    def figures(self) -> dict[str, Figure]:
        """A, R, E, M, B as acceptance sheets have them, by name."""
        mean, s = self.mean, self.s
        middle = mean.mean(axis=0)

        def um(value: float | np.floating[Any], meaning: str) -> Figure:
            return Figure(1e6 * float(value), "um", meaning)

        result = {
            "A": um(np.max(mean + 2 * s) - np.min(mean - 2 * s), "bidirectional accuracy of positioning (ISO 230-2)"),
            "R": um(np.max(self.R), "bidirectional repeatability of positioning, largest of all targets (ISO 230-2)"),
            "M": um(np.ptp(middle), "range of the mean bidirectional deviations (ISO 230-2)"),
            "B": um(np.max(np.abs(self.B)), "reversal value, largest magnitude of all targets (ISO 230-2)"),
            "B_mean": um(np.mean(self.B), "mean reversal value: upwards less downwards (ISO 230-2)"),
            "E": um(np.ptp(mean), "bidirectional systematic deviation of positioning (ISO 230-2)"),
        }
        for side, m, d in zip(SIDES, mean, s, strict=True):
            approaches = f"of approaches {side}wards (ISO 230-2)"
            result |= {
                f"A_{side}": um(np.max(m + 2 * d) - np.min(m - 2 * d), f"accuracy {approaches}"),
                f"R_{side}": um(4 * np.max(d), f"repeatability {approaches}"),
                f"E_{side}": um(np.ptp(m), f"systematic deviation {approaches}"),
            }
        return result


def readings(trace: Trace, visits: Visits, name: str, noise: float, rng: np.random.Generator) -> Array:
    """(2, M, N) position `name` less target at the end of every rest [m]: upwards, then downwards.

    noise: standard deviation of the measuring system [m]. Raises InputError where the position is not recorded, or not
    up to the last visit.
    """
    purpose = f"positioning accuracy of axis {visits.axis}"
    position = require_column(trace, name, purpose)
    values = np.empty((len(SIDES), len(visits.targets), visits.runs))
    places = {target: i for i, target in enumerate(visits.targets)}
    for visit in visits.visits:
        rows = find_rows(trace, visit.begin, visit.end, purpose)
        at = (0 if visit.sense > 0 else 1, places[visit.target], visit.run)
        values[at] = position[rows.stop - 1] - visit.target + noise * rng.standard_normal()
    return values


def up_crossings(time: Array, signal: Array) -> Array:
    """Instants [s], linearly interpolated, at which ``signal`` (N,) rises through zero."""
    rise = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    share = signal[rise] / (signal[rise] - signal[rise + 1])
    return np.asarray(time[rise] + share * (time[rise + 1] - time[rise]), dtype=np.float64)


def last_outside(time: Array, deviation: Array, band: float) -> float:
    """Last instant [s] with |deviation| > band, interpolated to the crossing of the band's edge.

    -inf where the deviation never leaves the band, NaN where it is still outside at the last sample.
    """
    outside = np.flatnonzero(np.abs(deviation) > band)
    if len(outside) == 0:
        return -math.inf
    k = int(outside[-1])
    if k == len(time) - 1:
        return math.nan
    edge = math.copysign(band, deviation[k])
    share = (deviation[k] - edge) / (deviation[k] - deviation[k + 1])
    return float(time[k] + share * (time[k + 1] - time[k]))
