"""Values of our parameters, in SI, out of what files of a control hold; and what could not be taken, with the reason.

Nothing is guessed. A value is taken where the file has it once, where it acts, where its unit is confirmed by a public
source (or by who calls), and where nothing contradicts it. May use errors. Start reading at read_values().
"""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from feedsim.files.control.archive import Archive, Entry, scalar
from feedsim.files.control.names import (
    ConditionVerdict,
    Name,
    condition_names,
    explain_absence,
    judge_conditions,
    table,
    value_text,
)
from feedsim.foundation.errors import Finding, InputError

# --- What values of feed axes usually are: a value far outside is read in a wrong unit, more often than it is true ----


RANGES_FILE = Path(__file__).with_name("usual.csv")


@dataclass(frozen=True)
class UsualRange:
    """A range, both ends included. unit: SI, of both ends; "" of a count."""

    low: float
    high: float
    unit: str

    def holds(self, value: float) -> bool:
        """Whether a value lies within; ends are not exact, and neither is the comparison."""
        return self.low * (1 - 1e-9) <= value <= self.high * (1 + 1e-9)


@cache
def usual_ranges() -> Mapping[str, UsualRange]:
    """Our parameter -> what it usually is. The ranges are judgement, from axes of tens of grams to tens of tonnes."""
    with RANGES_FILE.open(encoding="utf-8", newline="") as file:
        return {
            row["parameter"]: UsualRange(float(row["low"]), float(row["high"]), row["unit"])
            for row in csv.DictReader(file)
        }


# --- Files of a control as one axis sees them: which entries of a name are its own, and what their conditions find ----


Value = float | bool | str
MOST_LISTED = 40  # names in a message


@dataclass(frozen=True)
class Sought:
    """A parameter in the files of an axis: its entries, of all elements, and whether one of them was taken.

    problem: why none was. note: what there is to say of the one that was.
    """

    entries: Sequence[tuple[Archive, Entry]]
    chosen: tuple[Archive, Entry] | None
    problem: str = ""
    note: str = ""


class View:
    """Files as one axis sees them."""

    def __init__(
        self, archives: Sequence[Archive], axis: str, theirs: str, places: Sequence[str], axes: Mapping[str, str],
        assume: Mapping[str, str],
    ) -> None:  # fmt: skip
        self.axis, self.archives, self.assume = axis, archives, assume
        self.notes: list[Finding] = []
        self._axis_names = _axis_aliases(archives, theirs)
        self.known = self._axis_names & {entry.axis for archive in archives for entry in archive.entries if entry.axis}
        known = [place for archive in archives for place in archive.places]
        self.places = tuple(whole_place(place, known) for place in places) if places else self._own_places(theirs, axes)
        for place in self.places:
            if place not in known:
                raise InputError(f"no drive object or list {place!r}; the files have {_list_names(known) or 'none'}")
        if not self.known and not self.places:
            has = list(dict.fromkeys(name for archive in archives for name in axes_of(archive)))
            lists = [f"{place}{f' ({name})' if name else ''}" for archive in archives
                     for place, name in archive.places.items()]  # fmt: skip
            unnamed = next((archive.unnamed for archive in archives if archive.unnamed), "")
            raise InputError(
                f"no axis {theirs!r}; the files have {_list_names(has) or 'no axes'}"
                + (f"; lists that drives can be chosen from: {_list_names(lists)}" if lists else "")
                + (f". {unnamed[0].upper()}{unnamed[1:]}: name the joint, --axes {axis}=JOINT_n" if unnamed else "")
            )

    def _own_places(self, theirs: str, axes: Mapping[str, str]) -> tuple[str, ...]:
        """Drive object or list of the axis: that of its name, or the only one of the only axis."""
        every = {place: name for archive in self.archives for place, name in archive.places.items()
                 if _holds_parameters(archive, place)}  # fmt: skip
        named = [place for place, name in every.items() if theirs.upper() in (name.upper(), place.upper())]
        if len(named) == 1:
            text = f"{self.axis}: parameters of the drive are those of {named[0]}, which has its name"
            self.notes.append(Finding("drive-by-name", "note", text, self.axis))
            return tuple(named)
        if len(every) == 1 and len(axes) == 1:
            return tuple(every)
        if every:
            shown_ = _list_names([f"{place}{f' ({name})' if name else ''}" for place, name in every.items()])
            remedy = f"--drives {self.axis}={next(iter(every))}"
            self.notes.append(Finding(
                "drive-not-known", "note",
                f"{self.axis}: which drive is that of the axis is not known, so no parameter of a drive is taken; the "
                f"files have {shown_}: name it, {remedy}",
                self.axis, remedy,
            ))  # fmt: skip
        return ()

    def entries(self, *keys: str) -> list[tuple[Archive, Entry]]:
        """Entries of a key, by name or number, that are of this axis, or of the whole machine."""
        return [
            (archive, entry)
            for archive in self.archives
            for entry in dict.fromkeys(entry for key in keys for entry in archive.by_key.get(key, ()))
            if (not entry.axis or entry.axis in self.known) and (not entry.place or entry.place in self.places)
        ]

    def sought(self, *keys: str, element: int = 0) -> Sought:
        """The one entry of an element, index 0 or none; or why there is none."""
        every = self.entries(*keys)
        own = [entry for entry in every if (entry[1].index or 0) == element]
        if not every and (by_program := self.set_by_programs(*keys)):
            return Sought(by_program, None, f"only the program {by_program[0][1].program} sets it, when it runs")
        if not own:
            return Sought(every, None, "" if not every else f"the file has elements of it, but not [{element}]")
        if any(entry.sense for _, entry in own):
            return _find_tightest_limit(every, own)
        if len({comparable(entry.text) for _, entry in own}) > 1:
            lines = ", ".join(f"{archive.name}:{entry.line} ({entry.text[:20]})" for archive, entry in own[:4])
            return Sought(every, None, f"the files have several values: {lines}")
        return Sought(every, own[-1])

    def set_by_programs(self, *keys: str) -> list[tuple[Archive, Entry]]:
        """Assignments of programs that are of this axis, or of the whole machine."""
        return [
            (archive, entry)
            for archive in self.archives
            for entry in archive.in_programs
            if entry.key in keys and (not entry.axis or entry.axis in self._axis_names)
        ]

    def value(self, name: str) -> Value | None:
        """Value of a parameter or of one of its bits or elements; None: none, several, or no value."""
        if name in self.assume:
            return scalar(self.assume[name])
        key, element, bit = name_parts(name)
        if key in self.assume and not element:
            value: Value = scalar(self.assume[key])
        else:
            chosen = self.sought(key, element=int(element or 0)).chosen
            if chosen is None or chosen[1].doubt:
                return None
            try:
                value = scalar(chosen[1].text)
            except ValueError:
                return None
        if bit:
            whole = not isinstance(value, str) and value == int(value) and value >= 0
            return float((int(value) >> int(bit)) & 1) if whole else None
        return float(value) if isinstance(value, bool) else value

    def explain_lack(self, name: str) -> str:
        """Why value() has none, for a sentence."""
        key, element, bit = name_parts(name)
        result = self.sought(key, element=int(element or 0))
        if result.chosen is None:
            return result.problem or explain_absence(name)
        archive, entry = result.chosen
        where = f"{archive.name}:{entry.line}"
        if entry.doubt:
            return f"{key} in {where} is not taken: {entry.doubt}; --assume {name}={1 if bit else 'VALUE'}"
        return f"{key} is {entry.text[:24]!r} in {where}, which cannot be read; --assume {name}={1 if bit else 'VALUE'}"


def name_parts(name: str) -> tuple[str, str, str]:
    """Key, element and bit of "p115[1]" or "p1656.0"; "" of what it has not."""
    key, _, element = name.removesuffix("]").partition("[")
    key, _, bit = key.partition(".") if key[:1] == "p" else (key, "", "")
    return key, element, bit


def whole_place(place: str, known: Sequence[str]) -> str:
    """A drive object by the end of its name, where that is enough: PS000003 of SLAVE3.PS000003."""
    result = [name for name in known if name == place or name.endswith(f".{place}")]
    return result[0] if len(result) == 1 else place


def _holds_parameters(archive: Archive, place: str) -> bool:
    """Whether a drive object has what an axis needs; control units and infeeds have not."""
    return not _required_keys(archive.control).isdisjoint(archive.keys_of_places.get(place, ()))


@cache
def _required_keys(control: str) -> frozenset[str]:
    names = [name for name in table() if name.control == control and not name.parameter.startswith("cycles.")]
    return frozenset(key for name in names for key in (name.key, name.number))


def _list_names(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_LISTED]) + (
        f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    )


def _find_tightest_limit(every: Sequence[tuple[Archive, Entry]], own: Sequence[tuple[Archive, Entry]]) -> Sought:
    """Of a limit that several sections set, the entry that acts: the smallest upper one, the largest lower one."""
    limits: dict[str, float] = {}
    for archive, entry in own:
        where = f"{archive.name}:{entry.line}"
        if entry.doubt:
            return Sought(every, (archive, entry))
        try:
            limit = float(scalar(entry.text)) * entry.scale
        except ValueError:
            return Sought(every, None, f"{entry.text[:20]!r} of {entry.section} ({where}) is no number")
        if limits.setdefault(entry.section, limit) != limit:
            return Sought(every, None, f"{entry.section} has several values, the last in {where}")
    chosen = min(own, key=lambda pair: pair[1].sense * limits[pair[1].section])
    others = [f"{entry.section} has {entry.text}" for _, entry in own
              if limits[entry.section] != limits[chosen[1].section]]  # fmt: skip
    note = f"{chosen[1].text} of {chosen[1].section} acts, {', '.join(dict.fromkeys(others))}" if others else ""
    return Sought(every, chosen, note=note)


def axes_of(archive: Archive) -> Iterator[str]:
    for axis in dict.fromkeys(entry.axis for entry in archive.entries if entry.axis):
        name = archive.axis_names.get(axis, "")
        yield f"{axis} ({name})" if name and name != axis else axis


def _axis_aliases(archives: Sequence[Archive], theirs: str) -> frozenset[str]:
    """What the files call the axis: its name, and AX1 or JOINT_0 by the tables of names; several joints of a gantry."""
    asked = theirs.upper()
    names = [(axis, name.upper()) for archive in archives for axis, name in archive.axis_names.items()]
    return frozenset({asked, *(axis for axis, name in names if name == asked),
                      *(name for axis, name in names if axis == asked)})  # fmt: skip


def comparable(text: str) -> object:
    try:
        return scalar(text)
    except ValueError:
        return text


ALL_PARAMETERS = "all"
# What SINUMERIK's machine data are in, where MD10220 and MD10230 say nothing else: gains in 1000/min.
USUAL_MASK, USUAL_GAIN = 0x200, 1000 / 60
_OF_UNITS = ("SCALING_SYSTEM_IS_METRIC", "MD10240", "MD10220", "MD10230[9]")
# Software limits beyond this are none [m].
MAX_SOFTWARE_LIMIT = 1e4


@dataclass(frozen=True)
class TakenValue:
    """A value of ours.

    axis: ours; "" of the machine. value: SI. entry, archive: where it stands; None where it follows from what was
    assumed. condition: by which the parameter does not act and the value is that of none, "FFW_MODE=0"; the entry is
    then that of the condition.
    """

    axis: str
    name: Name
    value: Value
    entry: Entry | None
    archive: Archive | None
    condition: str = ""

    @property
    def number(self) -> str:
        """Of the parameter that the value stands in, or follows from."""
        if not self.condition:
            return self.name.number
        return (self.entry.number or self.entry.key) if self.entry else self.condition.partition("=")[0]

    @property
    def called(self) -> str:
        """Name of that parameter; of a condition also what does not act."""
        if not self.condition:
            return self.name.name.replace("[JOINT_n]", (self.entry and self.entry.section) or "[JOINT_n]")
        own = f"{self.entry.key}: " if self.entry and self.entry.key != self.number else ""
        return f"{own}{self.name.number} {self.name.name} does not act"

    @property
    def text(self) -> str:
        """As the file has it."""
        return self.entry.text if self.entry else f"{self.condition.partition('=')[2]} (assumed)"

    @property
    def unit(self) -> str:
        """Of the text; "" of a condition."""
        return "" if self.condition else self.name.unit

    @property
    def source(self) -> str:
        """Which text of the file the value is of, and where that stands."""
        where = f" ({self.where})" if self.where else ""
        if self.condition:
            return f"{self.number} = {self.text[:40]}{where}: {self.name.number} does not act"
        return f"{self.number} {self.called} = {self.text[:40]}{where}"

    @property
    def parameter(self) -> str:
        """Below the axis, or below the machine."""
        return self.name.parameter

    @property
    def where(self) -> str:
        """File and line."""
        return f"{self.archive.name}:{self.entry.line}" if self.archive and self.entry else ""


@dataclass(frozen=True)
class RefusedValue:
    """A value that was not taken. text: as the file has it. weight: "doubt", or "note" of what does not act."""

    axis: str
    name: Name
    text: str
    reason: str
    where: str = ""
    weight: str = "doubt"


@dataclass
class Reading:
    """What was found: values, refusals, doubts about values that were taken, and notes."""

    control: str
    axes: Mapping[str, str]
    taken: list[TakenValue] = field(default_factory=list)
    refused: list[RefusedValue] = field(default_factory=list)
    doubts: list[Finding] = field(default_factory=list)
    notes: list[Finding] = field(default_factory=list)
    places: dict[str, tuple[str, ...]] = field(default_factory=dict)


def read_values(
    archives: Sequence[Archive],
    axes: Mapping[str, str],
    *,
    places: Mapping[str, Sequence[str]] = {},
    assume: Mapping[str, str] = {},
    checked: Collection[str] = (),
) -> Reading:
    """Values of axes.

    Args:
        archives: files of one control.
        axes: our axis -> the archive's.
        places: our axis -> drive objects or lists that are its own.
        assume: parameter -> value, of what the files do not hold, such as a condition.
        checked: numbers whose unit the caller has checked at the control; "all".

    Raises:
        InputError: files of several controls, no such axis, a list that may be of several axes.
    """
    controls = {archive.control for archive in archives}
    if len(controls) > 1:
        raise InputError(f"files of several controls: {', '.join(sorted(controls))}; import one control at a time")
    rows = [name for name in table() if name.control in controls]
    numbers = {name.number for name in rows}
    if unknown := [name for name in checked if name != ALL_PARAMETERS and name not in numbers]:
        raise InputError(f"{unknown[0]} is no number of the table of names of the control {controls.pop()}")
    reading = Reading(controls.pop(), dict(axes))
    asked = _deciding_parameters(rows)
    if unknown := [
        entry for entry in assume if entry not in asked and entry not in {name_parts(name)[0] for name in asked}
    ]:
        raise InputError(
            f"{unknown[0]} is nothing that a value of the control {reading.control} depends on; that can be assumed of "
            f"{', '.join(asked) or 'no parameter'}"
        )
    seen: dict[object, str] = {}
    for axis, theirs in axes.items():
        view = View(archives, axis, theirs, places.get(axis, ()), axes, assume)
        for one in (theirs.upper(), *sorted(view.known)):
            if (other := seen.setdefault(one, axis)) != axis:
                given = f"{other}={axes[other]} and {axis}={theirs}"
                raise InputError(f"{given}: the same axis of the control, given to two axes")
        reading.places[axis] = view.places
        reading.notes += view.notes
        for name in rows:
            _read_parameter(reading, view, name, checked)
    _of_machine(reading)
    reading.doubts += [doubt for entry in reading.taken if (doubt := _describe_unusual_value(entry))]
    return reading


def _describe_unusual_value(taken: TakenValue) -> Finding | None:
    """A finding on a value far outside of what feed axes have; None of any other."""
    usual = usual_ranges().get(taken.parameter)
    if usual is None or taken.condition or isinstance(taken.value, bool | str) or usual.holds(taken.value):
        return None
    said = f"{taken.name.number} {taken.name.name} = {taken.text[:40]} ({taken.where}) is {taken.value:.4g}"
    axis = f"{taken.axis}: " if taken.axis else ""
    text = f"{axis}{said} {usual.unit}, usual is {usual.low:g} to {usual.high:g} {usual.unit}: check the unit"
    return Finding("value-unusual", "doubt", text, taken.where, "check the unit")


def _deciding_parameters(rows: Sequence[Name]) -> list[str]:
    """Parameters whose values decide about others: conditions, ratios, units of machine data."""
    result = [name for row in rows for name in (*condition_names(row.acts), *row.times)]
    if any(row.number.startswith("MD") for row in rows):
        result += _OF_UNITS
    return sorted(dict.fromkeys(result))


def _read_parameter(reading: Reading, view: View, name: Name, checked: Collection[str]) -> None:
    sought = view.sought(name.key, name.number)
    if not sought.entries:
        _read_case(reading, view, name)
        return
    if sought.chosen is None:
        archive, entry = sought.entries[0]
        reading.refused.append(
            RefusedValue(view.axis, name, entry.text, sought.problem, f"{archive.name}:{entry.line}")
        )
        return
    archive, entry = sought.chosen
    where = f"{archive.name}:{entry.line}"

    def refuse(reason: str, weight: str = "doubt") -> None:
        reading.refused.append(RefusedValue(view.axis, name, entry.text, reason, where, weight))

    said = judge_conditions(name.acts, view.value, view.explain_lack)
    if said.state == "case":
        _of_case(reading, view, name, said)
        return
    if said.state != "acts":
        refuse(said.reason, "note" if said.state == "inactive" else "doubt")
        return
    if name.number.startswith("MD") and {entry.number, entry.key} - {"", name.number, name.key}:
        refuse(f"the file has {entry.number} {entry.key}, the table of names {name.number} {name.key}")
        return
    if doubt := entry.doubt or ("" if {name.number, ALL_PARAMETERS} & {*checked} else entry.unsure):
        refuse(doubt)
        return
    try:
        raw = view.value(name.number) if "." in name.number and name.number[0] == "p" and not name.number.startswith(
            "pid"
        ) else scalar(entry.text)  # fmt: skip
    except ValueError:
        refuse("no number")
        return
    if reason := _unit(view, name, entry, checked):
        refuse(reason)
        return
    value, reason = _convert_entry(view, name, entry, raw)
    if reason or value is None:
        refuse(reason)
        return
    reading.taken.append(TakenValue(view.axis, name, value, entry, archive))
    if sought.note:
        text = f"{view.axis}: {name.number}: {sought.note}"
        reading.notes.append(Finding("value-chosen", "note", text, view.axis))
    if programs := view.set_by_programs(name.key):
        lines = ", ".join(f"{own.program} ({its.name}:{own.line})" for its, own in programs[:3])
        text = f"{view.axis}: {name.number} {name.name} is also set by programs when they run: {lines}"
        reading.notes.append(Finding("value-set-by-programs", "note", text, view.axis))
    for doubt in said.doubts:
        text = f"{view.axis}: {name.number} {name.name} is taken, but {doubt}: it holds for a part of the range alone"
        reading.doubts.append(Finding("value-of-a-part", "doubt", text, view.axis))
    others = {comparable(entry.text) for _, entry in sought.entries if (entry.index or 0) != 0}
    if name.number.startswith("MD") and others - {comparable(entry.text)}:
        reading.notes.append(Finding(
            "value-differs-between-sets", "note",
            f"{view.axis}: {name.number} {name.name} has other values in other elements (parameter sets, encoders); "
            "element 0 is taken",
            view.axis,
        ))  # fmt: skip
    elif others - {comparable(entry.text)} and name.number != "p115":
        text = f"{view.axis}: {name.number} {name.name} differs between data sets; that of index 0 is taken"
        reading.doubts.append(Finding("value-differs-between-sets", "doubt", text, view.axis))


def _read_case(reading: Reading, view: View, name: Name) -> None:
    """A parameter that the files do not have may have a value by what switches it off."""
    if name.acts:
        said = judge_conditions(name.acts, view.value, view.explain_lack)
        if said.state == "case":
            _of_case(reading, view, name, said)


def _of_case(reading: Reading, view: View, name: Name, said: ConditionVerdict) -> None:
    value: Value = {"true": True, "false": False}.get(said.value, said.value)
    if isinstance(value, str) and value != "off":
        value = float(value)
    condition = said.reason.partition("=")[0]
    key, element, _ = name_parts(condition)
    archive, entry = view.sought(key, element=int(element or 0)).chosen or (None, None)
    if {condition, key} & {*view.assume}:
        archive, entry = None, None
    reading.taken.append(TakenValue(view.axis, name, value, entry, archive, said.reason))


def _unit(view: View, name: Name, entry: Entry, checked: Collection[str]) -> str:
    """Why the unit of a value is not sure; "" where it is."""
    if entry.unit and name.unit not in ("", "1"):
        stated, ours = (_plain_unit(item) for item in (entry.unit, name.unit))
        if stated != ours:
            return f"the file has it in {entry.unit!r}, the table of names in {name.unit}"
        return ""
    if name.control == "sinumerik" and name.number.startswith("MD"):
        if 0 in (view.value("SCALING_SYSTEM_IS_METRIC"), view.value("MD10240")) and (
            "mm" in name.unit or "m/" in name.unit
        ):
            return "the machine's basic system is inch (MD10240)"
        mask = view.value("MD10220")
        if mask is not None and mask != USUAL_MASK and name.unit not in ("", "1"):
            return f"MD10220 is {value_text(mask)}: machine data are in units of the machine's maker"
        gain = view.value("MD10230[9]")
        if name.unit == "1000/min" and isinstance(gain, float) and not math.isclose(gain, USUAL_GAIN, rel_tol=1e-3):
            return f"MD10230[9] is {value_text(gain)}: the gain is in another unit than 1000/min"
    if not name.confirmed and name.number not in checked and ALL_PARAMETERS not in checked:
        return (
            f"no public source that was opened states its unit; {name.unit or 'its meaning'} is supposed. Check it at "
            f"the control: --checked {name.number}"
        )
    return ""


def _plain_unit(text: str) -> str:
    plain = text.lower().replace("arms", "a").replace("rms", "").replace("³", "^3").replace("²", "^2").replace("µ", "u")
    return "".join(c for c in plain if c not in " .·*[]()").replace("percent", "%")


def _convert_entry(view: View, name: Name, entry: Entry, raw: Value | None) -> tuple[Value | None, str]:
    if raw is None or isinstance(raw, str):
        return None, "no number"
    if name.codes:
        value = next((ours for code, ours in name.codes if float(raw) == code), None)
        return value, "" if value is not None else f"{value_text(float(raw))} is none of " + ", ".join(
            f"{code} ({str(ours).lower()})" for code, ours in name.codes
        )
    if not name.si and name.unit != "1":
        if raw not in (0.0, 1.0):
            return None, f"{value_text(float(raw))} is neither 0 nor 1"
        return bool(raw), ""
    if not math.isfinite(float(raw)):
        return None, "no finite number"
    number = name.ours(float(raw)) * entry.scale
    for k, other in enumerate(name.times):
        ratio = view.value(other)
        if ratio is None:
            why = view.explain_lack(other)
            why = f"{why.removesuffix(')')} {other}=1)" if why == explain_absence(other) else why
            return None, f"it is multiplied by {' / '.join(name.times)}, and {why}"
        if isinstance(ratio, str) or ratio == 0:
            return None, f"{other} is {value_text(ratio)}"
        number = number * float(ratio) if k == 0 else number / float(ratio)
    if name.parameter.startswith("travel") and abs(number) >= MAX_SOFTWARE_LIMIT:
        return None, "so far out that it is no limit"
    if name.parameter == "drive.M_max" and number <= 0:
        return None, "a drive without torque moves nothing"
    if name.parameter == "drive.p":
        return (int(number), "") if number == int(number) else (None, "no whole number")
    return number, ""


def _of_machine(reading: Reading) -> None:
    """Values of the whole machine, which every axis has found: kept once, where they are the same."""
    machine = [entry for entry in reading.taken if entry.parameter.startswith("cycles.")]
    reading.taken = [entry for entry in reading.taken if entry not in machine]
    refused: dict[str, RefusedValue] = {}
    for item in reading.refused:
        if item.name.parameter.startswith("cycles."):
            refused.setdefault(
                item.name.number, RefusedValue("", item.name, item.text, item.reason, item.where, item.weight)
            )
    reading.refused = [entry for entry in reading.refused if not entry.name.parameter.startswith("cycles.")]
    reading.refused += refused.values()
    for parameter in dict.fromkeys(taken.parameter for taken in machine):
        own = [taken for taken in machine if taken.parameter == parameter]
        if len({taken.value for taken in own}) > 1:
            values = ", ".join(f"{taken.axis} {taken.entry.text if taken.entry else ''}" for taken in own)
            reading.refused.append(
                RefusedValue(
                    "", own[0].name, "", f"it is one for all axes of a machine file; here {values}", own[0].where
                )
            )
        else:
            reading.taken.append(TakenValue("", own[0].name, own[0].value, own[0].entry, own[0].archive))
