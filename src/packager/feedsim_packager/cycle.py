"""The control cycle as data (`src/machine_fmu/cycle.h`) -> lists, for the master, which works it on units of its own.

Rows are read as text: `#define NAME(ROW)` and, a line each, `ROW(column, ...)` of plain words and numbers.
"""

import json
import re
from pathlib import Path
from typing import Any

from .checkout import SOURCES
from .errors import InputError

HEADER = SOURCES / "machine_fmu" / "cycle.h"
TABLES = ("SCHEMES", "CYCLE_BEGINS", "EXCHANGE_BEGINS", "EXCHANGE_PASS", "SPEED_GIVEN")
_TABLE = re.compile(r"#define (\w+)\(ROW\) *\\\n((?:.*\\\n)*.*)")
_ROW = re.compile(r" *ROW\(([\w., -]+)\) *\\?")


def read(header: Path = HEADER) -> dict[str, list[list[Any]]]:
    """Table -> its rows, columns as words, numbers and truth values.

    Raises:
        InputError: a table is missing, or a line of it is no row.
    """
    tables, problems = {}, []
    for name, body in _TABLE.findall(header.read_text(encoding="utf-8")):
        rows = [(line, _ROW.fullmatch(line)) for line in body.splitlines()]
        problems += [f"{name}: not a row: {line.strip()}" for line, row in rows if row is None]
        tables[name] = [[_column(text.strip()) for text in row[1].split(",")] for _, row in rows if row]
    problems += [f"{name}: no such table" for name in TABLES if name not in tables]
    if problems:
        raise InputError(str(header), problems)
    return {name: tables[name] for name in TABLES}


def _column(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
