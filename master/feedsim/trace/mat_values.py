"""What a MAT file holds, whatever its version: numbers, texts, structures and cells, by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_INFLATED_BYTES = 2 << 30  # bytes that the variables of a file may inflate to,
RATIO = 100  # nor more than this many times the file's own size,
FREE = 256 << 20  # from so many bytes on
MAX_DEPTH = 50  # structures within structures
MAX_FIELDS = 100_000  # variables and fields
REAL = "fiu"  # kinds of numpy's types


@dataclass(frozen=True)
class Other:
    """What is neither numbers nor a structure of its own. `what`: in words; `opaque`: only MATLAB reads it."""

    what: str
    opaque: bool = False


# Text is an array of characters (kind U), several structures and cells are a list.
Value = NDArray[np.generic] | dict[str, "Value"] | list["Value"] | Other


class Fault(Exception):
    """What is wrong with a file, in words."""


def allowed_bytes(size: int) -> int:
    """What the variables of a file of `size` bytes may inflate to."""
    return min(MAX_INFLATED_BYTES, max(FREE, RATIO * size))


def characters(codes: NDArray[np.uint32]) -> NDArray[np.str_]:
    """Code points as characters; what is none is a blank."""
    allowed = (codes < 0xD800) | ((codes > 0xDFFF) & (codes <= 0x10FFFF))
    return np.where(allowed, codes, 0x20).astype("<u4").view("<U1")


def lines(value: object) -> list[str]:
    """Rows of a text, without the blanks behind them; none of what is no text."""
    if not isinstance(value, np.ndarray) or value.dtype.kind != "U" or value.ndim > 2:
        return []
    return ["".join(row.tolist()).replace("\0", "").rstrip() for row in np.atleast_2d(value)]


def flat(content: Mapping[str, Value]) -> Iterator[tuple[str, NDArray[np.generic] | Other]]:
    """Variables, those inside structures too, as MATLAB calls them: "structure.field", "signals(2).values". Numbers
    have no dimensions of length 1."""
    for name, value in content.items():
        yield from _parts(name, value)


def _parts(name: str, value: Value) -> Iterator[tuple[str, NDArray[np.generic] | Other]]:
    if isinstance(value, dict):
        for field, inner in value.items():
            yield from _parts(f"{name}.{field}", inner)
    elif isinstance(value, list):
        for number, inner in enumerate(value, 1):
            yield from _parts(f"{name}({number})" if isinstance(inner, dict) else f"{name}{{{number}}}", inner)
    else:
        yield name, value.squeeze() if isinstance(value, np.ndarray) and value.dtype.kind != "U" else value
