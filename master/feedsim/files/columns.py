"""Mapping files: which columns of a recorded drive trace are what, in which unit and with which sign."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Field,
    PlainValidator,
    PrivateAttr,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)
from pydantic import model_validator as whole

from feedsim.files.checked import check_tree, read_checked, read_group
from feedsim.files.fields import AxisName, Model, Quantity, brief, fault
from feedsim.files.source import Place
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.foundation.units import spell_unit

# role -> units of the dimensions that its values may have, the usual one first
DIMENSIONS: dict[str, tuple[str, ...]] = {
    "time": ("s",),
    "position": ("m", "rad"),
    "speed": ("rad/s", "m/s"),
    "torque": ("N.m",),
    "current": ("A",),
    "force": ("N",),
    "load": ("N.m", "N"),
    "setpoint": ("m", "rad"),
    "deviation": ("m", "rad"),
    "speed_setpoint": ("rad/s", "m/s"),
    "feedforward": ("rad/s", "m/s"),
}
# The same of records of circles alone: angle and radius of a ballbar, or what its radius deviates by.
CIRCLE_DIMENSIONS: dict[str, tuple[str, ...]] = {"angle": ("rad",), "radius": ("m",), "radial_deviation": ("m",)}
DRIVING_SIGNALS = ("torque", "current", "force")


def resulting_unit(unit: str, factor_unit: str) -> units.Unit:
    """Unit of a column's values times the factor. InputError: not known."""
    plain = spell_unit(unit)
    return units.unit(plain if factor_unit == "1" else factor_unit if plain == "1" else f"({plain})*({factor_unit})")


def target_of(role: str, given: units.Unit) -> str:
    """SI unit that a role's values in unit `given` are converted to. InputError: it is no unit of that role."""
    known = (DIMENSIONS | CIRCLE_DIMENSIONS)[role]
    for target in known:
        if units.unit(target).dimension == given.dimension:
            return target
    kinds = " or ".join(units.article(units.unit(text).kind) for text in known)
    raise InputError(
        f"the values are {units.article(given.kind)}; {kinds} is expected here, in {' or '.join(known)} for example"
    )


def _check_unit(unit: str) -> str:
    try:
        units.unit(spell_unit(unit))
    except InputError as error:
        raise fault(str(error)) from None
    return unit


UnitText = Annotated[StrictStr, AfterValidator(_check_unit)]


class Factor(Model):
    """What a column is multiplied with: a number with a unit, or a number of the file; in short "35.15 N/V"."""

    value: StrictFloat | StrictInt | None = Field(default=None, description="The number")
    variable: StrictStr | None = Field(
        default=None, min_length=1, description="Variable of the file (MAT) that holds the number"
    )
    unit: UnitText = Field(default="1", description="Unit of the factor")

    @whole(mode="before")
    @classmethod
    def _in_short(cls, value: Any) -> Any:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return {"value": value}
        if not isinstance(value, str):
            return value
        match = re.fullmatch(rf"\s*({units.NUMBER})(.*)", value, re.DOTALL)
        if not match:
            raise fault(
                f"{value!r} is no factor; a number with a unit is expected, for example 35.15 N/V, or "
                "{variable: gtau, unit: N/V}"
            )
        return {"value": float(match[1]), "unit": match[2].strip() or "1"}

    @field_validator("variable")
    @classmethod
    def _one_of_both(cls, variable: str | None, info: ValidationInfo) -> str | None:
        if "value" in info.data and (variable is None) == (info.data["value"] is None):
            raise fault("a factor needs either 'value' or 'variable'")
        return variable

    @field_validator("value")
    @classmethod
    def _usable(cls, value: float | None) -> float | None:
        if value is not None and not 0 < abs(value) < 1e300:
            raise fault(f"{value} is outside the allowed range: any number but 0")
        return value

    model_config = Model.model_config | {"validate_default": True}


class Signal(Model):
    """A column of the trace."""

    column: StrictStr = Field(min_length=1, description="Name in the header without the unit, or variable of the file")
    unit: UnitText | None = Field(
        default=None, description="Unit of the column, where the header does not give it; increments for plain counts"
    )
    factor: Factor | None = Field(
        default=None, description="What the values are multiplied with, for example 35.15 N/V"
    )
    sign: Literal[1, -1] = Field(
        default=1, description="-1 where the column counts against the positive direction of the axis"
    )


class MotionSignal(Signal):
    """A column of motion, on the scale or on the motor."""

    at: Literal["scale", "motor"] | None = Field(
        default=None, description="Where it is measured; without it lengths are those of the scale, angles of the motor"
    )


class Clock(Model):
    """The time: a column, or the interval of a trace without one."""

    column: StrictStr | None = Field(default=None, min_length=1, description="Name of the time's column")
    unit: UnitText | None = Field(default=None, description="Unit of the column, where the header does not give it")
    factor: Factor | None = Field(default=None, description="What a counter of cycles is multiplied with: 2 ms")
    interval: Annotated[float, Quantity("s", above=0, example="2 ms")] | None = Field(
        default=None, description="Time between rows, where the trace has no column of time"
    )


class Delay(Model):
    """Known delays between channels."""

    torque: Annotated[float, Quantity("s", minimum=-1, maximum=1, example="0.5 ms")] | None = Field(
        default=None,
        description="By how much torque or current is logged later than the motion (below 0: earlier, as a command "
        "that is held from its instant on); left out: to be estimated",
    )


class Columns(Model):
    """A mapping file."""

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the record's numbers are shown")
    axis: AxisName | None = Field(default=None, description="Axis that the trace is of")
    time: Clock = Field(default=Clock(column=None), description="Column of the time; without it found by its name")
    position: MotionSignal | None = Field(default=None, description="Measured position: a length, or the motor's angle")
    speed: MotionSignal | None = Field(default=None, description="Measured speed: the motor's, or of the slide")
    torque: Signal | None = Field(default=None, description="Motor torque")
    current: Signal | None = Field(default=None, description="Torque-generating current")
    force: Signal | None = Field(default=None, description="Driving force on the slide")
    load: Signal | None = Field(
        default=None, description="Known disturbance, force or torque, counted against the motor"
    )
    setpoint: MotionSignal | None = Field(default=None, description="Position setpoint")
    deviation: MotionSignal | None = Field(
        default=None, description="Following error as the control forms it: delayed position setpoint less position"
    )
    speed_setpoint: MotionSignal | None = Field(default=None, description="Speed setpoint of the position controller")
    feedforward: MotionSignal | None = Field(default=None, description="Speed feedforward of the control")
    angle: Signal | None = Field(default=None, description="Of a ballbar: angle from the first axis of the plane")
    radius: Signal | None = Field(default=None, description="Of a ballbar: distance from the centre")
    radial_deviation: Signal | None = Field(default=None, description="Of a ballbar: radius less the programmed one")
    pitch: Annotated[float, Quantity("m", minimum=1e-8, example="20 mm")] | None = Field(
        default=None, description="Travel per motor turn"
    )
    torque_constant: Annotated[float, Quantity("N.m/A", minimum=1e-9)] | None = Field(
        default=None, description="Torque per current, in the amplitude (peak or rms) that the current is logged in"
    )
    inertia: Annotated[float, Quantity("kg.m^2", above=0, example="0.015 kg.m^2")] | None = Field(
        default=None, description="All that the motor accelerates, as seen by the motor"
    )
    mass: Annotated[float, Quantity("kg", above=0)] | None = Field(
        default=None, description="In place of the inertia: all that is accelerated, as seen by the slide"
    )
    delay: Delay = Field(default=Delay(), description="Known delays between channels")

    _file: Path | None = PrivateAttr(default=None)
    _origins: dict[Place, str] = PrivateAttr(default_factory=dict)

    @property
    def file(self) -> Path | None:
        """The mapping file; None where it was made in Python."""
        return self._file

    def where(self, *place: str | int) -> str:
        """Where a key stands, for messages: "z.yaml:12: position"."""
        name = ".".join(str(key) for key in place)
        at = place
        while at not in self._origins and at:
            at = at[:-1]
        return f"{self._origins[at]}: {name}" if at in self._origins else f"mapping: {name}"

    def signal(self, role: str) -> Signal | None:
        """Column of a role of DIMENSIONS other than the time."""
        signal = getattr(self, role)
        assert signal is None or isinstance(signal, Signal)
        return signal


def load_columns(path: str | Path) -> Columns:
    """Read and check a mapping file. InputError lists every problem with file and line."""
    path = Path(path)
    source = read_group(path)
    columns = check_tree(source, Columns, path, contradictions)
    columns._file = path
    columns._origins = {place: mark.where for place, mark in source.marks.items()}
    return columns


def contradictions(columns: Columns) -> Iterator[tuple[Place, str]]:
    """Place and message of what cannot go together."""
    clock = columns.time
    if clock.interval is not None and (clock.column, clock.unit, clock.factor) != (None, None, None):
        yield ("time",), "'interval' is for traces without a column of time; give either the interval or the column"
    if clock.column is None and clock.factor is not None:
        yield ("time",), "'factor' needs the 'column' that it belongs to"
    given = [role for role in DRIVING_SIGNALS if columns.signal(role) is not None]
    for role in given[1:]:
        yield (role,), f"stands beside {given[0]}; one of the two is enough, and they could contradict one another"
    if columns.position is None and columns.speed is None and columns.angle is None:
        yield (), "missing: position or speed, for example position: {column: x, unit: mm}"
    if columns.mass is not None and columns.inertia is not None:
        yield ("mass",), "stands beside inertia; give one of the two"
    if columns.torque_constant is not None and columns.current is None and given:
        yield ("torque_constant",), f"is of no use: the trace's {given[0]} is taken, not a current"
    for role in DIMENSIONS | CIRCLE_DIMENSIONS:
        yield from _of_signal(role, clock if role == "time" else columns.signal(role))


def _of_signal(role: str, signal: Signal | Clock | None) -> Iterator[tuple[Place, str]]:
    """Unit and factor of a column, as far as they can be checked without the trace."""
    if signal is None or (signal.unit is None and signal.factor is None):
        return
    factor = "1" if signal.factor is None else signal.factor.unit
    if signal.unit is None:
        return  # the trace's header may give it
    try:
        given = resulting_unit(signal.unit, factor)
        target = target_of(role, given)
    except InputError as error:
        text = f"{signal.unit} times {factor}: " if signal.factor is not None else f"{signal.unit}: "
        hint = ""
        if units.unit(spell_unit(signal.unit)).dimension == units.unit("1").dimension:
            hint = (
                f"; give the factor of one unit, for example factor: 0.001 {(DIMENSIONS | CIRCLE_DIMENSIONS)[role][0]}"
            )
        yield (role, "unit"), f"{text}{error}{hint}"
        return
    if getattr(signal, "at", None) == "scale" and target.startswith("rad"):
        yield (role, "at"), "the values are angles, which are the motor's; a scale measures lengths"


# --- Tolerance files: how far a result may be from a reference, per variable in value and in time ---------------------


Time = Annotated[float, Quantity("s", minimum=0, example="1 ms")]
EXAMPLE = "2 nm, or 1e-3 for a thousandth of the reference's range"


def _amount(value: Any) -> tuple[float, str]:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise fault(f"{brief(value)} is no tolerance; write for example {EXAMPLE}")
    if not isinstance(value, str):
        number, unit = float(value) if abs(value) < 1e308 else inf, ""
    else:
        match = re.fullmatch(rf"\s*({units.NUMBER})\s*(.*)", value, re.DOTALL)
        if not match:
            raise fault(f"{value!r} is no tolerance; write for example {EXAMPLE}")
        number, unit = float(match[1]), match[2].strip()
        if unit == "%":
            number, unit = number / 100, ""
        try:
            units.unit(unit or "1")
        except InputError as error:
            raise fault(f"{value!r}: {error}") from None
    if not (isfinite(number) and number >= 0):
        raise fault(f"{value} is outside the allowed range: 0 or more")
    return number, unit


# A number (share of the range), or a number with any unit; becomes (value, unit), unit "" for a share.
_TEXT = {"type": "string", "pattern": rf"^\s*{units.NUMBER}", "examples": ["2 nm", "0.1 %"]}
_NUMBER = {"type": "number", "minimum": 0}
Amount = Annotated[tuple[float, str], PlainValidator(_amount), WithJsonSchema({"anyOf": [_NUMBER, _TEXT]})]


class VariableTolerance(Model):
    """Tolerance of the variables of a pattern; what is left out is that of an earlier pattern, else of the file."""

    value: Amount | None = Field(
        default=None, description="In value: 2 nm; a bare number is a share of the reference's range"
    )
    time: Time | None = Field(default=None, description="In time: 1 ms")
    hold: StrictBool | None = Field(
        default=None,
        description="Whether values hold between rows instead of running straight to the next; left out: where the "
        "reference is 0 and 1 alone",
    )
    ignore: Literal[True] | None = Field(default=None, description="Not compared at all")

    @whole(mode="before")
    @classmethod
    def _in_short(cls, value: Any) -> Any:
        if value == "ignore":
            return {"ignore": True}
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            return {"value": value}
        return value


class ToleranceFile(Model):
    """A tolerance file."""

    name: StrictStr = Field(default="", description="Name in reports")
    note: StrictStr = Field(default="", description="Why the tolerances are what they are")
    value: Amount | None = Field(
        default=None, description="In value, of all variables: a share of the reference's range"
    )
    time: Time | None = Field(default=None, description="In time, of all variables")
    variables: dict[StrictStr, VariableTolerance] = Field(
        default={}, description="Pattern of names (*.x_a) -> tolerance; later ones count more"
    )


def load_tolerances(path: str | Path) -> ToleranceFile:
    """Read and check a tolerance file. InputError lists every problem with file and line."""
    return read_checked(path, ToleranceFile)
