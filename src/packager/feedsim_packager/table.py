"""variables.def -> rows, by the C preprocessor that the binary is compiled with, and the checks no importer makes."""

import math
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from . import targets, toolchain, units
from .errors import InputError

KINDS = ("REAL", "INTEGER", "BOOLEAN", "STRING")

# causality -> legal variabilities, FMI 2.0.4 section 2.2.7 (calculatedParameter, independent and constant are not
# offered by table.h). `initial` follows from the causality: see INITIAL.
VARIABILITIES = {
    "parameter": ("fixed", "tunable"),
    "input": ("discrete", "continuous"),
    "output": ("discrete", "continuous"),
    "local": ("fixed", "tunable", "discrete", "continuous"),
}
INITIAL = {"parameter": "exact", "input": None, "output": "calculated", "local": "calculated"}

B_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_STRUCTURED_NAME = re.compile(rf"{B_NAME.pattern}(\.{B_NAME.pattern})*")
_REAL = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_INTEGER = re.compile(r"[-+]?(0|[1-9]\d*)")  # a leading zero would make it octal in C
_INT32 = (-(2**31), 2**31 - 1)


@dataclass(frozen=True)
class Row:
    """One row of variables.def, texts as spelled there (start and bounds unparsed, strings unescaped)."""

    line: int
    per_axis: bool  # a row of the axis block; `name` is then the part behind the axis name
    kind: str  # one of KINDS
    field: str  # of the C struct
    name: str
    causality: str
    variability: str
    start: str
    unit: str
    display_unit: str
    min: str
    max: str
    depends: tuple[str, ...]  # inputs with direct feed-through
    depends_initially: tuple[str, ...]  # further inputs that count in initialisation mode
    description: str

    @property
    def minimum(self) -> float:
        """Lower bound, -inf without one."""
        return -math.inf if self.min == "NO_MIN" else float(self.min)

    @property
    def maximum(self) -> float:
        """Upper bound, +inf without one."""
        return math.inf if self.max == "NO_MAX" else float(self.max)


@dataclass(frozen=True)
class Table:
    """The interface of a unit: `scalars` have value references 0.., then each axis repeats `axis_rows`."""

    unit: str  # UNIT_NAME of identity.h: file name, model identifier
    summary: str  # first sentence of the comment that opens variables.def
    scalars: tuple[Row, ...]
    axis_rows: tuple[Row, ...]
    resources: str = ""  # kind of its resource files (kinds.py), by UNIT_RESOURCES of identity.h; "" without any

    def fingerprint_text(self) -> str:
        """The text whose hash is the first half of the GUID; table.c of the shell makes the same from VariableInfo."""
        return "".join(
            f"{row.name}|{row.kind}|{row.causality}|{row.variability}|{row.start}|{row.unit}|{row.min}|{row.max}\n"
            for row in (*self.scalars, *self.axis_rows)
        )


# Every field goes out as a string literal, __LINE__ as a number. table.h expands the table itself, for its structs;
# what comes before the mark is not ours.
_DRIVER = """\
#include "table.h"
#include "prefix.h"
#define VARIABLE(kind, field, name, causality, variability, start, start_text, unit, display, min, min_text, max, \\
                 max_text, depends, text) \\
    feedsim_row(__LINE__, "scalar", #kind, #field, name, #causality, #variability, start_text, unit, display, \\
                min_text, max_text, depends, text)
#define AXIS_VARIABLE(kind, field, name, causality, variability, start, start_text, unit, display, min, min_text, \\
                      max, max_text, depends, text) \\
    feedsim_row(__LINE__, "axis", #kind, #field, name, #causality, #variability, start_text, unit, display, \\
                min_text, max_text, depends, text)
#define FEEDSIM_TEXT(x) #x
#define FEEDSIM_EXPANDED(x) FEEDSIM_TEXT(x)
#ifndef UNIT_RESOURCES
#define UNIT_RESOURCES
#endif
feedsim_mark FEEDSIM_EXPANDED(UNIT_NAME) FEEDSIM_EXPANDED(STRING_SIZE) FEEDSIM_EXPANDED(UNIT_RESOURCES)
#include "variables.def"
"""
_COLUMNS = 13  # strings of a feedsim_row
_INITIALLY = re.compile(r"\(([^\s()]+)\)")  # in the column `depends`

_TOKEN = re.compile(r'(?P<space>\s+)|"(?P<string>(?:[^"\\\n]|\\.)*)"|(?P<word>\w+)|(?P<mark>.)')


def read(unit_directory: Path, include: Sequence[Path], compiler: Sequence[str]) -> Table:
    """Read and check `unit_directory`/variables.def.

    `include` holds table.h and prefix.h. Raises InputError with all problems found, each with its line, and
    CompilerError where the preprocessor itself refuses the file (e.g. a row with too few columns).
    """
    path = unit_directory / "variables.def"
    for needed in (path, unit_directory / "identity.h"):
        if not needed.is_file():
            raise InputError(f"{needed}: no such file; a unit needs variables.def and identity.h")
    with tempfile.TemporaryDirectory() as temporary:
        driver = Path(temporary, "driver.c")
        driver.write_text(_DRIVER, encoding="utf-8")
        folders = [f"-I{folder.resolve()}" for folder in (unit_directory, *include)]
        preprocessor = toolchain.for_target(compiler, targets.LINUX64.zig[0])  # any: a table is the same on all
        text = toolchain.run([*preprocessor, "-std=c99", "-E", "-P", *folders, driver.name], Path(temporary))

    body = text.partition("feedsim_mark")[2]
    match = re.match(r'\s*"(\w+)"\s*"\(?(\d+)\)?"\s*"(\w*)"', body)
    if match is None:
        raise InputError(f"{unit_directory}: identity.h must define UNIT_NAME (and UNIT_RESOURCES) as a plain word")
    rows, problems = _parse(body[match.end() :])
    problems += check(rows, string_size=int(match[2]))
    summary = _summary(path.read_text(encoding="utf-8"), match[1])
    if not rows and not problems:
        problems.append("no rows")
    if problems:
        raise InputError(str(path), problems)
    return Table(
        unit=match[1],
        summary=summary,
        scalars=tuple(row for row in rows if not row.per_axis),
        axis_rows=tuple(row for row in rows if row.per_axis),
        resources=match[3],
    )


def _summary(source: str, unit: str) -> str:
    """First sentence of the opening comment, without the unit's name in front."""
    comment = re.match(r"\s*/\*(.*?)\*/", source, re.DOTALL)
    text = " ".join(comment[1].replace("\n *", "\n").split()) if comment else ""
    text = re.split(r"\.(?:\s|$)", text.removeprefix(f"{unit}:").strip(), maxsplit=1)[0]
    return text[:1].upper() + text[1:]


def _parse(text: str) -> tuple[list[Row], list[str]]:
    """feedsim_row(...) calls -> rows; whatever else is left over is a problem."""
    rows: list[Row] = []
    problems: list[str] = []
    tokens = [match for match in _TOKEN.finditer(text) if match["space"] is None]
    starts = [i for i, token in enumerate(tokens) if token["word"] == "feedsim_row"]
    if tokens and (not starts or starts[0]):
        starts.insert(0, 0)
    for begin, end in pairwise([*starts, len(tokens)]):
        used, row = _row(tokens[begin:end])
        if row is not None:
            rows.append(row)
        if begin + used < end:
            remaining = text[tokens[begin + used].start() : tokens[end - 1].end()]
            where = f"after line {row.line}" if row else "at the start" if not rows else f"near line {rows[-1].line}"
            problems.append(f"{where}: not a row: {' '.join(remaining.split())[:100]}")
    return rows, problems


def _row(tokens: Sequence[re.Match[str]]) -> tuple[int, Row | None]:
    """One call at the head of `tokens`: number of tokens used, row (None where it is no such call)."""
    line, columns, current = 0, [], None  # type: int, list[str], str | None
    for used, token in enumerate(tokens):
        if used == 0 and token["word"] != "feedsim_row":
            return 0, None
        if token["string"] is not None:  # adjacent literals are one
            current = (current or "") + _unescaped(token["string"])
        elif token["word"] is not None and token["word"].isdigit():
            line = int(token["word"])
        elif token["mark"] in (",", ")") and used > 1:
            if current is not None:
                columns.append(current)
            current = None
            if token["mark"] == ")":
                if len(columns) != _COLUMNS:
                    return 0, None
                block, kind, field, name, causality, variability, start, unit, display, low, high, depends, text = (
                    columns
                )
                row = Row(
                    line=line,
                    per_axis=block == "axis",
                    kind=kind,
                    field=field,
                    name=name,
                    causality=causality,
                    variability=variability,
                    start=start,
                    unit=unit,
                    display_unit=display,
                    min=low,
                    max=high,
                    depends=tuple(name for name in depends.split() if not _INITIALLY.fullmatch(name)),
                    depends_initially=tuple(_INITIALLY.findall(depends)),
                    description=text,
                )
                return used + 1, row
    return 0, None


def _unescaped(literal: str) -> str:
    simple = {"n": "\n", "t": "\t", "r": "\r", "0": "\0"}
    return re.sub(r"\\(.)", lambda match: simple.get(match[1], match[1]), literal)


def check(rows: Sequence[Row], string_size: int) -> list[str]:
    """All that is wrong with the rows, as "line N: name: ..."; axis names come later (variables.py)."""
    problems: list[str] = []
    for block in (False, True):
        for what in ("name", "field"):
            first: dict[str, Row] = {}
            for row in (row for row in rows if row.per_axis is block):
                key = getattr(row, what)
                if first.setdefault(key, row) is not row:
                    earlier = first[key].line
                    problems.append(f"line {row.line}: {row.name}: the {what} {key} is already used in line {earlier}")
    inputs = {False: _inputs(rows, per_axis=False), True: _inputs(rows, per_axis=True)}
    for row in rows:
        problems += (f"line {row.line}: {row.name}: {problem}" for problem in _check_row(row, inputs, string_size))
    return problems


def _inputs(rows: Iterable[Row], per_axis: bool) -> frozenset[str]:
    return frozenset(row.name for row in rows if row.causality == "input" and row.per_axis is per_axis)


def _check_row(row: Row, inputs: dict[bool, frozenset[str]], string_size: int) -> Iterator[str]:
    if not _STRUCTURED_NAME.fullmatch(row.name):
        yield "not a structured name (letters, digits and _, parts joined by '.')"
    if row.kind not in KINDS:
        yield f"kind {row.kind} is none of {', '.join(KINDS)}"
    if row.causality not in VARIABILITIES:
        yield f"causality {row.causality} is none of {', '.join(VARIABILITIES)}"
    elif row.variability not in VARIABILITIES[row.causality]:
        allowed = " or ".join(VARIABILITIES[row.causality])
        yield f"variability {row.variability} is not allowed for causality {row.causality} (allowed: {allowed})"
    if row.kind != "REAL" and row.variability == "continuous":
        yield f"variability continuous is for REAL alone, not for {row.kind}"
    if not row.description.strip():
        yield "the description is empty"
    yield from _check_values(row, string_size)
    yield from _check_units(row)
    known = inputs[False] | (inputs[True] if row.per_axis else frozenset())
    depends = row.depends + row.depends_initially
    if depends and row.causality not in ("output", "local"):
        yield f"only outputs and locals depend on inputs, not a variable of causality {row.causality}"
    for name in depends:
        if name not in known:
            yield f"depends on {name}, which is not an input (inputs: {', '.join(sorted(known)) or 'none'})"


def _check_values(row: Row, string_size: int) -> Iterator[str]:
    if row.kind == "STRING":
        size = len(row.start.encode()) + 1
        if size > string_size:
            yield f"start has {size} bytes with its closing zero, allowed are {string_size}"
        if row.causality in ("output", "local") and row.start:
            yield f"start must be empty: a variable of causality {row.causality} is calculated"
        return
    pattern, kind = (_REAL, "number") if row.kind == "REAL" else (_INTEGER, "integer")
    bad = False
    for what, text, none in (("start", row.start, None), ("min", row.min, "NO_MIN"), ("max", row.max, "NO_MAX")):
        if text == none:
            continue
        if not pattern.fullmatch(text):
            bad = True
            yield f"{what} {text or '(empty)'} is not a plain {kind}" + (f" or {none}" if none else "")
        elif row.kind == "REAL" and not math.isfinite(float(text)):
            bad = True
            yield f"{what} {text} is beyond the range of a double"
        elif row.kind != "REAL" and not _INT32[0] <= int(text) <= _INT32[1]:
            bad = True
            yield f"{what} {text} is beyond the range of a 32-bit integer"
    if bad:
        return
    start = float(row.start)
    if row.kind == "BOOLEAN" and start not in (0, 1):
        yield f"start {row.start} is not 0 or 1"
    if row.minimum > row.maximum:
        yield f"min {row.min} is above max {row.max}"
    elif row.causality in ("output", "local"):
        if start != 0:
            yield f"start must be 0: a variable of causality {row.causality} is calculated"
    elif not row.minimum <= start <= row.maximum:
        yield f"start {row.start} is outside {row.min} to {row.max}"


def _check_units(row: Row) -> Iterator[str]:
    if row.kind != "REAL":
        return
    try:
        units.parse(row.unit)
    except units.UnitError as error:
        yield str(error)
        return
    try:
        units.conversion(row.unit, row.display_unit)
    except units.UnitError as error:
        yield f"display {error}" if "display" not in str(error) else str(error)
