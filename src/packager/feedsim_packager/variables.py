"""Rows and axes -> the flat list of FMI variables with their value references, and the GUID over all of it."""

from collections import Counter
from dataclasses import dataclass

from .errors import InputError
from .resources import Resources
from .table import Row, Table


@dataclass(frozen=True)
class Variable:
    """One FMI variable. `start` is a spelled number or text, None where the variable is calculated."""

    name: str
    reference: int  # value reference; also the position in the list, from 0
    row: Row
    start: str | None
    depends: tuple[int, ...]  # value references of the inputs with direct feed-through
    depends_initially: tuple[int, ...]  # the same in initialisation mode


def expand(table: Table, resources: Resources | None) -> tuple[Variable, ...]:
    """All variables in the order of their value references.

    Axis i's row r has the reference len(scalars) + i * len(axis_rows) + r (table.h). In `depends`, an axis row's name
    of an input of its own block means the same axis.
    """
    kind = resources.kind if resources else ""
    if table.resources != kind:
        raise InputError(
            f"{table.unit}: has resources of the kind '{table.resources}', those given are of the kind '{kind}'"
            if table.resources and kind
            else f"{table.unit}: needs resources of the kind '{table.resources}'"
            if table.resources
            else f"{table.unit}: takes no resources (given are those of the kind '{kind}')"
        )
    axes = resources.axis_names if resources else ()
    if bool(table.axis_rows) != bool(axes):
        has = "rows per axis, but no resources that name the axes" if table.axis_rows else "no rows per axis"
        raise InputError(f"{table.unit}: has {has}")
    started = resources.columns if resources else {}
    for name, unit in started.items():
        if not any((row.name, row.kind, row.unit) == (name, "REAL", unit) for row in table.axis_rows):
            raise InputError(
                f"{table.unit}: its resources give {name} [{unit}], but the table has no such row per axis"
            )
    groups = {row.name.partition(".")[0] for row in table.scalars if "." in row.name}
    if taken := [axis for axis in axes if axis in groups]:
        raise InputError(f"{table.unit}: an axis cannot be named {taken[0]}, which is a group of variables already")
    scalar_references = {row.name: i for i, row in enumerate(table.scalars)}
    rows: list[tuple[Row, str, str, dict[str, int]]] = [
        (row, row.name, row.start, scalar_references) for row in table.scalars
    ]
    for i, axis in enumerate(axes):
        base = len(table.scalars) + i * len(table.axis_rows)
        references = scalar_references | {row.name: base + r for r, row in enumerate(table.axis_rows)}
        for row in table.axis_rows:
            start = resources.start(axis, row.name) if resources and row.name in started else row.start
            rows.append((row, f"{axis}.{row.name}", start, references))
    count = Counter(name for _, name, _, _ in rows)
    if doubled := [name for name in count if count[name] > 1]:
        raise InputError(table.unit, [f"variable {name} would exist {count[name]} times" for name in doubled])
    given = resources.given() if resources else {}
    parameters = {name for row, name, _, _ in rows if row.causality == "parameter"}
    if unknown := [name for name in given if name not in parameters]:
        raise InputError(table.unit, [f"its resources give {name}, which is no parameter" for name in unknown])
    return tuple(
        Variable(
            name=name,
            reference=reference,
            row=row,
            start=given.get(name, start) if row.causality in ("parameter", "input") else None,
            depends=tuple(sorted(references[other] for other in row.depends)),
            depends_initially=tuple(sorted(references[other] for other in row.depends + row.depends_initially)),
        )
        for reference, (row, name, start, references) in enumerate(rows)
    )


def fnv1a_64(data: bytes) -> str:
    """FNV-1a, 64 bit, as 16 lower-case hexadecimal digits."""
    value = 0xCBF29CE484222325
    for byte in data:
        value = ((value ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return f"{value:016x}"


def guid(table: Table, resources: Resources | None) -> str:
    """The archive's GUID: hash of the table, hash of the resources.

    The binary knows the first half from its own table and finds the second in the resources it is started with, so a
    stale archive cannot be instantiated.
    """
    return f"{fnv1a_64(table.fingerprint_text().encode())}-{fnv1a_64(resources.hashed() if resources else b'')}"
