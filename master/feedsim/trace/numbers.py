"""Cells of a CSV file -> numbers: decimal points or commas, never a guess between decimal and thousand."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from feedsim.errors import InputError
from feedsim.trace.trace import Array

Decimal = Literal[".", ","]

_PLAIN = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_PLAIN_COLUMN = re.compile(r"[0-9eE+\-.\n]*")
# Could mark thousands just as well as a decimal: 1,234 or 12,345, but not 0,125 or 1,25 or 1234,567.
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")


def decimal_mark(columns: Sequence[Sequence[str]], lines: Sequence[int], where: str) -> Decimal:
    """Decimal mark of all cells together. `lines` are the file's line numbers of the rows.

    InputError with the line: both marks occur, or every comma may stand for thousands as well.
    """
    unclear: tuple[int, str] | None = None
    comma: tuple[int, str] | None = None
    point: tuple[int, str] | None = None
    for column in columns:
        for line, cell in zip(lines, column, strict=True):
            if "," in cell:
                if "." in cell or cell.count(",") > 1:
                    raise InputError(f"{where}:{line}: {cell!r} marks thousands; write numbers without them")
                if not _THOUSANDS.fullmatch(cell):
                    comma = comma or (line, cell)
                else:
                    unclear = unclear or (line, cell)
            elif "." in cell:
                point = point or (line, cell)
    if point and (other := comma or unclear):
        first, second = sorted((point, other))
        raise InputError(
            f"{where}:{second[0]}: {second[1]!r}, but {first[1]!r} in line {first[0]}; decimal point and comma mixed"
        )
    if unclear and not comma:
        number = unclear[1]
        raise InputError(
            f"{where}:{unclear[0]}: {number!r} may mean {number.replace(',', '.')} or {number.replace(',', '')}, and "
            "no other number in the file tells which; write it with a decimal point"
        )
    return "," if comma else "."


def numbers(cells: Sequence[str], decimal: Decimal, lines: Sequence[int], where: str, name: str) -> Array:
    """Values of a column. InputError with line and column name: an empty cell, text, NaN or infinity."""
    plain = [cell.replace(",", ".") for cell in cells] if decimal == "," else list(cells)
    if _PLAIN_COLUMN.fullmatch("\n".join(plain)):
        try:
            values = np.array(plain, dtype=np.float64)
        except ValueError:
            pass
        else:
            if np.all(np.isfinite(values)):
                return values
    for line, cell, text in zip(lines, cells, plain, strict=True):
        if not cell:
            raise InputError(f"{where}:{line}: no value in column {name!r}")
        if cell.lower().lstrip("+-") in ("nan", "inf", "infinity", "#n/a", "n/a", "null", "none"):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r}; every value must be a finite number")
        if not _PLAIN.fullmatch(text):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r} is no number")
        if not np.isfinite(float(text)):
            raise InputError(f"{where}:{line}: {cell!r} in column {name!r} is too large")
    return np.array([float(text) for text in plain], dtype=np.float64)
