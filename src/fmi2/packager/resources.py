"""Resources of a unit with axes: which axes the machine has and where they stand (axes.csv), and its modes (modes.csv).

The files go into the archive byte for byte; their hash is the second half of the GUID.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from packager.errors import InputError

AXES_HEADER = ("axis", "x_0 [m]")
_AXIS_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")  # the length is AXIS_NAME_SIZE of axes.h
DIRECTIONS = ("X", "Y", "Z")  # of the machine frame: ports of the tool force


@dataclass(frozen=True)
class Axis:
    """One axis of the machine; `x_0` is its position at the start [m], the pose the modes belong to."""

    name: str
    x_0: float


@dataclass(frozen=True)
class Resources:
    """Contents of the two files, and the axes they describe in their order."""

    axes_csv: bytes
    modes_csv: bytes
    axes: tuple[Axis, ...]

    def files(self) -> dict[str, bytes]:
        """Archive path -> content."""
        return {"resources/axes.csv": self.axes_csv, "resources/modes.csv": self.modes_csv}

    def hashed(self) -> bytes:
        """The bytes whose hash is the second half of the GUID."""
        return self.axes_csv + self.modes_csv


def modes_header(axes: Sequence[str]) -> tuple[str, ...]:
    """Columns of modes.csv for a machine with these axes; the file may have them in any order."""
    return (
        "mode",
        "frequency [Hz]",
        "damping ratio [1]",
        *(f"n_{axis}" for axis in axes),
        *(f"x_{axis}" for axis in axes),
        *(f"tcp_{direction}" for direction in DIRECTIONS),
    )


def read(axes_path: Path, modes_path: Path) -> Resources:
    """Read and check both files; raises InputError with all problems of the file at fault."""
    axes_csv = _bytes(axes_path)
    axes = _axes(axes_path, axes_csv)
    modes_csv = _bytes(modes_path)
    if problems := list(_check_modes(modes_csv, [axis.name for axis in axes], axes_path)):
        raise InputError(str(modes_path), problems)
    return Resources(axes_csv, modes_csv, axes)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def _rows(content: bytes) -> list[tuple[int, list[str]]]:
    """Line number and fields of every line that is not empty. No quoting: names and numbers need none."""
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    return [(i, [field.strip() for field in line.split(",")]) for i, line in enumerate(lines, 1) if line.strip()]


def _finite(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in text else None


def _axes(path: Path, content: bytes) -> tuple[Axis, ...]:
    rows = _rows(content)
    header = tuple(rows[0][1]) if rows else ()
    if header != AXES_HEADER:
        found = ",".join(header) or "(empty)"
        raise InputError(f"{path}: the header must read {','.join(AXES_HEADER)}, but reads {found}")
    axes: list[Axis] = []
    problems: list[str] = []
    for line, fields in rows[1:]:
        if len(fields) != len(AXES_HEADER):
            problems.append(f"line {line}: {len(fields)} fields, expected {len(AXES_HEADER)}")
            continue
        name, position = fields[0], _finite(fields[1])
        if not _AXIS_NAME.fullmatch(name):
            problems.append(
                f"line {line}: axis name '{name}' is not a letter followed by at most 30 letters, digits or _"
            )
        if name in (axis.name for axis in axes):
            problems.append(f"line {line}: axis {name} is already listed")
        if position is None:
            problems.append(f"line {line}: x_0 of axis {name} is '{fields[1]}', not a finite number")
        axes.append(Axis(name, position or 0.0))
    if not rows[1:]:
        problems.append("no axis is listed")
    if problems:
        raise InputError(str(path), problems)
    return tuple(axes)


def _check_modes(content: bytes, axes: Sequence[str], axes_path: Path) -> Iterator[str]:
    rows = _rows(content)
    expected = modes_header(axes)
    header = rows[0][1] if rows else []
    if not rows:
        yield "the file is empty"
        return
    missing = [name for name in expected if name not in header]
    unknown = [name for name in header if name not in expected]
    if missing:
        yield f"line {rows[0][0]}: missing columns {', '.join(missing)} (axes {', '.join(axes)} of {axes_path.name})"
    if unknown:
        yield f"line {rows[0][0]}: unknown columns {', '.join(unknown)} (axes {', '.join(axes)} of {axes_path.name})"
    doubled = sorted({name for name in header if header.count(name) > 1})
    if doubled:
        yield f"line {rows[0][0]}: columns that appear twice: {', '.join(doubled)}"
    if missing or unknown or doubled:
        return
    if not rows[1:]:
        yield "there is no mode"
    for line, fields in rows[1:]:
        if len(fields) != len(expected):
            yield f"line {line}: {len(fields)} fields, expected {len(expected)}"
            continue
        for name, text in zip(header, fields, strict=True):
            value = _finite(text)
            if value is None:
                yield f"line {line}: {name} is '{text}', not a finite number"
            elif value < 0 and name in expected[1:3]:
                yield f"line {line}: {name} is {text}, allowed is 0 or more"


def embedded_source(resources: Resources) -> bytes:
    """embedded_resources.c: the files as constants, for targets without a file system (embedded_resources.h)."""
    return "".join(
        (
            "/* Generated by the packager: the files under resources/, for targets that have no files. */\n",
            '#include "embedded_resources.h"\n',
            *(_constant(f"embedded_{Path(path).stem}", content) for path, content in resources.files().items()),
        )
    ).encode()


def _constant(name: str, content: bytes) -> str:
    lines = (", ".join(map(str, content[i : i + 24])) for i in range(0, len(content), 24))
    body = ",\n    ".join(lines)
    return f"\nconst unsigned char {name}[] = {{\n    {body}}};\nconst size_t {name}_size = sizeof {name};\n"
