"""The mode table of a machine: mass-normalised mode shapes at the ports, read and checked.

Ports of an axis A: n_A (rotor against stator: torque in, speed out) and x_A (linear scale). Ports of the tool: tcp_X,
tcp_Y, tcp_Z (tool against workpiece: force in, displacement out). The format is described in docs/scenarios.md.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.files.fields import FileContent
from feedsim.files.trace.cells import duplicate_names, named_columns
from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Machine
from feedsim.structure.assembly import Floats
from feedsim.structure.mounts import MountTable, friction_cycle, read_mounts, scale_elements, viscous_cycle

MODE, FREQUENCY, DAMPING = "mode", "frequency [Hz]", "damping ratio [1]"
TOOL_PORTS = ("tcp_X", "tcp_Y", "tcp_Z")
# A lead from mode shapes carries the eigensolver's error (1e-8 and less); a wrong pitch is off by per cents.
LEAD_TOLERANCE = 1e-3
MOST_INERTIA = 0.95  # of J_inf, on the motor's side of a transmission; as the unit plant has it
MOST_PROBLEMS = 20
# A spring in the modes is the mounts' stiffness at rest where it agrees to this share: then the modes stay as they are.
SAME_STIFFNESS = 1e-9
# A mode lives in the mounts where so much of its strain energy is theirs.
MOUNT_ENERGY_SHARE = 0.5
# Frames without their mounts have 1 to 3 %: what a table has beyond it is meant for mounts.
FRAME_DAMPING = 0.03
# Of a mode's damping in the table: what the mounts bring at their best that is worth a warning.
MOUNT_DAMPING_SHARE = 0.25
AMPLITUDES = np.logspace(-1, 1, 21)  # of x_2, among which friction damps most


@dataclass(frozen=True, eq=False)
class Modes:
    """A mode table.

    Attributes:
        frequency: (N,) [Hz]; exactly 0 for rigid modes.
        damping: (N,) damping ratios [1].
        ports: port -> (N,) mass-normalised mode shape [1/sqrt(kg) for displacements, 1/(m sqrt(kg)) for rotations].
    """

    file: Path
    frequency: Floats
    damping: Floats
    ports: Mapping[str, Floats]

    @property
    def rigid(self) -> NDArray[np.bool_]:
        """(N,) which modes are rigid."""
        return np.asarray(self.frequency == 0)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that it has ports of."""
        return tuple(port.removeprefix("n_") for port in self.ports if port.startswith("n_"))

    def J_tot(self, axis: str) -> float:
        """Inertia that a slow torque of `axis` accelerates [kg.m2]: 1 / sum of n^2 over the rigid modes."""
        return float(1 / np.sum(self.ports[f"n_{axis}"][self.rigid] ** 2))

    def J_inf(self, axis: str) -> float:
        """Inertia that a sudden torque meets [kg.m2]: 1 / sum of n^2 over all modes; limits explicit coupling."""
        return float(1 / np.sum(self.ports[f"n_{axis}"] ** 2))

    def leads(self, axes: Sequence[str]) -> Floats:
        """(K, K) travel of each axis's scale (columns) per radian of each axis's rotor (rows) in rigid motion [m/rad].

        Raises:
            InputError: the rigid modes do not move every axis on its own.
        """
        n = np.column_stack([self.ports[f"n_{axis}"][self.rigid] for axis in axes])
        x = np.column_stack([self.ports[f"x_{axis}"][self.rigid] for axis in axes])
        if len(n) != len(axes) or np.linalg.matrix_rank(n) < len(axes):
            still = [axis for axis, column in zip(axes, n.T, strict=True) if not np.any(column)]
            which = f"; none moves {', '.join(still)}" if still else ""
            raise InputError(
                f"{self.file}: {len(n)} rigid modes (frequency 0); {len(axes)} are needed that move the axes "
                f"{', '.join(axes)} independently of one another{which}"
            )
        return np.asarray(np.linalg.solve(n, x))


def read_modes(file: Path, axes: Sequence[str]) -> Modes:
    """Modes of a file with the ports of `axes`; errors as :func:`parse_modes`."""
    return parse_modes(FileContent.read(file), tuple(axes))


@lru_cache(maxsize=8)  # a run asks several times, many runs of a machine ask for the same
def parse_modes(table: FileContent, axes: tuple[str, ...]) -> Modes:
    """Modes of a table with the ports of `axes`.

    Raises:
        InputError: lists what is wrong, with file and line.
    """
    file = table.file
    if table.content is None:
        raise InputError(f"{file}: no such file (table of modes)")
    try:
        text = table.content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: cannot be read as a table of modes: {error}") from error
    try:
        rows = named_columns(list(csv.reader(io.StringIO(text, newline=""))))
    except csv.Error as error:
        raise InputError(f"{file}: cannot be read as a table of modes: {error}") from error
    ports = [f"{quantity}_{axis}" for quantity in ("n", "x") for axis in axes] + list(TOOL_PORTS)
    header = rows[0] if rows else []
    problems = _header_problems(file, header, (MODE, FREQUENCY, DAMPING, *ports))
    if not problems and not any(rows[1:]):
        problems = [f"{file}: empty: a header, but no modes"]
    if problems:
        raise InputError.of(f"{file}: not a table of modes", problems)
    numbers, problems = _numbers(file, header, rows[1:])
    numbers.setflags(write=False)
    columns = dict(zip(header, numbers.T, strict=True))
    if not problems:
        problems = [
            f"{file}: column '{port}': all zero, nothing moves there"
            for port in ports[: 2 * len(axes)]
            if not columns[port].any()
        ]
    if problems:
        raise InputError.of(f"{file}: not a usable table of modes", problems[:MOST_PROBLEMS])
    return Modes(file, columns[FREQUENCY], columns[DAMPING], {port: columns[port] for port in ports})


def write_modes(path: Path, modes: Modes) -> None:
    """Write a mode table, as :func:`modes_text` has it.

    Raises:
        OutputError: it cannot be written; an old file of that name is then as it was.
    """
    with written_whole(path) as file:
        file.write(modes_text(modes).encode())


def table_of_modes(modes: Modes, file: Path) -> FileContent:
    """A mode table as a machine holds it, by this name."""
    return FileContent(file, modes_text(modes).encode())


def modes_text(modes: Modes) -> str:
    """A mode table: modes numbered from 0, numbers with the fewest digits that give them back exactly."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((MODE, FREQUENCY, DAMPING, *modes.ports))
    columns = [np.asarray(column).tolist() for column in (modes.frequency, modes.damping, *modes.ports.values())]
    writer.writerows((number, *map(repr, row)) for number, row in enumerate(zip(*columns, strict=True)))
    return text.getvalue()


def _header_problems(file: Path, header: Sequence[str], needed: Sequence[str]) -> list[str]:
    if not header:
        return [f"{file}: empty; a table of modes begins with a header: {', '.join(needed)}"]
    there = ", ".join(header)
    problems = [f"{file}:1: column '{name}' is missing; there is {there}" for name in needed if name not in header]
    problems += [f"{file}:1: column '{name}' belongs to no axis here" for name in header if name not in needed]
    problems += [f"{file}:1: column '{name}' occurs twice" for name in duplicate_names(header)]
    return problems


def _numbers(file: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[Floats, list[str]]:
    problems: list[str] = []
    table = []
    for line, row in enumerate(rows, start=2):
        if not row:
            continue
        if len(row) != len(header):
            problems.append(f"{file}:{line}: {len(row)} cells; the header has {len(header)}")
            continue
        values = [_number(cell) for cell in row]
        table.append(values)
        if all(map(math.isfinite, values)) and min(values[header.index(name)] for name in (FREQUENCY, DAMPING)) >= 0:
            continue
        for name, cell, value in zip(header, row, values, strict=True):
            if not math.isfinite(value):
                problems.append(f"{file}:{line}: column '{name}': '{cell}' is no finite number")
            elif name in (FREQUENCY, DAMPING) and value < 0:
                problems.append(f"{file}:{line}: column '{name}': {cell} is negative; 0 or more is allowed")
    return np.array(table, dtype=np.float64).reshape(-1, len(header)), problems


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


@lru_cache(maxsize=8)
def join_motors(modes: Modes, contacts: tuple[tuple[str, float, float, float], ...]) -> Modes:
    """Modes of a structure whose motors are joined to it by contacts, each closed: (axis, stiffness [N.m/rad], damping
    [N.m.s/rad], inertia on the motor's side [kg.m2]).

    The structure holds these inertias, so they are taken off it and set behind the springs: with q its coordinates, phi
    the motors' angles and n the shapes at the rotors, M = diag(1 - sum J n n', J), K = diag(omega^2, 0) + sum c w w',
    w = (-n, 1). Damping couples these modes; its diagonal is kept.

    Raises:
        InputError: an inertia is as large as what answers a torque at once.
    """
    from scipy.linalg import eigh  # few machines need it

    axes = [axis for axis, *_ in contacts]
    N, omega = len(modes.frequency), 2 * np.pi * modes.frequency
    size = N + len(axes)
    n = [np.concatenate([modes.ports[f"n_{axis}"], np.zeros(len(axes))]) for axis in axes]
    M = np.eye(size)
    K, D = (np.diag(np.concatenate([values, np.zeros(len(axes))])) for values in (omega**2, 2 * modes.damping * omega))
    for i, (axis, c, d, J) in enumerate(contacts):
        motor = np.zeros(size)
        motor[N + i] = 1.0
        M += J * np.outer(motor, motor) - np.outer(motor, motor) - J * np.outer(n[i], n[i])
        K += c * np.outer(motor - n[i], motor - n[i])
        D += d * np.outer(motor - n[i], motor - n[i])
        if modes.J_inf(axis) * MOST_INERTIA <= J:
            raise InputError(
                f"axis {axis}: transmission.inertia is {J:.6g} kg.m2; it must be below {MOST_INERTIA:g} of the inertia "
                f"that answers a torque at once, {modes.J_inf(axis):.6g} kg.m2 by {modes.file}, of which it is a part"
            )
    squares, shapes = eigh(K, M)
    slow = int(np.count_nonzero(modes.rigid))
    result = np.sqrt(np.maximum(squares, 0.0))
    result[:slow] = 0.0
    damping = np.zeros(size)
    damping[slow:] = np.einsum("im,ij,jm->m", shapes, D, shapes)[slow:] / (2 * result[slow:])
    ports = {name: shape @ shapes[:N] for name, shape in modes.ports.items()}
    ports |= {f"n_{axis}": shapes[N + i] for i, axis in enumerate(axes)}
    return Modes(modes.file, result / (2 * np.pi), damping, ports)


def with_mounts(modes: Modes, table: MountTable, element: Floats, amplitude: float = 0.0) -> Modes:
    """Modes with the mounts as linear springs and dampers: their tangent at rest, or the describing function of a
    steady cycle with this amplitude [m] at every mount; `modes` itself where the modes hold that already.

    The viscous part is stiffness and loss at each mode's own frequency. Damping couples modes; its diagonal is kept.

    Raises:
        InputError: the mounts would not hold the machine.
    """
    K_lin, K_e, F_max, x_2, K_v, c = element.T
    stiff, loss = friction_cycle(F_max, x_2, np.full(len(K_lin), float(amplitude)))
    added = K_e + stiff - K_lin
    viscous = bool(np.any((K_v > 0) & (c > 0)))
    if not viscous and not loss.any() and np.all(np.abs(added) <= SAME_STIFFNESS * K_lin):
        return modes
    elastic = np.flatnonzero(~modes.rigid)
    omega = 2 * np.pi * modes.frequency[elastic]
    b = table.shapes[:, elastic]
    squares, V = np.linalg.eigh(np.diag(omega**2) + b.T @ (added[:, None] * b))
    if squares.size and squares[0] <= 0:
        raise InputError(f"{modes.file}: with these mounts nothing holds the machine: more K_e")
    new = np.sqrt(squares)
    drag = np.einsum("im,i,im->m", V, 2 * modes.damping[elastic] * omega, V)
    b = b @ V
    for m, w in enumerate(new.tolist()):
        K, D = viscous_cycle(K_v, c, w)
        new[m] = math.sqrt(w**2 + float(K @ b[:, m] ** 2))
        drag[m] += float((loss + D) @ b[:, m] ** 2) / w
    frequency, damping = modes.frequency.copy(), modes.damping.copy()
    order = np.argsort(new, kind="stable")
    frequency[elastic], damping[elastic] = new[order] / (2 * np.pi), (drag / (2 * new))[order]
    ports = {name: shape.copy() for name, shape in modes.ports.items()}
    for name, shape in ports.items():
        shape[elastic] = (modes.ports[name][elastic] @ V)[order]
    return Modes(modes.file, frequency, damping, ports)


def damped_twice(modes: Modes, table: MountTable, element: Floats) -> list[Finding]:
    """Modes on the mounts whose damping in the table is more than a frame's, where the mounts bring theirs besides."""
    K_lin, _, F_max, x_2, K_v, c = element.T
    reported = []
    for k in np.flatnonzero(~modes.rigid).tolist():
        omega, squares = 2 * np.pi * modes.frequency[k], table.shapes[:, k] ** 2
        if K_lin @ squares < MOUNT_ENERGY_SHARE * omega**2 or modes.damping[k] <= FRAME_DAMPING:
            continue
        deflection = np.sqrt(squares / squares.max())
        typical = float(np.min(x_2[F_max > 0], initial=1.0))
        bring = max(
            float((friction_cycle(F_max, x_2, a * typical * deflection)[1] + viscous_cycle(K_v, c, omega)[1]) @ squares)
            for a in AMPLITUDES.tolist()
        ) / (2 * omega**2)
        if bring > MOUNT_DAMPING_SHARE * modes.damping[k]:
            reported.append(
                f"{modes.frequency[k]:.4g} Hz ({100 * modes.damping[k]:.3g} % and up to {100 * bring:.2g} %)"
            )
    if not reported:
        return []
    remedy = "Give these modes the damping of the frame alone (damping.steps of the structure file)"
    return [Finding(
        "damping-counted-twice", "doubt",
        f"damping counts twice: the table of modes damps modes on the mounts, and the mounts that are not linear damp "
        f"them besides: {', '.join(reported)}. {remedy}",
        "", remedy,
    )]  # fmt: skip


def checked_modes(machine: Machine, amplitude: float = 0.0) -> Modes:
    """The machine's mode table, consistent with its axes: one rigid mode per axis, leads that agree with the pitches.
    Transmissions of the machine are part of it, their contacts closed, and mounts that are not linear, as they are at
    rest or at an amplitude [m].

    Raises:
        InputError: the table is broken or contradicts the machine file.
    """
    axes = list(machine.axes)
    modes = parse_modes(machine.modes, tuple(axes))
    problems = []
    for (name, axis), lead in zip(machine.axes.items(), np.diag(modes.leads(axes)), strict=True):
        if abs(lead - axis.I_P) > LEAD_TOLERANCE * axis.I_P:
            problems.append(
                f"{machine.modes}: axis {name} travels {2e3 * math.pi * lead:.6g} mm per revolution by its modes; "
                f"the machine says pitch: {axis.pitch * 1e3:.6g} mm"
            )
    if problems:
        raise InputError.of(f"{machine.modes}: the modes contradict the machine", problems)
    return linear_modes(machine, modes, amplitude)


def linear_modes(machine: Machine, modes: Modes, amplitude: float = 0.0) -> Modes:
    """Modes of the structure with what the machine has besides: its mounts that are not linear, at rest or at an
    amplitude [m] (:func:`with_mounts`), and transmissions. Raises InputError."""
    if machine.mounts is not None:
        table = read_mounts(machine.mounts.table, len(modes.frequency))
        modes = with_mounts(modes, table, scale_elements(table, machine.mounts.parameters()), amplitude)
    return with_transmissions(machine, modes)


def with_transmissions(machine: Machine, modes: Modes) -> Modes:
    """Modes of the structure with the contacts that join the machine's motors to it; `modes` itself without any."""
    contacts = tuple(
        (name, entry.stiffness * axis.I_P**2, entry.damping * axis.I_P**2, entry.inertia)
        for name, axis in machine.axes.items() if (entry := axis.transmission) is not None and entry.stiffness > 0
    )  # fmt: skip
    return join_motors(modes, contacts) if contacts else modes
