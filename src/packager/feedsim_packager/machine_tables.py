"""A machine's resource files: which axes it has and where they stand (axes.csv), its modes (modes.csv), and where the
plant shall follow its axes the modes of a grid of poses (poses.bin), or mounts that are not linear (mounts.csv)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import poses
from .errors import InputError
from .resources import AXIS_NAME, AXIS_NAME_RULE, MOST_AXES, File, Resources, constant, finite

AXES_HEADER = ("axis", "x_0 [m]")
DIRECTIONS = ("X", "Y", "Z")  # of the machine frame: ports of the tool force
MOUNT_COLUMNS = ("mount", "K_lin [N/m]", "K_e [N/m]", "F_max [N]", "x_2 [m]", "K_v [N/m]", "c [N.s/m]")


@dataclass(frozen=True)
class Axis:
    """One axis of the machine; `x_0` is its position at the start [m], the pose the modes belong to."""

    name: str
    x_0: float


@dataclass(frozen=True)
class MachineTables(Resources):
    """Contents of the files, and the axes they describe in their order."""

    axes_csv: bytes
    modes_csv: bytes
    poses_bin: bytes | None  # None: the machine stays in one pose
    axes: tuple[Axis, ...]
    mounts_csv: bytes | None = None  # None: all mounts are the linear springs of the modes

    kind = "machine"
    noun = "Machine"
    columns = {"x_0": "m"}  # noqa: RUF012
    default_note = "Start values are those of a synthetic default machine; no existing machine has them."

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of `axes`."""
        return tuple(axis.name for axis in self.axes)

    def files(self) -> dict[str, bytes]:
        """Archive path -> content, in the order in which they are hashed."""
        result = {"resources/axes.csv": self.axes_csv, "resources/modes.csv": self.modes_csv}
        more = {"resources/poses.bin": self.poses_bin, "resources/mounts.csv": self.mounts_csv}
        return result | {path: content for path, content in more.items() if content is not None}

    def start(self, axis: str, row: str) -> str:
        """Start value of x_0."""
        return next(repr(entry.x_0) for entry in self.axes if entry.name == axis)

    def summary(self) -> str:
        """Its axes, and what its modes do."""
        axes = ", ".join(f"{axis.name} at {axis.x_0:.9g} m" for axis in self.axes)
        grid = " Its modes follow the axes by the grid of poses in resources/poses.bin." if self.poses_bin else ""
        mounts = " Mounts that are not linear are in resources/mounts.csv." if self.mounts_csv else ""
        return f"Its axes: {axes}.{grid}{mounts}"

    def embedded_source(self) -> bytes:
        """axes.csv and modes.csv as constants."""
        more = {"poses.bin": self.poses_bin, "mounts.csv": self.mounts_csv}  # one of them at most
        left = next((name for name, content in more.items() if content is not None), None)
        head = _EMBEDDED_HEAD if left is None else _EMBEDDED_HEAD_MORE.format(left)
        return "".join(
            (
                head,
                '#include "embedded_resources.h"\n',
                constant("embedded_axes", self.axes_csv),
                constant("embedded_modes", self.modes_csv),
            )
        ).encode()


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


def read(
    axes_path: Path, modes_path: Path, poses_path: Path | None = None, mounts_path: Path | None = None
) -> MachineTables:
    """Read and check the files; raises InputError with all problems of the file at fault."""
    more = (File.at(path) if path else None for path in (poses_path, mounts_path))
    return check(File.at(axes_path), File.at(modes_path), *more)


def check(axes: File, modes: File, grid: File | None = None, mounts: File | None = None) -> MachineTables:
    """The resources that these contents make; raises InputError with all problems of the file at fault."""
    result = _axes(axes)
    names = [axis.name for axis in result]
    if problems := list(_check_modes(modes.content, names, Path(axes.name).name)):
        raise InputError(modes.name, problems)
    if grid is not None:
        poses.check(grid.content, names, grid.name)
    if mounts is not None:
        if grid is not None:
            raise InputError(f"{mounts.name}: mounts that are not linear belong to one pose; {grid.name} has a grid")
        if problems := list(mount_problems(mounts.content, len(_rows(modes.content)) - 1)):
            raise InputError(mounts.name, problems)
    grid_content, mounts_content = (file.content if file is not None else None for file in (grid, mounts))
    return MachineTables(axes.content, modes.content, grid_content, result, mounts_content)


def _rows(content: bytes) -> list[tuple[int, list[str]]]:
    """Line number and fields of every line that is not empty. No quoting: names and numbers need none."""
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    return [(i, [field.strip() for field in line.split(",")]) for i, line in enumerate(lines, 1) if line.strip()]


def _axes(file: File) -> tuple[Axis, ...]:
    rows = _rows(file.content)
    header = tuple(rows[0][1]) if rows else ()
    if header != AXES_HEADER:
        text = ",".join(header) or "(empty)"
        raise InputError(f"{file.name}: the header must read {','.join(AXES_HEADER)}, but reads {text}")
    if len(rows) - 1 > MOST_AXES:
        raise InputError(f"{file.name}: {len(rows) - 1} axes are listed, at most {MOST_AXES} are allowed")
    axes: list[Axis] = []
    problems: list[str] = []
    for line, fields in rows[1:]:
        if len(fields) != len(AXES_HEADER):
            problems.append(f"line {line}: {len(fields)} fields, expected {len(AXES_HEADER)}")
            continue
        name, position = fields[0], finite(fields[1])
        if not AXIS_NAME.fullmatch(name):
            problems.append(f"line {line}: axis name '{name}' {AXIS_NAME_RULE}")
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
    table: list[tuple[int, list[float | None]]] = []
    for line, fields in rows[1:]:
        if len(fields) != len(expected):
            yield f"line {line}: {len(fields)} fields, expected {len(expected)}"
            continue
        values = [finite(text) for text in fields]
        table.append((line, values))
        for name, text, value in zip(header, fields, values, strict=True):
            if value is None:
                yield f"line {line}: {name} is '{text}', not a finite number"
            elif value < 0 and name in expected[1:3]:
                yield f"line {line}: {name} is {text}, allowed is 0 or more"
    if len(table) == len(rows) - 1:
        yield from _check_physics(header, table)


def mounts_header(modes: int) -> tuple[str, ...]:
    """Columns of mounts.csv for a table of so many modes, in this order."""
    return (*MOUNT_COLUMNS, *(f"mode_{k}" for k in range(modes)))


def mount_problems(content: bytes, modes: int) -> Iterator[str]:
    """What is wrong with mounts.csv, for a table of so many modes."""
    rows, header = _rows(content), mounts_header(modes)
    if not rows or tuple(rows[0][1]) != header:
        yield f"line 1: the header must be {','.join(MOUNT_COLUMNS)},mode_0 ... mode_{modes - 1}: modes.csv has {modes}"
        return
    if not rows[1:]:
        yield "no mount is listed"
    for line, fields in rows[1:]:
        if len(fields) != len(header):
            yield f"line {line}: {len(fields)} fields, expected {len(header)}"
            continue
        for name, text in zip(header[1:], fields[1:], strict=True):
            value = finite(text)
            if value is None:
                yield f"line {line}: {name} is '{text}', not a finite number"
            elif name in MOUNT_COLUMNS and (value < 0 or (name == "x_2 [m]" and value == 0)):
                yield f"line {line}: {name} is {text}, allowed is {'above 0' if name == 'x_2 [m]' else '0 or more'}"


def _check_physics(header: Sequence[str], rows: Sequence[tuple[int, Sequence[float | None]]]) -> Iterator[str]:
    """What the unit refuses in a table of sound numbers: damped rigid modes, rotors and scales that nothing moves."""
    columns: dict[str, list[float]] = {name: [] for name in header}
    for line, values in rows:
        if None in values:
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
_EMBEDDED_HEAD_MORE = """\
/* Generated by the packager: resources/axes.csv and resources/modes.csv. The archive follows
 * resources/{}, which is not embedded (it may have megabytes): without a resource location it is refused. */
"""
