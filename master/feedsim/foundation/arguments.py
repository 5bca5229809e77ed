"""Arguments of jobs: how messages spell them, and how values with units are read from them.

A job is called from Python, ``circle(..., radius="150 mm")``, and by a command, ``--radius "150 mm"``. A message about
a wrong argument spells it as the caller did. May use: units, errors. Start reading at spell_argument() and quantity().
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from feedsim.foundation.errors import InputError

T = TypeVar("T")
V = TypeVar("V")
Value = float | str  # a number in SI units, or a text with a unit
Band = str | tuple[float, float]  # lowest and highest frequency [Hz], or a text "1Hz..1000Hz"

_AS_OPTIONS = ContextVar("as_options", default=False)


@contextmanager
def as_options() -> Iterator[None]:
    """A block in which messages spell arguments as options: ``--fixed-value`` for ``fixed_value``."""
    before = _AS_OPTIONS.set(True)
    try:
        yield
    finally:
        _AS_OPTIONS.reset(before)


def spell_argument(name: str) -> str:
    """The argument as its caller writes it.

    >>> spell_argument("position_cycle")
    'position_cycle'
    """
    return f"--{name.replace('_', '-')}" if _AS_OPTIONS.get() else name


@dataclass(frozen=True, eq=False)
class Call:
    """A call of a job.

    Attributes:
        arguments: by their names, as they were given.
        typed: of a command and arguments that differ, the command line that takes the others along.
        units: argument -> unit of the numbers that it was read as.
    """

    arguments: Mapping[str, Any]
    typed: Callable[[Call, str, Mapping[str, Any]], str]
    units: dict[str, str] = field(default_factory=dict)


_CALL: ContextVar[Call | None] = ContextVar("call", default=None)


def call() -> Call | None:
    """The call of a job that is going on; None outside of jobs."""
    return _CALL.get()


@contextmanager
def call_context(of: Call | None) -> Iterator[None]:
    """A block that belongs to a call."""
    before = _CALL.set(of)
    try:
        yield
    finally:
        _CALL.reset(before)


@contextmanager
def prefix_argument_errors(name: str, value: object) -> Iterator[None]:
    """Put argument and value in front of the message of an InputError that the block raises: "--delay 3 kg: ..."."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{spell_argument(name)} {value}: {error}") from None


def quantity(name: str, value: Value, unit: str, example: str = "", *, positive: bool = False) -> float:
    """The value of an argument in `unit`; a number has that unit already. positive: above 0. Raises InputError."""
    if (present := call()) is not None:
        present.units[name] = unit
    with prefix_argument_errors(name, value):
        return amount(value, unit, example, positive=positive)


def amount(value: Value, unit: str, example: str = "", *, positive: bool = False) -> float:
    """As :func:`quantity`, of a value that is a part of an argument."""
    if isinstance(value, str):
        from feedsim.foundation import units

        number = units.parse(value, unit, example)
    else:
        number = float(value)
        if not math.isfinite(number):
            raise InputError(f"a finite number in {unit} is needed")
    if positive and number <= 0:
        raise InputError(f"more than zero is needed, e.g. {example}")
    return number


def parse_frequency_band(name: str, band: Band, lowest: str, highest: str) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] of an argument; lowest, highest: examples, with a unit. Raises InputError.

    >>> parse_frequency_band("band", "1Hz..1kHz", "1 Hz", "1000 Hz")
    (1.0, 1000.0)
    """
    if isinstance(band, str):
        first, dots, last = band.partition("..")
        if not dots:
            example = f"{lowest}..{highest}".replace(" ", "")
            raise InputError(f"{spell_argument(name)} {band}: LOW..HIGH is needed, such as {example}")
        return quantity(name, first, "Hz", lowest), quantity(name, last, "Hz", highest)
    low, high = band
    return quantity(name, low, "Hz", lowest), quantity(name, high, "Hz", highest)


def by_name(name: str, values: Mapping[str, V], read: Callable[[str, V], T]) -> dict[str, T]:
    """Key -> what `read` makes of key and value. Raises InputError, which names argument, key and value."""
    result: dict[str, T] = {}
    for key, value in values.items():
        with prefix_argument_errors(name, f"{key}={value}" if key else value):
            result[key] = read(key, value)
    return result


def lengths(name: str, values: Mapping[str, Value], example: str, *, positive: bool = False) -> dict[str, float]:
    """Axis -> length [m]. Raises InputError as :func:`by_name`."""
    if (present := call()) is not None:
        present.units[name] = "m"
    return by_name(name, values, lambda _, value: amount(value, "m", example, positive=positive))


Changes = Mapping[str, Any] | Sequence[str] | str | None


def settings(changes: Changes) -> list[str]:
    """Changes of a file as texts KEY=VALUE, which they are behind ``--set``; also of one text.

    >>> settings({"coupling.substeps": 2}), settings("coupling.substeps=2")
    (['coupling.substeps=2'], ['coupling.substeps=2'])
    """
    if changes is None:
        return []
    if isinstance(changes, str):
        return [changes]
    if not isinstance(changes, Mapping):
        return [*changes]
    return [f"{key}={_text(value)}" for key, value in changes.items()]


def _text(value: Any) -> str:
    return str(value) if isinstance(value, str | Path) else json.dumps(value, ensure_ascii=False)


Pairs = Mapping[str, V] | Sequence[str] | str | None  # name -> value, or texts NAME=VALUE


def pairs(
    name: str, given: Pairs[Any], needed: str = "NAME=VALUE is needed", *, common: bool = False
) -> dict[str, Any]:
    """Name -> value of an argument: of a mapping, or of texts NAME=VALUE, several with commas between them.

    needed: the form, for the message. common: a value without a name is allowed, and stands under "". Raises
    InputError: no such form, a name twice.

    >>> pairs("at", {"X": 0.8}), pairs("at", ["X=800mm", "Z=100mm"])
    ({'X': 0.8}, {'X': '800mm', 'Z': '100mm'})
    """
    if isinstance(given, Mapping):
        return {str(key): value for key, value in given.items()}
    result: dict[str, Any] = {}
    for text in [part for entry in ([given] if isinstance(given, str) else given or ()) for part in split_names(entry)]:
        key, equals, value = (part.strip() for part in text.partition("="))
        if common and not equals:
            key, value = "", text
        elif not (key and equals and value):
            raise InputError(f"{spell_argument(name)} {text}: {needed}")
        if key in result:
            raise InputError(f"{spell_argument(name)} {text}: {key or 'that of all axes'} is given twice")
        result[key] = value
    return result


def split_names(names: str | Sequence[str]) -> tuple[str, ...]:
    """Names of a list, of a text with commas, or of several such texts.

    >>> split_names("X, Z")
    ('X', 'Z')
    """
    # Commas within brackets are of a name, data(:,2).
    texts = [names] if isinstance(names, str) else names
    return tuple(part.strip() for text in texts for part in re.split(r",(?![^()]*\))", text) if part.strip())
