"""Values of our parameters, in SI, out of what files of a control hold; and what could not be taken, with the reason.

Nothing is guessed. A value is taken where the file has it once, where it acts, where its unit is confirmed by a public
source (or by who calls), and where nothing contradicts it. May use errors. Start reading at read().
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from feedsim.control.archive import Archive, Entry, scalar
from feedsim.control.conditions import Judged, absent, depends, judged, shown
from feedsim.control.names import Name, table
from feedsim.control.usual import usual_ranges
from feedsim.control.view import Value, View, comparable, name_parts
from feedsim.errors import InputError

ALL = "all"
# What SINUMERIK's machine data are in, where MD10220 and MD10230 say nothing else: gains in 1000/min.
USUAL_MASK, USUAL_GAIN = 0x200, 1000 / 60
_OF_UNITS = ("SCALING_SYSTEM_IS_METRIC", "MD10240", "MD10220", "MD10230[9]")
# Software limits beyond this are none [m].
MAX_SOFTWARE_LIMIT = 1e4


@dataclass(frozen=True)
class Taken:
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
class Refused:
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
    taken: list[Taken] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    places: dict[str, tuple[str, ...]] = field(default_factory=dict)


def read(
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
    if unknown := [name for name in checked if name != ALL and name not in numbers]:
        raise InputError(f"{unknown[0]} is no number of the table of names of the control {controls.pop()}")
    reading = Reading(controls.pop(), dict(axes))
    asked = _asked(rows)
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
            _read(reading, view, name, checked)
    _of_machine(reading)
    reading.doubts += [doubt for entry in reading.taken if (doubt := _unusual(entry))]
    return reading


def _unusual(taken: Taken) -> str:
    """A sentence on a value far outside of what feed axes have; "" of any other."""
    usual = usual_ranges().get(taken.parameter)
    if usual is None or taken.condition or isinstance(taken.value, bool | str) or usual.holds(taken.value):
        return ""
    said = f"{taken.name.number} {taken.name.name} = {taken.text[:40]} ({taken.where}) is {taken.value:.4g}"
    axis = f"{taken.axis}: " if taken.axis else ""
    return f"{axis}{said} {usual.unit}, usual is {usual.low:g} to {usual.high:g} {usual.unit}: check the unit"


def _asked(rows: Sequence[Name]) -> list[str]:
    """Parameters whose values decide about others: conditions, ratios, units of machine data."""
    result = [name for row in rows for name in (*depends(row.acts), *row.times)]
    if any(row.number.startswith("MD") for row in rows):
        result += _OF_UNITS
    return sorted(dict.fromkeys(result))


def _read(reading: Reading, view: View, name: Name, checked: Collection[str]) -> None:
    sought = view.sought(name.key, name.number)
    if not sought.entries:
        _case(reading, view, name)
        return
    if sought.chosen is None:
        archive, entry = sought.entries[0]
        reading.refused.append(Refused(view.axis, name, entry.text, sought.problem, f"{archive.name}:{entry.line}"))
        return
    archive, entry = sought.chosen
    where = f"{archive.name}:{entry.line}"

    def refuse(reason: str, weight: str = "doubt") -> None:
        reading.refused.append(Refused(view.axis, name, entry.text, reason, where, weight))

    said = judged(name.acts, view.value, view.lack)
    if said.state == "case":
        _of_case(reading, view, name, said)
        return
    if said.state != "acts":
        refuse(said.reason, "note" if said.state == "inactive" else "doubt")
        return
    if name.number.startswith("MD") and {entry.number, entry.key} - {"", name.number, name.key}:
        refuse(f"the file has {entry.number} {entry.key}, the table of names {name.number} {name.key}")
        return
    if doubt := entry.doubt or ("" if {name.number, ALL} & {*checked} else entry.unsure):
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
    value, reason = _converted(view, name, entry, raw)
    if reason or value is None:
        refuse(reason)
        return
    reading.taken.append(Taken(view.axis, name, value, entry, archive))
    if sought.note:
        reading.notes.append(f"{view.axis}: {name.number}: {sought.note}")
    if programs := view.set_by_programs(name.key):
        lines = ", ".join(f"{own.program} ({its.name}:{own.line})" for its, own in programs[:3])
        reading.notes.append(f"{view.axis}: {name.number} {name.name} is also set by programs when they run: {lines}")
    reading.doubts += [
        f"{view.axis}: {name.number} {name.name} is taken, but {text}: it holds for a part of the range alone"
        for text in said.doubts
    ]
    others = {comparable(entry.text) for _, entry in sought.entries if (entry.index or 0) != 0}
    if name.number.startswith("MD") and others - {comparable(entry.text)}:
        reading.notes.append(
            f"{view.axis}: {name.number} {name.name} has other values in other elements (parameter sets, encoders); "
            "element 0 is taken"
        )
    elif others - {comparable(entry.text)} and name.number != "p115":
        reading.doubts.append(
            f"{view.axis}: {name.number} {name.name} differs between data sets; that of index 0 is taken"
        )


def _case(reading: Reading, view: View, name: Name) -> None:
    """A parameter that the files do not have may have a value by what switches it off."""
    if name.acts:
        said = judged(name.acts, view.value, view.lack)
        if said.state == "case":
            _of_case(reading, view, name, said)


def _of_case(reading: Reading, view: View, name: Name, said: Judged) -> None:
    value: Value = {"true": True, "false": False}.get(said.value, said.value)
    if isinstance(value, str) and value != "off":
        value = float(value)
    condition = said.reason.partition("=")[0]
    key, element, _ = name_parts(condition)
    archive, entry = view.sought(key, element=int(element or 0)).chosen or (None, None)
    if {condition, key} & {*view.assume}:
        archive, entry = None, None
    reading.taken.append(Taken(view.axis, name, value, entry, archive, said.reason))


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
            return f"MD10220 is {shown(mask)}: machine data are in units of the machine's maker"
        gain = view.value("MD10230[9]")
        if name.unit == "1000/min" and isinstance(gain, float) and not math.isclose(gain, USUAL_GAIN, rel_tol=1e-3):
            return f"MD10230[9] is {shown(gain)}: the gain is in another unit than 1000/min"
    if not name.confirmed and name.number not in checked and ALL not in checked:
        return (
            f"no public source that was opened states its unit; {name.unit or 'its meaning'} is supposed. Check it at "
            f"the control: --checked {name.number}"
        )
    return ""


def _plain_unit(text: str) -> str:
    plain = text.lower().replace("arms", "a").replace("rms", "").replace("³", "^3").replace("²", "^2").replace("µ", "u")
    return "".join(c for c in plain if c not in " .·*[]()").replace("percent", "%")


def _converted(view: View, name: Name, entry: Entry, raw: Value | None) -> tuple[Value | None, str]:
    if raw is None or isinstance(raw, str):
        return None, "no number"
    if name.codes:
        value = next((ours for code, ours in name.codes if float(raw) == code), None)
        return value, "" if value is not None else f"{shown(float(raw))} is none of " + ", ".join(
            f"{code} ({str(ours).lower()})" for code, ours in name.codes
        )
    if not name.si and name.unit != "1":
        if raw not in (0.0, 1.0):
            return None, f"{shown(float(raw))} is neither 0 nor 1"
        return bool(raw), ""
    if not math.isfinite(float(raw)):
        return None, "no finite number"
    number = name.ours(float(raw)) * entry.scale
    for k, other in enumerate(name.times):
        ratio = view.value(other)
        if ratio is None:
            why = view.lack(other)
            why = f"{why.removesuffix(')')} {other}=1)" if why == absent(other) else why
            return None, f"it is multiplied by {' / '.join(name.times)}, and {why}"
        if isinstance(ratio, str) or ratio == 0:
            return None, f"{other} is {shown(ratio)}"
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
    refused: dict[str, Refused] = {}
    for item in reading.refused:
        if item.name.parameter.startswith("cycles."):
            refused.setdefault(
                item.name.number, Refused("", item.name, item.text, item.reason, item.where, item.weight)
            )
    reading.refused = [entry for entry in reading.refused if not entry.name.parameter.startswith("cycles.")]
    reading.refused += refused.values()
    for parameter in dict.fromkeys(taken.parameter for taken in machine):
        own = [taken for taken in machine if taken.parameter == parameter]
        if len({taken.value for taken in own}) > 1:
            values = ", ".join(f"{taken.axis} {taken.entry.text if taken.entry else ''}" for taken in own)
            reading.refused.append(
                Refused("", own[0].name, "", f"it is one for all axes of a machine file; here {values}", own[0].where)
            )
        else:
            reading.taken.append(Taken("", own[0].name, own[0].value, own[0].entry, own[0].archive))
