"""Files of a control as one axis sees them: which entries of a name are its own, and what their conditions find."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from feedsim.control.archive import Archive, Entry, scalar
from feedsim.control.conditions import absent
from feedsim.control.names import table
from feedsim.errors import InputError

Value = float | bool | str


@dataclass(frozen=True)
class Sought:
    """A parameter in the files of an axis: its entries, of all elements, and whether one of them was taken."""

    entries: Sequence[tuple[Archive, Entry]]
    chosen: tuple[Archive, Entry] | None
    problem: str = ""


class View:
    """Files as one axis sees them."""

    def __init__(
        self, archives: Sequence[Archive], axis: str, theirs: str, places: Sequence[str], axes: Mapping[str, str],
        assume: Mapping[str, str],
    ) -> None:  # fmt: skip
        self.axis, self.archives, self.assume = axis, archives, assume
        self.notes: list[str] = []
        self.known = _identified(archives, theirs)
        known = [place for archive in archives for place in archive.places]
        self.places = tuple(whole_place(place, known) for place in places) if places else self._own_places(theirs, axes)
        for place in self.places:
            if place not in known:
                raise InputError(f"no drive object or list {place!r}; the files have {', '.join(known) or 'none'}")
        if not self.known and not self.places:
            has = list(dict.fromkeys(name for archive in archives for name in axes_of(archive)))
            lists = [f"{place}{f' ({name})' if name else ''}" for archive in archives
                     for place, name in archive.places.items()]  # fmt: skip
            raise InputError(
                f"no axis {theirs!r}; the files have {', '.join(has[:40]) or 'no axes'}"
                + (f"; lists that drives can be chosen from: {', '.join(lists[:40])}" if lists else "")
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
            shown_ = ", ".join(f"{place}{f' ({name})' if name else ''}" for place, name in every.items())
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
        if not own:
            return Sought(every, None, "" if not every else f"the file has elements of it, but not [{element}]")
        if len({comparable(entry.text) for _, entry in own}) > 1:
            lines = ", ".join(f"{archive.name}:{entry.line} ({entry.text[:20]})" for archive, entry in own[:4])
            return Sought(every, None, f"the files have several values: {lines}")
        return Sought(every, own[-1])

    def value(self, name: str) -> Value | None:
        """Value of a parameter or of one of its bits or elements; None: none, several, or no value."""
        if name in self.assume:
            return scalar(self.assume[name])
        key, element, bit = name_parts(name)
        if key in self.assume and not element:
            value: Value = scalar(self.assume[key])
        else:
            chosen = self.sought(key, element=int(element or 0)).chosen
            if chosen is None:
                return None
            try:
                value = scalar(chosen[1].text)
            except ValueError:
                return None
        if bit:
            return None if isinstance(value, str) else float((int(value) >> int(bit)) & 1)
        return float(value) if isinstance(value, bool) else value

    def lack(self, name: str) -> str:
        """Why value() has none, for a sentence."""
        key, element, bit = name_parts(name)
        result = self.sought(key, element=int(element or 0))
        if result.chosen is None:
            return result.problem or absent(name)
        archive, entry = result.chosen
        where = f"{archive.name}:{entry.line}"
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
    names = [name for name in table() if name.control == archive.control and not name.parameter.startswith("cycles.")]
    keys = {key for name in names for key in (name.key, name.number)}
    return any(entry.place == place and entry.key in keys for entry in archive.entries)


def axes_of(archive: Archive) -> Iterator[str]:
    for axis in dict.fromkeys(entry.axis for entry in archive.entries if entry.axis):
        name = archive.axis_names.get(axis, "")
        yield f"{axis} ({name})" if name and name != axis else axis


def _identified(archives: Sequence[Archive], theirs: str) -> frozenset[str]:
    """What the files call the axis: its name, and AX1 or JOINT_0 by the table of names."""
    result = set()
    for archive in archives:
        used = {entry.axis for entry in archive.entries if entry.axis}
        by_name = {name.upper(): axis for axis, name in archive.axis_names.items()}
        for item in (
            theirs.upper(),
            by_name.get(theirs.upper(), ""),
            archive.axis_names.get(theirs.upper(), "").upper(),
        ):
            if item in used:
                result.add(item)
    return frozenset(result)


def comparable(text: str) -> object:
    try:
        return scalar(text)
    except ValueError:
        return text
