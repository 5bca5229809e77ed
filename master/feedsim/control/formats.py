"""How files of controls are read: a row of _FORMATS and a function for each kind of file.

Start reading at opened().
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

from feedsim.control import linuxcnc, sinumerik
from feedsim.control.archive import BINARY, HEXADECIMAL, Archive, Entry, decoded, lines, scalar
from feedsim.control.linuxcnc import Include
from feedsim.errors import InputError

# No pattern may be tried at every length of a long text: possessive quantifiers (++, *+) give nothing back.
MAX_NESTING = 500  # open tags
MAX_COLUMNS = 2  # with the same head: which one counts is open
_ISG_NAME = re.compile(r"[ \t]*+([A-Za-z_]\w*+(?:\[\d{1,6}\])?(?:\.\w++(?:\[\d{1,6}\])?)++)[ \t]++")
_TAG = re.compile(r"<(?P<end>/?)(?P<name>[\w:.-]++)(?P<rest>(?:[^<>\"']++|\"[^\"<]*+\"|'[^'<]*+')*+)>")
_ATTRIBUTE = re.compile(r"(?<![\w:.-])([\w:.-]++)\s*+=\s*+(\"([^\"]*+)\"|'([^']*+)')")
# A comma that is a decimal one, and a point that may then group thousands.
_DECIMAL_COMMA = re.compile(r"[+-]?[\d.]+,\d+")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+")
_PARAMETER = re.compile(
    r"^\W*((?P<p>[pPrR]0*(?P<number>\d{1,5})(?:\[(?P<index>\d{1,6})\])?)|(?P<idn>[SP]-\d-\d{4}(?:\.\d+\.\d+)?)|"
    r"(?P<isg>P-(?:AXIS|COMP|CHAN)-\d{5})|(?P<md>(?:MD|N)(?P<mdn>\d{5})(?:\[(?P<mdi>\d{1,6})\])?))\W*$"
)
_VALUE_HEADS = ("value", "wert", "valeur", "setting", "actual", "offline", "online", "current value")
_UNIT_HEADS = ("unit", "einheit", "unité")


def opened(name: str, data: bytes, path: PurePath | None = None, include: Include | None = None) -> Archive:
    """What a file holds, by its content.

    Args:
        name: of the file. path: by which the user knows it.
        include: path and content of a file that this one names (#INCLUDE of LinuxCNC); None: those are not read.

    Raises:
        InputError: none of the formats; a file to include that there is not.
    """
    text, encoding = decoded(data)
    plain = text.lstrip("\ufeff")
    for control, form, is_one, parse in _FORMATS:
        if is_one(plain):
            archive = Archive(name, control, form, text, encoding, container=bool(BINARY.search(text)))
            archive.path = path or PurePath(name)
            parse(archive, include)
            if archive.entries or any(inner.entries for inner in archive.included.values()):
                return archive
            if archive.in_programs:
                entry = archive.in_programs[0]
                raise InputError(
                    f"{path or name}: only programs set machine data here, {entry.program} in line {entry.line} the "
                    "first; what they set is no value of the file. Give the archive or the TEA files of the control"
                )
    raise InputError(
        f"{path or name}: holds no parameters of a control that are known here; machine data ($MA_...=), lists of "
        "drive parameters (p1460[0]=...), lists of TwinCAT CNC, .xti, tables of parameters and LinuxCNC's INI files "
        "are read"
    )


def _isg(archive: Archive, _: Include | None) -> None:
    place = PurePath(archive.name).stem
    archive.places[place] = ""
    for number, start, line, _ended in lines(archive.text):
        bare = line.partition("#")[0].rstrip()
        result = _ISG_NAME.match(bare)
        if not line.strip() or line.lstrip().startswith("#"):
            archive.comments += 1
        elif result is None or result.end() == len(bare) or BINARY.search(line):
            archive.add_odd(number, line, "no parameter with its value")
        else:
            value = bare[result.end() :]
            indices = [int(entry) for entry in re.findall(r"\[(\d+)\]", result[1])]
            key = re.sub(r"\[\d+\]", "", result[1])
            if key.endswith("log_achs_name"):
                archive.places[place] = value.strip('"')
            span = (start + result.end(), start + len(bare))
            archive.entries.append(Entry(key, value, indices[0] if indices else None, "", place, number, span))


def _xti(archive: Archive, _: Include | None) -> None:
    blank = _without_comments(archive)
    way: list[str] = []
    within: Counter[str] = Counter()
    stem = PurePath(archive.name).stem
    place, axes = "", 0
    numbers = _LineNumbers(archive.text)
    for tag in _TAG.finditer(blank):
        name = tag["name"]
        if tag["end"]:
            while within[name] and way:
                within[closed := way.pop()] -= 1
                if closed == name:
                    break
            continue
        if name == "Axis":
            axes += 1
            place = stem if axes == 1 else f"{stem} {axes}"
            archive.places[place] = ""
        if name == "Name" and way[-1:] == ["Axis"]:
            text = blank[tag.end() : tag.end() + 200].partition("<")[0].strip()
            archive.places[place] = "" if text == "__FILENAME__" else text[:64]
        if within["Axis"] or name == "Axis":
            for entry in _ATTRIBUTE.finditer(tag["rest"]):
                at = tag.start("rest") + entry.start(2) + 1
                text = entry[3] if entry[3] is not None else entry[4]
                archive.entries.append(
                    Entry(f"{name}@{entry[1]}", text, None, "", place, numbers.of(at), (at, at + len(text)))
                )
        if not tag["rest"].endswith("/"):
            way.append(name)
            within[name] += 1
            if len(way) > MAX_NESTING:
                raise InputError(f"{archive.path}:{numbers.of(tag.start())}: more than {MAX_NESTING} tags are open")


def _without_comments(archive: Archive) -> str:
    """The text of an XML file, blanks in place of comments and of what is no markup; one without an end goes on."""
    text, parts, at = archive.text, [], 0
    for start in (mark.start() for mark in re.finditer("<!", text)):
        if start < at:
            continue
        opening = next((words for words in ("<!--", "<![CDATA[") if text.startswith(words, start)), "")
        if not opening:
            line = _LineNumbers(text).of(start)
            raise InputError(f"{archive.path}:{line}: declarations of XML (<!DOCTYPE) are not read; no .xti has them")
        closing = "-->" if opening == "<!--" else "]]>"
        end = text.find(closing, start + len(opening))
        end = len(text) if end < 0 else end + len(closing)
        parts += [text[at:start], re.sub(r"[^\n]+", lambda match: " " * len(match[0]), text[start:end])]
        at = end
    return "".join([*parts, text[at:]])


class _LineNumbers:
    """Number of the line of a character; asked with rising places."""

    def __init__(self, text: str) -> None:
        self._text, self._at, self._line = text, 0, 1

    def of(self, at: int) -> int:
        self._line += self._text.count("\n", self._at, at)
        self._at = max(at, self._at)
        return self._line


def _table(archive: Archive, _: Include | None) -> None:
    rows = [(n, start, line) for n, start, line, _ended in lines(archive.text)]
    mark = max(";\t,", key=lambda text: sum(line.count(text) for _, _, line in rows))
    place = PurePath(archive.name).stem
    archive.places[place] = ""
    with_heads = False
    of_value: list[int] = []  # columns by the header
    of_unit: list[int] = []
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
                with_heads = True
                of_value = [k for k, word in enumerate(words) if word in _VALUE_HEADS][:MAX_COLUMNS]
                of_unit = [k for k, word in enumerate(words) if word in _UNIT_HEADS][:MAX_COLUMNS]
                archive.comments += 1
            else:
                archive.add_odd(number, line, "no parameter with its value")
            continue
        at, results = named[0]
        values = [k for k in of_value if k < len(cells) and k != at] if with_heads else _numbers(cells, at)
        if len(named) > 1 or len(values) != 1 or BINARY.search(line):
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
        units = [k for k in of_unit if k < len(cells)]
        unit = cells[units[0]][0].strip("\"' []") if len(units) == 1 else ""
        span = (start + where + shift, start + where + shift + len(bare))
        archive.entries.append(Entry(key, bare, index, "", place, number, span, unit=unit))
    if any(_DECIMAL_COMMA.fullmatch(entry.text) for entry in archive.entries):
        doubt = "the table has decimal commas, so that its point may group thousands"
        archive.entries = [
            replace(entry, doubt=doubt) if _THOUSANDS.fullmatch(entry.text) else entry for entry in archive.entries
        ]
    controls = {"sinumerik" if re.match(r"p\d|MD", entry.key) else "twincat" for entry in archive.entries}
    if len(controls) == 1:
        archive.control = controls.pop()
    elif controls:
        raise InputError(f"{archive.path}: holds parameters of several controls; give each a file of its own")


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


def _numbers(cells: Sequence[tuple[str, int]], named: int) -> list[int]:
    """Cells besides the named one that hold a number."""
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


def _has(pattern: str) -> Callable[[str], bool]:
    compiled = re.compile(pattern, re.MULTILINE)
    return lambda text: compiled.search(text) is not None


_FORMATS: tuple[tuple[str, str, Callable[[str], bool], Callable[[Archive, Include | None], None]], ...] = (
    ("twincat", ".xti of TwinCAT NC", _has(r"<TcSmItem\b|<AxisPara\b"), _xti),
    ("sinumerik", "machine data of a SINUMERIK", _has(r"(?i)\$M[ANC]_[A-Z0-9_][^\n=]{0,160}="), sinumerik.parse),
    ("sinumerik", "parameters of SINAMICS", _has(r"^[ \t]*+[pP]0*\d{1,5}[ \t]*+(\[[ \t\d]{1,20}\])?[ \t]*+="),
     sinumerik.parse),
    ("linuxcnc", "INI file of LinuxCNC",
     _has(r"^[ \t]*+(\[(EMC|TRAJ|EMCMOT|KINS|JOINT_\d+|AXIS_[\dXYZABCUVW])\]|#INCLUDE[ \t])"), linuxcnc.parse),
    ("twincat", "axis list of TwinCAT CNC", _has(r"^[ \t]*+(kopf|kenngr|getriebe|antr|lr_param|lr_hw|vorsteuer|"
                                                 r"frict_comp|filter)(\[\d+\])?\.\w"), _isg),
    ("sinumerik", "table of parameters", _has(r"(^|[;,\t\"' ])([pP]0*\d{3,5}(\[\d+\])?|[SP]-\d-\d{4}|P-AXIS-\d{5}"
                                              r"|MD\d{5}(\[\d+\])?)[;,\t\"' ]"), _table),
)  # fmt: skip
