"""Which figures a scenario asks for: from its `evaluate` list and the planned program to approaches and turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle import CircleUnderTest, Diagnosis, Term, TurnedPath, diagnose, term_name
from feedsim.analysis.circularity import (
    EVEN_SPEED_SHARE,
    Turn,
    axis_letters,
    circularity,
    contour,
    fitted_centre,
    recorded_circle,
    speed_change,
)
from feedsim.analysis.contour_error import ContourError, contour_error
from feedsim.analysis.figures import Array, Figure
from feedsim.analysis.positioning import MIN_REST_TIME, Accuracy, Approach, mounts_share, positioning_figures, readings
from feedsim.files.trace import Trace, matches
from feedsim.foundation.errors import Finding, InputError
from feedsim.linear.loops import measuring_error, position_reference
from feedsim.linear.system import LinearSystem
from feedsim.motions.circular import Circular
from feedsim.motions.move import Straight
from feedsim.motions.positioning_cycle import Visits
from feedsim.motions.program import ProgrammedGeometry
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.scenario import CircleTest, ContourTest, Machine, Positioning, PositioningAccuracy, Scenario
from feedsim.simulation.nc import Program, Segment

# --- Figures that need more of a circle than its radii: why it is not round, and both directions together -------------
# Definitions: docs/figures.md. Here recorded turns meet feedsim.analysis.circle, which takes them apart.


# Samples of a turn below which there is no telling its parts apart: three per degree would show a peak's shape.
MIN_PEAK_TURN_SAMPLES = 180
# A glitch by its old definition is misleading where it differs from the peak by this share of it, and this much [m].
MISLEADING, LEAST_MISLEADING = 0.2, 1e-6
FIGURE_UNITS = {"s": (1e3, "ms"), "m": (1e6, "um"), "1": (1e6, "um/m"), "rad": (1e6, "um/m"), "N.m": (1.0, "N.m")}
FIGURE_ORDER = (
    "peaks", "servo", "squareness", "squareness_or_servo", "scale", "lost_motion", "pitch", "cogging", "straightness",
    "third", "drift", "centres", "radii", "radius", "offset", "rest",
)  # fmt: skip
COMPARED_ANGLES = 720  # at which two directions are compared: every half degree


def diagnose_turns(
    trace: Trace,
    turns: Sequence[Turn],
    pitch: Mapping[str, float],
    gain: Mapping[str, complex] | None = None,
    drag: Mapping[str, NDArray[np.complex128]] | None = None,
    columns: tuple[str, str] | None = None,
    recorded: bool = False,
    response: Callable[[str, Array], NDArray[np.complex128]] | None = None,
    following: Mapping[str, NDArray[np.complex128]] | None = None,
) -> Diagnosis | None:
    """Turns of one circle taken apart; None where they have too few samples for that.

    pitch: axis -> [m]. gain: axis -> x_a/x_s at the circle's frequency [1]. drag: axis -> x_a over a torque at the
    motor at the odd multiples of that frequency [m/(N.m)]. columns: of the positions; default: those of the scales.
    recorded: they are looked at as those of an instrument are. response: of an axis at frequencies (F,) [Hz], x_a over
    a torque on the rotor (F,) [m/(N.m)].
    """
    turn = turns[0]
    paths = []
    for entry in turns:
        measured = contour(trace, entry, columns)
        if len(measured.angle) < MIN_PEAK_TURN_SAMPLES:
            return None
        phase = (measured.time - measured.time[0]) * (2 * math.pi / (entry.end - entry.begin))
        paths.append(TurnedPath(measured.angle, measured.deviation, entry.sense, phase))
    speed = 2 * math.pi * turn.radius / (turn.end - turn.begin)
    circle = CircleUnderTest(
        turn.axes, turn.radius, speed, pitch, gain or {}, drag or {}, following or {}, recorded, response
    )
    return diagnose(circle, paths)


def cause_figures(diagnosis: Diagnosis) -> dict[str, Figure]:
    """Figures of what makes the circle not round."""
    figures = {}
    first, second = diagnosis.circle.axes
    meanings = {
        "offset": "distance of the centre from the programmed one",
        "radius": "mean radius deviation without peaks",
        "scale": f"scale mismatch: how much further {first} travels than {second}",
        "squareness": f"squareness: how much the angle between {first}+ and {second}+ is below 90 deg",
        "servo": f"servo mismatch: how much later {first} answers than {second}",
        "squareness_or_servo": "amplitude of the ellipse along 45 deg, of squareness or servo mismatch: one direction "
        "cannot tell",
        "lost_motion": "lost motion: step where {axis} reverses",
        "peaks": "reversal peak where {axis} reverses, the largest one over the fitted rest",
        "pitch": "amplitude of the error of {axis} that repeats with its pitch",
        "cogging": "amplitude of the torque of {axis} that comes {order} times in a turn of its motor",
        "straightness": "straightness of second order of the guide of {axis}, at the edge of the circle",
        "third": f"straightness of third order at the edge of the circle, that of {first} less that of {second}",
        "drift": "way of the centre in a turn",
        "centres": "distance of the centres of both directions",
        "radii": "mean radius of counterclockwise turns less that of clockwise ones, or that of the second turn less "
        "that of the first",
        "rest": "what no cause explains, from peak to valley",
    }  # fmt: skip
    for term in sorted(diagnosis.terms, key=lambda term: (FIGURE_ORDER.index(term.key), term.axis, term.order)):
        factor, unit = FIGURE_UNITS[term.unit]
        ends = factor * (term.value - term.half), factor * (term.value + term.half)
        meaning = meanings[term.key].format(axis=term.axis, order=term.order)
        known = ends if math.isfinite(term.half) else None
        figures[figure_name(term)] = Figure(factor * term.value, unit, meaning, known)
    if diagnosis.lag is not None:
        meaning = "part of the mean radius deviation that path lag makes, by the response of the position loops"
        figures["radius_lag"] = Figure(1e6 * diagnosis.lag, "um", meaning)
    vibration = diagnosis.vibration
    amplitude, frequency = (vibration.amplitude * 1e6, vibration.frequency) if vibration else (0.0, math.nan)
    figures["vibration"] = Figure(amplitude, "um", "amplitude of the strongest vibration; 0 where none stands out")
    figures["vibration_frequency"] = Figure(frequency, "Hz", "frequency of that vibration")
    for entry in diagnosis.vibrations:
        if entry.axis:
            figures[f"vibration_{entry.axis}"] = Figure(
                1e6 * entry.amplitude, "um", f"amplitude of what {entry.axis} swings"
            )
            meaning = f"frequency of what {entry.axis} swings"
            figures[f"vibration_frequency_{entry.axis}"] = Figure(entry.frequency, "Hz", meaning)
    return figures


def figure_name(term: Term) -> str:
    """Name of a term's figure, without the plane's."""
    names = {"servo": "servo_mismatch", "scale": "scale_mismatch", "peaks": "peak", "radius": "radius_change"}
    names |= {"third": "straightness_third", "drift": "centre_drift", "centres": "centres_apart"}
    names |= {"radii": "radii_apart"}
    order = f"_{term.order}" if term.order else ""
    return f"{names.get(term.key, term.key)}{'_' if term.axis else ''}{term.axis}{order}"


def warn_misleading_glitches(diagnosis: Diagnosis, glitches: Mapping[str, Figure]) -> list[str]:
    """A sentence for every axis whose quadrant glitch, largest deviation in the quadrant, is not friction's peak."""
    result = []
    for axis in diagnosis.circle.axes:
        peak, old = diagnosis[f"peaks {axis}"], glitches[f"glitch_{axis}"]
        off = abs(old.value * 1e-6 - peak.value)
        if off > max(MISLEADING * abs(peak.value), LEAST_MISLEADING):
            largest = max(
                (term for term in diagnosis.terms if term.key not in ("peaks", "rest")), key=lambda term: term.size
            )
            result.append(
                f"glitch_{axis}, {old}, is the largest deviation of the quadrant, most of it {term_name(largest)}; the "
                f"reversal peak of {axis} itself is {peak.value * 1e6:.3g} um"
            )
    return result


def bidirectional_figures(trace: Trace, turn: Turn, back: Turn) -> dict[str, Figure]:
    """ISO 230-4's figures of two turns in opposite senses, about the centre of the circle fitted to both."""
    measured = [contour(trace, entry) for entry in (turn, back)]
    return both_directions([(m.angle, m.deviation) for m in measured], turn.radius, turn.axes)


def both_directions(turns: Sequence[tuple[Array, Array]], radius: float, axes: tuple[str, str]) -> dict[str, Figure]:
    """The same of two turns by their angles [rad] and deviations of the radius [m]."""
    centre = fitted_centre(np.concatenate([a for a, _ in turns]), np.concatenate([e for _, e in turns]), radius)
    around = [shift_centre(angle, deviation, radius, centre) for angle, deviation in turns]
    even: Array = np.arange(COMPARED_ANGLES, dtype=np.float64) * (2 * math.pi / COMPARED_ANGLES) - math.pi
    there, again = (_deviation_at(even, angle, deviation) for angle, deviation in around)
    letters = axis_letters(axes)
    both = np.concatenate([deviation for _, deviation in around])

    def um(value: float, meaning: str) -> Figure:
        return Figure(value * 1e6, "um", f"{meaning}, by the linear scales")

    apart = np.abs(there - again)
    return {
        "G_b": um(
            float(np.ptp(both)),
            f"ISO 230-4 bidirectional circular deviation G(b)_{letters}, about the centre of the least-squares circle "
            "of both turns",
        ),
        "D": um(float(there.mean() + again.mean()) / 2, f"ISO 230-4 mean bidirectional radial deviation D_{letters}"),
        "H": um(
            float(apart.max()),
            f"ISO 230-4 circular hysteresis H_{letters}: largest distance of the two turns at an angle",
        ),
    }


def shift_centre(angle: Array, deviation: Array, radius: float, centre: Array) -> tuple[Array, Array]:
    """Angle [rad] and deviation of the radius [m] about another centre (2,) [m]."""
    x, y = (radius + deviation) * np.cos(angle) - centre[0], (radius + deviation) * np.sin(angle) - centre[1]
    return np.arctan2(y, x), np.hypot(x, y) - radius


def _deviation_at(wanted: Array, angle: Array, deviation: Array) -> Array:
    order = np.argsort(angle)
    return np.asarray(np.interp(wanted, angle[order], deviation[order], period=2 * math.pi))


# What acceleration leaves dies away in the run-in [s]: on the default machine it makes G 3 % too large after 0.2 s on
# circles of 5 mm at 3 m/min and of 15 mm at 10 m/min, and nothing on one of 15 mm at 3 m/min.
RUN_IN = 0.2
# Of the loops' response to friction: frequencies up to this [Hz], and up to this multiple of the circle's.
DRAG_HIGHEST, DRAG_MOST = 200.0, 401
# Harmonics beyond z of cos(z cos t), in cube roots of z: J_n(z) is below 1e-4 there.
PITCH_HARMONICS = 4.0


class Result(Protocol):
    """What evaluation needs of a run."""

    @property
    def scenario(self) -> Scenario: ...
    @property
    def program(self) -> Program: ...
    @property
    def trace(self) -> Trace: ...


@dataclass(frozen=True)
class PositioningTask:
    """A stop to evaluate; ``band`` [m], ``prefix`` of its figures, the ``segment`` that it ends."""

    prefix: str
    approach: Approach
    band: float
    segment: Segment

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        return (f"{self.approach.axis}.x_a",)

    def figures(self, trace: Trace, clamped: Trace | None = None) -> dict[str, Figure]:
        """Figures of the task, without prefix. clamped: the same setpoints on mounts that hold still."""
        figures = positioning_figures(trace, self.approach, band=self.band)
        if clamped is not None:
            settling = figures["settling_time"]
            figures["settling_of_mounts"] = mounts_share(clamped, self.approach, settling, self.band)
        return figures


@dataclass(frozen=True)
class CircleTask:
    """A turn to evaluate; ``prefix`` of its figures; ``back``: the same circle in the other sense, if it is driven."""

    prefix: str
    turn: Turn
    machine: Machine
    back: Turn | None = None

    @property
    def turns(self) -> tuple[Turn, ...]:
        """The turn, and that in the other sense if there is one."""
        return (self.turn,) if self.back is None else (self.turn, self.back)

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        return (f"{self.turn.axes[0]}.x_a", f"{self.turn.axes[1]}.x_a")

    def figures(self, trace: Trace) -> dict[str, Figure]:
        """Figures of the task, without prefix."""
        result = circularity(trace, self.turn)
        if self.back is not None:
            result |= bidirectional_figures(trace, self.turn, self.back)
            result |= {f"clockwise.{name}": figure for name, figure in circularity(trace, self.back).items()}
        diagnosis = self.diagnosis(trace)
        return result | (cause_figures(diagnosis) if diagnosis is not None else {})

    def diagnosis(self, trace: Trace) -> Diagnosis | None:
        """Why the circle is not round; None where it has too few samples to say.

        Found once for the same trace: figures and causes of a run both rest on it.
        """
        last: tuple[Trace, Diagnosis | None] | None = self.__dict__.get("_last")
        if last is None or last[0] is not trace:
            last = (
                trace,
                diagnose_turns(
                    trace,
                    self.turns,
                    self.pitch,
                    self.gain,
                    self.drag,
                    response=self.response,
                    following=self.following,
                ),
            )
            self.__dict__["_last"] = last
        return last[1]

    @property
    def pitch(self) -> dict[str, float]:
        """Of the plane's axes [m]."""
        return {axis: 2 * math.pi * self.machine.axes[axis].I_P for axis in self.turn.axes}

    @property
    def _circle_frequency(self) -> float:
        """The circle's frequency [Hz]."""
        return 1 / (self.turn.end - self.turn.begin)

    @cached_property
    def _system(self) -> LinearSystem | None:
        """The closed loops; None where a drive is not the shipped one."""
        try:
            # Gain, drag and what follows of all axes are asked for one by one at the same few frequencies.
            from feedsim.simulation.cosim.plant import plant_modes  # what reads records alone does without it

            system = LinearSystem(self.machine, plant_modes(self.machine)[0], kept_from=1)
            return system if system.drives else None
        except InputError:
            return None

    @cached_property
    def _orders(self) -> tuple[int, dict[str, int]]:
        """Up to which multiple of the circle's frequency the loops' response to friction is taken; and of each axis, up
        to which one errors that repeat with the pitch have harmonics."""
        sampled = 0.4 / self.machine.cycles.T_c / self._circle_frequency
        counts = {}
        for axis in self.turn.axes:
            waves = 2 * math.pi * self.turn.radius / self.pitch[axis]
            counts[axis] = max(int(min(waves + PITCH_HARMONICS * (1 + waves ** (1 / 3)), sampled, 500)), 1)
        return math.ceil(max(2, min(DRAG_HIGHEST / self._circle_frequency, sampled, DRAG_MOST))) - 1, counts

    @cached_property
    def _multiples(self) -> NDArray[np.int64]:
        """Of the circle's frequency, ascending, all that is asked for: odd ones for friction, all for the pitch."""
        top, counts = self._orders
        return np.union1d(np.arange(1, top + 1, 2), np.arange(1, max(counts.values()) + 1))

    def _at_multiples(
        self, response: Callable[[LinearSystem, str, NDArray[np.float64]], NDArray[np.complex128]]
    ) -> dict[str, NDArray[np.complex128]]:
        """A response of the plane's axes at all multiples; empty where a drive is not the shipped one."""
        if self._system is None:
            return {}
        frequency = np.asarray(self._circle_frequency * self._multiples, dtype=np.float64)
        return {axis: response(self._system, axis, frequency) for axis in self.turn.axes}

    @cached_property
    def gain(self) -> dict[str, complex]:
        """x_a/x_s of the plane's axes at the circle's frequency [1]; empty where a drive is not the shipped one."""
        responses = self._at_multiples(partial(position_reference, feedforward=True))
        return {axis: complex(response[0]) for axis, response in responses.items()}

    @cached_property
    def drag(self) -> dict[str, NDArray[np.complex128]]:
        """x_a over M_add, a torque at the motor but for the current loop, of the plane's axes at the odd multiples of
        the circle's frequency [m/(N.m)]; empty as gain."""
        own = (self._multiples % 2 == 1) & (self._multiples <= self._orders[0])
        return {axis: response[own] for axis, response in self._at_multiples(_drag_response).items()}

    @cached_property
    def following(self) -> dict[str, NDArray[np.complex128]]:
        """How the plane's axes follow errors of their measured positions, at the multiples of the circle's frequency up
        to where errors that repeat with the pitch have harmonics [1]; empty as gain."""
        counts = self._orders[1]
        return {axis: response[: counts[axis]] for axis, response in self._at_multiples(measuring_error).items()}

    @property
    def response(self) -> Callable[[str, NDArray[np.float64]], NDArray[np.complex128]] | None:
        """x_a over a torque on the rotor, of an axis at frequencies (F,) [Hz]: (F,) [m/(N.m)]; None as gain."""
        system = self._system
        if system is None:
            return None

        def of_torque(axis: str, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
            s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
            per_setpoint, _ = system.drives[system.axes.index(axis)].torque(s)
            return np.asarray(_drag_response(system, axis, frequency) / per_setpoint)

        return of_torque


def _drag_response(system: LinearSystem, axis: str, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """x_a over M_add of an axis with its position loop closed, at frequencies (F,) [Hz]: (F,) [m/(N.m)]."""
    return system.closing({axis: "position"}).transfer(frequency, f"{axis}.x_a", f"{axis}.M_add")


@dataclass(frozen=True)
class AccuracyTask:
    """A positioning cycle; ``prefix`` of its figures; ``noise`` [m] of the measuring system, and its seed."""

    prefix: str
    visits: Visits
    noise: float = 0.0
    seed: int = 0

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        return (f"{self.visits.axis}.x_a",)

    def accuracies(self, trace: Trace) -> dict[str, Accuracy]:
        """By the linear scale (""), and by the tool point ("tool.") where that is recorded."""
        names = {"": f"{self.visits.axis}.x_a", "tool.": f"tcp.x_{self.visits.axis}"}
        rng = np.random.default_rng(self.seed)
        return {
            place: Accuracy(self.visits.targets, readings(trace, self.visits, name, self.noise, rng))
            for place, name in names.items()
            if not place or name in trace.columns
        }

    def figures(self, trace: Trace) -> dict[str, Figure]:
        """Figures of the task, without prefix."""
        return {
            f"{place}{name}": figure
            for place, accuracy in self.accuracies(trace).items()
            for name, figure in accuracy.figures.items()
        }


@dataclass(frozen=True)
class ContourTask:
    """An NC program whose contour is evaluated; ``prefix`` of its figures; ``program``: all setpoints."""

    prefix: str
    segment: Segment
    program: Program
    machine: Machine

    @property
    def needs(self) -> tuple[str, ...]:
        """Columns without which there is nothing to evaluate."""
        assert isinstance(self.segment.geometry, ProgrammedGeometry)
        return tuple(f"{axis}.x_a" for axis in self.segment.geometry.moves.axes)

    def error(self, trace: Trace, frictionless: Trace | None = None) -> ContourError:
        """Distances from the programmed path; frictionless: the same setpoints nearly without friction."""
        return contour_error(trace, self.program, self.segment, self.machine, frictionless)

    def figures(self, trace: Trace) -> dict[str, Figure]:
        """Figures of the task, without prefix."""
        return self.error(trace).figures()


Task = PositioningTask | CircleTask | AccuracyTask | ContourTask


def tasks(scenario: Scenario, program: Program) -> tuple[Task, ...]:
    """One task per entry of ``scenario.evaluate``.

    Raises InputError that lists every entry for which the program has nothing to evaluate.
    """
    result: list[Task] = []
    problems: list[str] = []
    for i, item in enumerate(scenario.evaluate):
        try:
            task = _task(item, scenario, program)
        except InputError as error:
            problems += [f"{scenario.at('evaluate', i)}: {problem}" for problem in error.problems]
            continue
        same = sum(other.prefix.partition("#")[0] == task.prefix for other in result)
        if same:  # the same axis or plane once more: X, X#2, X#3
            task = replace(task, prefix=f"{task.prefix}#{same + 1}")
        result.append(task)
    if problems:
        raise InputError.of(f"{scenario.file}: the evaluation is not possible", problems)
    return tuple(result)


def check(scenario: Scenario, program: Program) -> None:
    """Raise InputError where the figures asked for could not be had from the simulation.

    Nothing to evaluate, too little recorded, or too short a rest behind the motion to be positioned.
    """
    patterns = scenario.recording.variables
    problems = []
    for i, task in enumerate(tasks(scenario, program)):
        result = [
            f"evaluation of {task.prefix} needs {name}, which recording.variables leaves out"
            for name in task.needs
            if patterns is not None and not any(matches(name, pattern) for pattern in patterns)
        ]
        if isinstance(task, PositioningTask):
            result += _short_rest(task, program)
        problems += [f"{scenario.at('evaluate', i)}: {problem}" for problem in result]
    if problems:
        raise InputError.of(f"{scenario.file}: the evaluation is not possible", problems)


def diagnoses(result: Result, asked: Sequence[Task] | None = None) -> dict[str, Diagnosis]:
    """Why its circles are not round: prefix of a circle's figures -> what it is made of. asked: as of evaluate()."""
    asked = tasks(result.scenario, result.program) if asked is None else asked
    circles = [task for task in asked if isinstance(task, CircleTask)]
    diagnoses = {task.prefix: task.diagnosis(result.trace) for task in circles}
    return {prefix: diagnosis for prefix, diagnosis in diagnoses.items() if diagnosis is not None}


def evaluates_contours(scenario: Scenario, program: Program) -> bool:
    """Whether the contour of an NC program is evaluated."""
    return any(isinstance(task, ContourTask) for task in tasks(scenario, program))


def evaluates_stops(scenario: Scenario, program: Program) -> bool:
    """Whether a stop is evaluated."""
    return any(isinstance(task, PositioningTask) for task in tasks(scenario, program))


def contours(result: Result) -> Mapping[str, ContourError]:
    """Distances from the paths of its NC programs: prefix of a contour's figures -> what came out.

    Found once for the same result: figures, words and pictures rest on it.
    """
    known: Mapping[str, ContourError] | None = result.__dict__.get("_contours")
    if known is None:
        frictionless = getattr(result, "frictionless", None)
        known = result.__dict__["_contours"] = {
            task.prefix: task.error(result.trace, frictionless)
            for task in tasks(result.scenario, result.program)
            if isinstance(task, ContourTask)
        }
    return known


def program_notes(program: Program) -> tuple[Finding, ...]:
    """What is to be known of the NC programs among the motions."""
    geometries = [segment.geometry for segment in program.segments]
    return tuple(note for entry in geometries if isinstance(entry, ProgrammedGeometry) for note in entry.notes)


def doubt_figures(figures: Mapping[str, Figure], diagnoses: Mapping[str, Diagnosis]) -> tuple[Finding, ...]:
    """Figures that do not mean what their names say, of this result."""
    notes = []
    for prefix, diagnosis in diagnoses.items():
        own = {name.removeprefix(f"{prefix}."): f for name, f in figures.items() if name.startswith(f"{prefix}.")}
        notes += [
            Finding("glitch-misleading", "note", f"{prefix}: {sentence}", prefix)
            for sentence in warn_misleading_glitches(diagnosis, own)
        ]
    return tuple(notes)


def evaluate(result: Result, asked: Sequence[Task] | None = None) -> dict[str, Figure]:
    """Every figure that the scenario of ``result`` asks for, e.g. "Z.overshoot", "XZ.G", "XZ.tool.glitch_X".

    asked: the scenario's tasks, where the caller has them already.

    >>> import feedsim as fs
    >>> figures = fs.evaluate(fs.run("z_positioning.yaml"))
    >>> print(figures["Z.duration"])
    1.247 s
    """
    clamped = getattr(result, "clamped", None)

    def figures(task: Task) -> Mapping[str, Figure]:
        if isinstance(task, ContourTask):
            return contours(result)[task.prefix].figures()
        return task.figures(result.trace, clamped) if isinstance(task, PositioningTask) else task.figures(result.trace)

    return {
        f"{task.prefix}.{name}": figure
        for task in (tasks(result.scenario, result.program) if asked is None else asked)
        for name, figure in figures(task).items()
    }


def _task(
    item: Positioning | CircleTest | PositioningAccuracy | ContourTest, scenario: Scenario, program: Program
) -> Task:
    if isinstance(item, Positioning):
        return _stop(item, program)
    if isinstance(item, CircleTest):
        return _turn(item, scenario, program)
    if isinstance(item, ContourTest):
        programs = [s for s in _chosen(program, item.motion) if isinstance(s.geometry, ProgrammedGeometry)]
        if not programs:
            raise InputError("contour: the motions have no NC program")
        return ContourTask("contour", programs[-1], program, scenario.machine)
    cycles = [s.geometry for s in _chosen(program, item.motion) if isinstance(s.geometry, Visits)]
    if not cycles:
        raise InputError("positioning accuracy: the program has no positioning cycle")
    return AccuracyTask(cycles[-1].axis, cycles[-1], item.noise, item.seed)


def _stop(item: Positioning, program: Program) -> PositioningTask:
    moved = [s for s in _chosen(program, item.motion) if s.origin[item.axis] != s.target[item.axis]]
    if not moved:
        what = "no motion takes it" if item.motion is None else f"motions.{item.motion} does not take it"
        raise InputError(f"positioning of axis {item.axis}: {what} to another position")
    segment = moved[-1]
    approach = Approach(
        axis=item.axis,
        start=segment.start,
        end=segment.end,
        until=program.until(segment, item.axis),
        origin=segment.origin[item.axis],
        target=segment.target[item.axis],
        steady=segment.geometry.steady if isinstance(segment.geometry, Straight) else None,
    )
    return PositioningTask(item.axis, approach, item.band, segment)


def _short_rest(task: PositioningTask, program: Program) -> list[str]:
    """What is wrong where another motion of the axis, or the end of the program, follows too soon."""
    axis, rest = task.approach.axis, task.approach.until - task.approach.end
    own = f"motions.{task.segment.index}"
    if rest >= MIN_REST_TIME:
        return []
    following = program.following(task.segment, axis)
    then = f"the next motion of {axis}, motions.{following.index}" if following else "the end of the program"
    return [
        f"positioning of {axis}: only {max(rest, 0.0) * 1e3:.2g} ms between the end of {own} and {then}; "
        f"at least {MIN_REST_TIME * 1e3:g} ms are needed: add a dwell"
    ]


def _chosen(program: Program, motion: int | None) -> tuple[Segment, ...]:
    return program.segments if motion is None else program.segments[motion : motion + 1]


def _turn(item: CircleTest, scenario: Scenario, program: Program) -> CircleTask:
    circle = _circle(item, _chosen(program, item.motion), program)
    turns = len(circle.turns)
    if (item.turn or 0) > turns:
        raise InputError(f"circularity: turn {item.turn} of a circle of {turns} turn{'s'[: turns != 1]}")
    turn, *back = (
        Turn(circular.axes, circular.centre, circular.radius, circular.sense, *_even_turn(circular, item.turn, program))
        for circular in (circle, circle.back)
        if circular is not None
    )
    return CircleTask(axis_letters(circle.axes), turn, scenario.machine, back[0] if back else None)


def _even_turn(circle: Circular, number: int | None, program: Program) -> tuple[float, float]:
    """Begin and end [s] of the turn asked for, or of the middle one, or else of the last full turn at constant speed.

    Raises InputError where that is no full turn at constant path speed, settled: what to change.
    """
    at = (number or len(circle.turns) // 2 + 1) - 1
    begin, end = circle.turns[at] if circle.turns else (0.0, 0.0)
    name = f"circularity: turn {at + 1} of {len(circle.turns)}"
    if circle.turn_time is None:  # recorded setpoints
        if (change := speed_change(program, circle, begin, end)) <= EVEN_SPEED_SHARE:
            return begin, end
        raise InputError(
            f"{name} of the recorded setpoints is not driven at constant speed: parts of it take {100 * change:.2g} % "
            f"more or less time than the mean; allowed: {100 * EVEN_SPEED_SHARE:g} %. Take another turn, or the "
            "circle alone by "
            "'between'"
        )
    first, last = circle.steady or (math.inf, -math.inf)
    slack = 1e-9 * circle.turn_time
    if begin >= first + RUN_IN and end <= last + slack and circle.turns:
        return begin, end
    if number is None and last - circle.turn_time >= first + RUN_IN:
        return last - circle.turn_time, last
    if circle.steady is None:
        raise InputError(
            f"{name}: the circle is too short to reach its path speed, and no part of it is driven at constant speed; "
            "lower its feed, or give it more turns"
        )
    needed = math.ceil(len(circle.turns) + (RUN_IN + circle.turn_time - (last - first)) / circle.turn_time)
    enough = needed <= len(circle.turns)
    other = (
        "leave 'turn' out, and a full turn at constant speed is taken" if enough else f"give it turns: {max(needed, 3)}"
    )
    raise InputError(
        f"{name} (from {begin:.4g} to {end:.4g} s) is not driven at constant speed and {RUN_IN:g} s after that is "
        f"reached: the circle has its speed from {first:.4g} to {last:.4g} s; {other}"
    )


def _circle(item: CircleTest, chosen: tuple[Segment, ...], program: Program) -> Circular:
    """The last circle of the chosen segments, or else their last recorded setpoints taken as one."""
    circles = [s.geometry for s in chosen if s.kind == "circle" and isinstance(s.geometry, Circular)]
    if circles:
        return circles[-1]
    recorded = [s for s in chosen if isinstance(s.geometry, RecordedGeometry)]
    if not recorded:
        what = "the program has no circle" if item.motion is None else f"motions.{item.motion} is no circle"
        raise InputError(f"circularity: {what}")
    plane = item.plane or recorded[-1].geometry.axes  # type: ignore[union-attr]
    if len(plane) != 2:
        raise InputError(f"circularity: recorded setpoints of {', '.join(plane)}: say which two with plane: [X, Z]")
    return recorded_circle(program, recorded[-1], (plane[0], plane[1]), item.centre, item.radius)
