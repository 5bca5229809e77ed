"""Text files of oscilloscopes in controls: TwinCAT Scope (CSV export with its block of headers), LinuxCNC's halscope.

They are known by their first lines. Nothing is resampled but channels of another sampling time, which keep their value
until their next one.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.errors import InputError, few
from feedsim.files import regular
from feedsim.files.spellings import known_unit, spelled
from feedsim.trace.trace import Array

SCOPE_BYTES = 65536  # bytes within which a file shows what it is
# Rows of a TwinCAT header; they repeat their key ahead of every column of time.
KEYS = frozenset({
    "Name", "SymbolName", "SymbolComment", "NetId", "NetID", "Port", "IndexGroup", "IndexOffset", "Data-Type",
    "SampleTime[ms]", "SymbolBased", "VariableSize", "Offset", "ScaleFactor", "BitMask", "Unit", "Unit ScaleFactor",
    "Unit Offset",
})  # fmt: skip
PROJECT_KEYS = frozenset({"File", "Starttime of export", "StartRecord"})
_TWINCAT = re.compile(
    r"^(?:Starttime of export|StartRecord|SampleTime\[ms\]|SymbolName|Data-Type)([\t;,])", re.MULTILINE
)
_HALSCOPE = re.compile(r"\s*Sampling period is (\d+) ns")
TICKS = 1e15  # a time beyond is a date in 100 ns, not in ms since the start
TICK, MS = 1e-7, 1e-3  # s
MAX_PERIOD_DIGITS = 12  # digits of halscope's sampling period in ns: 1000 s


@dataclass(frozen=True, eq=False)
class Signals:
    """Columns of one length, "time" [s] among them, their units ("" where none is shown), what a reader should know."""

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    notes: tuple[str, ...] = ()


def read_scope(path: Path) -> Signals | None:
    """The signals of such a file; None where it is another one. InputError with the line: what cannot be read."""
    if not path.is_file():
        return None  # a pipe is read once
    with regular.opened(path) as file:
        raw = file.read(SCOPE_BYTES)
    head = _decoded(raw)
    if _HALSCOPE.match(head):
        return _halscope(path, _decoded(regular.content(path)))
    if result := _TWINCAT.search(head):
        return _twincat(path, _decoded(regular.content(path)), result[1])
    return None


def _decoded(raw: bytes) -> str:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # A character may be cut at the end of a head.
        return raw.decode("utf-8-sig" if error.start > len(raw) - 4 else "cp1252", "replace")


def unique(names: Iterable[str]) -> list[str]:
    """Names that a column may have: without brackets, each once."""
    result: list[str] = []
    for name in names:
        plain = "".join(c for c in name.strip().replace("[", "(").replace("]", ")") if c.isprintable()) or "signal"
        plain = f"{plain} (1)" if plain == "time" else plain
        again = 2
        candidate = plain
        while candidate in result:
            candidate, again = f"{plain} ({again})", again + 1
        result.append(candidate)
    return result


# --- TwinCAT ---


def _twincat(path: Path, text: str, separator: str) -> Signals:
    rows = list(csv.reader(text.splitlines(), delimiter=separator))
    first = next((k for k, row in enumerate(rows) if _is_data(row)), None)
    if first is None:
        raise InputError(f"{path}: a TwinCAT Scope header without a row of values below it")
    header: dict[str, list[str]] = {}
    for row in rows[:first]:
        key = row[0].strip() if row else ""
        if key in PROJECT_KEYS:
            header.pop("Name", None)  # that ahead of them is of the project
        elif key in KEYS:
            header[key] = row
    if "Name" not in header:
        raise InputError(f"{path}: a TwinCAT Scope header without the names of its channels; export it with them")
    names = header["Name"]
    clocks = [k for k, cell in enumerate(names) if cell.strip() == "Name"]
    channels = {k: names[k].strip() for k in range(len(names)) if k not in clocks and names[k].strip()}
    if not channels:
        raise InputError(f"{path}: a TwinCAT Scope header without the names of its channels; export it with them")
    if "SymbolName" in header and len(set(channels.values())) < len(channels):
        channels = {k: _cell(header, "SymbolName", k) or name for k, name in channels.items()}
    body = [(k + 1, row) for k, row in enumerate(rows[first:], first) if row and row[0].strip() != "EOF"]
    width = max(len(row) for row in header.values())
    for line, row in body:
        if any(cell.strip() for cell in row[width:]):
            hint = "; with commas between columns, numbers need decimal points" if separator == "," else ""
            raise InputError(f"{path}:{line}: {len(row)} values below {width} columns of the header{hint}")
    width = max(max(channels), max(clocks)) + 1
    if any(len(row) < width for _, row in body[:1]):
        raise InputError(
            f"{path}:{first + 1}: {len(rows[first])} values below {width} columns of the header; export it with a "
            "column of time for every channel or sampling time (Timelines: All)"
        )
    return _grouped(path, header, clocks, channels, body)


def _cell(header: Mapping[str, Sequence[str]], key: str, column: int) -> str:
    row = header.get(key, ())
    return row[column].strip() if column < len(row) else ""


def _grouped(
    path: Path, header: Mapping[str, Sequence[str]], clocks: Sequence[int], channels: Mapping[int, str],
    body: Sequence[tuple[int, Sequence[str]]],
) -> Signals:  # fmt: skip
    """One time of all groups of channels: that of the group with the most rows."""
    groups: dict[int, tuple[Array, dict[int, Array]]] = {}
    for clock in clocks:
        own = [k for k in channels if clock < k and not any(clock < other < k for other in clocks)]
        if not own:
            continue
        kept = [(line, row) for line, row in body if len(row) > clock and row[clock].strip()]
        if short := [line for line, row in kept if len(row) <= max(own)]:
            raise InputError(f"{path}:{short[0]}: no value of {channels[max(own)]!r} beside its time")
        times = _numbers(path, kept, clock, "the time")
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size:
            line = kept[int(back[0]) + 1][0]
            raise InputError(
                f"{path}:{line}: the time {times[back[0] + 1]:.15g} follows {times[back[0]]:.15g}; it must increase"
            )
        times = (times - times[0]) * (TICK if times.size and times[0] > TICKS else MS) if times.size else times
        groups[clock] = times, {k: _numbers(path, kept, k, channels[k]) for k in own}
    if not groups:
        raise InputError(f"{path}: no channel has a column of time; export it with one (Timelines: All)")
    base = max(groups, key=lambda clock: groups[clock][0].size)
    time = groups[base][0]
    if time.size < 2:
        raise InputError(f"{path}: {time.size} rows of values; at least 2 are needed")
    order = [k for own in groups.values() for k in own[1]]
    titles = dict(zip(order, unique(channels[k] for k in order), strict=True))
    columns, units, notes, resampled, unknown, scaled = {"time": time}, {"time": "s"}, [], [], [], []
    for times, values in groups.values():
        same = times.size == time.size and bool(np.all(np.abs(times - time) <= 1e-9 + 1e-9 * time))
        for k, signal in values.items():
            name = titles[k]
            rows = np.searchsorted(times, time + 1e-9, side="right") - 1
            columns[name] = signal if same else signal[rows.clip(0)]
            resampled += [] if same else [name]
            unit = _cell(header, "Unit", k)
            known = bool(unit) and known_unit(unit)
            units[name] = spelled(unit) if known else ""
            unknown += [name] if unit and not known and unit.strip("()").lower() not in ("none", "-") else []
            factor = _cell(header, "ScaleFactor", k).replace(",", ".")
            scaled += [name] if factor not in ("", "1", "1.0") else []
    for names, words in (
        (resampled, "has another sampling time: its values are kept until its next one"),
        (unknown, "is in a unit that is not known"),
        (scaled, "has a scale factor; the file does not say whether its values are scaled"),
    ):
        notes += [f"{path}: {few(names, 4)} {words}"] if names else []
    return Signals(columns, units, tuple(notes))


def _is_data(row: Sequence[str]) -> bool:
    return bool(row) and _number(row[0]) is not None and len([c for c in row if _number(c) is not None]) > 1


def _number(cell: str) -> float | None:
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return None


def _numbers(path: Path, rows: Sequence[tuple[int, Sequence[str]]], k: int, name: str) -> Array:
    try:
        return np.array([float(row[k].replace(",", ".")) for _, row in rows], dtype=np.float64)
    except ValueError:
        line, cell = next((line, row[k]) for line, row in rows if _number(row[k]) is None)
        words = {"true": 1.0, "false": 0.0}
        if all(row[k].strip().lower() in words for _, row in rows):
            return np.array([words[row[k].strip().lower()] for _, row in rows])
        raise InputError(f"{path}:{line}: {cell!r} in {name!r} is no number") from None


# --- LinuxCNC ---


def _halscope(path: Path, text: str) -> Signals:
    """Lines of `label value label value`, below the sampling period in ns."""
    first, *lines = text.splitlines()
    result = _HALSCOPE.match(first)
    if result is None or not int(result[1][:MAX_PERIOD_DIGITS]) or len(result[1]) > MAX_PERIOD_DIGITS:
        raise InputError(
            f"{path}:1: {first[:80]!r}; a sampling period in ns is expected, of up to {MAX_PERIOD_DIGITS} digits"
        )
    rows = [(k, line.split()) for k, line in enumerate(lines, 2) if line.strip()]
    if len(rows) < 3:
        raise InputError(f"{path}: {len(rows)} rows of samples; at least 3 are needed")
    labels = rows[0][1][::2]
    if len(rows[-1][1]) < 2 * len(labels):
        rows.pop()
    values = []
    for line, cells in rows:
        if cells[::2] != labels or len(cells) != 2 * len(labels):
            raise InputError(f"{path}:{line}: holds {' '.join(cells[::2])}, the first row {' '.join(labels)}")
        try:
            values.append([float(cell) for cell in cells[1::2]])
        except ValueError:
            wrong = next(cell for cell in cells[1::2] if "," in cell or _number(cell) is None)
            raise InputError(f"{path}:{line}: {wrong!r} is no number") from None
    table = np.array(values[:-1], dtype=np.float64)  # halscope writes one sample more than it has recorded
    names = unique(labels)
    columns: dict[str, Array] = {"time": np.arange(len(table), dtype=np.float64) * (int(result[1]) * 1e-9)}
    columns |= {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
    note = f"{path}: halscope writes one sample more than it has recorded: the last one is left out"
    return Signals(columns, {"time": "s"} | dict.fromkeys(names, ""), (note,))
