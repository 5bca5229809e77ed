"""poses.bin of the plant: modes of a grid of poses, and the matrices that carry the state from one to the next.

8 bytes "FSPOSES1", then little-endian float64 alone, counts among them:

    number of axes (those of axes.csv); number of grid axes G; largest number of modes of a cell
    per grid axis: index of the axis; number of cells n; hysteresis [m]; n centres [m]; n - 1 boundaries [m]
    per cell, row-major with the last grid axis fastest: number of modes N, then N rows: frequency [Hz],
        damping ratio [1], n_A of all axes, tcp_X, tcp_Y, tcp_Z, x_A of all axes
    per grid axis, per cell that has an upper neighbour along it: T, rows x columns = upper x lower modes
"""

import math
import sys
from array import array
from collections.abc import Sequence
from dataclasses import dataclass

from .errors import InputError

MAGIC = b"FSPOSES1"
_SIZE = 8  # bytes of a number
TOOL_DIRECTIONS = 3

# T changes between bases that are orthonormal to some 1e-10 (eigensolver): rows and columns are no longer than 1.
_LONGEST = 1 + 1e-6


class _Fault(Exception):
    """What is wrong, without the file's name."""


@dataclass(frozen=True)
class GridAxis:
    """One direction of the grid."""

    name: str  # of the axis
    centres: Sequence[float]  # [m]

    @property
    def cells(self) -> int:
        return len(self.centres)


class _Reader:
    """Numbers one after the other; a fault names the byte."""

    def __init__(self, numbers: Sequence[float]) -> None:
        self.numbers = numbers
        self.at = 0

    def fault(self, at: int, text: str) -> _Fault:
        return _Fault(f"byte {len(MAGIC) + _SIZE * at}: {text}")

    def take(self, count: int, what: str) -> Sequence[float]:
        remaining = len(self.numbers) - self.at
        if count > remaining:
            raise self.fault(self.at, f"{what}: {count} numbers are needed, but the file ends after {remaining}")
        self.at += count
        return self.numbers[self.at - count : self.at]

    def count(self, what: str, least: int, most: int) -> int:
        number = self.take(1, what)[0]
        if not number.is_integer() or not least <= number <= most:
            raise self.fault(self.at - 1, f"{what} is {number:.9g}; allowed are whole numbers" + _between(least, most))
        return int(number)


def _between(least: int, most: int) -> str:
    return f" from {least} to {most}" if least < most else f": {least}"


def check(content: bytes, axes: Sequence[str], where: str) -> tuple[GridAxis, ...]:
    """Check the file's content for a machine with these axes; `where` names it. Returns the grid.

    Raises:
        InputError: names the first fault and its byte; what follows a fault cannot be distinguished.
    """
    try:
        return _check(_Reader(_numbers(content)), axes)
    except _Fault as fault:
        raise InputError(f"{where}: {fault}") from None


def _numbers(content: bytes) -> Sequence[float]:
    if not content.startswith(MAGIC):
        raise _Fault(f"does not begin with {MAGIC.decode()}: no grid of poses, or of another format")
    if len(content) % _SIZE:
        raise _Fault(f"has {len(content)} bytes, which is no multiple of {_SIZE}: it was cut off or altered")
    numbers = array("d")
    numbers.frombytes(content[len(MAGIC) :])
    if sys.byteorder == "big":
        numbers.byteswap()
    if not all(map(math.isfinite, numbers)):
        i = next(i for i, number in enumerate(numbers) if not math.isfinite(number))
        raise _Fault(f"byte {len(MAGIC) + _SIZE * i}: {numbers[i]} is no finite number")
    return numbers


def _check(reader: _Reader, axes: Sequence[str]) -> tuple[GridAxis, ...]:
    reader.count(f"number of axes (axes.csv has {', '.join(axes)})", len(axes), len(axes))
    directions = reader.count("number of grid axes", 1, len(axes))
    most_at = reader.at
    most = reader.count("largest number of modes of a cell", 1, len(reader.numbers))
    grid: list[GridAxis] = []
    for _ in range(directions):
        grid.append(_grid_axis(reader, axes, [axis.name for axis in grid]))
    cells = math.prod(axis.cells for axis in grid)
    if cells > len(reader.numbers):
        raise _Fault(f"the grid has {cells} cells, but the file has only {len(reader.numbers)} numbers")
    modes = [_cell(reader, axes, _place(grid, cell), most) for cell in range(cells)]
    if max(modes) != most:
        raise reader.fault(most_at, f"largest number of modes of a cell is said to be {most}, but is {max(modes)}")
    stride = cells
    for axis in grid:
        stride //= axis.cells
        for lower in range(cells):
            if lower // stride % axis.cells + 1 < axis.cells:
                upper = lower + stride
                _transfer(reader, modes[upper], modes[lower], f"transfer from {_place(grid, lower)} to cell {upper}")
    if remaining := len(reader.numbers) - reader.at:
        raise reader.fault(reader.at, f"{remaining} numbers too many; nothing may follow the last transfer")
    return tuple(grid)


def _grid_axis(reader: _Reader, axes: Sequence[str], taken: Sequence[str]) -> GridAxis:
    name = axes[reader.count("index of a grid axis", 0, len(axes) - 1)]
    if name in taken:
        raise reader.fault(reader.at - 1, f"axis {name} is in the grid twice")
    cells = reader.count(f"number of cells along {name}", 1, len(reader.numbers))
    hysteresis = reader.take(1, f"hysteresis along {name}")[0]
    if hysteresis < 0:
        raise reader.fault(reader.at - 1, f"hysteresis along {name} is {hysteresis:.9g} m, allowed is 0 or more")
    start = reader.at
    centres = reader.take(cells, f"centres along {name}")
    boundaries = reader.take(cells - 1, f"boundaries along {name}")
    for i in range(cells - 1):
        low, boundary, high = centres[i], boundaries[i], centres[i + 1]
        if not low < high:
            raise reader.fault(
                start + i + 1, f"centre {i + 1} along {name} is {high:.9g} m, allowed is more than {low:.9g} m"
            )
        if not low < boundary < high:
            raise reader.fault(
                start + cells + i,
                f"boundary {i} along {name} is {boundary:.9g} m, allowed is between its centres, {low:.9g} and "
                f"{high:.9g} m",
            )
    return GridAxis(name, centres)


def _place(grid: Sequence[GridAxis], cell: int) -> str:
    """ "cell 3 (X 0.1 m, Z 0.325 m)" """
    rest, parts = cell, []
    for axis in reversed(grid):
        rest, i = divmod(rest, axis.cells)
        parts.append(f"{axis.name} {axis.centres[i]:.9g} m")
    return f"cell {cell} ({', '.join(reversed(parts))})"


def _cell(reader: _Reader, axes: Sequence[str], place: str, most: int) -> int:
    """Check a cell; returns its number of modes."""
    count = reader.count(f"{place}: number of modes", 1, most)
    columns = [f"n_{axis}" for axis in axes] + [""] * TOOL_DIRECTIONS + [f"x_{axis}" for axis in axes]
    width = 2 + len(columns)
    start = reader.at
    values = reader.take(count * width, f"{place}: modes")
    for mode in range(count):
        frequency, damping = values[mode * width : mode * width + 2]
        for i, what, value in ((0, "frequency [Hz]", frequency), (1, "damping ratio [1]", damping)):
            if value < 0:
                raise reader.fault(
                    start + mode * width + i, f"{place}, mode {mode}: {what} is {value:.9g}, allowed is 0 or more"
                )
        if frequency == 0 and damping > 0:
            raise reader.fault(
                start + mode * width + 1,
                f"{place}, mode {mode}: damping ratio {damping:.9g} at frequency 0 Hz; a rigid mode has none: 0",
            )
    for i, name in enumerate(columns, 2):
        if name and not any(values[i::width]):
            raise reader.fault(start + i, f"{place}: {name} is 0 in every mode: no mode moves that port")
    return count


def _transfer(reader: _Reader, rows: int, columns: int, what: str) -> None:
    start = reader.at
    t = reader.take(rows * columns, what)
    lines = [("row", i, t[i * columns : (i + 1) * columns]) for i in range(rows)]
    lines += [("column", j, t[j::columns]) for j in range(columns)]
    for kind, i, line in lines:
        if (length := math.hypot(*line)) > _LONGEST:
            raise reader.fault(
                start + (i * columns if kind == "row" else i),
                f"{what}: {kind} {i} has the length {length:.9g}; a change between orthonormal bases has 1 at most",
            )
