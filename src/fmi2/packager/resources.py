"""Resources of a unit with axes: which axes the machine has and where they stand (axes.csv), its modes (modes.csv), and
where the plant shall follow its axes the modes of a grid of poses (poses.bin).

The files go into the archive byte for byte; their hash is the second half of the GUID.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import poses
from .errors import InputError

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
    """Contents of the files, and the axes they describe in their order."""

    axes_csv: bytes
    modes_csv: bytes
    poses_bin: bytes | None  # None: the machine stays in one pose
    axes: tuple[Axis, ...]

    def files(self) -> dict[str, bytes]:
        """Archive path -> content, in the order in which they are hashed."""
        found = {"resources/axes.csv": self.axes_csv, "resources/modes.csv": self.modes_csv}
        return found if self.poses_bin is None else found | {"resources/poses.bin": self.poses_bin}

    def hashed(self) -> bytes:
        """The bytes whose hash is the second half of the GUID."""
        return b"".join(self.files().values())


@dataclass(frozen=True)
class File:
    """Content of a file, with the name that messages call it by."""

    name: str
    content: bytes

    @classmethod
    def at(cls, path: Path) -> "File":
        """Read `path`; raises InputError."""
        try:
            return cls(str(path), path.read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def axes_csv(pose: Mapping[str, float]) -> bytes:
    """axes.csv of a machine whose axes stand at these positions [m], in their order."""
    lines = (",".join(AXES_HEADER), *(f"{name},{float(position)!r}" for name, position in pose.items()))
    return "".join(f"{line}\n" for line in lines).encode()


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


def read(axes_path: Path, modes_path: Path, poses_path: Path | None = None) -> Resources:
    """Read and check the files; raises InputError with all problems of the file at fault."""
    return check(File.at(axes_path), File.at(modes_path), File.at(poses_path) if poses_path else None)


def check(axes: File, modes: File, grid: File | None = None) -> Resources:
    """The resources that these contents make; raises InputError with all problems of the file at fault."""
    found = _axes(axes)
    names = [axis.name for axis in found]
    if problems := list(_check_modes(modes.content, names, Path(axes.name).name)):
        raise InputError(modes.name, problems)
    if grid is not None:
        poses.check(grid.content, names, grid.name)
    return Resources(axes.content, modes.content, grid.content if grid is not None else None, found)


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


def _axes(file: File) -> tuple[Axis, ...]:
    rows = _rows(file.content)
    header = tuple(rows[0][1]) if rows else ()
    if header != AXES_HEADER:
        found = ",".join(header) or "(empty)"
        raise InputError(f"{file.name}: the header must read {','.join(AXES_HEADER)}, but reads {found}")
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
        raise InputError(file.name, problems)
    return tuple(axes)


def _check_modes(content: bytes, axes: Sequence[str], axes_file: str) -> Iterator[str]:
    rows = _rows(content)
    expected = modes_header(axes)
    header = rows[0][1] if rows else []
    if not rows:
        yield "the file is empty"
        return
    missing = [name for name in expected if name not in header]
    unknown = [name for name in header if name not in expected]
    if missing:
        yield f"line {rows[0][0]}: missing columns {', '.join(missing)} (axes {', '.join(axes)} of {axes_file})"
    if unknown:
        yield f"line {rows[0][0]}: unknown columns {', '.join(unknown)} (axes {', '.join(axes)} of {axes_file})"
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
    yield from _check_physics(header, rows[1:])


def _check_physics(header: Sequence[str], rows: Sequence[tuple[int, Sequence[str]]]) -> Iterator[str]:
    """What the unit refuses in a table of sound numbers: damped rigid modes, rotors and scales that nothing moves."""
    columns: dict[str, list[float]] = {name: [] for name in header}
    for line, fields in rows:
        values = [_finite(text) for text in fields]
        if len(fields) != len(header) or None in values:
            return  # reported already
        for name, value in zip(header, values, strict=True):
            columns[name].append(value or 0.0)
        if columns["frequency [Hz]"][-1] == 0 and (damping := columns["damping ratio [1]"][-1]) > 0:
            yield f"line {line}: damping ratio [1] is {damping:.9g} at frequency 0 Hz; a rigid mode has none: 0"
    for name, moved in columns.items():
        if name.startswith(("n_", "x_")) and not any(moved):
            yield f"{name} is 0 in every mode: no mode moves that port"


_EMBEDDED_HEAD = """\
/* Generated by the packager: resources/axes.csv and resources/modes.csv, for targets that have no files. */
"""
_EMBEDDED_HEAD_POSES = """\
/* Generated by the packager: resources/axes.csv and resources/modes.csv. The archive follows its axes by
 * resources/poses.bin, which is not embedded (it may have megabytes): without a resource location it is refused. */
"""


def embedded_source(resources: Resources) -> bytes:
    """embedded_resources.c: axes.csv and modes.csv as constants, for targets without files (embedded_resources.h)."""
    return "".join(
        (
            _EMBEDDED_HEAD if resources.poses_bin is None else _EMBEDDED_HEAD_POSES,
            '#include "embedded_resources.h"\n',
            _constant("embedded_axes", resources.axes_csv),
            _constant("embedded_modes", resources.modes_csv),
        )
    ).encode()


def _constant(name: str, content: bytes) -> str:
    lines = (", ".join(map(str, content[i : i + 24])) for i in range(0, len(content), 24))
    body = ",\n    ".join(lines)
    return f"\nconst unsigned char {name}[] = {{\n    {body}}};\nconst size_t {name}_size = sizeof {name};\n"
