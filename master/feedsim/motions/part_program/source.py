"""Program files: bytes become text, a text becomes a program with an index of its loops and jump targets."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path

from feedsim.files.source import content
from feedsim.foundation.errors import InputError
from feedsim.motions.part_program.recorder import Fault

MAX_FILE_SIZE = 100_000_000  # bytes; the memory for one is some 2 GB
ENDINGS = ("", ".spf", ".mpf", ".nc", ".ngc", ".iso", ".tap", ".cnc", ".txt", ".h")
DIALECTS = ("sinumerik", "iso", "heidenhain")
# Bytes that no text has; the end mark of old systems is left out ahead.
_BINARY = re.compile(rb"[\x00-\x08\x0e-\x1f]")

# Words that SINUMERIK alone has, and those that it does not have.
_OWN_WORDS = re.compile(
    r"\b(?:CR|AR|ADIS|ADISPOS|CTOL|RND|RNDM|CHR|CHF|RP|AP|ANG|RPL|R\d+)[ \t]*=|\bG(?:64[125]|70|71|700|710|11[012])\b"
    r"|\b(?:TRANS|ROT|MSG|DEF|PROC|IF|WHILE|FOR|GOTO[FB]?|CIP|CT|BRISK|SOFT|COMPCAD)\b|^%_N_",
    re.MULTILINE,
)
_ISO_WORDS = re.compile(
    r"^[ \t]*%[ \t]*$|^[ \t]*O\d+|#[\d<\[]|\bM9[89]\b|\bG0?[23](?![\d.])[^\n]*R[ \t]*[-+]?[\d.]"
    r"|\bG(?:20|21|28|43|49|61|61\.1|64[ \t]*P.*|80|9[0-1]\.1|98|99)(?![\d.])",
    re.MULTILINE,
)

Place = tuple[int, int]  # position in the text, line from 1


def decode(path: Path | str, data: bytes) -> str:
    """Text with \\n as the only line end. UTF-8 or UTF-16 with their marks, else UTF-8, else Latin-1."""
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    encoding = next((name for mark, name in marks.items() if data.startswith(mark)), "")
    if not encoding and data.count(b"\x00") and len(data) >= 4:
        # Without a mark, Latin letters in UTF-16 have every other byte 0.
        pairs = len(data) // 2
        for name, zeros in (("utf-16-le", data[1::2]), ("utf-16-be", data[::2])):
            if zeros.count(b"\x00") > 0.9 * pairs and data.count(b"\x00") == zeros.count(b"\x00"):
                encoding = name
    if not encoding:
        data = data.rstrip(b"\x1a")
        match = _BINARY.search(data)
        if match:
            line = data.count(b"\n", 0, match.start()) + 1
            raise InputError(f"{path}:{line}: byte 0x{match[0][0]:02x}: the file is binary, not a program as text")
        encoding = "utf-8"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            raise InputError(
                f"{path}: the file begins as {encoding.upper()} and cannot be read as it: {error}"
            ) from None
        text = data.decode("latin-1")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text


def detect_dialect(path: Path, text: str) -> str:
    """By the ending of the file, then by words that one dialect alone has; else SINUMERIK."""
    ending, head = path.suffix.lower(), text[:100_000].upper()
    if ending == ".h" or re.search(r"^[ \t]*\d*[ \t]*BEGIN PGM ", head, re.MULTILINE):
        return "heidenhain"
    if ending in (".mpf", ".spf"):
        return "sinumerik"
    if ending == ".ngc":
        return "iso"
    code = re.sub(r";.*|\"[^\"\n]*\"|\([^()\n]*\)", "", head)
    if _OWN_WORDS.search(code):
        return "sinumerik"
    return "iso" if _ISO_WORDS.search(re.sub(r"N\d+", " ", code).replace("G", " G")) else "sinumerik"


_HEAD = r"^[ \t]*(?:/\d?[ \t]*)?(?:N\d+[ \t]*)?"
_LABEL = r"(?:[A-Z_][A-Z0-9_]*[ \t]*:(?!=)[ \t]*)"
_STRUCTURE = re.compile(
    rf"{_HEAD}{_LABEL}*(IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|UNTIL)(?![A-Z0-9_:])([^\n;]*)",
    re.MULTILINE,
)
# Loops of other controls: WHILE [#1 LT 5] DO1 of Fanuc's macros, O100 WHILE [#1 LT 5] of LinuxCNC.
_OTHER_LOOP = re.compile(
    rf"{_HEAD}(?:(WHILE)[ \t]*\[|O(?:\d+|<[^>\n]*>)[ \t]*(WHILE|ENDWHILE|DO|REPEAT|ENDREPEAT|BREAK|CONTINUE)(?!\w))",
    re.MULTILINE,
)
_TARGET = re.compile(rf"[ \t]*(?:/\d?[ \t]*)?(?:(?:N|:)(\d+))?[ \t]*({_LABEL}*)")
_LABEL_NAME = re.compile(r"[A-Z_][A-Z0-9_]*")
_ISO_TARGET = re.compile(r"[ \t]*[O:](\d+)")
_OPENS = {"ENDIF": "IF", "ELSE": "IF", "ENDWHILE": "WHILE", "ENDFOR": "FOR", "ENDLOOP": "LOOP", "UNTIL": "REPEAT"}
_CLOSES = {"IF": "ENDIF", "WHILE": "ENDWHILE", "FOR": "ENDFOR", "LOOP": "ENDLOOP", "REPEAT": "UNTIL"}


class Program:
    """A file: its text, and code, which is the text in capitals. index: of the file."""

    def __init__(self, name: str, text: str, index: int) -> None:
        self.name, self.text, self.index = name, text, index
        upper = text.upper()
        if len(upper) != len(text):  # letters that become two
            upper = "".join(letter if len(letter.upper()) != 1 else letter.upper() for letter in text)
        self.code = text if upper == text else upper

    def end_of_line(self, at: int) -> int:
        stop = self.code.find("\n", at)
        return len(self.code) if stop < 0 else stop

    @cached_property
    def loop_of_other_controls(self) -> Fault | None:
        """The first loop that is written as other controls have it: here it would be read as something else."""
        match = _OTHER_LOOP.search(self.code)
        if not match:
            return None
        control = "Fanuc (WHILE [..] DO 1)" if match[1] else "LinuxCNC (O100 WHILE [..])"
        reason = f"macro loops of {control} are not read; write the blocks out, or call a subprogram with M98 P L"
        line = self.code.count("\n", 0, match.end()) + 1
        return Fault(match[1] or match[2], reason, line, self.index)

    @cached_property
    def structure(self) -> Mapping[int, Place]:
        """Where a block of a branch or loop stands (its line) -> where the flow goes on.

        IF and ELSE: behind the ELSE or ENDIF. WHILE, FOR: behind the loop's end. Ends of loops: at its beginning.
        """
        result: dict[int, Place] = {}
        opened: list[tuple[str, int, int]] = []  # word, line, position
        line, counted = 1, 0
        for match in _STRUCTURE.finditer(self.code):
            line += self.code.count("\n", counted, match.start())
            counted = match.start()
            word, rest = match[1], match[2].strip()
            if (word == "IF" and re.search(r"\bGOTO[BFCS]?\b", rest)) or (
                word == "REPEAT" and rest and not rest.startswith("(")
            ):
                continue
            behind = (self.end_of_line(match.start()) + 1, line + 1)
            if word in _CLOSES:
                opened.append((word, line, match.start()))
                continue
            if not opened or opened[-1][0] not in (_OPENS[word], "ELSE" if word == "ENDIF" else ""):
                what = f"; {opened[-1][0]} of line {opened[-1][1]} is open" if opened else ""
                raise Fault(word, f"{word} without {_OPENS[word]}{what}", line, self.index)
            begun = opened.pop()
            if word in ("ELSE", "ENDIF"):
                result[begun[1]] = behind
            else:
                result[begun[1]] = behind
                result[line] = (begun[2], begun[1])
            if word == "ELSE":
                opened.append((word, line, match.start()))
        if opened:
            word, line, _ = opened[-1]
            closing = _CLOSES.get(word, "ENDIF")
            raise Fault(word, f"{word} without {closing}", line, self.index)
        return result

    def _places(self, target: Callable[[int, int], list[str]]) -> Mapping[str, list[Place]]:
        result: dict[str, list[Place]] = {}
        at, line = 0, 1
        while at < len(self.code):
            stop = self.end_of_line(at)
            for name in target(at, stop):
                result.setdefault(name, []).append((at, line))
            at, line = stop + 1, line + 1
        return result

    @cached_property
    def targets(self) -> Mapping[str, list[Place]]:
        """Labels and block numbers (N10 as `N10`) -> where they stand, in order."""

        def target(at: int, stop: int) -> list[str]:
            match = _TARGET.match(self.code, at, stop)
            assert match
            number = [f"N{match[1].lstrip('0') or '0'}"] if match[1] else []
            return number + (_LABEL_NAME.findall(match[2]) if match[2] else [])

        return self._places(target)

    @cached_property
    def numbered(self) -> Mapping[str, list[Place]]:
        """Programs within a file of ISO (O100 as `100`) -> where they stand."""

        def target(at: int, stop: int) -> list[str]:
            match = _ISO_TARGET.match(self.code, at, stop)
            return [match[1].lstrip("0") or "0"] if match else []

        return self._places(target)

    def find_target(self, name: str, at: int, ways: str) -> Place | None:
        """A jump target from a position. ways: F forwards, B backwards, in the order of the search."""
        places = self.targets.get(name, [])
        for way in ways:
            # The block of the jump itself is reached by a search backwards.
            if way == "B":
                before = bisect_right(places, (at, len(self.code) + 1))
                if before:
                    return places[before - 1]
            else:
                behind = bisect_left(places, (at + 1, 0))
                if behind < len(places):
                    return places[behind]
        return None


class Folder:
    """Programs that a program calls: files beside it, whatever the case of their names."""

    def __init__(self, main: Path) -> None:
        self.folder = main.parent

    @cached_property
    def files(self) -> Mapping[str, Path]:
        """Name in lower case -> file. Of names that differ in case alone the first in order counts."""
        try:
            match = sorted(self.folder.iterdir(), reverse=True)
        except OSError:
            return {}
        return {path.name.lower(): path for path in match}

    def find(self, name: str) -> Path | None:
        stem = name.lower()
        names = [stem + ending for ending in ENDINGS]
        names += [f"_n_{stem}_spf", f"_n_{stem}_spf.spf", f"_n_{stem}_mpf", f"_n_{stem}_mpf.mpf"]
        return next((self.files[file] for file in names if file in self.files and self.files[file].is_file()), None)


def read_text(path: Path) -> str:
    """InputError: no such file, binary, too large."""
    return decode(path, content(path, MAX_FILE_SIZE))
