"""Files of a control as one axis sees them: which entries of a name are its own, and what their conditions find."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from feedsim.control.archive import Archive, Entry, scalar
from feedsim.control.conditions import absent
from feedsim.control.names import table
from feedsim.errors import InputError

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
        self.notes: list[str] = []
        self._called = _called(archives, theirs)
        self.known = self._called & {entry.axis for archive in archives for entry in archive.entries if entry.axis}
        known = [place for archive in archives for place in archive.places]
        self.places = tuple(whole_place(place, known) for place in places) if places else self._own_places(theirs, axes)
        for place in self.places:
            if place not in known:
                raise InputError(f"no drive object or list {place!r}; the files have {_listed(known) or 'none'}")
        if not self.known and not self.places:
            has = list(dict.fromkeys(name for archive in archives for name in axes_of(archive)))
            lists = [f"{place}{f' ({name})' if name else ''}" for archive in archives
                     for place, name in archive.places.items()]  # fmt: skip
            unnamed = next((archive.unnamed for archive in archives if archive.unnamed), "")
            raise InputError(
                f"no axis {theirs!r}; the files have {_listed(has) or 'no axes'}"
                + (f"; lists that drives can be chosen from: {_listed(lists)}" if lists else "")
                + (f". {unnamed[0].upper()}{unnamed[1:]}: name the joint, --axes {axis}=JOINT_n" if unnamed else "")
            )

    def _own_places(self, theirs: str, axes: Mapping[str, str]) -> tuple[str, ...]:
        """Drive object or list of the axis: that of its name, or the only one of the only axis."""
        every = {place: name for archive in self.archives for place, name in archive.places.items()
                 if _holds_parameters(archive, place)}  # fmt: skip
        named = [place for place, name in every.items() if theirs.upper() in (name.upper(), place.upper())]
        if len(named) == 1:
            self.notes.append(f"{self.axis}: parameters of the drive are those of {named[0]}, which has its name")
            return tuple(named)
        if len(every) == 1 and len(axes) == 1:
            return tuple(every)
        if every:
            shown_ = _listed([f"{place}{f' ({name})' if name else ''}" for place, name in every.items()])
            self.notes.append(
                f"{self.axis}: which drive is that of the axis is not known, so no parameter of a drive is taken; the "
                f"files have {shown_}: name it, --drives {self.axis}={next(iter(every))}"
            )
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
            return _tightest(every, own)
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
            if entry.key in keys and (not entry.axis or entry.axis in self._called)
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

    def lack(self, name: str) -> str:
        """Why value() has none, for a sentence."""
        key, element, bit = name_parts(name)
        result = self.sought(key, element=int(element or 0))
        if result.chosen is None:
            return result.problem or absent(name)
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
    return not _needed(archive.control).isdisjoint(archive.keys_of_places.get(place, ()))


@cache
def _needed(control: str) -> frozenset[str]:
    names = [name for name in table() if name.control == control and not name.parameter.startswith("cycles.")]
    return frozenset(key for name in names for key in (name.key, name.number))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_LISTED]) + (
        f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    )


def _tightest(every: Sequence[tuple[Archive, Entry]], own: Sequence[tuple[Archive, Entry]]) -> Sought:
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


def _called(archives: Sequence[Archive], theirs: str) -> frozenset[str]:
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
