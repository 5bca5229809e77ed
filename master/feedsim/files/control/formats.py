"""How files of controls are read: a row of _FORMATS and a function for each kind of file.

Start reading at parse_file().
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

from feedsim.files.control import sinumerik
from feedsim.files.control.archive import (
    BINARY,
    HEXADECIMAL,
    MAX_INCLUDED_BYTES,
    Archive,
    Entry,
    decode_text,
    lines,
    scalar,
)
from feedsim.foundation.errors import InputError

# --- INI files of LinuxCNC: their lines and those of files that they include, the joints of an axis, the limits that ac
# After docs/src/config/ini-config.adoc, the man page kins(9) and src/libnml/inifile/inifile.cc. Of settings that
# stand
# twice LinuxCNC takes the first; a value of ours that stands twice is refused where the two differ (view.py).


Include = Callable[[str], tuple[PurePath, bytes]]  # as #INCLUDE names a file -> its path and content
MAX_INCLUDES = 100  # #INCLUDE lines, those of included files counted again each time
_SECTION = re.compile(r"\[([^\[\]]*)\]")
_ASSIGNMENT = re.compile(r"(?P<name>[A-Za-z_]\w*)[ \t]*=[ \t]*(?P<value>.*)$")
_COMMENT = re.compile(r"[ \t][#;]")
MAX_JOINTS = 16  # of LinuxCNC (EMCMOT_MAX_JOINTS)
_AXIS_LETTERS = "XYZABCUVW"
# Limits that sections share: +1 of several the smallest acts, -1 the largest.
_LIMITS = {"MAX_VELOCITY": 1, "MAX_ACCELERATION": 1, "MIN_LIMIT": -1, "MAX_LIMIT": 1}
# What [TRAJ] calls limits of all axes, from 2.8 on and before -> the limit.
_OF_ALL = (
    {"MAX_LINEAR_VELOCITY": "MAX_VELOCITY", "MAX_LINEAR_ACCELERATION": "MAX_ACCELERATION",
     "MAX_LINEAR_ACCEL": "MAX_ACCELERATION"},
    {"MAX_VELOCITY": "MAX_VELOCITY", "MAX_ACCELERATION": "MAX_ACCELERATION"},
)  # fmt: skip


@dataclass(frozen=True)
class _SectionSetting:
    """KEY = VALUE below a section. span: None where several lines make it, so that it cannot be written."""

    archive: Archive
    section: str
    key: str
    text: str
    line: int
    span: tuple[int, int] | None


def parse(archive: Archive, include: Include | None) -> None:
    """Entries of a file and of those that it includes, which become `archive.included`."""
    settings = list(_Reader(archive, include).settings(archive, ()))
    first: dict[tuple[str, str], str] = {}
    for one in settings:
        first.setdefault((one.section, one.key), one.text)
    old = not any(re.fullmatch(r"JOINT_\d+", one.section) for one in settings)
    own = re.compile(r"AXIS_\d{1,2}" if old else r"JOINT_\d{1,2}")
    joints = sorted({one.section for one in settings if own.fullmatch(one.section)}, key=lambda name: (len(name), name))
    if old and joints:
        archive.form += " up to 2.7"
    archive.axis_names, archive.unnamed = _letters(joints, first, old)
    for one in settings:
        if one.span is None or one.section in joints or (not old and re.fullmatch(r"AXIS_[A-Z]", one.section)):
            continue
        if not re.fullmatch(r"(?:AXIS|JOINT)_\d+", one.section):
            one.archive.entries.append(_entry(one, f"{one.section}.{one.key}"))
    by_section: dict[str, list[_SectionSetting]] = {}
    for one in settings:
        if one.span is not None:
            by_section.setdefault(one.section, []).append(one)
    for joint in joints:
        _of_joint(joint, archive.axis_names.get(joint, ""), by_section, first, old)
    for file in (archive, *archive.included.values()):
        file.entries.sort(key=lambda entry: entry.span)


class _Reader:
    """Settings in their order; a section goes on in a file that is included below it."""

    def __init__(self, root: Archive, include: Include | None) -> None:
        self._root, self._include = root, include
        self._section, self._count, self._size = "", 0, 0

    def settings(self, archive: Archive, chain: tuple[PurePath, ...]) -> Iterator[_SectionSetting]:
        chain = (*chain, archive.path)
        for number, start, line, several in _logical(archive.text):
            bare = line.lstrip(" \t")
            if BINARY.search(line):
                archive.add_odd(number, line, "binary")
            elif bare.startswith("#INCLUDE") and bare[8:9] in (" ", "\t"):
                yield from self._included(archive, number, bare[8:].strip(), chain)
            elif not bare or bare.startswith(("#", ";")):
                archive.comments += 1
            elif bare.startswith("["):
                head = _SECTION.match(bare)
                self._section = head[1].strip().upper() if head else ""
                if head is None:
                    archive.add_odd(number, line, "a section without its closing bracket")
            elif (assigned := _ASSIGNMENT.match(bare)) and self._section:
                at = start + len(line) - len(bare) + assigned.start("value")
                comment = _COMMENT.search(" " + assigned["value"])
                text = (assigned["value"][: comment.start()] if comment else assigned["value"]).rstrip()
                if several:
                    archive.add_odd(number, line, "a value of several lines")
                span = None if several else (at, at + len(text))
                yield _SectionSetting(archive, self._section, assigned["name"].upper(), text, number, span)
            else:
                archive.add_odd(number, line, "no KEY = VALUE below a section")

    def _included(
        self, archive: Archive, number: int, word: str, chain: tuple[PurePath, ...]
    ) -> Iterator[_SectionSetting]:
        where = f"{archive.path}:{number}: #INCLUDE {word}"
        self._count += 1
        if self._include is None:
            archive.add_odd(number, word, "a file to include, which is not read here")
            return
        if self._count > MAX_INCLUDES:
            raise InputError(f"{where}: more than {MAX_INCLUDES} files are included")
        known = self._root.included.get(word)
        if known is None:
            try:
                path, data = self._include(word)
            except InputError as error:
                raise InputError(f"{where}: {error}") from None
            # The same file by another name, ./a.inc of a.inc.
            known = next((file for file in self._root.included.values() if file.path == path), None)
            if known is None:
                text, encoding = decode_text(data)
                known = Archive(path.name, archive.control, archive.form, text, encoding, path=path)
            self._root.included[word] = known
        self._size += len(known.text)
        if self._size > MAX_INCLUDED_BYTES:
            raise InputError(f"{where}: included files have more than {MAX_INCLUDED_BYTES / 1e6:g} MB altogether")
        if known.path in chain:
            raise InputError(f"{where}: the file includes itself: {' -> '.join(map(str, (*chain, known.path)))}")
        yield from self.settings(known, chain)


def _logical(text: str) -> Iterator[tuple[int, int, str, bool]]:
    """Number, start and text of lines, and whether several make one: a backslash at the end goes on in the next."""
    parts: list[str] = []
    first = (0, 0)
    for number, start, line, _ in lines(text):
        if not parts:
            first = (number, start)
        parts.append(line.removesuffix("\\"))
        if not line.endswith("\\"):
            yield *first, "".join(parts), len(parts) > 1
            parts = []
    if parts:
        yield *first, "".join(parts), True


def _letters(joints: list[str], first: Mapping[tuple[str, str], str], old: bool) -> tuple[dict[str, str], str]:
    """Section of a joint -> letter of its axis; and why letters are not known, "" where they are.

    trivkins counts joints along its parameter `coordinates`, without it along all letters. [TRAJ] COORDINATES has the
    axes that there are. Without [KINS] KINEMATICS a letter is known if both ways give it the same joints.
    """
    given = [letter for letter in first.get(("TRAJ", "COORDINATES"), "").upper() if letter in _AXIS_LETTERS]
    module, *parameters = first.get(("KINS", "KINEMATICS"), "").strip('"').split() or [""]
    orders, reason = [_AXIS_LETTERS], ""
    if module == "trivkins":
        named = [value for name, _, value in (part.partition("=") for part in parameters) if name == "coordinates"]
        orders = [order.upper() for order in named[:1]] or orders
    elif module:
        return {}, f"the kinematics {module[:40]} do not say which joint moves an axis"
    elif not old or len({*given}) < len(given):
        orders.append("".join(given))
        reason = "the file has no [KINS] KINEMATICS, which say which joint moves an axis"
    known = {letter: [{k for k, other in enumerate(order[:MAX_JOINTS]) if other == letter} for order in orders]
             for letter in dict.fromkeys(given) or _AXIS_LETTERS[: 9 if module or old else 0]}  # fmt: skip
    names = {f"{'AXIS' if old else 'JOINT'}_{k}": letter for letter, ways in known.items()
             if all(way == ways[0] for way in ways) for k in ways[0]}  # fmt: skip
    return {joint: names[joint] for joint in joints if joint in names}, reason


def _of_joint(
    joint: str,
    letter: str,
    by_section: Mapping[str, list[_SectionSetting]],
    first: Mapping[tuple[str, str], str],
    old: bool,
) -> None:
    """Entries of a joint; limits of its axis and of all axes act on it as well."""
    own = by_section[joint]
    common = _unit(first.get(("TRAJ", "LINEAR_UNITS"), first.get(("TRAJ", "UNITS"))))
    scale, unsure, doubt = common if (joint, "UNITS") not in first else _unit(first[joint, "UNITS"])
    kind = first.get((joint, "TYPE"), "ANGULAR" if letter and letter in "ABC" else "LINEAR").upper()
    if kind != "LINEAR":
        doubt = "the joint is a rotary one" if kind == "ANGULAR" else f"the joint's TYPE is {kind[:20]!r}"
    for one in own:
        if one.key in ("P", "FF1"):
            wiring = "its wiring is in the HAL file: a gain in 1/s only where the output is a speed"
            entry = _entry(one, f"JOINT.{one.key}", joint, 1.0, wiring, doubt if kind != "LINEAR" else "")
        else:
            replaced = one.key == "BACKLASH" and (joint, "COMP_FILE") in first
            reason = doubt or ("COMP_FILE takes its place" if replaced else "")
            entry = _entry(one, f"JOINT.{one.key}", joint, scale, unsure, reason)
        one.archive.entries.append(entry)
    lacking = {"MAX_VELOCITY", "MAX_ACCELERATION"} - {one.key for one in own}
    shared = (
        [] if old or not letter else _first_two(by_section.get(f"AXIS_{letter}", ()), {key: key for key in _LIMITS})
    )
    for key, one in shared + _first_two(by_section.get("TRAJ", ()), _OF_ALL[old]):
        missing = f"[{joint}] has no {key}, and LinuxCNC's default acts" if key in lacking else ""
        if one.section != "TRAJ" or not missing:
            reason = doubt or common[2] or missing
            one.archive.entries.append(_entry(one, f"JOINT.{key}", joint, common[0], common[1], reason))


def _first_two(settings: Sequence[_SectionSetting], names: Mapping[str, str]) -> list[tuple[str, _SectionSetting]]:
    """Limit and setting of a section that several joints share; two values of one limit are enough to refuse it."""
    result: dict[tuple[str, str], _SectionSetting] = {}
    counts: Counter[str] = Counter()
    for one in settings:
        if (key := names.get(one.key, "")) and counts[key] < 2 and (key, one.text) not in result:
            counts[key] += 1
            result[key, one.text] = one
    return [(key, one) for (key, _), one in result.items()]


def _entry(
    one: _SectionSetting, key: str, axis: str = "", scale: float = 1.0, unsure: str = "", doubt: str = ""
) -> Entry:
    assert one.span is not None
    sense = _LIMITS.get(key.partition(".")[2], 0) if axis else 0
    section = f"[{one.section}]" if sense else ""
    return Entry(key, one.text, None, axis, "", one.line, one.span, scale=scale, unsure=unsure, doubt=doubt,
                 sense=sense, section=section)  # fmt: skip


def _unit(text: str | None) -> tuple[float, str, str]:
    """Millimetres of a unit of length, what is to be checked of it, and why it cannot be used."""
    if text is None:
        return 1.0, "the file has no LINEAR_UNITS", ""
    word = text.strip().strip('"').lower()
    known = {"mm": 1.0, "metric": 1.0, "inch": 25.4, "in": 25.4, "imperial": 25.4}
    if word in known:
        return known[word], "", ""
    try:
        per_mm = float(word)  # older files: units in a millimetre
    except ValueError:
        per_mm = math.nan
    if not 1e-6 < per_mm < 1e6:
        return 1.0, "", f"the unit {word[:20]!r} is not known"
    return (25.4 if math.isclose(per_mm, 1 / 25.4, rel_tol=1e-3) else 1 / per_mm), "", ""


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


def parse_file(name: str, data: bytes, path: PurePath | None = None, include: Include | None = None) -> Archive:
    """What a file holds, by its content.

    Args:
        name: of the file. path: by which the user knows it.
        include: path and content of a file that this one names (#INCLUDE of LinuxCNC); None: those are not read.

    Raises:
        InputError: none of the formats; a file to include that there is not.
    """
    text, encoding = decode_text(data)
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


def _contains_pattern(pattern: str) -> Callable[[str], bool]:
    compiled = re.compile(pattern, re.MULTILINE)
    return lambda text: compiled.search(text) is not None


_FORMATS: tuple[tuple[str, str, Callable[[str], bool], Callable[[Archive, Include | None], None]], ...] = (
    ("twincat", ".xti of TwinCAT NC", _contains_pattern(r"<TcSmItem\b|<AxisPara\b"), _xti),
    (
        "sinumerik",
        "machine data of a SINUMERIK",
        _contains_pattern(r"(?i)\$M[ANC]_[A-Z0-9_][^\n=]{0,160}="),
        sinumerik.parse,
    ),
    (
        "sinumerik",
        "parameters of SINAMICS",
        _contains_pattern(r"^[ \t]*+[pP]0*\d{1,5}[ \t]*+(\[[ \t\d]{1,20}\])?[ \t]*+="),
        sinumerik.parse,
    ),
    (
        "linuxcnc",
        "INI file of LinuxCNC",
        _contains_pattern(r"^[ \t]*+(\[(EMC|TRAJ|EMCMOT|KINS|JOINT_\d+|AXIS_[\dXYZABCUVW])\]|#INCLUDE[ \t])"),
        parse,
    ),
    (
        "twincat",
        "axis list of TwinCAT CNC",
        _contains_pattern(
            r"^[ \t]*+(kopf|kenngr|getriebe|antr|lr_param|lr_hw|vorsteuer|"
            r"frict_comp|filter)(\[\d+\])?\.\w"
        ),
        _isg,
    ),
    (
        "sinumerik",
        "table of parameters",
        _contains_pattern(
            r"(^|[;,\t\"' ])([pP]0*\d{3,5}(\[\d+\])?|[SP]-\d-\d{4}|P-AXIS-\d{5}"
            r"|MD\d{5}(\[\d+\])?)[;,\t\"' ]"
        ),
        _table,
    ),
)
