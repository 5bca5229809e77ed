"""Values that a control's files hold, laid into a machine file; a value that the machine file cannot have is refused.

May use control, files. Start reading at import_reading().
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from feedsim.files.checked import check, fetch, in_order, read_group
from feedsim.files.control.reading import Reading, RefusedValue, TakenValue
from feedsim.files.fields import Quantity
from feedsim.files.source import Mark, Place, Source, copy_tree
from feedsim.foundation.errors import InputError
from feedsim.scenario.axis_units import Drive, Filter
from feedsim.scenario.load import translate
from feedsim.scenario.machine import Axis, Machine

# Switches of the machine file follow from what was taken.
SWITCHES = {"omega_0": "reference_model", "D": "reference_model"}
# Groups that are taken whole or not at all.
GROUP_PREFIXES = ("drive.filter_", "drive.friction_pulse")
# Files that a machine file names and that stay where they are; the modes go with it.
_FILE_KEYS = ("structure", "plant")
MODES_TABLE = "modes.csv"
_PLAIN_TEXT = re.compile(r"^[A-Za-z_][\w .,/()%-]*$")
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


@dataclass
class ImportedMachine:
    """A machine file with values of a control.

    Attributes:
        tree: the keys of the file. base: machine that was given; None: a draft, to which `missing` is to be added.
        values: those of the reading that the file has. refused: those that it cannot have, with the reason.
        missing: keys that a machine file needs and that neither the files nor a machine have. before: place -> value of
        the machine that was given, as its file has it.
    """

    tree: dict[str, Any]
    base: Machine | None
    values: list[TakenValue]
    refused: list[RefusedValue]
    missing: list[str]
    before: dict[Place, Any] = field(default_factory=dict)

    def text(self) -> str:
        """The machine file."""
        remarks = {place_of(value): value.source for value in self.values}
        head = ["# Written by feedsim machine import; behind each value that a control's file holds stands its place."]
        if self.missing:
            head += ["# A draft: a machine file needs these keys besides:", *(f"#   {name}" for name in self.missing)]
        return "\n".join([*head, *_lines(self.tree, (), remarks, 0)]) + "\n"

    def files(self) -> dict[str, str | bytes]:
        """Name -> content, of the whole folder."""
        modes = {} if self.base is None else {MODES_TABLE: self.base.modes.content or b""}
        return {Machine.IN_FOLDER: self.text(), **modes}


def place_of(taken: TakenValue) -> Place:
    """The place of a value in a machine file."""
    parts = tuple(int(part) if part.isdecimal() else part for part in taken.parameter.split("."))
    if taken.value == "off" and parts[-1] != "type":
        parts = parts[:-1]
    return ("axes", taken.axis, *parts) if taken.axis else parts


def import_reading(reading: Reading, machine: Path | None, name: str) -> ImportedMachine:
    """Lay the values of a reading into a machine file; machine: file or folder; None: a draft. name: of a draft.

    A value, or a group of values that belong together, is refused where the machine file would be wrong with it.
    InputError: the machine is faulty, or has not one of the axes.
    """
    source, base = _base_source(machine, name, reading)
    result = ImportedMachine(source.data, base, [], [], [])
    before = _faults(source)
    halved = {(entry.axis, _group(entry.name.parameter)) for entry in reading.refused if entry.weight == "doubt"}
    for group in _groups(reading.taken):
        trial = source.copy()
        for item in group:
            _set_value(trial, item)
        if (group[0].axis, whole := _group(group[0].parameter)) in halved and whole.startswith(GROUP_PREFIXES):
            reason = "a value that belongs to it was not taken; a half of a filter or of a pulse would be another one"
            result.refused += [_refuse_value(taken, reason) for taken in group]
            continue
        if [taken.parameter for taken in group] in (["travel.0"], ["travel.1"]):
            result.refused.append(_refuse_value(group[0], "a machine file takes both ends of the travel or none"))
            continue
        new = [fault for fault in _faults(trial) if fault not in before and not _is_missing_key(fault)]
        if new:
            reason = f"a machine file cannot have it: {new[0].partition(': ')[2] or new[0]}"
            result.refused += [_refuse_value(taken, reason) for taken in group]
            continue
        for item in group:
            result.before[place_of(item)] = _value_at(source.data, place_of(item))
        source = trial
        result.values += group
    source.data["control"] = reading.control
    result.tree = source.data
    faults = _faults(source)
    result.missing = [fault.partition(": ")[2] for fault in in_order(faults)]
    if base is not None and result.missing:
        raise InputError.of(str(machine), in_order(faults))
    return result


def _refuse_value(taken: TakenValue, reason: str) -> RefusedValue:
    return RefusedValue(taken.axis, taken.name, taken.entry.text if taken.entry else "", reason, taken.where)


def _base_source(machine: Path | None, name: str, reading: Reading) -> tuple[Source, Machine | None]:
    if machine is None:
        note = "Imported from a control; what its files do not hold is missing"
        axes: dict[str, Any] = {axis: {"drive": {}} for axis in reading.axes}
        tree = {"name": name, "note": note, "control": reading.control, "axes": axes}
        return Source(tree, {(): Mark("the draft", Path())}), None
    from feedsim.scenario.load import load_machine

    base = load_machine(machine)
    path = machine / Machine.IN_FOLDER if machine.is_dir() else machine
    for axis in reading.axes:
        if axis not in base.axes:
            has = ", ".join(base.axes)
            raise InputError(
                f"{path}: has no axis {axis!r}; it has {has}: name the machine's axis first, "
                f"{next(iter(base.axes))}={reading.axes[axis]}"
            )
        base.shipped_drive(axis, "values of a control")
    source = read_group(path)
    faults: list[str] = []
    fetch(source, Machine, (), faults)
    translate(source, ("axes",), faults)
    source.data["modes"] = MODES_TABLE
    for key in _FILE_KEYS:
        if isinstance(source.data.get(key), str):
            source.data[key] = str(Path(source.data[key]).resolve())
    for axis in source.data["axes"].values():
        for role in ("drive", "friction"):
            if isinstance(axis.get(role), dict) and isinstance(axis[role].get("fmu"), str):
                axis[role]["fmu"] = str(Path(axis[role]["fmu"]).resolve())
    order = [key for key in ("name", "note", "control") if key in source.data or key == "control"]
    source.data = {**{key: source.data.get(key, "") for key in order}, **source.data}
    source.data["control"] = reading.control
    return source, base


def _faults(source: Source) -> list[str]:
    faults: list[str] = []
    tree = source.copy()
    if isinstance(tree.data.get("modes"), str):
        tree.data["modes"] = str(Path(__file__))  # it is written with the file; that there is one is all that counts
    check(tree, Machine, faults)
    return faults


def _is_missing_key(fault: str) -> bool:
    return ": missing" in fault


def _group(parameter: str) -> str:
    """What a value belongs to: its filter, the pulse, the reference model, the travel, or itself."""
    way, _, last = parameter.rpartition(".")
    return way if way not in ("", "drive", "cycles") else SWITCHES.get(last, last)


def _groups(taken: Sequence[TakenValue]) -> Iterator[list[TakenValue]]:
    """Values that can only go together: those of a filter, of the pulse, of the reference model, both ends of a way."""
    result: dict[tuple[str, str], list[TakenValue]] = {}
    for entry in taken:
        result.setdefault((entry.axis, _group(entry.parameter)), []).append(entry)
    yield from result.values()


def _set_value(source: Source, taken: TakenValue) -> None:
    place = place_of(taken)
    data: Any = source.data
    for key, following in pairwise(place):
        if isinstance(data, dict) and not isinstance(data.get(key), dict | list):
            data[key] = ["", ""] if isinstance(following, int) else {}
        data = data[key]
    last = place[-1]
    data[last] = machine_file_value(taken)
    if taken.value == "off" and last != "type":
        del data[last]


def machine_file_value(taken: TakenValue) -> Any:
    """A value as a machine file has it: with the unit that people write."""
    value = taken.value
    if isinstance(value, bool | str | int):
        return value
    quantity = _quantity(taken.parameter)
    unit = quantity.unit if quantity is not None else taken.name.si
    return f"{value!r} {unit}".removesuffix(" 1") if unit not in ("", "1") else value


def _quantity(parameter: str) -> Quantity | None:
    first, _, rest = parameter.partition(".")
    if first == "drive":
        model: Any = Filter if rest.startswith("filter_") else Drive
        info = model.model_fields.get(rest.rpartition(".")[2])
        return Quantity.of(info) if info is not None else None
    info = Axis.model_fields.get(first)
    return Quantity.of(info) if info is not None else None


def _value_at(data: Any, place: Place) -> Any:
    for key in place:
        if isinstance(data, dict):
            data = data.get(str(key))
        elif isinstance(data, list) and isinstance(key, int) and key < len(data):
            data = data[key]
        else:
            return None
    return copy_tree(data)


def _lines(data: Mapping[str, Any], place: Place, remarks: Mapping[Place, str], depth: int) -> Iterator[str]:
    """A tree as YAML, a key a line."""
    pad = "  " * depth
    for key, value in data.items():
        own = (*place, key)
        head = f"{pad}{_scalar_text(key)}:"
        if isinstance(value, dict) and value:
            yield head
            yield from _lines(value, own, remarks, depth + 1)
        elif isinstance(value, list):
            reported = "; ".join(remarks[(*own, k)] for k in range(len(value)) if (*own, k) in remarks)
            yield _append_remark(f"{head} {_flow_text(value)}", reported)
        else:
            yield _append_remark(f"{head} {_flow_text(value)}", remarks.get(own, ""))


def _append_remark(text: str, remark: str) -> str:
    plain = "".join(c if c.isprintable() else "." for c in remark)
    return f"{text:<36}  # {plain}" if remark else text


def _flow_text(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_scalar_text(key)}: {_flow_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow_text(item) for item in value) + "]"
    return _scalar_text(value)


def _scalar_text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, int | float):
        return repr(value)
    text = str(value)
    quantity = re.match(r"^-?[\d.]+(e[+-]?\d+)? [\w./^()]+$", text)
    if quantity or (
        _PLAIN_TEXT.match(text) and text.lower() not in _WORDS and ", " not in text and not text.endswith(" ")
    ):
        return text
    return json.dumps(text, ensure_ascii=False)
