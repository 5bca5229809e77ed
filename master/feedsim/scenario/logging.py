"""What a log of the drive holds, as a control records it: signals, rate, noise, resolution, delays; all in SI."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StrictInt,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import core_schema

from feedsim import units
from feedsim.errors import InputError
from feedsim.fields import AxisName, Model, Quantity, Reading, fault, is_multiple

Signal = Literal[
    "x_s", "n_ffw", "x_a", "n_a", "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q",
    "torque_limited", "voltage_limited", "M_fr", "z", "c", "k", "lambda",
]  # fmt: skip


def interval_fault(interval: float, control_cycle: float) -> str | None:
    """Why a recording interval [s] does not fit the control cycle [s]; None if it does."""
    if is_multiple(interval, control_cycle):
        return None
    return f"{interval:.9g} s is no whole multiple of the control cycle, {control_cycle:.9g} s"


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
            return self.read(value, text=isinstance(info.context, Reading))

        return core_schema.with_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(
        self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        absolute = Quantity(self.unit).json_schema()
        share = {"type": "string", "pattern": rf"^\s*{units.NUMBER}\s*(?:%|percent)\s*$", "examples": ["5 %"]}
        return {"anyOf": [share, absolute]} if self.share else absolute


_NOISE = "Standard deviation of white noise: absolute, or a share of the signal's RMS while the axis moves"
_PLACE = "Standard deviation of white noise"
_STEP = "Resolution"
_DELAY = "Delay: what is logged at t is the signal at t less this"
_Time = Annotated[float, Quantity("s", minimum=0, example="0.5 ms")] | None
_Metre = Annotated[float, Quantity("m", above=0, example="1 nm")] | None
_Speed = Annotated[float, Quantity("rad/s", above=0, example="0.001 rad/s")] | None
_Torque = Annotated[float, Quantity("N.m", above=0, example="0.01 N.m")] | None
_Ampere = Annotated[float, Quantity("A", above=0, example="1 mA")] | None
_Volt = Annotated[float, Quantity("V", above=0, example="0.1 V")] | None


class _PerSignal(Model):
    """A value for some of the signals that a drive can measure."""

    def given(self) -> dict[str, Any]:
        """Signal -> value, of those that have one."""
        return {name: getattr(self, name) for name in type(self).model_fields if getattr(self, name) is not None}


class Noise(_PerSignal):
    """White Gaussian noise of each signal."""

    x_s: Annotated[Level, _Level("m", share=False)] | None = Field(default=None, description=_PLACE)
    n_ffw: Annotated[Level, _Level("rad/s")] | None = Field(default=None, description=_NOISE)
    x_a: Annotated[Level, _Level("m", share=False)] | None = Field(default=None, description=_PLACE)
    n_a: Annotated[Level, _Level("rad/s")] | None = Field(default=None, description=_NOISE)
    M_a: Annotated[Level, _Level("N.m")] | None = Field(default=None, description=_NOISE)
    x_e: Annotated[Level, _Level("m")] | None = Field(default=None, description=_NOISE)
    n_s: Annotated[Level, _Level("rad/s")] | None = Field(default=None, description=_NOISE)
    n_ref: Annotated[Level, _Level("rad/s")] | None = Field(default=None, description=_NOISE)
    M_s: Annotated[Level, _Level("N.m")] | None = Field(default=None, description=_NOISE)
    i_d: Annotated[Level, _Level("A")] | None = Field(default=None, description=_NOISE)
    i_q: Annotated[Level, _Level("A")] | None = Field(default=None, description=_NOISE)
    u_d: Annotated[Level, _Level("V")] | None = Field(default=None, description=_NOISE)
    u_q: Annotated[Level, _Level("V")] | None = Field(default=None, description=_NOISE)
    M_fr: Annotated[Level, _Level("N.m")] | None = Field(default=None, description=_NOISE)


class Quantisation(_PerSignal):
    """Step to whose multiples each signal is rounded."""

    x_s: _Metre = Field(default=None, description=_STEP)
    n_ffw: _Speed = Field(default=None, description=_STEP)
    x_a: _Metre = Field(default=None, description=_STEP)
    n_a: _Speed = Field(default=None, description=_STEP)
    M_a: _Torque = Field(default=None, description=_STEP)
    x_e: _Metre = Field(default=None, description=_STEP)
    n_s: _Speed = Field(default=None, description=_STEP)
    n_ref: _Speed = Field(default=None, description=_STEP)
    M_s: _Torque = Field(default=None, description=_STEP)
    i_d: _Ampere = Field(default=None, description=_STEP)
    i_q: _Ampere = Field(default=None, description=_STEP)
    u_d: _Volt = Field(default=None, description=_STEP)
    u_q: _Volt = Field(default=None, description=_STEP)
    M_fr: _Torque = Field(default=None, description=_STEP)


class Delay(_PerSignal):
    """Delay of each signal, not necessarily a multiple of any cycle."""

    x_s: _Time = Field(default=None, description=_DELAY)
    n_ffw: _Time = Field(default=None, description=_DELAY)
    x_a: _Time = Field(default=None, description=_DELAY)
    n_a: _Time = Field(default=None, description=_DELAY)
    M_a: _Time = Field(default=None, description=_DELAY)
    x_e: _Time = Field(default=None, description=_DELAY)
    n_s: _Time = Field(default=None, description=_DELAY)
    n_ref: _Time = Field(default=None, description=_DELAY)
    M_s: _Time = Field(default=None, description=_DELAY)
    i_d: _Time = Field(default=None, description=_DELAY)
    i_q: _Time = Field(default=None, description=_DELAY)
    u_d: _Time = Field(default=None, description=_DELAY)
    u_q: _Time = Field(default=None, description=_DELAY)
    M_fr: _Time = Field(default=None, description=_DELAY)


class Logging(Model):
    """A log as a control records it, log.csv: sampled at instants, delayed, disturbed and rounded, in this order."""

    interval: Annotated[float, Quantity("s", minimum=1e-6, example="2 ms")] = Field(
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

    @field_validator("interval")
    @classmethod
    def _on_the_grid(cls, interval: float, info: ValidationInfo) -> float:
        cycle = info.context.control_cycle if isinstance(info.context, Reading) else None
        if cycle and (message := interval_fault(interval, cycle)):
            raise fault(message)
        return interval

    @model_validator(mode="after")
    def _once(self) -> Self:
        for name in ("axes", "signals"):
            entries = getattr(self, name) or ()
            if twice := [entry for i, entry in enumerate(entries) if entry in entries[:i]]:
                raise fault(f"{name}: {twice[0]} twice; once is enough")
        return self

    def disturbed(self) -> dict[str, tuple[str, ...]]:
        """Group of settings -> signals that it names."""
        return {group: tuple(getattr(self, group).given()) for group in ("noise", "quantisation", "delay")}
