"""What fills the roles of drive and friction on an axis: the shipped unit with its parameters, or anybody's FMI 2.0
co-simulation unit, of which a machine file says which of its variables stand for which signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

from pydantic import (
    BeforeValidator,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    create_model,
    model_validator,
)

from feedsim.files.fields import File, Model, brief, fault
from feedsim.foundation.units import table

SHIPPED, FOREIGN, ANOTHER_LAW = "[shipped]", "[foreign]", "[law]"  # tags of unions, in brackets, being no keys
LUGRE = "lugre"  # the law of friction.fmu
GMS = "gms"  # generalised Maxwell slip, a friction law besides LuGre
FRICTION_UNITS = {GMS: "friction_gms"}  # law -> unit that has it
BOOLEAN = ""  # the unit of a signal that is true or false


@dataclass(frozen=True)
class Signal:
    """A variable that a role has on the side of the system, in SI units.

    needed: a unit without it cannot fill the role.
    """

    name: str
    unit: str
    text: str
    needed: bool = False


@dataclass(frozen=True)
class Role:
    """What a unit takes from the system and gives to it. The order of the outputs is that of the recorded columns.

    shipped: the archive that fills the role where nothing else is said. others: law -> shipped archive of that law.
    """

    name: str
    shipped: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    others: tuple[tuple[str, str], ...] = ()

    def archive_name(self, unit: Model) -> str:
        """The shipped archive that has the law of `unit`, without its ending."""
        return dict(self.others).get(getattr(unit, "law", ""), self.shipped)

    def shown(self, unit: Model) -> list[str]:
        """The outputs that a unit in this role shows: of the shipped one those that say something."""
        known = unit.variables if isinstance(unit, ForeignUnit) else self.signals
        left_out = getattr(unit, "not_shown", ())
        return [signal.name for signal in self.outputs if signal.name in known and signal.name not in left_out]

    @property
    def signals(self) -> dict[str, Signal]:
        return {signal.name: signal for signal in (*self.inputs, *self.outputs)}


def _role(name: str, shipped: str, *needed: str, others: Mapping[str, str] = MappingProxyType({})) -> Role:
    """A role with the signals that the table of the shipped unit declares, in its order."""
    known = {
        name: (
            variable.causality,
            Signal(name, variable.unit if variable.kind == "REAL" else BOOLEAN, variable.short, name in needed),
        )
        for name, variable in table(shipped).items()
    }
    inputs, outputs = (
        tuple(signal for causality, signal in known.values() if causality in wanted)
        for wanted in (("input",), ("output", "local"))
    )
    return Role(name, shipped, inputs, outputs, tuple(others.items()))


DRIVE = _role("drive", "controller", "x_s", "x_a", "M_a")
FRICTION_ROLE = _role("friction", "friction", "n_fr", "M_fr", others=FRICTION_UNITS)

VariableName = Annotated[StrictStr, Field(min_length=1)]


def _check_plain_value(value: Any) -> Any:
    if not isinstance(value, (bool, int, float, str)):
        raise fault(f"{brief(value)} is no value of a variable; a number, a text, true or false is expected")
    return value


ForeignValue = Annotated[StrictBool | StrictInt | StrictFloat | StrictStr, BeforeValidator(_check_plain_value)]


class ForeignUnit(Model):
    """Another maker's unit in a role."""

    TOLD_BY = "fmu"
    role: ClassVar[Role]
    shipped: ClassVar[type[Model]]

    fmu: File = Field(description="FMI 2.0 co-simulation archive, relative to this file")
    inputs: Model
    outputs: Model
    parameters: dict[VariableName, ForeignValue] = Field(
        default={},
        description="Start values by the names of the archive: numbers in the unit that it declares, or text with a "
        "unit, as '66.7 1/s'; also of inputs that no signal is given to",
    )

    @model_validator(mode="before")
    @classmethod
    def _one_or_the_other(cls, data: Any) -> Any:
        mixed = [key for key in data if key in cls.shipped.model_fields] if isinstance(data, Mapping) else []
        if mixed:
            raise fault(
                f"{mixed[0]!r} is a parameter of the shipped {cls.role.shipped}.fmu, which does not go together with "
                "'fmu'; parameters of another unit stand under 'parameters', by its own names",
                beside=(cls.role.name, mixed[0]),
            )
        return data

    @property
    def variables(self) -> dict[str, str]:
        """Signal of the role -> name of the variable that stands for it."""
        return {
            name: variable
            for group in (self.inputs, self.outputs)
            for name, variable in group.model_dump(by_alias=True).items()
            if variable is not None
        }


def signal_mapping(name: str, signals: tuple[Signal, ...]) -> Any:
    """A group of keys, one per signal, whose values are names of variables."""
    fields: dict[str, Any] = {
        f"{signal.name}_" if signal.name == "lambda" else signal.name: (
            (VariableName, Field(alias=signal.name, description=_describe_signal(signal)))
            if signal.needed
            else (VariableName | None, Field(default=None, alias=signal.name, description=_describe_signal(signal)))
        )
        for signal in signals
    }
    # A scenario is sent to other processes, where a class is looked up by its name.
    globals()[name] = create_model(name, __base__=Model, __module__=__name__, **fields)
    return globals()[name]


def _describe_signal(signal: Signal) -> str:
    unit = f" [{signal.unit}]" if signal.unit not in (BOOLEAN, "1") else ""
    return f"variable of the archive for: {signal.text}{unit}"


def role_unit_tag(data: Any) -> str:
    """Which of the two stands there, as the tag of a pydantic union; in brackets, being no key."""
    foreign = isinstance(data, ForeignUnit) or (isinstance(data, Mapping) and ForeignUnit.TOLD_BY in data)
    return FOREIGN if foreign else SHIPPED
