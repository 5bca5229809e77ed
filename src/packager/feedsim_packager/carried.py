"""The table as an archive carries it, sources/variables.json: a machine is packed from it without a C preprocessor."""

import json
from dataclasses import asdict, fields
from typing import Any

from .errors import InputError
from .table import Row, Table

PATH = "sources/variables.json"
_FORMAT = 2


def dump(table: Table, version: str) -> bytes:
    """The file's content; `version` is that of the unit."""
    content = {
        "format": _FORMAT,
        "unit": table.unit,
        "version": version,
        "summary": table.summary,
        "resources": table.resources,
        "scalars": [asdict(row) for row in table.scalars],
        "axis_rows": [asdict(row) for row in table.axis_rows],
    }
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


def load(content: bytes, where: str) -> tuple[Table, str]:
    """Table and version from the file's content; `where` names it. Raises InputError where it is no such file."""
    try:
        read = json.loads(content)
        if read["format"] != _FORMAT:
            raise InputError(f"{where}: has format {read['format']!r}, this packager reads format {_FORMAT}")
        texts = [read[key] for key in ("unit", "version", "summary", "resources")]
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("unit, version, summary and resources must be texts")
        unit, version, summary, kind = texts
        scalars, axis_rows = (tuple(map(_row, read[key])) for key in ("scalars", "axis_rows"))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{where}: not a table of variables: {type(error).__name__}: {error}") from error
    table = Table(unit=unit, summary=summary, scalars=scalars, axis_rows=axis_rows, resources=kind)
    return table, version


def _row(read: dict[str, Any]) -> Row:
    values: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in read.items()}
    for field in fields(Row):
        kind = {"line": int, "per_axis": bool, "depends": tuple, "depends_initially": tuple}.get(field.name, str)
        if not isinstance(values[field.name], kind):
            raise TypeError(f"{field.name} of {values['name']} is {values[field.name]!r}")
    return Row(**values)
