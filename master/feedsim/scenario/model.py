"""A scenario: a machine, its motions, how the units are coupled, what is recorded and what is evaluated."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PrivateAttr,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from pydantic_core import core_schema

from feedsim.files.fields import AxisName, Model, Quantity, ReadingContext, did_you_mean, fault, is_multiple, no_axis
from feedsim.files.source import Place
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.motions import Circle, MeasuredSetpoints, Motion, PartProgram, PositioningCycle
from feedsim.scenario.loads import Load, MotionIndex
from feedsim.scenario.machine import Machine
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE

# --- How plant and friction are exchanged within a control cycle: the schemes, and what a scenario says of it ---------
# The schemes are rows of src/machine_fmu/cycle.h, which says what their columns mean; feedsim.simulation.cosim.schedule
# makes operations of them.


@dataclass(frozen=True)
class Scheme:
    """How the units see each other within a step."""

    number: int
    name: str
    stable_share: float
    speed: str
    torque_ramp: bool
    friction_ramp: bool
    passes: int
    friction_first: bool

    @property
    def speed_ramp(self) -> bool:
        """Whether friction is given the slope of its speed."""
        return self.speed in ("within", "extrapolated")


SCHEMES = {scheme.name: scheme for scheme in (Scheme(*row) for row in units.cycle()["SCHEMES"])}


MOST_STEPS = 1000  # in a control cycle
# By how much [rad] a motor behind a contact swings on in an exchange step, about. Friction follows it from step to
# step: the axes of the default machine stay within 2 nm of steps without end, with play and its impacts.
SWING_IN_STEP = 0.037


class Coupling(Model):
    """How plant and friction are exchanged."""

    scheme: Literal[tuple(SCHEMES)] = Field(  # type: ignore[valid-type]
        default="extrapolated", description="Order of the units and use of input slopes within an exchange step"
    )
    substeps: Annotated[StrictInt, Field(ge=1, le=MOST_STEPS)] = Field(
        default=1,
        description="Exchange steps of plant and friction per control cycle; where it is not given, more with a stiff "
        "transmission",
    )
    call_limit: Annotated[float, Quantity("s", above=0, example="60 s")] = Field(
        default=60.0, description="Time after which a call of another maker's unit is ended"
    )
    units: Literal["separate", "one"] = Field(
        default="separate",
        description="Structure, drives and friction as units of their own, or as one unit (machine.fmu), same results",
    )

    def steps(self, machine: Machine) -> int:
        """Exchange steps in a control cycle: `substeps` where it is given, else one, or what stiff contacts with play
        need.

        A motor of inertia J [kg.m2] behind a contact of stiffness k [N/m] swings with I_P sqrt(k/J) [rad/s]. One unit
        that is run (`units: one`) takes one step; other makers' units have steps of their own.
        """
        if "substeps" in self.model_fields_set or self.units == "one" or machine.foreign_units:
            return self.substeps
        contacts = ((axis.I_P, axis.transmission) for axis in machine.axes.values() if axis.transmission is not None)
        swings = (I_P * math.sqrt(contact.stiffness / contact.inertia) for I_P, contact in contacts if contact.play > 0)
        swing = max(swings, default=0.0) * machine.cycles.T_c
        return max(1, min(round(swing / SWING_IN_STEP), MOST_STEPS))


# --- A scenario: a machine, its motions, how the units are coupled, what is recorded and what is evaluated ------------


# --- What an acceptance sheet needs besides the readings: limits, the uncertainty of the measurement, conditions ------


# Figures that a limit can be given for, by the kind of test.
OF_POSITIONING = ("A", "A_up", "A_down", "R", "R_up", "R_down", "B", "B_mean", "E", "E_up", "E_down", "M")
OF_CIRCLES = ("G", "G_b", "F_max", "F_min", "D")
Limit = Annotated[float, Quantity("m", above=0, example="10 um")]


class Sheet(Model):
    """An acceptance sheet: sheet.html for print, sheet.csv and, where it is asked for, sheet.xlsx."""

    limits: dict[StrictStr, Limit] = Field(default={}, description="Figure -> largest magnitude that passes")
    uncertainty: Annotated[float, Quantity("m", minimum=0, example="0.5 um")] = Field(
        default=0.0, description="Expanded uncertainty (k = 2) of the figures, by which a result must keep clear"
    )
    conditions: dict[StrictStr, StrictStr] = Field(
        default={}, description="Condition of the test -> what it was, such as instrument: laser interferometer"
    )
    xlsx: StrictBool = Field(default=False, description="Write sheet.xlsx too, a workbook of all sheets of the run")


def check_sheet(sheet: Sheet | None, known: tuple[str, ...]) -> Sheet | None:
    """The sheet, whose limits are of figures that its test has."""
    for name in sheet.limits if sheet is not None else ():
        if name not in known:
            raise fault(f"limits: no figure {name!r}{did_you_mean(name, [*known])}")
    return sheet


# --- What a log of the drive holds, as a control records it: signals, rate, noise, resolution, delays; all in SI ------


Signal = Literal[
    "x_s", "n_ffw", "x_a", "n_a", "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q",
    "torque_limited", "voltage_limited", "M_fr", "z", "c", "k", "lambda",
]  # fmt: skip


def interval_fault(interval: float, control_cycle: float) -> str | None:
    """Why a recording interval [s] does not fit the control cycle [s]; None if it does."""
    if is_multiple(interval, control_cycle):
        return None
    return f"{interval:.9g} s is no whole multiple of the control cycle, {control_cycle:.9g} s"


def on_the_grid(interval: float, info: ValidationInfo) -> float:
    """A recording interval [s] of a file that is read, checked against its control cycle as far as that is known."""
    cycle = info.context.control_cycle if isinstance(info.context, ReadingContext) else None
    if cycle and (message := interval_fault(interval, cycle)):
        raise fault(message)
    return interval


@dataclass(frozen=True)
class Level:
    """Standard deviation of white noise: a value in the signal's SI unit, or a share of the signal's RMS."""

    value: float
    relative: bool = False


@dataclass(frozen=True)
class _Level:
    """Annotation of a Level: a quantity in ``unit``, or a share in percent; models built in Python may give a Level.

    share: whether a share makes sense. The RMS of a position depends on where the axis is.
    """

    unit: str
    share: bool = True

    def read(self, value: Any, *, text: bool) -> Level:
        if isinstance(value, Level):
            if not 0 <= value.value < float("inf"):
                raise fault(f"a noise of {value.value}: at least 0 and finite")
            return value
        if self.share and isinstance(value, str) and value.strip().endswith(("%", "percent")):
            try:
                share = units.parse(value, units.DIMENSIONLESS, "5 %")
            except InputError as error:
                raise fault(str(error)) from None
            if share < 0:
                raise fault(f"{value.strip()} is outside the allowed range: at least 0 %")
            return Level(share, relative=True)
        return Level(Quantity(self.unit, minimum=0).read(value, text=text))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(value: Any, info: ValidationInfo) -> Level:
            return self.read(value, text=isinstance(info.context, ReadingContext))

        return core_schema.with_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(
        self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        absolute = Quantity(self.unit).json_schema()
        share = {"type": "string", "pattern": rf"^\s*{units.NUMBER}\s*(?:%|percent)\s*$", "examples": ["5 %"]}
        return {"anyOf": [share, absolute]} if self.share else absolute


class _PerSignal(Model):
    """A value for some of the signals that a drive can measure."""

    def given(self) -> dict[str, Any]:
        """Signal -> value, of those that have one."""
        return {name: getattr(self, name) for name in type(self).model_fields if getattr(self, name) is not None}


_MEASURED_SIGNALS = (
    "x_s", "n_ffw", "x_a", "n_a", "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q", "M_fr",
)  # fmt: skip
_RESOLUTIONS = {"m": "1 nm", "rad/s": "0.001 rad/s", "N.m": "0.01 N.m", "A": "1 mA", "V": "0.1 V"}  # examples


def _per_signal(name: str, text: str, value: Callable[[str, str], tuple[Any, str]]) -> Any:
    """A group with a key per measured signal; `value`: signal and its unit -> what the key takes, its description."""
    units_of = {name: signal.unit for role in (DRIVE, FRICTION_ROLE) for name, signal in role.signals.items()}
    result = {signal: value(signal, units_of[signal]) for signal in _MEASURED_SIGNALS}
    fields: Any = {name: (kind | None, Field(default=None, description=said)) for name, (kind, said) in result.items()}
    return create_model(name, __base__=_PerSignal, __module__=__name__, __doc__=text, **fields)


def _noise(signal: str, unit: str) -> tuple[Any, str]:
    text = "Standard deviation of white noise"
    if signal in ("x_s", "x_a"):
        return Annotated[Level, _Level(unit, share=False)], text
    return Annotated[Level, _Level(unit)], f"{text}: absolute, or a share of the signal's RMS while the axis moves"


def _step(signal: str, unit: str) -> tuple[Any, str]:
    return Annotated[float, Quantity(unit, above=0, example=_RESOLUTIONS[unit])], "Resolution"


def _delay(signal: str, unit: str) -> tuple[Any, str]:
    text = "Delay: what is logged at t is the signal at t less this"
    return Annotated[float, Quantity("s", minimum=0, example="0.5 ms")], text


if TYPE_CHECKING:
    Noise = _PerSignal
    Quantisation = _PerSignal
    Delay = _PerSignal
else:
    Noise = _per_signal("Noise", "White Gaussian noise of each signal.", _noise)
    Quantisation = _per_signal("Quantisation", "Step to whose multiples each signal is rounded.", _step)
    Delay = _per_signal("Delay", "Delay of each signal, not necessarily a multiple of any cycle.", _delay)


class Logging(Model):
    """A log as a control records it, log.csv: sampled at instants, delayed, disturbed and rounded, in this order."""

    interval: Annotated[float, Quantity("s", minimum=1e-6, example="2 ms"), AfterValidator(on_the_grid)] = Field(
        default=2e-3, description="Time between rows, a whole multiple of the control cycle"
    )
    axes: Annotated[tuple[AxisName, ...], Field(min_length=1)] | None = Field(
        default=None, description="Axes (default: those that the motions move)"
    )
    signals: Annotated[tuple[Signal, ...], Field(min_length=1)] = Field(
        default=("x_s", "x_a", "n_a", "i_q"), description="Signals of every axis"
    )
    noise: Noise = Noise()
    quantisation: Quantisation = Quantisation()
    delay: Delay = Delay()
    seed: Annotated[StrictInt, Field(ge=0, le=2**63 - 1)] = Field(default=1, description="Of the noise")

    @model_validator(mode="after")
    def _check_entries_once(self) -> Self:
        for name in ("axes", "signals"):
            entries = getattr(self, name) or ()
            if twice := [entry for i, entry in enumerate(entries) if entry in entries[:i]]:
                raise fault(f"{name}: {twice[0]} twice; once is enough")
        return self

    def disturbed(self) -> dict[str, tuple[str, ...]]:
        """Group of settings -> signals that it names."""
        return {group: tuple(getattr(self, group).given()) for group in ("noise", "quantisation", "delay")}


MOST_MOTIONS = 10_000  # of a scenario; a longer program is recorded setpoints


class Recording(Model):
    """What goes into result.csv."""

    interval: Annotated[float, Quantity("s", minimum=1e-6, example="1 ms"), AfterValidator(on_the_grid)] = Field(
        description="Time between rows, a whole multiple of the control cycle (default: the position cycle)"
    )
    variables: Annotated[tuple[Annotated[StrictStr, Field(min_length=1)], ...], Field(min_length=1)] | None = Field(
        default=None, description='Names or patterns such as "Z.*" (default: everything)'
    )


class Positioning(Model):
    """Overshoot, settling time, ringing and rest torque of an axis after a motion."""

    kind: Literal["positioning"] = "positioning"
    axis: AxisName
    band: Annotated[float, Quantity("m", above=0, example="1 um")] = Field(
        default=1e-6, description="Half width of the band about the target that counts as settled"
    )
    motion: MotionIndex | None = Field(
        default=None, description="Place of the motion in motions, from 0 (default: the last one that moves the axis)"
    )


class CircleTest(Model):
    """Circular deviations (ISO 230-4) and quadrant glitches of a circle, over one full turn."""

    kind: Literal["circle"] = "circle"
    turn: Annotated[StrictInt, Field(ge=1)] | None = Field(
        default=None, description="Turn evaluated, from 1 (default: the middle one, or the last at constant speed)"
    )
    motion: MotionIndex | None = Field(
        default=None, description="Place of the circle in motions, from 0 (default: the last circle)"
    )
    plane: tuple[AxisName, AxisName] | None = Field(
        default=None, description="Only for recorded setpoints: first and second axis (default: the recording's two)"
    )
    centre: dict[AxisName, Annotated[float, Quantity("m")]] | None = Field(
        default=None, description="Only for recorded setpoints: centre (default: fitted to the setpoints)"
    )
    radius: Annotated[float, Quantity("m", above=0, example="15 mm")] | None = Field(
        default=None, description="Only for recorded setpoints: radius (default: fitted to the setpoints)"
    )
    sheet: Sheet | None = Field(default=None, description="Write an acceptance sheet in the letters of ISO 230-4")

    @field_validator("sheet", mode="after")
    @classmethod
    def _sheet(cls, sheet: Sheet | None) -> Sheet | None:
        return check_sheet(sheet, OF_CIRCLES)


class PositioningAccuracy(Model):
    """Accuracy and repeatability of positioning (ISO 230-2) over a positioning cycle."""

    kind: Literal["positioning_accuracy"] = "positioning_accuracy"
    motion: MotionIndex | None = Field(
        default=None, description="Place of the cycle in motions, from 0 (default: the last positioning cycle)"
    )
    noise: Annotated[float, Quantity("m", minimum=0, example="0.1 um")] = Field(
        default=0.0, description="Standard deviation of the measuring system, drawn anew for every reading"
    )
    seed: Annotated[StrictInt, Field(ge=0)] = Field(default=0, description="Of that noise")
    sheet: Sheet | None = Field(default=None, description="Write an acceptance sheet in the letters of ISO 230-2")

    @field_validator("sheet", mode="after")
    @classmethod
    def _sheet(cls, sheet: Sheet | None) -> Sheet | None:
        return check_sheet(sheet, OF_POSITIONING)


class ContourTest(Model):
    """Distance of the axes and of the tool from the path of an NC program, block by block, and what makes it."""

    kind: Literal["contour"] = "contour"
    motion: MotionIndex | None = Field(
        default=None, description="Place of the program in motions, from 0 (default: the last program)"
    )


Evaluation = Annotated[Positioning | CircleTest | PositioningAccuracy | ContourTest, Field(discriminator="kind")]


class Scenario(Model):
    """Everything that a run needs, checked.

    >>> import feedsim as fs
    >>> scenario: fs.Scenario = fs.load("xz_circle.yaml")
    >>> scenario
    Scenario 'X-Z circle' on Test centre: 2 motions
    """

    def __repr__(self) -> str:
        return f"Scenario {self.name!r} on {self.machine.name}: {len(self.motions)} motions"

    __str__ = __repr__

    name: StrictStr = Field(description="Name in reports")
    note: StrictStr = Field(default="", description="Remark")
    machine: Machine = Field(description="Folder with a machine.yaml, a machine file, or the machine itself")
    motions: Annotated[tuple[Motion, ...], Field(min_length=1, max_length=MOST_MOTIONS)] = Field(
        description="What the machine does, in this order"
    )
    loads: tuple[Load, ...] = Field(default=(), description="Torques and forces that act on the axes and at the tool")
    coupling: Coupling = Coupling()
    recording: Recording
    logging: Logging | None = Field(default=None, description="A log as a control records it, log.csv")
    evaluate: tuple[Evaluation, ...] = Field(default=(), description="Figures to derive")

    _file: Path = PrivateAttr(default=Path("scenario.yaml"))
    _overrides: tuple[str, ...] = PrivateAttr(default=())
    # Where the values come from, as messages say it: "file:line" or "--set KEY=VALUE"; what was set from outside.
    _origins: Mapping[Place, str] = PrivateAttr(default={})
    _changes: tuple[tuple[Place, str], ...] = PrivateAttr(default=())
    _settings: tuple[str, ...] = PrivateAttr(default=())
    _files: tuple[tuple[str, Path], ...] = PrivateAttr(default=())

    @property
    def file(self) -> Path:
        """The scenario file."""
        return self._file

    @property
    def overrides(self) -> tuple[str, ...]:
        """What was changed from outside the file, as KEY=VALUE."""
        return self._overrides

    def at(self, *place: str | int) -> str:
        """A place as messages name it: "s.yaml:6: motions.0", with the changes inside it; without a file the key alone.

        >>> scenario.at("motions", 0)
        's.yaml:6, --set motions.0.feed=60 m/min: motions.0'
        """
        key = ".".join(map(str, place))
        known = next((place[:n] for n in range(len(place), -1, -1) if place[:n] in self._origins), None)
        if known is None:
            return key
        inside = [where for changed, where in self._changes if changed[: len(place)] == place]
        return f"{', '.join(dict.fromkeys([self._origins[known], *inside]))}: {key}"

    @property
    def settings(self) -> tuple[str, ...]:
        """The file's own `set` group, as KEY=VALUE."""
        return self._settings

    @property
    def files(self) -> tuple[tuple[str, Path], ...]:
        """YAML files that it was read from, each with the first key that it gives; "" for the scenario file."""
        return self._files

    @model_validator(mode="before")
    @classmethod
    def _record_position_cycles(cls, data: Any, info: ValidationInfo) -> Any:
        """The recording interval defaults to the machine's position cycle."""
        if not isinstance(data, dict):
            return data
        recording, machine = data.get("recording", {}), data.get("machine")
        interval: Any
        if isinstance(info.context, ReadingContext):
            # A cycle that cannot be read is reported where it stands; what is recorded does not matter then.
            interval = f"{info.context.position_cycle or info.context.control_cycle or 1.0!r} s"
        elif isinstance(machine, Machine):
            interval = machine.cycles.T_pos
        else:
            return data
        if isinstance(recording, dict) and "interval" not in recording:
            return {**data, "recording": {**recording, "interval": interval}}
        return data

    @model_validator(mode="after")
    def _no_contradictions(self, info: ValidationInfo) -> Self:
        # A file's contradictions are reported by load(), which knows their lines.
        if not isinstance(info.context, ReadingContext) and (
            result := [message for _, message in contradictions(self)]
        ):
            raise fault("; ".join(result))
        return self


def _plane_fault(item: CircleTest, columns: tuple[str, ...]) -> str | None:
    """Why recorded setpoints of the axes ``columns`` cannot be evaluated as a circle; None if they can."""
    plane = item.plane or columns
    if len(set(plane)) != 2:
        return f"setpoints of {', '.join(columns)} as a circle: plane must name two axes, for example plane: [X, Z]"
    if missing := [axis for axis in plane if axis not in columns]:
        return f"the recorded setpoints have no column for {missing[0]}; they have {', '.join(columns)}"
    if item.centre is not None and set(item.centre) != set(plane):
        return f"centre must give {plane[0]} and {plane[1]}, the axes of the plane"
    return None


def _logging_faults(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of what does not fit the log's own signals, the axes and the control cycle."""
    logging = scenario.logging
    if logging is None:
        return
    if message := interval_fault(logging.interval, scenario.machine.cycles.T_c):
        yield ("logging", "interval"), message
    for i, axis in enumerate(logging.axes or ()):
        if axis not in scenario.machine.axes:
            yield ("logging", "axes", i), no_axis(axis, scenario.machine.axes)
    if logging.axes is None and not any(motion.axes or not motion.names_axes for motion in scenario.motions):
        yield ("logging",), "no motion moves an axis; name the axes to be logged, for example axes: [Z]"
    for group, signals in logging.disturbed().items():
        for signal in signals:
            if signal not in logging.signals:
                yield ("logging", group, signal), f"{signal} is not logged; signals: {', '.join(logging.signals)}"


def _load_faults(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of what does not fit the axes and the motions."""
    for i, load in enumerate(scenario.loads):
        if load.kind != "tool" and load.axis not in scenario.machine.axes:
            yield ("loads", i, "axis"), no_axis(load.axis, scenario.machine.axes)
        if load.motor_torque is not None and load.axis_name not in scenario.machine.axes:
            yield ("loads", i, "motor_torque"), no_axis(load.axis_name, scenario.machine.axes)
        if load.motion is not None and (message := _motion_fault(scenario, load.motion)):
            yield ("loads", i, "motion"), message


def _motion_fault(scenario: Scenario, index: int) -> str | None:
    """Why there is no motion of that index; None where there is one."""
    known = len(scenario.motions)
    if index < known:
        return None
    there = f"0 to {known - 1}" if known > 1 else "0 only"
    return f"{index} is no entry of motions (entries: {there}, counted from 0)"


def contradictions(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Place and message of everything in a scenario that cannot go together."""
    machine = scenario.machine
    if message := interval_fault(scenario.recording.interval, machine.cycles.T_c):
        yield ("recording", "interval"), message
    yield from _logging_faults(scenario)
    yield from _load_faults(scenario)
    for i, motion in enumerate(scenario.motions):
        for axis in motion.axes:
            if axis not in machine.axes:
                yield ("motions", i), no_axis(axis, machine.axes)
    for i, item in enumerate(scenario.evaluate):
        chosen = item.motion
        if chosen is not None and (message := _motion_fault(scenario, chosen)):
            yield ("evaluate", i, "motion"), message
            continue
        motions = scenario.motions if chosen is None else scenario.motions[chosen : chosen + 1]
        if item.kind == "positioning":
            if not any(item.axis in motion.axes or not motion.names_axes for motion in motions):
                which = "no motion moves" if chosen is None else f"motions.{chosen} ({motions[0].kind}) does not move"
                yield ("evaluate", i), f"positioning of axis {item.axis}, which {which}"
            continue
        if item.kind == "positioning_accuracy":
            if not any(isinstance(motion, PositioningCycle) for motion in motions):
                which = "no motion is" if chosen is None else f"motions.{chosen} ({motions[0].kind}) is not"
                yield (
                    ("evaluate", i),
                    f"the accuracy of positioning is asked for, but {which} of kind positioning_cycle",
                )
            continue
        if item.kind == "contour":
            if not any(isinstance(motion, PartProgram) for motion in motions):
                which = "no motion is" if chosen is None else f"motions.{chosen} ({motions[0].kind}) is not"
                yield ("evaluate", i), f"a contour is to be evaluated, but {which} of kind program"
            continue
        circles = [motion for motion in motions if isinstance(motion, Circle)]
        recordings = [motion for motion in motions if isinstance(motion, MeasuredSetpoints)]
        if not circles and recordings:
            if message := _plane_fault(item, tuple(recordings[-1].columns)):
                yield ("evaluate", i), message
        elif not circles:
            which = "no motion is" if chosen is None else f"motions.{chosen} ({motions[0].kind}) is not"
            yield ("evaluate", i), f"a circle is to be evaluated, but {which} of kind circle"
        elif given := [name for name in ("plane", "centre", "radius") if getattr(item, name) is not None]:
            yield ("evaluate", i, given[0]), "only for recorded setpoints; a motion of kind circle has its own"
        elif item.turn is not None and item.turn > circles[-1].turns:
            turns = circles[-1].turns
            yield ("evaluate", i, "turn"), f"turn {item.turn} of a circle of {turns} turn{'s'[: turns != 1]}"
