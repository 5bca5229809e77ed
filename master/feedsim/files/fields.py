"""Field types of the files that people write: quantities with units, axis names, files; the base of their models.

May use: variables, units, errors. Start reading at Quantity.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache, lru_cache
from math import inf, isfinite
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, ClassVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from feedsim.foundation import units
from feedsim.foundation.errors import InputError, find_nearest_name, no_such_file
from feedsim.foundation.units import Variable

# Studies check a scenario for every run, most of whose texts are those of the run before.
_parse_cached = lru_cache(maxsize=4096)(units.parse)

RESERVED_PREFIXES = ("time", "tool", "tcp", "pose")  # first parts of other column names


@dataclass(frozen=True)
class ReadingContext:
    """What a file's values are checked against while the models are built from text.

    Without it (models built in Python) bare numbers are SI values. None: not known, so not checked.
    """

    axes: tuple[str, ...] | None = None  # of the machine
    control_cycle: float | None = None  # T_c [s]
    position_cycle: float | None = None  # T_pos [s], where it is a multiple of the control cycle


def _without_examples(schema: dict[str, Any]) -> None:
    """Schemas say what docstrings say; their examples are for a Python prompt."""
    if description := schema.get("description"):
        schema["description"] = description.partition("\n\n>>> ")[0]


class Model(BaseModel):
    """Base of all scenario models: values that do not change, no unknown keys."""

    # Built on first use: most models are only read as part of another one, which needs no validator of theirs.
    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_default=False, defer_build=True, json_schema_extra=_without_examples
    )

    IN_FOLDER: ClassVar[str] = ""  # name of the file, where its folder may be named in its place
    TOLD_BY: ClassVar[str | None] = None  # the key that separates it from another model that may stand at its place
    BUT_FOR: ClassVar[tuple[str, ...]] = ()  # values of that key that stand for the other model all the same
    ELSEWHERE: ClassVar[dict[str, str]] = {}  # keys that are looked for here and belong elsewhere: how to write them


def fault(message: str, beside: tuple[str, ...] = ()) -> PydanticCustomError:
    """A validation error that carries its own wording; `beside`: what it is about, a key next to the one checked."""
    return PydanticCustomError("feedsim", "{message}", {"message": message, "beside": beside})


def no_axis(name: str, axes: Iterable[str]) -> str:
    """Message about a name that is none of the machine's `axes`."""
    same = [axis for axis in axes if axis.lower() == name.lower()]
    hint = f"did you mean {same[0]!r}?" if same else f"it has {', '.join(axes)}"
    return f"the machine has no axis {name!r}; {hint}"


def is_multiple(value: float, step: float) -> bool:
    """Whether value is 1, 2, 3 ... times step; both come from decimal text, so a relative 1e-9 is rounding."""
    ratio = value / step
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * ratio


@dataclass(frozen=True)
class Quantity:
    """Annotation of a float field that is written with a unit and kept in SI.

    unit      SI unit of the value in the object (dimensionless: "1", where a bare number is fine)
    minimum, maximum  closed range in that unit
    above     open lower limit
    example   shown in messages and editors; a usual one by default
    """

    unit: str
    minimum: float = -inf
    maximum: float = inf
    above: float = -inf
    example: str = ""

    @classmethod
    def of(cls, info: FieldInfo) -> Quantity | None:
        """What a field of a model holds, where it is a quantity."""
        return next((note for note in info.metadata if isinstance(note, cls)), None)

    def read(self, value: Any, *, text: bool = True) -> float:
        """`value` as SI number; PydanticCustomError with a message that a person can act on."""
        shown = self.example or units.example(self.unit)
        if isinstance(value, bool) or not isinstance(value, (str, int, float)):
            raise fault(f"{brief(value)} is no quantity; {units.article(self.kind)} is expected, for example {shown}")
        if isinstance(value, str):
            try:
                number = _parse_cached(value, self.unit, shown)
            except InputError as error:
                raise fault(str(error)) from None
        else:
            number = float(value) if abs(value) < 1e308 else inf
            if text and self.unit != "1":
                raise fault(f"{value} has no unit; {units.article(self.kind)} is expected, for example {shown}")
            if not isfinite(number):
                raise fault(f"{value} is no number to calculate with; {units.article(self.kind)} is expected")
        if not self.minimum <= number <= self.maximum or number <= self.above:
            raise fault(f"{value} is outside the allowed range: {self.range}")
        return number

    @property
    def kind(self) -> str:
        return units.unit(self.unit).kind

    @property
    def range(self) -> str:
        """The range in words: "at least 0 s", "from 0 to 1"."""
        low, high = units.show(self.minimum, self.unit), units.show(self.maximum, self.unit)
        if self.above > -inf:
            low = units.show(self.above, self.unit)
            return f"more than {low}" + (f", at most {high}" if self.maximum < inf else "")
        if self.maximum == inf:
            return f"at least {low}"
        return f"at most {high}" if self.minimum == -inf else f"from {low} to {high}"

    def json_schema(self) -> dict[str, Any]:
        """A number and known symbols; a symbol that stands alone must have the right dimension."""
        dimension = units.unit(self.unit).dimension
        symbols = sorted(_symbols(), key=len, reverse=True)
        refused = (
            rf"\s*{units.NUMBER}\s*(?:{'|'.join(symbol for symbol in symbols if _symbols()[symbol] != dimension)})\s*$"
        )
        if self.unit != "1":
            refused += rf"|\s*{units.NUMBER}\s*$"
        expression = rf"(?:{'|'.join(symbols)}|[-0-9 .*/^()·⋅²³+])*"
        shown = self.example or units.example(self.unit)
        pattern = rf"^(?!{refused})\s*{units.NUMBER}\s*{expression}\s*$"
        text: dict[str, Any] = {"type": "string", "pattern": pattern, "examples": [shown]}
        if self.unit != "1":
            return text
        number: dict[str, Any] = {"type": "number"}
        if self.minimum > -inf:
            number["minimum"] = self.minimum
        if self.maximum < inf:
            number["maximum"] = self.maximum
        return {"anyOf": [number, text], "examples": [shown]}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(value: Any, info: ValidationInfo) -> float:
            return self.read(value, text=isinstance(info.context, ReadingContext))

        schema: core_schema.CoreSchema = core_schema.with_info_plain_validator_function(
            validate, serialization=core_schema.plain_serializer_function_ser_schema(lambda value: value)
        )
        return core_schema.nullable_schema(schema) if NoneType in get_args(source) else schema

    def __get_pydantic_json_schema__(
        self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        inner: Any = core  # within what checks the field further
        while inner["type"] != "nullable" and "schema" in inner:
            inner = inner["schema"]
        own = self.json_schema()
        return {"anyOf": [own, {"type": "null"}]} if inner["type"] == "nullable" else own


def parameter(variable: Variable, default: Any = ..., *, example: str = "", text: str = "") -> Any:
    """A field for a parameter of a unit: unit, range and description are those of the unit's table.

    default: `...` for a key that must be given. example: shown in messages, the start value by default. text: another
    description, for what the table says of one of several groups.
    """
    checked = default is None  # by what depends on other keys; a number has no unit, being no text
    low, high = (bound if isfinite(bound) else None for bound in (variable.minimum, variable.maximum))
    bounds: dict[str, Any] = {"ge": low, "le": high} if variable.kind == "INTEGER" else {}
    field: Any = Field(default, description=text or variable.text, validate_default=checked, **bounds)
    if variable.kind == "REAL":
        shown = example or variable.example
        field.metadata.append(Quantity(variable.unit, variable.minimum, variable.maximum, example=shown))
    return field


@cache
def _symbols() -> dict[str, str]:
    """Symbol as a pattern -> its dimension."""
    return {symbol: units.unit(symbol).dimension for symbol in (*units.UNIT_SYMBOLS, *units.ALIASES)}


def _axis(value: Any, info: ValidationInfo) -> str:
    if not isinstance(value, str) or not re.fullmatch(_NAME_PATTERN, value) or value in RESERVED_PREFIXES:
        raise fault(
            f"{brief(value)} is no axis name: a letter, then letters, digits and _ (not {', '.join(RESERVED_PREFIXES)})"
        )
    if isinstance(info.context, ReadingContext) and info.context.axes is not None and value not in info.context.axes:
        raise fault(no_axis(value, info.context.axes))
    return value


_NAME_PATTERN = "[A-Za-z][A-Za-z0-9_]*"
_AXIS = {"type": "string", "pattern": f"^{_NAME_PATTERN}$", "description": "Axis of the machine."}
AxisName = Annotated[str, PlainValidator(_axis), WithJsonSchema(_AXIS)]


@dataclass(frozen=True)
class FileContent:
    """The bytes of a file, read once: who holds them sees no later change. Printed, it is the file's name.

    Attributes:
        file: name that messages call it by; it need not be on any disk.
        content: None: there is no such file.
    """

    file: Path
    content: bytes | None = field(repr=False)

    def __str__(self) -> str:
        return str(self.file)

    @property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return hashlib.sha256(self.content or b"").hexdigest()

    @classmethod
    def read(cls, file: Path) -> FileContent:
        """The content of a file. InputError: it is there, and cannot be read."""
        try:
            return cls(file, file.read_bytes())
        except FileNotFoundError:
            return cls(file, None)
        except OSError as error:
            raise InputError(f"{file}: cannot be read: {error.strerror or error}") from error


@dataclass(frozen=True)
class ExistingFile:
    """A file that is there. In a file's text the path is relative to that file. read: its content is the value."""

    read: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(value: Any, info: ValidationInfo) -> Path | FileContent:
            if self.read and isinstance(value, FileContent):
                return value
            if not isinstance(value, (str, Path)) or not str(value):
                raise fault(f"{brief(value)} is no file name")
            path = Path(value)
            if not path.is_file():
                other = " (it is a folder)" if path.is_dir() else " (it is a pipe or a device)" if path.exists() else ""
                raise fault(f"no such file: {value}{other}" if other else no_such_file(value))
            try:
                return FileContent.read(path) if self.read else path
            except InputError as error:
                raise fault(str(error)) from None

        return core_schema.with_info_plain_validator_function(
            validate, serialization=core_schema.plain_serializer_function_ser_schema(str)
        )

    def __get_pydantic_json_schema__(
        self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "minLength": 1}


File = Annotated[Path, ExistingFile()]
Content = Annotated[FileContent, ExistingFile(read=True)]


def brief(value: Any) -> str:
    """A value as a message shows it."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a group of keys"
    if isinstance(value, (list, tuple)):
        return "a list"
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def did_you_mean(word: str, known: list[str]) -> str:
    """'; did you mean ...?', else '; allowed: ...', as the tail of a message."""
    near = find_nearest_name(word, known)
    return f"; did you mean {near!r}?" if near else f"; allowed: {', '.join(known)}"
