"""INI files of LinuxCNC: their lines and those of files that they include, the joints of an axis, the limits that act.

After docs/src/config/ini-config.adoc, the man page kins(9) and src/libnml/inifile/inifile.cc. Of settings that stand
twice LinuxCNC takes the first; a value of ours that stands twice is refused where the two differ (view.py).
Start reading at parse().
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from feedsim.control.archive import BINARY, MAX_INCLUDED_BYTES, Archive, Entry, decoded, lines
from feedsim.errors import InputError

Include = Callable[[str], tuple[PurePath, bytes]]  # as #INCLUDE names a file -> its path and content
MAX_INCLUDES = 100  # #INCLUDE lines, those of included files counted again each time
_SECTION = re.compile(r"\[([^\[\]]*)\]")
_ASSIGNED = re.compile(r"(?P<name>[A-Za-z_]\w*)[ \t]*=[ \t]*(?P<value>.*)$")
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
class _Setting:
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
    by_section: dict[str, list[_Setting]] = {}
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

    def settings(self, archive: Archive, chain: tuple[PurePath, ...]) -> Iterator[_Setting]:
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
            elif (assigned := _ASSIGNED.match(bare)) and self._section:
                at = start + len(line) - len(bare) + assigned.start("value")
                comment = _COMMENT.search(" " + assigned["value"])
                text = (assigned["value"][: comment.start()] if comment else assigned["value"]).rstrip()
                if several:
                    archive.add_odd(number, line, "a value of several lines")
                span = None if several else (at, at + len(text))
                yield _Setting(archive, self._section, assigned["name"].upper(), text, number, span)
            else:
                archive.add_odd(number, line, "no KEY = VALUE below a section")

    def _included(self, archive: Archive, number: int, word: str, chain: tuple[PurePath, ...]) -> Iterator[_Setting]:
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
                text, encoding = decoded(data)
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
    joint: str, letter: str, by_section: Mapping[str, list[_Setting]], first: Mapping[tuple[str, str], str], old: bool
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


def _first_two(settings: Sequence[_Setting], names: Mapping[str, str]) -> list[tuple[str, _Setting]]:
    """Limit and setting of a section that several joints share; two values of one limit are enough to refuse it."""
    result: dict[tuple[str, str], _Setting] = {}
    counts: Counter[str] = Counter()
    for one in settings:
        if (key := names.get(one.key, "")) and counts[key] < 2 and (key, one.text) not in result:
            counts[key] += 1
            result[key, one.text] = one
    return [(key, one) for (key, _), one in result.items()]


def _entry(one: _Setting, key: str, axis: str = "", scale: float = 1.0, unsure: str = "", doubt: str = "") -> Entry:
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
