"""Machine data of a SINUMERIK and parameters of its drives: sections of an archive, and what their lines set.

A section begins with %_N_NAME_TEA, with ;$PATH=.../_N_NAME_TEA, with the binary head of a record, or with PROC. What
programs, cycles and definitions set happens when they run: it is no value of the archive. Start reading at parse().
"""

from __future__ import annotations

import re

from feedsim.files.control.archive import BINARY, Archive, Entry, lines

MAX_LINE_LENGTH = 4000  # characters of a line; longer ones hold no single value
# Up to the sign of equality; two of them compare. The language of the control knows no cases of letters.
_MACHINE_DATUM = re.compile(
    r"(?:(?<![A-Za-z])N(?P<number>\d{1,6})[ \t]*)?\$(?P<kind>M[ANC]|S[ANC])_(?P<name>[A-Z0-9_]+)"
    r"[ \t]*(?:\[(?P<index>[^\[\]]*)\][ \t]*)?=(?!=)",
    re.IGNORECASE,
)
_DRIVE = re.compile(
    r"^[ \t]*(?P<name>[pPrR]0*(?P<number>\d{1,5}))[ \t]*(?:\[[ \t]*(?P<index>\d{1,6})[ \t]*\][ \t]*)?=(?P<value>.*)$"
)
_DRIVE_OBJECT = re.compile(r"PS0*(\d{1,6})[._](?:TEA|ACX)", re.IGNORECASE)
_SLAVE = re.compile(r"SLAVE(\d{1,4})[._]DIR", re.IGNORECASE)
_CHECKSUM = re.compile(r"(?<=[ \t])'[0-9A-Fa-f]{4}'?$")
_STATEMENT = re.compile(
    r"\s*+(?:N\d++\s++)?(?P<word>IF|GOTO[FB]?|WHILE|ELSE|ENDIF|ENDWHILE|ENDFOR|FOR|REPEAT)\b", re.IGNORECASE
)
_END = re.compile(r"\s*(?:N\d+\s+)?M(?:0?17|0?2|30)\b")
# How sections begin: in a text, in a binary head (where the name may run into the next one), and as a program.
_SECTION = re.compile(
    r"\s*+(?:%\s*+|;\s*+\$PATH\s*+=\s*+\S*/)_N_(?P<name>\w+)_(?P<kind>(?!DIR|WPD)[A-Z]{3})\s*+(?:;.*)?$", re.IGNORECASE
)
_RECORD = re.compile(
    r"_N_(?P<name>\w{1,32}?)_(?P<kind>TEA|INI|SEA|ACX|OPT|SPF|MPF|CYC|CPF|DEF|SYF)(?![A-Z0-9_])"
    r"|(?<!\w)(?P<name_>\w+)\.(?P<kind_>TEA|INI|SEA|ACX|OPT|SPF|MPF|CYC|CPF|DEF|SYF)(?![A-Z0-9_])",
    re.IGNORECASE,
)
_PROGRAM = re.compile(
    r"\s*+(?:%\s*+(?P<number>(?:(?:MPF|SPF)\s*+)?\d++)|(?:N\d++\s++)?PROC\s++(?P<name>\w++))", re.IGNORECASE
)
_DATA = ("TEA", "INI", "SEA", "ACX", "OPT")  # kinds of sections that hold machine data
_PROGRAM_SUFFIXES = (".spf", ".mpf", ".cyc", ".cpf", ".def", ".syf")


def _without_comment(text: str, mark: str = ";") -> str:
    """What stands ahead of a comment; marks within quotes begin none."""
    quoted = False
    for k, c in enumerate(text):
        if c == '"':
            quoted = not quoted
        elif c == mark and not quoted:
            return text[:k]
    return text


def parse(archive: Archive, _: object = None) -> None:
    """Entries of the sections with machine data; what programs set stands in `archive.in_programs`."""
    place, branches = "", 0
    program = archive.path.name if archive.path.suffix.lower() in _PROGRAM_SUFFIXES else ""
    for number, start, line, ended in lines(archive.text):
        program = _program(line, program, archive.container)
        if program:
            _set_by_program(archive, number, start, line, program)
            continue
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
            damaged = bool(BINARY.search(line))
            archive.add_odd(number, line, "binary" if damaged else "no assignment of a parameter")
    for entry in [item for item in archive.entries if item.key == "AXCONF_MACHAX_NAME_TAB" and item.index is not None]:
        name = entry.text.strip().strip('"')
        if name and archive.axis_names.setdefault(f"AX{entry.index + 1}", name) != name:  # type: ignore[operator]
            archive.add_odd(entry.line, entry.text, "another name of an axis that has one")
    named: dict[str, dict[int, str]] = {item.place: {} for item in archive.entries if item.place}
    for item in archive.entries:
        if item.key == "p199" and item.index is not None:
            named[item.place][item.index] = item.text
    for place, codes in named.items():
        archive.places[place] = "".join(
            chr(int(codes[k])) for k in sorted(codes)
            if codes[k].isdecimal() and len(codes[k]) < 6 and 32 <= int(codes[k]) < 127
        ).strip()  # fmt: skip


def _program(line: str, program: str, container: bool) -> str:
    """Name of the program that a line belongs to, after that of the line before; "" of machine data."""
    if (record := _SECTION.match(line)) is not None:
        return "" if record["kind"].upper() in _DATA else f"_N_{record['name']}_{record['kind']}"
    if container and BINARY.search(line):
        for record in _RECORD.finditer(line):
            kind = record["kind"] or record["kind_"]
            program = "" if kind.upper() in _DATA else f"{record['name'] or record['name_']}.{kind}"
    elif (started := _PROGRAM.match(line)) is not None:
        return program or (started["name"] or f"%{started['number']}")
    return program


def _set_by_program(archive: Archive, number: int, start: int, line: str, program: str) -> None:
    data = _data(_without_comment(line)) if len(line) <= MAX_LINE_LENGTH else []
    starts = [*(datum.start() for datum in data), len(line)]
    for datum, end in zip(data, starts[1:], strict=True):
        text, at, _ = _value(line[:end], datum.end())
        axis = next((part.strip() for part in (datum["index"] or "").split(",") if part.strip()[:1].isalpha()), "")
        archive.in_programs.append(
            Entry(datum["name"].upper(), text, None, axis.upper() if datum["kind"].upper() == "MA" else "", "", number,
                  (start + at, start + at + len(text)), program=program)
        )  # fmt: skip
    archive.comments += not data


def _value(line: str, at: int) -> tuple[str, int, bool]:
    """The value that begins at a place of a line, where it begins, and whether a checksum stands behind it."""
    text = _without_comment(line[at:]).rstrip()
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
    if not whole or BINARY.search(line[match.start() :]):
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
    if not whole or BINARY.search(line) or not text:
        archive.add_odd(number, line, "no value behind the sign of equality" if whole else "cut, or not whole")
        return
    index = int(match["index"]) if match["index"] else None
    archive.entries.append(
        Entry(f"p{int(match['number'])}", text, index, "", place, number, (start + at, start + at + len(text)),
              checksum=checked)
    )  # fmt: skip
