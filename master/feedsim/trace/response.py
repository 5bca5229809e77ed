"""A frequency response: complex functions of frequency with names, units and, where measured, coherence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feedsim import units as quantities
from feedsim.errors import InputError
from feedsim.trace.trace import check_name, check_unit, matching, suggest

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ROUNDING = 1e-9  # of a frequency: quotients of times carry it


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Functions over a common frequency axis.

    Attributes:
        frequency: (N,) [Hz], increasing, above 0.
        columns: name -> (N,) complex values. Names are output/input, such as "Z.n_a/Z.M_a".
        units: name -> unit, such as "(rad/s)/(N.m)"; "" where none is known.
        coherence: name -> (N,) from 0 to 1; only for what was measured.

    Arrays are copied and made read-only.

    Raises:
        InputError: lengths that differ, a frequency that is not above 0 or does not increase, a value that is not
            finite, a coherence outside 0 to 1, a name or unit that could not be written to a header and read back, a
            unit or coherence without its column.
    """

    frequency: Floats
    columns: Mapping[str, Complexes]
    units: Mapping[str, str] = field(default_factory=dict)
    coherence: Mapping[str, Floats] = field(default_factory=dict)

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
            if size and not (values.min() >= -ROUNDING and values.max() <= 1 + ROUNDING):
                row = int(np.argmax(np.maximum(values - 1, -values)))
                raise InputError(
                    f"coherence of {name!r} is {values[row]:.6g} at {frequency[row]:.6g} Hz; 0 to 1 is allowed"
                )
        units = {name: check_unit(self.units.get(name, "")) for name in columns}
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "units", MappingProxyType(units))
        object.__setattr__(self, "coherence", MappingProxyType(coherence))

    def __getitem__(self, name: str) -> Complexes:
        """Values of a column; InputError with a suggestion if there is none of that name."""
        try:
            return self.columns[name]
        except KeyError:
            raise InputError(f"no frequency response {name!r}{suggest(name, self.columns)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        """Number of frequencies."""
        return int(self.frequency.size)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)

    def unit(self, name: str) -> str:
        """Unit of a column; "" where none is known."""
        self[name]
        return self.units[name]

    def dB(self, name: str) -> Floats:
        """Magnitude in decibels, 20 lg of the value in its unit."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(np.abs(self[name])))

    def phase(self, name: str, *, unwrapped: bool = False) -> Floats:
        """Phase [deg], from -180 to 180, or continuous over the frequencies from there."""
        angle = np.angle(self[name])
        return np.degrees(np.unwrap(angle) if unwrapped else angle)

    def between(self, low: float, high: float) -> FrequencyResponse:
        """Rows with low <= frequency <= high [Hz], up to rounding."""
        first = int(np.searchsorted(self.frequency, low * (1 - ROUNDING), side="left"))
        return self._rows(np.arange(first, int(np.searchsorted(self.frequency, high * (1 + ROUNDING), side="right"))))

    def where(self, rows: NDArray[np.bool_]) -> FrequencyResponse:
        """Rows for which `rows` (N,) is true, such as those of high coherence."""
        return self._rows(np.flatnonzero(rows))

    def select(self, patterns: Iterable[str]) -> FrequencyResponse:
        """Columns whose name matches any of the glob patterns. InputError for a pattern that matches nothing."""
        kept = matching(self.columns, patterns)
        return FrequencyResponse(
            self.frequency,
            {name: self.columns[name] for name in kept},
            {name: self.units[name] for name in kept},
            {name: self.coherence[name] for name in kept if name in self.coherence},
        )

    def at(self, frequency: ArrayLike) -> FrequencyResponse:
        """On other frequencies [Hz] within the range: magnitude in dB and unwrapped phase linear over lg f.

        Raises:
            InputError: a frequency beyond the range, or a magnitude of 0, which has no decibels.
        """
        wanted = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        if not len(self):
            raise InputError("a frequency response without frequencies cannot be interpolated")
        low, high = self.frequency[0], self.frequency[-1]
        outside = ~((wanted >= low * (1 - ROUNDING)) & (wanted <= high * (1 + ROUNDING)))
        if outside.any():
            raise InputError(
                f"{wanted[outside][0]:.6g} Hz is outside the frequency response, which has {low:.6g} to {high:.6g} Hz"
            )
        x, known = np.log(wanted), np.log(self.frequency)
        columns = {}
        for name, values in self.columns.items():
            if not np.all(values):
                at = self.frequency[np.flatnonzero(values == 0)[0]]
                raise InputError(f"frequency response {name!r} is 0 at {at:.6g} Hz and cannot be interpolated")
            logarithm = np.log(np.abs(values)) + 1j * np.unwrap(np.angle(values))
            columns[name] = np.exp(np.interp(x, known, logarithm))
        coherence = {name: np.interp(x, known, values) for name, values in self.coherence.items()}
        return FrequencyResponse(wanted, columns, self.units, coherence)

    def converted(self, units: Mapping[str, str]) -> FrequencyResponse:
        """With the columns named in `units` in that unit.

        Raises:
            InputError: no such column, one without a known unit, or a unit of another dimension.
        """
        columns = dict(self.columns)
        for name, wanted in units.items():
            if not (given := self.unit(name)):
                raise InputError(f"frequency response {name!r} has no unit; it cannot be converted to {wanted}")
            try:
                columns[name] = self[name] * float(quantities.factor(given, wanted))
            except InputError as error:
                raise InputError(f"frequency response {name!r}: {error}") from None
        return FrequencyResponse(self.frequency, columns, {**self.units, **units}, self.coherence)

    def renamed(self, names: Mapping[str, str]) -> FrequencyResponse:
        """With the columns named in `names` (old name -> new name) called anew. InputError: no such column."""
        for name in names:
            self[name]
        if double := sorted({new for new in names.values() if (set(self.columns) - set(names)) & {new}}):
            raise InputError(f"there is a frequency response {double[0]!r} already")
        return FrequencyResponse(
            self.frequency,
            {names.get(name, name): values for name, values in self.columns.items()},
            {names.get(name, name): unit for name, unit in self.units.items()},
            {names.get(name, name): values for name, values in self.coherence.items()},
        )

    def joined(self, other: FrequencyResponse) -> FrequencyResponse:
        """With the columns of `other`, whose frequencies must be the same. InputError: they are not, a name twice."""
        if self.frequency.shape != other.frequency.shape or not np.allclose(
            self.frequency, other.frequency, rtol=ROUNDING, atol=0
        ):
            raise InputError("frequency responses over different frequencies cannot be joined")
        if double := sorted(set(self.columns) & set(other.columns)):
            raise InputError(f"frequency response {double[0]!r} is in both of those to be joined")
        return FrequencyResponse(
            self.frequency,
            {**self.columns, **other.columns},
            {**self.units, **other.units},
            {**self.coherence, **other.coherence},
        )

    def _rows(self, rows: NDArray[np.intp]) -> FrequencyResponse:
        return FrequencyResponse(
            self.frequency[rows],
            {name: values[rows] for name, values in self.columns.items()},
            self.units,
            {name: values[rows] for name, values in self.coherence.items()},
        )


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
