"""Text files of oscilloscopes in controls: TwinCAT Scope (CSV export with its block of headers), LinuxCNC's halscope.

They are known by their first lines. Nothing is resampled but channels of another sampling time, which keep their value
until their next one.
"""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.files import source
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.foundation.units import known_unit, spell_unit

MAX_CHANNELS = 1000
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
_HALSCOPE = re.compile(r"\s*(#?)\s*Sampling period is (\d+) n(?:s|Sec)\b", re.IGNORECASE)
_SWAPPED_SEPARATORS = str.maketrans(",.", ".,")
TICKS = 1e15  # a time beyond is a date in 100 ns, not in ms since the start
TICK, MS = 1e-7, 1e-3  # s
MAX_CLOCK_DIFFERENCE = 1e-9  # [s] by which the same instant may differ between two clocks
FLAGS = ("BOOL", "BIT", "BIT8")  # types of TwinCAT for what is on or off
MAX_PERIOD_DIGITS = 12  # digits of halscope's sampling period in ns: 1000 s


@dataclass(frozen=True, eq=False)
class Signals:
    """Columns of one length, "time" [s] among them, their units ("" where none is shown), what a reader should know."""

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    notes: tuple[Finding, ...] = ()


def read_scope(path: Path) -> Signals | None:
    """The signals of such a file; None where it is another one. InputError with the line: what cannot be read."""
    if not path.is_file():
        return None  # a pipe is read once
    with source.open_file(path) as file:
        raw = file.read(SCOPE_BYTES)
    head = _decode_head(raw)
    if _HALSCOPE.match(head):
        return _halscope(path, _decode_head(source.content(path)))
    if result := _TWINCAT.search(head):
        return _twincat(path, _decode_head(source.content(path)), result[1])
    return None


def _decode_head(raw: bytes) -> str:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # A character may be cut at the end of a head.
        return raw.decode("utf-8-sig" if error.start > len(raw) - 4 else "cp1252", "replace")


def unique(names: Iterable[str]) -> list[str]:
    """Names that a column may have: without brackets, each once."""
    result: dict[str, None] = {}
    counts: dict[str, int] = {}
    for name in names:
        plain = "".join(c for c in name.strip().replace("[", "(").replace("]", ")") if c.isprintable()) or "signal"
        plain = f"{plain} (1)" if plain == "time" else plain
        candidate = plain
        while candidate in result:
            counts[plain] = counts.get(plain, 1) + 1
            candidate = f"{plain} ({counts[plain]})"
        result[candidate] = None
    return list(result)


# --- TwinCAT ---


def _twincat(path: Path, text: str, separator: str) -> Signals:
    try:
        rows = list(csv.reader(text.splitlines(), delimiter=separator))
    except csv.Error as error:
        raise InputError(f"{path}: {error}") from None
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
    channels = {k: name.strip() for k, name in enumerate(names) if name.strip() not in ("", "Name")}
    if len(channels) > MAX_CHANNELS:
        raise InputError(f"{path}: {len(channels)} channels of TwinCAT Scope; allowed: up to {MAX_CHANNELS}")
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
    return _merge_groups(path, header, clocks, channels, body)


def _cell(header: Mapping[str, Sequence[str]], key: str, column: int) -> str:
    row = header.get(key, ())
    return row[column].strip() if column < len(row) else ""


def _merge_groups(
    path: Path, header: Mapping[str, Sequence[str]], clocks: Sequence[int], channels: Mapping[int, str],
    body: Sequence[tuple[int, Sequence[str]]],
) -> Signals:  # fmt: skip
    """All channels over one time: that of the group with the most rows, where all of them are recorded."""
    groups: list[tuple[_Clock, dict[int, Array]]] = []
    silent: list[str] = []
    for clock, after in zip(clocks, [*clocks[1:], math.inf], strict=True):
        own = [k for k in channels if clock < k < after]
        if not own:
            continue
        kept = [(line, row) for line, row in body if len(row) > clock and row[clock].strip()]
        if short := [line for line, row in kept if len(row) <= max(own)]:
            raise InputError(f"{path}:{short[0]}: no value of {channels[max(own)]!r} beside its time")
        if not kept:
            silent += [channels[k] for k in own]
            continue
        groups.append((_clock(path, kept, clock), {k: _numbers(path, kept, k, channels[k]) for k in own}))
    if not groups:
        raise InputError(f"{path}: no channel has a column of time; export it with one (Timelines: All)")
    base, channels_of_base = max(groups, key=lambda group: group[0].instants.size)
    if base.instants.size < 2:
        raise InputError(f"{path}: {base.instants.size} rows of values; at least 2 are needed")
    if apart := [own for other, own in groups if other.unit != base.unit]:
        raise InputError(
            f"{path}: the time of {channels[min(apart[0])]!r} counts from another instant than that of other channels; "
            "export all of them with the same time"
        )
    order = [k for _, own in groups for k in own]
    titles = dict(zip(order, unique(channels[k] for k in order), strict=True))
    times = [clock.since(base) for clock, _ in groups]
    time, slower = _one_time(path, base.since(base), times, [titles[min(own)] for _, own in groups])
    columns, units, notes, unknown, scaled = {"time": time}, {"time": "s"}, list[Finding](), [], []
    resampled: list[str] = []
    interpolated: list[str] = []
    for instants, keeps, (_, values) in zip(times, slower, groups, strict=True):
        at = _rows_at(instants, time)
        same = _are_same_instants(instants[at], time)
        for k, signal in values.items():
            name = titles[k]
            # What is on or off has no values in between.
            stepped = (
                keeps or same or _cell(header, "Data-Type", k).upper() in FLAGS or bool(np.isin(signal, (0, 1)).all())
            )
            columns[name] = signal[at] if stepped else np.interp(time, instants, signal)
            (resampled if stepped else interpolated).extend([] if same else [name])
            unit = _cell(header, "Unit", k)
            known = bool(unit) and known_unit(unit)
            units[name] = spell_unit(unit) if known else ""
            unknown += [name] if unit and not known and unit.strip("()").lower() not in ("none", "-") else []
            factor = _cell(header, "ScaleFactor", k).replace(",", ".")
            scaled += [name] if factor not in ("", "1", "1.0") else []
    if time.size < base.instants.size or any(instants[0] < time[0] - MAX_CLOCK_DIFFERENCE for instants in times):
        notes.append(Finding(
            "rows-left-out", "doubt",
            f"{path}: its channels begin or end at different times; read are {time[0]:.6g} to {time[-1]:.6g} s, where "
            f"all are recorded, counted from the first value of {titles[min(channels_of_base)]}",
            str(path),
        ))  # fmt: skip

    def said(names: Sequence[str], words: str) -> str:
        return f"{path}: {shorten_list(names, 4)} {words}"

    rarer = "has another sampling time: its values are kept until its next one"
    between = "is sampled at other instants: its values are interpolated"
    unclear = "has a scale factor; the file does not say whether its values are scaled"
    findings = (
        (silent, Finding("channel-empty", "doubt", said(silent, "has no value"))),
        (resampled, Finding("channel-resampled", "doubt", said(resampled, rarer))),
        (interpolated, Finding("channel-resampled", "doubt", said(interpolated, between))),
        (unknown, Finding("unit-unknown", "doubt", said(unknown, "is in a unit that is not known"))),
        (scaled, Finding("scale-unclear", "doubt", said(scaled, unclear))),
    )
    notes += [replace(finding, place=str(path)) for names, finding in findings if names]
    return Signals(columns, units, tuple(notes))


@dataclass(frozen=True, eq=False)
class _Clock:
    """A column of time as the file has it, in units of `unit` [s]: whole numbers of 100 ns, dates, or ms."""

    instants: NDArray[Any]
    unit: float

    def since(self, other: _Clock) -> Array:
        """Seconds since the first instant of a clock of the same unit."""
        return np.asarray((self.instants - other.instants[0]) * self.unit, dtype=np.float64)


def _clock(path: Path, rows: Sequence[tuple[int, Sequence[str]]], column: int) -> _Clock:
    times = _numbers(path, rows, column, "the time")
    dates = bool(times[0] > TICKS)
    instants: NDArray[Any] = times
    if dates and all((cell := row[column].strip()).isdecimal() and len(cell) < 19 for _, row in rows):
        instants = np.array([int(row[column]) for _, row in rows], dtype=np.int64)  # beyond the digits of a double
    if (back := np.flatnonzero(np.diff(instants) <= 0)).size:
        line, before, after = rows[int(back[0]) + 1][0], times[back[0]], times[back[0] + 1]
        raise InputError(f"{path}:{line}: the time {after:.15g} follows {before:.15g}; it must increase")
    return _Clock(instants, TICK if dates else MS)


def _one_time(path: Path, base: Array, times: Sequence[Array], names: Sequence[str]) -> tuple[Array, list[bool]]:
    """Instants of the base at which all of several clocks run, and which of these tick less often at the same instants.

    names: of a channel of every clock. InputError: they have no time in common.
    """
    slower = [_are_same_instants(base[_rows_at(base, instants)], instants) for instants in times]
    begin = max(instants[0] for instants in times)
    # A value of what ticks less often lasts until the next one.
    lasting = [_usual_step(instants) - _usual_step(base) if keeps else 0.0
               for instants, keeps in zip(times, slower, strict=True)]  # fmt: skip
    end = min(instants[-1] + more for instants, more in zip(times, lasting, strict=True))
    time = base[(base >= begin - MAX_CLOCK_DIFFERENCE) & (base <= end + MAX_CLOCK_DIFFERENCE)]
    if time.size < 2:
        spans = [f"{name} {own[0]:.6g} to {own[-1]:.6g} s" for name, own in zip(names, times, strict=True)]
        raise InputError(f"{path}: its channels have no time in common: {shorten_list(spans, 4)}")
    return time, slower


def _are_same_instants(one: Array, other: Array) -> bool:
    """Whether instants of two clocks are the same."""
    return bool(np.all(np.abs(one - other) <= MAX_CLOCK_DIFFERENCE + 1e-9 * np.abs(other)))


def _rows_at(instants: Array, time: Array) -> NDArray[np.intp]:
    """Row of the last instant that is not later, the first row where all are."""
    return np.asarray((np.searchsorted(instants, time + MAX_CLOCK_DIFFERENCE, side="right") - 1).clip(0))


def _usual_step(time: Array) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


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
    """The sampling period in ns; below it, up to version 2.8, lines of `label value label value`, from 2.9 on labels
    and then values, with semicolons, and remarks between."""
    first, *lines = text.splitlines()
    result = _HALSCOPE.match(first)
    if result is None or not int(result[2][:MAX_PERIOD_DIGITS]) or len(result[2]) > MAX_PERIOD_DIGITS:
        raise InputError(
            f"{path}:1: {first[:80]!r}; a sampling period in ns is expected, of up to {MAX_PERIOD_DIGITS} digits"
        )
    rows = [(k, line) for k, line in enumerate(lines, 2) if line.strip() and not line.startswith("#")]
    notes: tuple[Finding, ...] = ()
    if result[1]:
        labels, values = _table(path, rows)
    else:
        labels, values = _read_labelled_lines(path, [(k, line.split()) for k, line in rows])
        values = values[:-1]  # halscope writes one sample more than it has recorded
        text = f"{path}: halscope writes one sample more than it has recorded: the last one is left out"
        notes = (Finding("rows-left-out", "doubt", text, str(path)),)
    if len(values) < 2:
        raise InputError(f"{path}: {len(rows)} rows of samples; at least 3 are needed")
    table = np.array(values, dtype=np.float64)
    names = unique(labels)
    columns: dict[str, Array] = {"time": np.arange(len(table), dtype=np.float64) * (int(result[2]) * 1e-9)}
    columns |= {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
    return Signals(columns, {"time": "s"} | dict.fromkeys(names, ""), notes)


def _read_labelled_lines(path: Path, rows: list[tuple[int, list[str]]]) -> tuple[list[str], list[list[float]]]:
    """Labels and values of lines that have both in turn; a last line that is not whole is left out."""
    labels = rows[0][1][::2] if rows else []
    if rows and len(rows[-1][1]) < 2 * len(labels):
        rows = rows[:-1]
    values = []
    for line, cells in rows:
        if cells[::2] != labels or len(cells) != 2 * len(labels):
            raise InputError(
                f"{path}:{line}: holds {shorten_list(cells[::2], 20)}, the first row {shorten_list(labels, 20)}"
            )
        values.append(_samples(path, line, cells[1::2], comma="," in rows[0][1][1]))
    return labels, values


def _table(path: Path, rows: list[tuple[int, str]]) -> tuple[list[str], list[list[float]]]:
    """Labels of the first line, and values of the others."""
    labels = rows[0][1].split(";") if rows else []
    values = []
    for line, text in rows[1:]:
        cells = text.split(";")
        if len(cells) != len(labels):
            raise InputError(f"{path}:{line}: {len(cells)} values, the header has {len(labels)} columns")
        values.append(_samples(path, line, cells, comma="," in rows[1][1]))
    return labels, values


def _samples(path: Path, line: int, cells: list[str], *, comma: bool) -> list[float]:
    """Numbers with decimal points, or commas, as the locale of halscope had them in the first row."""
    plain = [cell.translate(_SWAPPED_SEPARATORS) for cell in cells] if comma else cells
    try:
        return [float(cell) for cell in plain]
    except ValueError:
        wrong = next(cell for cell, text in zip(cells, plain, strict=True) if "," in text or _number(text) is None)
        raise InputError(f"{path}:{line}: {wrong[:80]!r} is no number") from None
