"""A frequency response: complex functions of frequency with names, units and, where measured, coherence."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim.files.trace.trace import Array, Columns, check_name, check_unit, match_names
from feedsim.foundation import units as quantities
from feedsim.foundation.errors import Finding, InputError

Complexes = NDArray[np.complex128]

STANDARD_GRAVITY = 9.80665  # m/s^2: the unit g of accelerometers
_GRAVITY = re.compile(r"(?<![A-Za-z])[gG](?:_?n|'s)?(?![A-Za-z_^0-9])")
FREQUENCY_ROUNDING = 1e-9  # of a frequency: quotients of times carry it


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Columns[Complexes]):
    """Functions over a common frequency axis.

    Attributes:
        frequency: (N,) [Hz], increasing, above 0.
        columns: name -> (N,) complex values. Names are output/input, such as "Z.n_a/Z.M_a".
        units: name -> unit, such as "(rad/s)/(N.m)"; "" where none is known.
        coherence: name -> (N,) from 0 to 1; only for what was measured.
        notes: what became of the values on their way from a file.

    Arrays are copied and made read-only.

    Raises:
        InputError: lengths that differ, a frequency that is not above 0 or does not increase, a value that is not
            finite, a coherence outside 0 to 1, a name or unit that could not be written to a header and read back, a
            unit or coherence without its column.
    """

    frequency: Array
    columns: Mapping[str, Complexes]
    units: Mapping[str, str] = field(default_factory=dict)
    coherence: Mapping[str, Array] = field(default_factory=dict)
    notes: tuple[Finding, ...] = ()
    kind = "frequency response"

    def __repr__(self) -> str:
        band = f"{self.frequency[0]:.4g} to {self.frequency[-1]:.4g} Hz" if len(self.frequency) else "no frequencies"
        return f"FrequencyResponse: {band}; {textwrap.shorten(', '.join(self), 80)}"

    def __post_init__(self) -> None:
        frequency = _frozen(self.frequency, np.float64, "frequency", None)
        if frequency.size and not frequency[0] > 0:
            raise InputError(f"frequency {frequency[0]:.9g} Hz: frequencies of a response are above 0")
        if (wrong := np.flatnonzero(np.diff(frequency) <= 0)).size:
            row = int(wrong[0]) + 1
            raise InputError(
                f"frequencies must increase: {frequency[row]:.9g} Hz follows {frequency[row - 1]:.9g} Hz at row {row} "
                "(counted from 0)"
            )
        size = frequency.size
        columns = {check_name(name): _frozen(v, np.complex128, name, size) for name, v in self.columns.items()}
        coherence = {name: _frozen(v, np.float64, f"coherence of {name}", size) for name, v in self.coherence.items()}
        for what, names in (("unit", self.units), ("coherence", coherence)):
            if unknown := sorted(set(names) - set(columns)):
                raise InputError(f"{what} given for {unknown[0]!r}, which is no column")
        for name, values in coherence.items():
            if size and not (values.min() >= -FREQUENCY_ROUNDING and values.max() <= 1 + FREQUENCY_ROUNDING):
                row = int(np.argmax(np.maximum(values - 1, -values)))
                raise InputError(
                    f"coherence of {name!r} is {values[row]:.6g} at {frequency[row]:.6g} Hz; 0 to 1 is allowed"
                )
        units = {name: check_unit(self.units.get(name, "")) for name in columns}
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "units", MappingProxyType(units))
        object.__setattr__(self, "coherence", MappingProxyType(coherence))

    def __len__(self) -> int:
        """Number of frequencies."""
        return int(self.frequency.size)

    def to_control(self, name: str) -> Any:
        """A response as `control.FRD` of python-control, over the angular frequency [rad/s]. Needs that package.

        As arrays a response is ``response.frequency`` [Hz] and ``response[name]``.
        """
        try:
            from control import FRD
        except ImportError:
            raise InputError("python-control is needed: pip install control") from None
        return FRD(np.asarray(self[name]), 2 * np.pi * np.asarray(self.frequency))

    def phase(self, name: str) -> Array:
        """Phase [deg], from -180 to 180."""
        return np.degrees(np.angle(self[name]))

    def select(self, patterns: Iterable[str]) -> FrequencyResponse:
        """Columns whose name matches any of the glob patterns. InputError for a pattern that matches nothing."""
        kept = match_names(self.columns, patterns)
        return FrequencyResponse(
            self.frequency,
            {name: self.columns[name] for name in kept},
            {name: self.units[name] for name in kept},
            {name: self.coherence[name] for name in kept if name in self.coherence},
            self.notes,
        )

    def converted(self, units: Mapping[str, str]) -> FrequencyResponse:
        """With the columns named in `units` in that unit, integrated or differentiated in time where that leads to it.

        An accelerance is divided by -(2 pi f)^2 to be a receptance, for example, and a dynamic stiffness is taken as
        its reciprocal; a note has it.

        Raises:
            InputError: no such column, one without a known unit, or a unit of another dimension.
        """
        columns, notes = dict(self.columns), list(self.notes)
        for name, wanted in units.items():
            if not (given := self.unit(name)):
                raise InputError(f"frequency response {name!r} has no unit; it cannot be converted to {wanted}")
            try:
                way = _way(given, wanted)
            except InputError as error:
                raise InputError(f"frequency response {name!r}: {error}") from None
            values = self[name]
            if way.reciprocal:
                if not np.all(values):
                    raise InputError(f"frequency response {name!r}, in {given}: has no reciprocal, as a value is 0")
                values = 1 / values
            columns[name] = values * way.factor / (2j * math.pi * self.frequency) ** way.order
            if words := way.words():
                text = f"{name} is in {given}: {words} to be in {wanted}"
                notes.append(Finding("response-converted", "note", text, name))
        return FrequencyResponse(self.frequency, columns, {**self.units, **units}, self.coherence, tuple(notes))


@dataclass(frozen=True)
class _Way:
    """From one unit of a response to another: reciprocal, factor, division by (j 2 pi f)^order. gravity: the unit g is
    that of an acceleration."""

    reciprocal: bool
    factor: float
    order: int
    gravity: bool

    def words(self) -> str:
        by = {1: "j 2 pi f", 2: "-(2 pi f)^2"}.get(abs(self.order))
        return ", ".join(
            text
            for text, is_so in (
                (f"g is taken as {STANDARD_GRAVITY} m/s^2", self.gravity),
                ("the reciprocal is taken", self.reciprocal),
                (f"{'divided' if self.order > 0 else 'multiplied'} by {by}", self.order),
            )
            if is_so
        )


def _way(given: str, wanted: str) -> _Way:
    """A plain number is converted to plain numbers alone. InputError: there is no way."""
    problems = []
    plain = quantities.unit(wanted).dimension == quantities.unit("1").dimension
    for gravity in (False, True):
        text = _GRAVITY.sub("(m/s^2)", given) if gravity else given
        for reciprocal in (False,) if plain else (False, True):
            for order in (0,) if plain else (0, 1, 2, -1, -2):
                per = f"(1/({text}))" if reciprocal else f"({text})"
                try:
                    factor = quantities.factor(f"{per}*s^{order}" if order else per, wanted)
                except InputError as error:
                    problems.append(error)
                    continue
                return _Way(reciprocal, float(factor) * (STANDARD_GRAVITY if gravity else 1), order, gravity)
    raise problems[0]


def without_zero(path: Path, frequency: Array) -> tuple[Finding, ...]:
    """The note on a first line at 0 Hz, which no response has; none where there is no such line."""
    note = Finding("zero-frequency-left-out", "note", f"{path}: the line at 0 Hz is left out", str(path))
    return (note,) if frequency.size and frequency[0] == 0 else ()


def quotient_unit(output: str, input: str) -> str:
    """Unit of a response, such as "(rad/s)/(N.m)"; "1" where both are the same, "" where one is not known."""
    if not output or not input:
        return ""
    if output == input:
        return "1"
    over, under = (f"({unit})" if any(c in unit for c in "./* ") else unit for unit in (output, input))
    return over if under == "1" else f"{over}/{under}"


def _frozen(values: ArrayLike, dtype: Any, name: str, size: int | None) -> NDArray[Any]:
    array = np.array(values, dtype=dtype)
    if array.ndim != 1:
        raise InputError(f"{name!r} must be one-dimensional, has shape {array.shape}")
    if size is not None and array.size != size:
        raise InputError(f"{name!r} has {array.size} values, there are {size} frequencies")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name!r} is not finite at row {int(np.argmin(np.isfinite(array)))} (counted from 0)")
    array.setflags(write=False)
    return array
