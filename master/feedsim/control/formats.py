"""How files of controls are read: a row of _FORMATS and a function for each kind of file.

Start reading at opened().
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import PurePath

from feedsim.control.archive import HEXADECIMAL, Archive, Entry, scalar
from feedsim.errors import InputError

MAX_LINE_LENGTH = 4000  # characters of a line; longer ones hold no single value
_BINARY = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
# Up to the sign of equality; two of them compare. The language of the control knows no cases of letters.
_MACHINE_DATUM = re.compile(
    r"(?:(?<![A-Za-z])N(?P<number>\d{1,6})[ \t]*)?\$(?P<kind>M[ANC]|S[ANC])_(?P<name>[A-Z0-9_]+)"
    r"[ \t]*(?:\[(?P<index>[^\[\]]*)\])?[ \t]*=(?!=)",
    re.IGNORECASE,
)
_DRIVE = re.compile(r"^[ \t]*(?P<name>[pPrR]0*(?P<number>\d{1,5}))[ \t]*(?:\[(?P<index>\d+)\])?[ \t]*=(?P<value>.*)$")
_DRIVE_OBJECT = re.compile(r"PS0*(\d{1,6})[._](?:TEA|ACX)", re.IGNORECASE)
_SLAVE = re.compile(r"SLAVE(\d{1,4})[._]DIR", re.IGNORECASE)
_CHECKSUM = re.compile(r"[ \t]+'[0-9A-Fa-f]{4}'?[ \t]*$")
_ISG = re.compile(
    r"^[ \t]*(?P<name>[A-Za-z_]\w*(?:\[\d+\])?(?:\.\w+(?:\[\d+\])?)+)[ \t]+(?P<value>[^#\n]*?)[ \t]*(?:#.*)?$"
)
_INI_KEY = re.compile(r"^[ \t]*(?P<name>[A-Za-z_]\w*)[ \t]*=[ \t]*(?P<value>.*)$")
_SECTION = re.compile(r"^[ \t]*\[(?P<name>\w+)\]")
_TAG = re.compile(r"<(?P<end>/?)(?P<name>[\w:.-]+)(?P<rest>[^<>]*?)(?P<single>/?)>", re.DOTALL)
_ATTRIBUTE = re.compile(r"([\w:.-]+)\s*=\s*(\"([^\"]*)\"|'([^']*)')")
_PARAMETER = re.compile(
    r"^\W*((?P<p>[pPrR]0*(?P<number>\d{1,5})(?:\[(?P<index>\d+)\])?)|(?P<idn>[SP]-\d-\d{4}(?:\.\d+\.\d+)?)|"
    r"(?P<isg>P-(?:AXIS|COMP|CHAN)-\d{5})|(?P<md>(?:MD|N)(?P<mdn>\d{5})(?:\[(?P<mdi>\d+)\])?))\W*$"
)
_STATEMENT = re.compile(
    r"\s*(?:N\d+\s+)?(?P<word>IF|GOTO[FB]?|WHILE|ELSE|ENDIF|ENDWHILE|ENDFOR|FOR|REPEAT)\b", re.IGNORECASE
)
_END = re.compile(r"\s*(?:N\d+\s+)?M(?:0?17|0?2|30)\b")
_VALUE_HEADS = ("value", "wert", "valeur", "setting", "actual", "offline", "online", "current value")
_UNIT_HEADS = ("unit", "einheit", "unité")


def opened(name: str, data: bytes, path: PurePath | None = None) -> Archive:
    """What a file holds, by its content. path: by which the user knows it. InputError: none of the formats."""
    text, encoding = _decoded(data)
    plain = text.lstrip("\ufeff")
    for control, form, is_one, parse in _FORMATS:
        if is_one(plain):
            archive = Archive(name, control, form, text, encoding, container=bool(_BINARY.search(text)))
            parse(archive)
            if archive.entries:
                return archive
    raise InputError(
        f"{path or name}: holds no parameters of a control that are known here; machine data ($MA_...=), lists of "
        "drive parameters (p1460[0]=...), lists of TwinCAT CNC, .xti, tables of parameters and LinuxCNC's INI files "
        "are read"
    )


def _decoded(data: bytes) -> tuple[str, str]:
    for mark, encoding in ((b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"), (b"\xef\xbb\xbf", "utf-8")):
        if data.startswith(mark):
            try:
                text = data.decode(encoding)
            except UnicodeDecodeError:
                break
            if text.encode(encoding) == data:
                return text, encoding
            break
    return data.decode("latin-1"), "latin-1"


def _lines(text: str) -> Iterator[tuple[int, int, str, bool]]:
    """Number, start, text without its line feed, and whether one ends it. A byte order mark is part of no line."""
    start, number = int(text.startswith("\ufeff")), 1
    while start < len(text):
        end = text.find("\n", start)
        if end < 0:
            yield number, start, text[start:], False
            return
        yield number, start, text[start:end].removesuffix("\r"), True
        start, number = end + 1, number + 1


def _without_comment(text: str, mark: str = ";") -> str:
    """What stands ahead of a comment; marks within quotes begin none."""
    quoted = False
    for k, c in enumerate(text):
        if c == '"':
            quoted = not quoted
        elif c == mark and not quoted:
            return text[:k]
    return text


def _sinumerik(archive: Archive) -> None:
    place, branches = "", 0
    for number, start, line, ended in _lines(archive.text):
        if result := _DRIVE_OBJECT.findall(line):
            slaves = _SLAVE.findall(line)
            own = f"PS{int(result[-1]):06d}"
            if slaves:
                place = f"SLAVE{int(slaves[-1])}.{own}"
            elif not place.endswith(f".{own}"):  # the header names the file again, without its unit
                place = own
        elif "%_N_" in line:
            place = ""
        if "_N_" in line or _END.match(line):
            branches = 0
        if not line.strip() or line.lstrip().startswith((";", "%", "[", "#", "\\SYSTEM.DRV")):
            archive.comments += 1
            continue
        if len(line) > MAX_LINE_LENGTH:
            archive.add_odd(number, line[:200], "a line of more than 4000 characters")
            continue
        whole = ended or not archive.container
        data = _data(_without_comment(line))
        if data:
            ends = [*(datum.start() for datum in data[1:]), len(line)]
            for datum, end in zip(data, ends, strict=True):
                _machine_datum(archive, number, start, line[:end], datum, whole, "below an IF" if branches else "")
        elif _MACHINE_DATUM.search(line) and not _STATEMENT.match(line):
            archive.comments += 1
        elif (drive := _DRIVE.match(line)) and not drive["name"].lower().startswith("r"):
            _drive_parameter(archive, number, start, line, drive, place or "drive", whole)
        elif drive or re.fullmatch(r"\s*(?:M0?17|M0?2|M30|CHANDATA\(\d+\)|\w+_HEADER|[A-Z_]+\s*=.*)\s*(?:;.*)?", line):
            archive.comments += 1
        elif statement := _STATEMENT.match(line):
            word = statement["word"].upper()
            branches += word in ("IF", "WHILE", "FOR") and "GOTO" not in line.upper()
            branches -= word in ("ENDIF", "ENDWHILE", "ENDFOR") and branches > 0
            archive.add_odd(number, line, "a statement of a program")
        else:
            damaged = bool(_BINARY.search(line))
            archive.add_odd(number, line, "binary" if damaged else "no assignment of a parameter")
    for entry in [item for item in archive.entries if item.key == "AXCONF_MACHAX_NAME_TAB" and item.index is not None]:
        name = entry.text.strip().strip('"')
        if name and archive.axis_names.setdefault(f"AX{entry.index + 1}", name) != name:  # type: ignore[operator]
            archive.add_odd(entry.line, entry.text, "another name of an axis that has one")
    for place in dict.fromkeys(item.place for item in archive.entries if item.place):
        codes = {item.index: item.text for item in archive.entries if item.place == place and item.key == "p199"}
        archive.places[place] = "".join(
            chr(int(codes[k])) for k in sorted(k for k in codes if k is not None)
            if codes[k].isdecimal() and 32 <= int(codes[k]) < 127
        ).strip()  # fmt: skip


def _value(line: str, at: int) -> tuple[str, int, bool]:
    """The value that begins at a place of a line, where it begins, and whether a checksum stands behind it."""
    text = _without_comment(line[at:])
    checked = _CHECKSUM.search(text)
    if checked and not text[: checked.start()].strip():
        checked = None
    text = text[: checked.start()] if checked else text
    return text.strip(), at + len(text) - len(text.lstrip()), checked is not None


def _data(line: str) -> list[re.Match[str]]:
    """Assignments of a line without its comment, up to their signs of equality; none within quotes."""
    return [datum for datum in _MACHINE_DATUM.finditer(line) if line.count('"', 0, datum.start()) % 2 == 0]


def _machine_datum(
    archive: Archive, number: int, start: int, line: str, match: re.Match[str], whole: bool, doubt: str
) -> None:
    if not whole or _BINARY.search(line[match.start() :]):
        archive.add_odd(number, line[match.start() :], "cut by a binary record, or not whole")
        return
    text, at, checked = _value(line, match.end())
    index, axis, odd = None, "", ""
    for part in (entry.strip() for entry in (match["index"] or "").split(",")):
        if part.isdecimal() and len(part) < 6 and index is None:
            index = int(part)
        elif part and not axis and re.fullmatch(r"[A-Za-z_]\w{0,31}", part):
            axis = part.upper()
        elif part:
            odd = "an index that is not known"
    if not text or odd:
        archive.add_odd(number, line[match.start() :], odd or "no value behind the sign of equality")
        return
    of_axis = match["kind"].upper() == "MA"
    if of_axis and not axis:
        archive.add_odd(number, line[match.start() :], "machine data of an axis, without the axis")
        return
    filed = f"MD{match['number']}" if match["number"] else ""
    archive.entries.append(
        Entry(
            match["name"].upper(), text, index, axis if of_axis else "", "", number,
            (start + at, start + at + len(text)), doubt=doubt, number=filed, checksum=checked,
        )
    )  # fmt: skip


def _drive_parameter(
    archive: Archive, number: int, start: int, line: str, match: re.Match[str], place: str, whole: bool
) -> None:
    text, at, checked = _value(line, match.start("value"))
    if not whole or _BINARY.search(line) or not text:
        archive.add_odd(number, line, "no value behind the sign of equality" if whole else "cut, or not whole")
        return
    index = int(match["index"]) if match["index"] else None
    archive.entries.append(
        Entry(f"p{int(match['number'])}", text, index, "", place, number, (start + at, start + at + len(text)),
              checksum=checked)
    )  # fmt: skip


def _isg(archive: Archive) -> None:
    place = PurePath(archive.name).stem
    archive.places[place] = ""
    for number, start, line, _ in _lines(archive.text):
        result = _ISG.match(line)
        if not line.strip() or line.lstrip().startswith("#"):
            archive.comments += 1
        elif result is None or not result["value"] or _BINARY.search(line):
            archive.add_odd(number, line, "no parameter with its value")
        else:
            indices = [int(entry) for entry in re.findall(r"\[(\d{1,6})\]", result["name"])]
            key = re.sub(r"\[\d+\]", "", result["name"])
            if key.endswith("log_achs_name"):
                archive.places[place] = result["value"].strip().strip('"')
            span = (start + result.start("value"), start + result.start("value") + len(result["value"]))
            archive.entries.append(
                Entry(key, result["value"], indices[0] if indices else None, "", place, number, span)
            )


def _xti(archive: Archive) -> None:
    blank = re.sub(
        r"<!--.*?-->|<!\[CDATA\[.*?\]\]>", lambda match: re.sub(r"[^\n]", " ", match[0]), archive.text, flags=re.DOTALL
    )
    way: list[str] = []
    place, axes = "", 0
    lines = _LineNumbers(archive.text)
    for tag in _TAG.finditer(blank):
        name = tag["name"]
        if tag["end"]:
            if name in way:
                del way[len(way) - 1 - way[::-1].index(name) :]
            continue
        if name == "Axis":
            axes += 1
            place = f"{PurePath(archive.name).stem}" if axes == 1 else f"{PurePath(archive.name).stem} {axes}"
            archive.places[place] = ""
        if name == "Name" and way[-1:] == ["Axis"]:
            text = blank[tag.end() : blank.find("<", tag.end())].strip()
            archive.places[place] = "" if text == "__FILENAME__" else text[:64]
        if "Axis" in way or name == "Axis":
            for entry in _ATTRIBUTE.finditer(tag["rest"]):
                at = tag.start("rest") + entry.start(2) + 1
                text = entry[3] if entry[3] is not None else entry[4]
                archive.entries.append(
                    Entry(f"{name}@{entry[1]}", text, None, "", place, lines.of(at), (at, at + len(text)))
                )
        if not tag["single"]:
            way.append(name)
            if len(way) > 500:
                raise InputError(f"{archive.name}:{lines.of(tag.start())}: nested too deeply")


class _LineNumbers:
    """Number of the line of a character; asked with rising places."""

    def __init__(self, text: str) -> None:
        self._text, self._at, self._line = text, 0, 1

    def of(self, at: int) -> int:
        self._line += self._text.count("\n", self._at, at)
        self._at = max(at, self._at)
        return self._line


def _table(archive: Archive) -> None:
    rows = [(n, start, line) for n, start, line, _ in _lines(archive.text)]
    mark = max(";\t,", key=lambda text: sum(line.count(text) for _, _, line in rows))
    place = PurePath(archive.name).stem
    archive.places[place] = ""
    heads: list[str] = []
    for number, start, line in rows:
        cells = list(_cells(line, mark))
        named = [
            (k, result) for k, (text, _) in enumerate(cells) if (result := _PARAMETER.match(text.strip("\"' \ufeff")))
        ]
        if not line.strip():
            archive.comments += 1
            continue
        if not named:
            words = [text.strip("\"' \ufeff").lower() for text, _ in cells]
            if any(word in _VALUE_HEADS for word in words):
                heads = words
                archive.comments += 1
            else:
                archive.add_odd(number, line, "no parameter with its value")
            continue
        at, results = named[0]
        values = _value_cells(cells, heads, at)
        if len(named) > 1 or len(values) != 1 or _BINARY.search(line):
            archive.add_odd(number, line, "which cell is the value is not known")
            continue
        text, where = cells[values[0]]
        if results["p"]:
            key, index = f"p{int(results['number'])}", int(results["index"]) if results["index"] else None
        elif results["md"]:
            key, index = f"MD{results['mdn']}", int(results["mdi"]) if results["mdi"] else None
        else:
            key, index = (results["idn"] or results["isg"]).partition(".")[0], None
        shift = len(text) - len(text.lstrip("\"' "))
        bare = text.strip("\"' ")
        units = [k for k, head in enumerate(heads) if head in _UNIT_HEADS and k < len(cells)]
        unit = cells[units[0]][0].strip("\"' []") if len(units) == 1 else ""
        span = (start + where + shift, start + where + shift + len(bare))
        archive.entries.append(Entry(key, bare, index, "", place, number, span, unit=unit))
    controls = {"sinumerik" if re.match(r"p\d|MD", entry.key) else "twincat" for entry in archive.entries}
    if len(controls) == 1:
        archive.control = controls.pop()
    elif controls:
        raise InputError(f"{archive.name}: holds parameters of several controls; give each a file of its own")


def _cells(line: str, mark: str) -> Iterator[tuple[str, int]]:
    """Cells of a row and where they begin; a mark within double quotes separates none."""
    start, quoted = 0, False
    for k, c in enumerate(line):
        if c == '"':
            quoted = not quoted
        elif c == mark and not quoted:
            yield line[start:k], start
            start = k + 1
    yield line[start:], start


def _value_cells(cells: Sequence[tuple[str, int]], heads: Sequence[str], named: int) -> list[int]:
    """Cells that may be the value: by the header, else those that hold a number."""
    by_head = [k for k, head in enumerate(heads) if head in _VALUE_HEADS and k < len(cells) and k != named]
    if heads:
        return by_head
    indexes = []
    for k, (text, _) in enumerate(cells):
        try:
            bare = text.strip("\"' ")
            word = bare.isalpha() and HEXADECIMAL.match(bare)  # EACH is a word ahead of a number
            if k != named and not word and not isinstance(scalar(bare), str):
                indexes.append(k)
        except ValueError:
            continue
    return indexes


def _linuxcnc(archive: Archive) -> None:
    section, continued = "", ""
    scales: dict[str, tuple[float, str]] = {}
    entries: list[tuple[str, str, str, int, tuple[int, int]]] = []
    for number, start, line, _ in _lines(archive.text):
        if continued or line.rstrip().endswith("\\"):  # goes on in the next line: names of files, no values of ours
            continued = "more" if line.rstrip().endswith("\\") else ""
            archive.add_odd(number, line, "a value of several lines")
        elif not line.strip() or line.lstrip().startswith(("#", ";")):
            archive.comments += 1
        elif result := _SECTION.match(line):
            section = result["name"].upper()
            archive.comments += 1
        elif (result := _INI_KEY.match(line)) and section and not _BINARY.search(line):
            text = re.split(r"\s[#;]", result["value"], maxsplit=1)[0].rstrip()
            at = start + result.start("value")
            entries.append((section, result["name"].upper(), text, number, (at, at + len(text))))
        else:
            archive.add_odd(number, line, "no KEY = VALUE below a section")
    for section, key, text, _, _ in entries:
        if (section, key) in (("TRAJ", "LINEAR_UNITS"), ("TRAJ", "UNITS")) or (
            section.startswith("JOINT_") and key in ("UNITS", "TYPE")
        ):
            scales[f"{section}.{key}"] = _unit_of(text)
    letters = "".join(text for section, key, text, _, _ in entries if (section, key) == ("TRAJ", "COORDINATES"))
    for k, letter in enumerate(re.sub(r"[^A-Za-z]", "", letters).upper()):
        if letter not in archive.axis_names.values():
            archive.axis_names[f"JOINT_{k}"] = letter
        else:  # two joints of one axis
            archive.axis_names = {joint: name for joint, name in archive.axis_names.items() if name != letter}
    common = scales.get("TRAJ.LINEAR_UNITS", scales.get("TRAJ.UNITS", (1.0, "the file has no LINEAR_UNITS")))
    for section, key, text, number, span in entries:
        axis = section if section.startswith("JOINT_") else ""
        scale, doubt = (scales.get(f"{axis}.UNITS", common)) if axis else (1.0, "")
        if axis and scales.get(f"{axis}.TYPE", (0.0, ""))[1] == "angular":
            doubt = "the joint is a rotary one"
        if axis and key in ("P", "FF1"):
            scale = 1.0
            doubt = doubt or "its wiring is in the HAL file: a gain in 1/s only where the output is a speed"
        elif axis and key == "BACKLASH" and any(other[:2] == (axis, "COMP_FILE") for other in entries):
            doubt = "COMP_FILE takes its place"
        shown = "JOINT" if axis else section
        archive.entries.append(Entry(f"{shown}.{key}", text, None, axis, "", number, span, scale=scale, doubt=doubt))


def _unit_of(text: str) -> tuple[float, str]:
    word = text.strip().strip('"').lower()
    known: dict[str, tuple[float, str]] = {
        "mm": (1.0, ""), "metric": (1.0, ""), "1": (1.0, ""), "1.0": (1.0, ""), "inch": (25.4, ""), "in": (25.4, ""),
        "imperial": (25.4, ""), "linear": (1.0, ""), "angular": (1.0, "angular"),
    }  # fmt: skip
    return known.get(word, (1.0, f"the unit {word[:20]!r} is not known"))


def _has(pattern: str) -> Callable[[str], bool]:
    compiled = re.compile(pattern, re.MULTILINE)
    return lambda text: compiled.search(text) is not None


_FORMATS: tuple[tuple[str, str, Callable[[str], bool], Callable[[Archive], None]], ...] = (
    ("twincat", ".xti of TwinCAT NC", _has(r"<TcSmItem\b|<AxisPara\b"), _xti),
    ("sinumerik", "machine data of a SINUMERIK", _has(r"(?i)\$M[ANC]_[A-Z0-9_]+[^\n=]{0,80}="), _sinumerik),
    ("sinumerik", "parameters of SINAMICS", _has(r"^[ \t]*[pP]0*\d{1,5}[ \t]*(\[\d+\])?[ \t]*="), _sinumerik),
    ("linuxcnc", "INI file of LinuxCNC", _has(r"^[ \t]*\[(EMC|TRAJ|EMCMOT|JOINT_\d+)\]"), _linuxcnc),
    ("twincat", "axis list of TwinCAT CNC", _has(r"^[ \t]*(kopf|kenngr|getriebe|antr|lr_param|lr_hw|vorsteuer|"
                                                 r"frict_comp|filter)(\[\d+\])?\.\w"), _isg),
    ("sinumerik", "table of parameters", _has(r"(^|[;,\t\"' ])([pP]0*\d{3,5}(\[\d+\])?|[SP]-\d-\d{4}|P-AXIS-\d{5}"
                                              r"|MD\d{5}(\[\d+\])?)[;,\t\"' ]"), _table),
)  # fmt: skip
