"""Time stamps -> seconds since the first one: dates as loggers and gateways write them, times of day, milliseconds
since 1970.

The order of day, month and year is taken from the dates themselves; where they leave it open, they are refused. Local
time that is set back in autumn is refused; times of day without a date go on over midnight.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, date, datetime

import numpy as np

from feedsim.errors import InputError
from feedsim.trace.trace import Array

DAY, HOUR = 86400, 3600  # s
INTERVAL_ADVICE = "give time: {interval: 2 ms} in a mapping file, with the interval of the rows"
STAMP_FORMS = "time stamps are read such as 2025-03-04 10:00:00.002, 2025-03-04T10:00:00Z, 04.03.2025 10:00:00,002"
# Milliseconds since 1970 of the years 2000 to 2100, and the steps [ms] up to which whole numbers without a unit are
# such: a counter of us or ns makes longer ones.
EPOCH, MAX_EPOCH_STEP = (9.46e11, 4.1e12), 100.0
_EPOCH_NAME = re.compile(r"time|date|datum|zeit|stamp|epoch|unix|^t$", re.IGNORECASE)
_MONTHS = {name: k // 3 + 1 for k in range(0, 36, 3) if (name := "janfebmaraprmayjunjulaugsepoctnovdec"[k : k + 3])}
_STAMP = re.compile(
    r"""(?:(?P<date>\d{1,4}([-/.])(?:\d{1,2}|[A-Za-z]{3})\2\d{1,4})(?:T|,?\s+))?
        (?P<hour>\d{1,2}):(?P<minute>[0-5]\d):(?P<second>[0-5]\d|60)(?:[.,:](?P<part>\d{1,9}))?
        (?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?
        (?:\s*(?P<zone>[Zz]|UTC|GMT|[+-]\d{2}(?::?\d{2})?))?""",
    re.VERBOSE | re.ASCII,
)
Order = Callable[[str, str, str], date]  # parts of a date -> the day; ValueError, KeyError where it is none


@dataclass(frozen=True, eq=False)
class Stamps:
    """Seconds since the first stamp, and what a reader of the file should know.

    day: of the first stamp, ISO 8601; "" where the stamps have no date, or it is not clear.
    """

    seconds: Array
    note: str
    day: str = ""


def is_stamp(cell: str) -> bool:
    """Whether a cell has the form of a time stamp."""
    return _STAMP.fullmatch(cell) is not None


def like_a_stamp(cell: str) -> bool:
    """Whether a cell that is no number looks like a date or a time of day, known here or not."""
    return re.search(r"\d[-:/.T]\d\d?[-:/.]\d", cell) is not None


def stamps(cells: Sequence[str], lines: Sequence[int], where: str, name: str) -> Stamps:
    """Seconds of a column of stamps. InputError with the line: a cell that is none, time that stands still or runs
    back, dates whose day and month are not clear."""
    clocks = np.empty(len(cells))
    parts = np.empty(len(cells))
    days, zones = [], []
    for row, cell in enumerate(cells):
        match = _STAMP.fullmatch(cell)
        if match is None or (hour := _hour(match)) is None:
            raise InputError(f"{where}:{lines[row]}: {cell!r} in column {name!r} is no time stamp; {STAMP_FORMS}")
        clocks[row] = 3600 * hour + 60 * int(match["minute"]) + int(match["second"])
        parts[row] = float(f"0.{match['part']}") if match["part"] else 0.0
        days.append(match["date"])
        zones.append(match["zone"])
    unlike = next((row for row in range(1, len(cells)) if bool(zones[row]) != bool(zones[0])
                   or bool(days[row]) != bool(days[0])), None)  # fmt: skip
    if unlike is not None:
        raise InputError(
            f"{where}:{lines[unlike]}: {cells[unlike]!r} in column {name!r}, but {cells[0]!r} in line {lines[0]}; "
            "date and time zone are needed in all stamps or in none"
        )
    offsets = {zone: _offset(zone) for zone in set(zones)}
    clocks -= np.array([offsets[zone] for zone in zones])
    day = ""
    if days[0]:
        numbers = _numbered(days, where, lines[0], name)
        whole = DAY * np.array([numbers[day] - numbers[days[0]] for day in days], dtype=np.float64) + clocks
        day = _first_day(days, numbers)
    else:  # half a day back is midnight
        whole = clocks + DAY * np.cumsum(np.diff(clocks, prepend=clocks[0]) < -DAY / 2)
    seconds = (whole - whole[0]) + (parts - parts[0])
    note = f"{where}: time counts from the first stamp in column {name!r}, {cells[0]}"
    if (row := _check(seconds, cells, lines, where, name)) and not zones[0]:
        note += f"; in line {lines[row]} the clock goes on by an hour, as where summer time begins"
    return Stamps(seconds, note, day)


def _first_day(days: Sequence[str], numbers: Mapping[str, int]) -> str:
    """The first date, ISO 8601; "" where it alone does not show the order of its parts."""
    if len(numbers) > 1:
        return date.fromordinal(numbers[days[0]]).isoformat()
    possible = set()
    for order in _orders(days[0]):
        with suppress(ValueError, KeyError):
            possible.add(order(*re.split("[-/.]", days[0])))
    return possible.pop().isoformat() if len(possible) == 1 else ""


def _hour(match: re.Match[str]) -> int | None:
    hour = int(match["hour"])
    if not match["half"]:
        return hour if hour < 24 else None
    return hour % 12 + (12 if match["half"] in "pP" else 0) if 1 <= hour <= 12 else None


def _offset(zone: str | None) -> int:
    """Seconds that a time zone is ahead of UTC."""
    if not zone or zone[0] not in "+-":
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    return (1 if zone[0] == "+" else -1) * (3600 * int(digits[:2]) + 60 * int(digits[2:]))


def _numbered(days: Sequence[str], where: str, line: int, name: str) -> Mapping[str, int]:
    """Date -> its number. Of one date any will do; of several the order of their parts must show."""
    changes = [row for row in range(1, len(days)) if days[row] != days[row - 1]]
    if not changes:
        return {days[0]: 0}
    dates = list(dict.fromkeys(days))
    possible: list[dict[str, int]] = []
    for order in _orders(dates[0]):
        try:
            numbers = {text: order(*re.split("[-/.]", text)).toordinal() for text in dates}
        except (ValueError, KeyError):
            continue
        if all(numbers[days[row]] >= numbers[days[row - 1]] for row in changes):
            possible.append(numbers)
    # A record that goes on over midnight goes to the next day.
    next_day = [n for n in possible if all(n[days[row]] - n[days[row - 1]] == 1 for row in changes)]
    if possible and all(n == possible[0] for n in possible):
        return possible[0]
    if len(next_day) == 1:
        return next_day[0]
    example = f"{dates[0]!r} and {dates[1]!r} in column {name!r}"
    if possible:
        raise InputError(
            f"{where}:{line}: {example}: the day may stand ahead of the month or behind it; write dates as "
            f"2025-03-04, or {INTERVAL_ADVICE}"
        )
    raise InputError(
        f"{where}:{line}: {example} are no dates of which one follows the other; {STAMP_FORMS}; or {INTERVAL_ADVICE}"
    )


def _orders(text: str) -> list[Order]:
    """Orders that the parts of a date may have."""
    first, middle, last = re.split("[-/.]", text)
    if len(first) == 4:
        return [lambda y, m, d: date(int(y), int(m), int(d))]
    by_day: Order = lambda d, m, y: date(_year(y), int(m), int(d))  # noqa: E731
    by_month: Order = lambda m, d, y: date(_year(y), int(m), int(d))  # noqa: E731
    if middle.isalpha():
        return [lambda d, m, y: date(_year(y), _MONTHS[m.lower()], int(d))]
    if "." in text:
        return [by_day]
    by_year: Order = lambda y, m, d: date(_year(y), int(m), int(d))  # noqa: E731
    return [by_day, by_month, *([by_year] if len(last) == 2 else [])]


def _year(text: str) -> int:
    return int(text) if len(text) > 2 else 2000 + int(text)


def _check(seconds: Array, cells: Sequence[str], lines: Sequence[int], where: str, name: str) -> int:
    """The row before which the clock was set forward by an hour, 0: none. InputError: time that does not increase."""
    steps = np.diff(seconds)
    usual = max(1.0, 2 * float(np.quantile(steps, 0.5, method="lower"))) if steps.size else 0.0
    if not (wrong := np.flatnonzero(steps <= 0)).size:
        forward = np.flatnonzero(np.abs(steps - HOUR) <= usual) if usual < HOUR / 2 else wrong
        return int(forward[0]) + 1 if forward.size else 0
    row = int(wrong[0]) + 1
    what = f"{where}:{lines[row]}: {cells[row]!r} in column {name!r} follows {cells[row - 1]!r}"
    if steps[row - 1] == 0:
        raise InputError(f"{what}: stamps are too coarse to tell rows apart; {INTERVAL_ADVICE}")
    if abs(steps[row - 1] + HOUR) <= usual:
        raise InputError(
            f"{what}: the clock was set back by an hour; give stamps with their time zone, or {INTERVAL_ADVICE}"
        )
    raise InputError(f"{what}; time must increase. Put rows in order, or {INTERVAL_ADVICE}")


def epoch(name: str, values: Array) -> str:
    """The instant of the first row where a column without a unit has milliseconds since 1970; "" where it has not."""
    low, high = EPOCH
    if len(values) < 2 or not _EPOCH_NAME.search(name) or not (low <= values[0] <= high and low <= values[-1] <= high):
        return ""
    steps = np.diff(values)
    if np.any(values != np.floor(values)) or steps.min() < 0 or not 0 < np.median(steps) <= MAX_EPOCH_STEP:
        return ""
    return datetime.fromtimestamp(values[0] / 1000, UTC).replace(tzinfo=None).isoformat(" ", "milliseconds")
