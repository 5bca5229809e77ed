"""What a log of the drive holds, as a control records it: signals, rate, noise, resolution, delays; all in SI."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StrictInt,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic_core import core_schema

from feedsim import units
from feedsim.errors import InputError
from feedsim.fields import AxisName, Model, Quantity, Reading, fault, is_multiple
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE

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
    cycle = info.context.control_cycle if isinstance(info.context, Reading) else None
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
            return self.read(value, text=isinstance(info.context, Reading))

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


_MEASURED = (
    "x_s", "n_ffw", "x_a", "n_a", "M_a", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q", "u_d", "u_q", "M_fr",
)  # fmt: skip
_RESOLUTIONS = {"m": "1 nm", "rad/s": "0.001 rad/s", "N.m": "0.01 N.m", "A": "1 mA", "V": "0.1 V"}  # examples


def _per_signal(name: str, text: str, value: Callable[[str, str], tuple[Any, str]]) -> Any:
    """A group with a key per measured signal; `value`: signal and its unit -> what the key takes, its description."""
    units_of = {name: signal.unit for role in (DRIVE, FRICTION_ROLE) for name, signal in role.signals.items()}
    result = {signal: value(signal, units_of[signal]) for signal in _MEASURED}
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
    def _once(self) -> Self:
        for name in ("axes", "signals"):
            entries = getattr(self, name) or ()
            if twice := [entry for i, entry in enumerate(entries) if entry in entries[:i]]:
                raise fault(f"{name}: {twice[0]} twice; once is enough")
        return self

    def disturbed(self) -> dict[str, tuple[str, ...]]:
        """Group of settings -> signals that it names."""
        return {group: tuple(getattr(self, group).given()) for group in ("noise", "quantisation", "delay")}
