"""Tables of variables -> one JSON file for those who know the units by name and have no C preprocessor: the master."""

import json
from collections.abc import Iterable
from typing import Any

from . import cycle
from .table import Row, Table


def dump(tables: Iterable[Table]) -> bytes:
    """Unit -> name -> what its row says; a bound that is not there is left out. Parameters that every axis has stand
    under "unit/axis", the rows of the control cycle under "machine/cycle"."""
    content: dict[str, Any] = {"machine/cycle": cycle.read()}
    for table in tables:
        content[table.unit] = {row.name: _entry(row) for row in table.scalars}
        if own := [row for row in table.axis_rows if row.causality == "parameter"]:
            content[f"{table.unit}/axis"] = {row.name: _entry(row) for row in own}
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


def _entry(row: Row) -> dict[str, Any]:
    start = row.start if row.kind == "STRING" else _number(row.start)
    entry: dict[str, Any] = {"kind": row.kind, "causality": row.causality, "start": start}
    if row.kind == "REAL":
        entry |= {"unit": row.unit, "display_unit": row.display_unit}
    bounds = {"minimum": row.min, "maximum": row.max}
    known = {name: _number(bound) for name, bound in bounds.items() if bound not in ("NO_MIN", "NO_MAX")}
    return entry | known | {"text": row.description}


def _number(text: str) -> float:
    """As it is spelled: 1 is no 1.0."""
    return int(text) if text.lstrip("+-").isdigit() else float(text)
