"""A file with parameters of a control, as it is: every value with its place in the text; nothing is interpreted.

The format follows from the content (formats.py): machine data of a SINUMERIK (INI, TEA, archives), parameter lists of
SINAMICS, lists of TwinCAT CNC, .xti files of TwinCAT NC, tables of parameters, and LinuxCNC's INI files. A value that a
binary record cuts, or whose line is damaged, is no value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePath

MAX_FILE_BYTES = 256_000_000  # bytes of a file
MAX_INCLUDED_BYTES = 4_000_000  # bytes of a file that another one includes
MAX_SCALAR_LENGTH = 1000  # characters; a longer text is none, and no number that can be converted
MOST_ODD = 1000  # lines that were not understood and are kept
BINARY = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_CONTROL_NUMBER = re.compile(r"^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE]X?[+-]?\d+)?$", re.IGNORECASE)
HEXADECIMAL = re.compile(r"^[0-9A-F]+H$", re.IGNORECASE)  # as commissioning tools list words of bits


@dataclass(frozen=True)
class Entry:
    """A value of a file.

    Attributes:
        key: what the control calls it: "POSCTRL_GAIN", "p1460", "getriebe.kv", "JOINT.MAX_VELOCITY".
        text: as written. index: element, such as the parameter set; None without one.
        axis: that the file names, "AX1" or "JOINT_0"; "" where the file is of one axis, or the value of none.
        place: drive object or list that it belongs to; "" of what holds everywhere.
        line: from 1. span: of the text's characters. unit: as the file states it; "" where it does not.
        scale: of the file's unit over the table's, 25.4 of inches. unsure: what of its unit is to be checked.
        doubt: why it is not to be taken, whatever was checked. number: that the file gives besides the name, "MD32200".
        program: that sets it when it runs; "" of a value of the file. sense: of a limit that several sections set; +1
        of an upper one, of which the smallest acts, -1 of a lower one. section: of such a limit, "[AXIS_X]".
    """

    key: str
    text: str
    index: int | None
    axis: str
    place: str
    line: int
    span: tuple[int, int]
    unit: str = ""
    scale: float = 1.0
    unsure: str = ""
    doubt: str = ""
    number: str = ""
    checksum: bool = False
    program: str = ""
    sense: int = 0
    section: str = ""


@dataclass(frozen=True)
class OddLine:
    """A line that was not understood."""

    line: int
    text: str
    reason: str


@dataclass
class Archive:
    """What a file holds.

    Attributes:
        name: of the file. path: as the user knows it. control: one of CONTROLS. form: what kind of file it is.
        text, encoding: as decoded; encoding it again gives the bytes. container: binary records lie between the texts.
        entries: in the order of the file. odd: the first of `odd_count` lines that were not
        understood. comments: how many lines say nothing.
        axis_names: axis -> name, "AX1" -> "X1". unnamed: why axes have no names; "" where they have.
        places: drive object or list -> name, "PS000003" -> "SERVO_X".
        in_programs: what programs set when they run.
        included: as the file names it -> a file that it includes, of its own entries.
    """

    name: str
    control: str = ""
    form: str = ""
    text: str = ""
    encoding: str = "latin-1"
    container: bool = False
    entries: list[Entry] = field(default_factory=list)
    odd: list[OddLine] = field(default_factory=list)
    comments: int = 0
    odd_count: int = 0
    axis_names: dict[str, str] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)
    unnamed: str = ""
    in_programs: list[Entry] = field(default_factory=list)
    path: PurePath = field(default_factory=PurePath)
    included: dict[str, Archive] = field(default_factory=dict)

    @property
    def content(self) -> bytes:
        """The bytes of the file."""
        return self.text.encode(self.encoding)

    @cached_property
    def by_key(self) -> Mapping[str, Sequence[Entry]]:
        """Entries by key and by number; asked for when the file has been read."""
        result: dict[str, list[Entry]] = {}
        for entry in self.entries:
            for key in {entry.key, entry.number} - {""}:
                result.setdefault(key, []).append(entry)
        return result

    @cached_property
    def keys_of_places(self) -> Mapping[str, set[str]]:
        """Drive object or list -> keys of its entries."""
        result: dict[str, set[str]] = {}
        for entry in self.entries:
            result.setdefault(entry.place, set()).add(entry.key)
        return result

    def add_odd(self, line: int, text: str, reason: str) -> None:
        """Note a line that was not understood."""
        self.odd_count += 1
        if len(self.odd) >= MOST_ODD:
            return
        shown = "".join(c if c.isprintable() else "." for c in text.strip())
        self.odd.append(OddLine(line, shown[:77] + "..." if len(shown) > 80 else shown, reason))


def decode_text(data: bytes) -> tuple[str, str]:
    """Text and encoding of a file; encoding it again gives the bytes."""
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"), (b"\xef\xbb\xbf", "utf-8")):
        if data.startswith(mark):
            try:
                text = data.decode(encoding)
            except UnicodeDecodeError:
                break
            if text.encode(encoding) == data:
                return text, encoding
            break
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "latin-1"


def lines(text: str) -> Iterator[tuple[int, int, str, bool]]:
    """Number, start, text without its line feed, and whether one ends it. A byte order mark is part of no line."""
    start, number = int(text.startswith("\ufeff")), 1
    while start < len(text):
        end = text.find("\n", start)
        if end < 0:
            yield number, start, text[start:], False
            return
        yield number, start, text[start:end].removesuffix("\r"), True
        start, number = end + 1, number + 1


def scalar(text: str) -> float | bool | str:
    """The value of a text of a control: number, TRUE or FALSE, 'H..', ..H, 'B..', "...". ValueError: none, or one that
    is not finite."""
    try:
        value = _scalar(text)
    except OverflowError:
        value = math.inf
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("no finite number")
    return value


def _scalar(text: str) -> float | bool | str:
    text = text.strip()
    upper = text.upper()
    if len(text) > MAX_SCALAR_LENGTH:
        raise ValueError("no number")
    if upper in ("TRUE", "FALSE"):
        return upper == "TRUE"
    if len(text) >= 2 and text[0] == text[-1] == '"':
        return text[1:-1]
    if len(text) >= 4 and text[0] == text[-1] == "'" and upper[1] in "HB":
        return float(int(upper[2:-1], 16 if upper[1] == "H" else 2))
    if upper.startswith("#X"):
        return float(int(upper[2:], 16))
    if HEXADECIMAL.match(text):
        return float(int(upper[:-1], 16))
    if _CONTROL_NUMBER.match(text):
        return float(upper.replace("EX", "E"))
    raise ValueError("no number")
