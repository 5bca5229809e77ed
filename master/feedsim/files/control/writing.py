"""Values of ours written back into the files of a control: the bytes of changed values differ, and no others.

What cannot be written is listed with the value to type. After the change the file is read again: every other value has
to be what it was, and every changed one what it should be. May use errors. Start reading at change_files().
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import PurePath

from feedsim.files.control.archive import Archive, Entry, scalar
from feedsim.files.control.formats import parse_file
from feedsim.files.control.names import Name, names_of, tied_parameters, value_text
from feedsim.files.control.reading import Reading, TakenValue, Value, View, read_values
from feedsim.foundation.errors import Finding, InputError

# Values this close are the same [relative]: a text of ten digits and its value in SI.
TEXT_TOLERANCE = 1e-9
# The same filter by two names.
_BIT = re.compile(r"(p\d+\.\d+)=1(?:;|$)")  # a condition that begins with a bit
SYNONYMS = {"band_stop": "second_order"}


@dataclass(frozen=True)
class Change:
    """A value of the control that differs from the machine file's.

    old, new: texts in the control's unit. written: whether the new file has it. reason: why not, or what goes with it.
    """

    axis: str
    name: Name
    old: str
    new: str
    written: bool
    reason: str = ""
    where: str = ""


@dataclass
class WrittenFiles:
    """Files with changed values. contents: name -> bytes; none of a file without a change. changes: all differences.
    same: values that agree. notes: what was not touched although it may matter."""

    contents: dict[str, bytes] = field(default_factory=dict)
    changes: list[Change] = field(default_factory=list)
    same: list[TakenValue] = field(default_factory=list)
    notes: list[Finding] = field(default_factory=list)
    reading: Reading | None = None


@dataclass(frozen=True)
class _Edit:
    archive: Archive
    entry: Entry
    text: str


def change_files(
    archives: Sequence[Archive],
    axes: Mapping[str, str],
    values: Mapping[str, Mapping[str, Value]],
    *,
    places: Mapping[str, Sequence[str]] = {},
    assume: Mapping[str, str] = {},
    checked: Collection[str] = (),
) -> WrittenFiles:
    """Lay values into files; values: axis -> our parameter -> SI value. Other arguments and errors: as of
    read_values()."""
    reading = read_values(archives, axes, places=places, assume=assume, checked=checked)
    written = WrittenFiles(reading=reading, notes=list(reading.notes))
    edits: list[_Edit] = []
    for entry in reading.taken:
        if entry.axis and not entry.parameter.startswith("cycles."):
            view = View(archives, entry.axis, axes[entry.axis], places.get(entry.axis, ()), axes, assume)
            _compare(written, edits, view, entry, values[entry.axis])
    for gone in reading.refused:
        ours = values.get(gone.axis, {}).get(gone.name.parameter)
        if ours is None or gone.name.parameter.startswith("cycles.") or isinstance(ours, str):
            continue
        view = View(archives, gone.axis, axes[gone.axis], places.get(gone.axis, ()), axes, assume)
        new, _ = _text(view, gone.name, None, ours)
        if gone.weight == "doubt" and not _equal(gone.text, new):
            written.changes.append(Change(gone.axis, gone.name, gone.text, new, False, gone.reason, gone.where))
    _note_absent_values(written, archives, axes, values, reading)
    _bits(written, archives, axes, values, places, assume)
    _apply(written, edits, archives)
    if written.contents:
        _check(written, archives, axes, values, edits, dict(places=places, assume=assume, checked=checked))
    return written


def _compare(
    written: WrittenFiles, edits: list[_Edit], view: View, taken: TakenValue, values: Mapping[str, Value]
) -> None:
    ours = values.get(taken.parameter)
    group = taken.parameter.rpartition(".")[0]
    if ours is None:
        if group.endswith("friction_pulse") and taken.value != "off" and taken.parameter.endswith("amplitude"):
            written.changes.append(Change(
                taken.axis, taken.name, _old(taken), "0", False,
                "the machine file has no such compensation: switch it off at the control", taken.where,
            ))  # fmt: skip
        return
    if isinstance(ours, str):
        ours = SYNONYMS.get(ours, ours)
    if _are_equal_values(taken.value, ours):
        written.same.append(taken)
        return
    if taken.entry is None or taken.condition:
        new, _ = _text(view, taken.name, None, ours)
        reason = f"it does not act: {_condition(taken)}; change that at the control, and then the value"
        written.changes.append(Change(taken.axis, taken.name, "", new, False, reason, taken.where))
        return
    new, reason = _text(view, taken.name, taken.entry, ours)
    own = [entry for entry in view.entries(taken.name.key, taken.name.number) if (entry[1].index or 0) == 0]
    if taken.entry.sense:  # of a limit that sections share those that would still be tighter
        own = [
            (archive, entry) for archive, entry in own
            if entry is taken.entry
            or entry.sense * taken.name.ours(float(scalar(entry.text)) * entry.scale) < entry.sense * float(ours)
        ]  # fmt: skip
    if not reason and any(entry.section == "[TRAJ]" for _, entry in own):
        reason = "[TRAJ] limits all axes: type the value"
    if not reason and any(entry.checksum for _, entry in own):
        reason = "the line has a checksum; switch it off (MD11230 bit 0), or type the value"
    if not reason and any(archive.container for archive, _ in own):
        reason = "a container with a checksum of its own cannot be written; type the value"
    if reason:
        written.changes.append(Change(taken.axis, taken.name, _old(taken), new, False, reason, taken.where))
        return
    edits += [_Edit(archive, entry, _text(view, taken.name, entry, ours)[0]) for archive, entry in own]
    also = []
    for other, right, sign in tied_parameters(taken.name.acts):
        if right != taken.name.key:
            continue
        key, _, element = other.removesuffix("]").partition("[")
        pair = [entry for entry in view.entries(key) if (entry[1].index or 0) == int(element or 0)]
        before = view.value(other)
        if pair and isinstance(before, float) and isinstance(taken.value, float):
            raw = scalar(taken.entry.text)
            if math.isclose(before, sign * float(raw), rel_tol=TEXT_TOLERANCE):
                text = new if sign > 0 else new.removeprefix("-") if new.startswith("-") else f"-{new}"
                edits += [_Edit(archive, entry, text) for archive, entry in pair]
                also.append(f"{other} is set to {text} with it")
    written.changes.append(Change(taken.axis, taken.name, _old(taken), new, True, "; ".join(also), taken.where))


def _condition(taken: TakenValue) -> str:
    return f"{taken.entry.key} is {taken.entry.text}" if taken.entry is not None else "what switches it on is off"


def _old(taken: TakenValue) -> str:
    return taken.entry.text if taken.entry is not None else ""


def _equal(old: str, new: str) -> bool:
    """Whether two texts of a control are the same number."""
    try:
        a, b = scalar(old), scalar(new)
    except ValueError:
        return False
    return _are_equal_values(a, b)


def _are_equal_values(a: Value, b: Value) -> bool:
    if isinstance(a, str) or isinstance(b, str) or isinstance(a, bool) or isinstance(b, bool):
        return a == b
    return math.isclose(a, b, rel_tol=TEXT_TOLERANCE, abs_tol=1e-300)


def _text(view: View, name: Name, entry: Entry | None, ours: Value) -> tuple[str, str]:
    """The control's text of a value of ours, and why it cannot be written; "" where it can."""
    old = entry.text if entry is not None else ""
    if name.codes:
        code = next((code for code, value in name.codes if value == ours), None)
        return (str(code), "") if code is not None else (str(ours), f"{ours} is switched by another parameter")
    if isinstance(ours, bool) or (not name.si and name.unit != "1"):
        return _switch_text(name, old, bool(ours))
    if isinstance(ours, str):
        return ours, "no number"
    raw = float(ours) / name.factor / (entry.scale if entry is not None else 1.0)
    for k, other in enumerate(name.times):
        ratio = view.value(other)
        if ratio is None or isinstance(ratio, str) or ratio == 0:
            return "", f"it is multiplied by {' / '.join(name.times)}"
        raw = raw / float(ratio) if k == 0 else raw * float(ratio)
    text = number(raw)
    whole = re.fullmatch(r"[+-]?\d+", old) is not None and name.control == "twincat" and "." in name.key
    if whole and "." in text:
        return text, "the list has whole numbers here; type the value, rounded"
    return text, ""


def _switch_text(name: Name, old: str, on: bool) -> tuple[str, str]:
    bit = name.number.partition(".")[2]
    if not bit:
        return (("TRUE" if on else "FALSE") if old.strip().upper() in ("TRUE", "FALSE") else str(int(on))), ""
    try:
        before = scalar(old)
    except ValueError:
        return str(int(on)), ""
    if isinstance(before, str):
        return str(int(on)), "no number"
    value = int(before) | (1 << int(bit)) if on else int(before) & ~(1 << int(bit))
    if old[:2].upper() == "'H":
        return f"'{old[1]}{value:0{len(old) - 3}X}'", ""
    if re.fullmatch(r"[0-9A-Fa-f]+[Hh]", old):
        return f"{value:0{len(old) - 1}X}{old[-1]}", ""
    if old[:2].upper() == "'B":
        return f"'{old[1]}{value:0{len(old) - 3}b}'", ""
    return str(value), ""


def number(value: float) -> str:
    """A number as controls take it: without an exponent, to as many digits as it needs.

    >>> number(4.2), number(1e-7), number(70 / 16.666666666666668)
    ('4.2', '0.0000001', '4.2')
    """
    text = next(
        (
            text
            for digits in range(1, 17)
            if math.isclose(float(text := f"{value:.{digits}g}"), value, rel_tol=TEXT_TOLERANCE / 10)
        ),
        repr(value),
    )
    plain = f"{Decimal(text):f}"
    return plain.rstrip("0").rstrip(".") if "." in plain else plain


def _note_absent_values(
    written: WrittenFiles,
    archives: Sequence[Archive],
    axes: Mapping[str, str],
    values: Mapping[str, Mapping[str, Value]],
    reading: Reading,
) -> None:
    """Values of the machine file whose parameter the files do not have."""
    named = {(entry.axis, entry.name.parameter) for entry in reading.taken}
    named |= {(entry.axis, entry.name.parameter) for entry in reading.refused}
    for axis, own in values.items():
        for parameter, name in names_of(reading.control).items():
            ours = own.get(parameter)
            if ours is None or (axis, parameter) in named or not name.parameter.startswith("drive."):
                continue
            if isinstance(ours, str):
                ours = SYNONYMS.get(ours, ours)
            if ours is False or (isinstance(ours, str) and ours not in {value for _, value in name.codes}):
                continue
            view = View(archives, axis, axes[axis], (), axes, {})
            new, _ = _text(view, name, None, ours)
            reason = "the files have no such parameter"
            for other, right, sign in tied_parameters(name.acts):
                if right == name.key:
                    reason += f"; {other} is to be {'-' if sign < 0 else ''}{new} as well"
            written.changes.append(Change(axis, name, "", new, False, reason))


def _bits(
    result: WrittenFiles,
    archives: Sequence[Archive],
    axes: Mapping[str, str],
    values: Mapping[str, Mapping[str, Value]],
    places: Mapping[str, Sequence[str]],
    assume: Mapping[str, str],
) -> None:
    """Bits of the control that switch a filter on, whose values are to be typed: they are to be set with them."""
    seen: set[tuple[str, str]] = set()
    changes: list[Change] = []
    for change in result.changes:
        group = change.name.parameter.rpartition(".")[0]
        bit = _BIT.match(change.name.acts)
        on = bit is not None and values[change.axis].get(f"{group}.type", "off") != "off"
        if bit is not None and on and not change.written and (change.axis, bit[1]) not in seen:
            seen.add((change.axis, bit[1]))
            view = View(archives, change.axis, axes[change.axis], places.get(change.axis, ()), axes, assume)
            before = view.value(bit[1])
            if before != 1.0:
                chosen = view.sought(bit[1].partition(".")[0]).chosen
                where = f"{chosen[0].name}:{chosen[1].line}" if chosen else ""
                called = f"switches {group.rpartition('.')[2].replace('_', ' ')} on"
                name = replace(change.name, parameter=f"{group}.type", number=bit[1], name=called, unit="", si="",
                               key="", acts="", codes=())  # fmt: skip
                old = "" if before is None else value_text(before)
                reason = "set it with the values of the filter"
                changes.append(Change(change.axis, name, old, "1", False, reason, where))
        changes.append(change)
    result.changes = changes


def _apply(written: WrittenFiles, edits: Sequence[_Edit], archives: Sequence[Archive]) -> None:
    for archive in archives:
        own: dict[tuple[int, int], str] = {}
        for edit in edits:
            if edit.archive is archive and own.setdefault(edit.entry.span, edit.text) != edit.text:
                raise InputError(
                    f"{archive.name}:{edit.entry.line}: {edit.entry.key} is to be {own[edit.entry.span]} and "
                    f"{edit.text}, by two axes or two parameters; make them the same in the machine file"
                )
        if not own:
            continue
        text, at = [], 0
        for (start, end), new in sorted(own.items()):
            text += [archive.text[at:start], new]
            at = end
        written.contents[archive.name] = "".join([*text, archive.text[at:]]).encode(archive.encoding)


def _read_again(archives: Sequence[Archive], contents: Mapping[str, bytes]) -> list[Archive]:
    """The files as they would be, those that others include behind them."""
    inner = {id(file) for archive in archives for file in archive.included.values()}
    result: list[Archive] = []
    for archive in archives:
        if id(archive) not in inner:

            def include(word: str, included: Mapping[str, Archive] = archive.included) -> tuple[PurePath, bytes]:
                return included[word].path, contents.get(included[word].name, included[word].content)

            made = parse_file(archive.name, contents.get(archive.name, archive.content), archive.path, include)
            result += [made, *{id(file): file for file in made.included.values()}.values()]
    return result


def _check(
    result: WrittenFiles, archives: Sequence[Archive], axes: Mapping[str, str],
    values: Mapping[str, Mapping[str, Value]], edits: Sequence[_Edit], how: Mapping[str, object],
) -> None:  # fmt: skip
    """Read what was made: every value is as it was, but the changed ones, which are as they should be."""
    again = _read_again(archives, result.contents)
    for archive, made in zip(archives, again, strict=True):
        changed_ones = {id(edit.entry): edit.text for edit in edits if edit.archive is archive}
        wanted = [changed_ones.get(id(entry), entry.text) for entry in archive.entries]
        if [entry.text for entry in made.entries] != wanted or made.odd_count != archive.odd_count:
            raise InputError(f"{archive.name}: writing the values would change others; nothing was written")
    now = {(entry.axis, entry.parameter): entry.value for entry in read_values(again, axes, **how).taken}  # type: ignore[arg-type]
    for change in result.changes:
        if change.written:
            ours = values[change.axis][change.name.parameter]
            ours = SYNONYMS.get(ours, ours) if isinstance(ours, str) else ours
            value = now.get((change.axis, change.name.parameter))
            if value is not None and not _are_equal_values(value, ours):  # None: another change has switched it off
                raise InputError(
                    f"{change.axis} {change.name.number}: {change.new} would be read as {value}, not as {ours}; "
                    "nothing was written"
                )
