"""Executes programs of SINUMERIK and of ISO: blocks, branches, loops, subprograms; movements go to a Recorder.

Sources of the rules: Siemens, SINUMERIK 840D sl / 828D, programming manuals "Fundamentals" and "Job planning"; of the
ISO dialect: ISO 6983-1, and what LinuxCNC documents of its interpreter RS274/NGC.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feedsim.motions.part_program.expressions import NAME, Scanner, Value, Variable, badly_written, rounded, whole, zero
from feedsim.motions.part_program.geometry import (  # fmt: skip
    IDENTITY,
    MIN_DISTANCE,
    Arc,
    Frame,
    arc_about,
    arc_of_angle,
    arc_of_radius,
    arc_tangent,
    arc_through,
    rotation,
    sine,
)
from feedsim.motions.part_program.recorder import ARC, MAX_COORDINATE, Corner, Fault, Options, Recorder
from feedsim.motions.part_program.source import Place, Program
from feedsim.motions.part_program.words import (  # fmt: skip
    FRAMES,
    ISO_CODES,
    ISO_REFUSED,
    NAMED_CODES,
    NOTED,
    NOTED_VALUES,
    NOTED_WITH_ARGUMENTS,
    SINUMERIK_CODES,
    SINUMERIK_REFUSED,
    VALUES,
    WITH_WAY,
    WORKPIECE_LENGTHS,
    Blending,
    Modal,
    refusal_of,
    spelled,
)

MAX_REPEATED = 2_000_000  # blocks that loops, jumps back and subprograms execute in all
MAX_CALLS = 16  # levels of subprograms and repeated sections
MAX_ELEMENTS = 100_000  # of an array
MAX_FEED = 1e9  # as programmed

# What most blocks have alone: letters and named values with a number. L and O call and name subprograms.
_WORD = r"([A-KMNP-Z]|(?:CR|AR|TURN|RP|AP|ANG|RND|CHF|CHR)(?=[ \t]*=))[ \t]*=?[ \t]*([-+]?[\d.]+)"
_DECIMAL = r"[-+]?(?:\d+\.?\d*|\.\d+)(?![.\d]|E[-+\d])"
_PLAIN_BLOCK = {
    True: re.compile(rf"(?:[ \t]*[A-KMNP-Z][ \t]*{_DECIMAL})*[ \t]*"),
    False: re.compile(rf"(?:[ \t]*(?:[A-KMNP-Z]|(?:CR|AR|TURN|RP|AP|ANG|RND|CHF|CHR)[ \t]*=)[ \t]*{_DECIMAL})*[ \t]*"),
}
_PLAIN_WORD = re.compile(_WORD)
_ADDRESS = re.compile(r"([A-Z])[ \t]*([-+]?(?:\d+\.?\d*|\.\d+)(?:EX[-+]?\d+)?)")
_ASSIGNED = re.compile(r"([A-Z_$][A-Z_$][A-Z0-9_$]*|[A-Z]\d*)[ \t]*=(?!=)")
_INDEXED = re.compile(r"([A-Z_$][A-Z_$][A-Z0-9_$]*|[A-Z])[ \t]*(?=\[)")
_LABEL = re.compile(r"([A-Z_][A-Z0-9_]*)[ \t]*:(?!=)")
_SKIP = re.compile(r"/\d?(?!\d)")
_NUMBERED = re.compile(r"(?:N|:)[ \t]*\d+(?![.\d]|[ \t]*=)")
_WAY = re.compile(r"(?:IC|AC|DC|ACP|ACN|CAC|CIC|CDC|CACP|CACN)(?=[ \t]*\()")
_GOTO = re.compile(r"(GOTO[BFC]?)(?![A-Z0-9_])")
_TARGET = re.compile(r"N\d+|[A-Z_][A-Z0-9_]*|:\d+")
_REPEATS = re.compile(r"P[ \t]*(?:=[ \t]*(?=.)|(?=\d))")
_DEF_KIND = re.compile(r"(REAL|INT|BOOL|CHAR|STRING|AXIS|FRAME)(?![A-Z0-9_])")
_PROC = re.compile(r"^[ \t]*(?:N\d+[ \t]*)?PROC[ \t]+[A-Z_]", re.MULTILINE)
_ISO_COMMENT = re.compile(r"\([^()\n]*\)")

WayValue = tuple[str, float]  # AC or IC, value


@dataclass
class Called:
    """A subprogram that is being executed: its variables, loops that count, arguments, and where they came from."""

    variables: dict[str, Variable]
    counting: dict[int, tuple[str, float]]  # line of FOR -> variable, last value
    arguments: list[tuple[Value | None, str]] | None = None
    returned: dict[str, str] | None = None  # VAR parameters: name here -> name of the caller


class Interpreter:
    """State of a program that is being read.

    recorder: takes the movements. find: a program by its name, or None. offsets [mm]: G54 ... -> axis -> value.
    tolerance [mm]: of G642, G645 and compressors without CTOL. skip: whether blocks with / are left out.
    """

    def __init__(
        self, recorder: Recorder, find: Callable[[str], Program | None], *, iso: bool, skip: bool, tolerance: float,
        offsets: Mapping[str, Mapping[str, float]],
    ) -> None:  # fmt: skip
        self.recorder, self.find, self.iso, self.skip, self.tolerance = recorder, find, iso, skip, tolerance
        self.offsets = offsets
        missing = {name for name in "XYZ" if name not in recorder.axes}
        self.missing = missing
        self.places = {name: place for place, name in enumerate(recorder.names) if name not in missing}
        self.codes, self.refused = (ISO_CODES, ISO_REFUSED) if iso else (SINUMERIK_CODES, SINUMERIK_REFUSED)
        self.modal = Modal()
        if iso:
            self.modal = Modal(motion="", blending=Blending.CONTINUOUS)
        self.programmed = Frame(IDENTITY, (0.0,) * len(recorder.names))
        self.point: list[float] = list(recorder.position)  # of the program, in its frame
        self.pending: dict[int, float] = {}  # shifts of the frame that an incremental word of the axis still makes
        self.pole = [0.0, 0.0, 0.0]
        self.polar: tuple[float | None, float | None] = (None, None)  # radius, angle [degrees] programmed last
        self.spindle = 0.0
        self.speed = 0.0  # [mm/s] of G94 and G95
        self.parameters: dict[int, float] = {}
        self.calls = [Called({}, {})]
        self.program: Program | None = None
        self.flow: Place | str | None = None  # jump, "return" or "end", after the block
        self.repeated = 0
        self.changes = 0  # of variables: a loop in which nothing changes does not end
        self.passed: dict[tuple[int, int], int] = {}  # jump back -> changes when it was last made
        self.open_line: tuple[float, int, Corner | None] | None = None  # ANG without an end: angle, line
        self.options: list[Options] = []
        self._update_options()
        self.control = {
            "IF": self._if, "ELSE": self._else, "ENDIF": self._nothing, "WHILE": self._while, "ENDWHILE": self._back,
            "LOOP": self._nothing, "ENDLOOP": self._back, "FOR": self._for, "ENDFOR": self._end_for,
            "REPEAT": self._repeat, "REPEATB": self._repeat, "UNTIL": self._until, "CASE": self._case,
            "GOTO": self._goto, "GOTOF": self._goto, "GOTOB": self._goto, "GOTOC": self._goto, "GOTOS": self._goto,
            "DEF": self._def, "PROC": self._proc, "EXTERN": self._skip_rest, "RET": self._return,
            "CALL": self._call_text, "EXTCALL": self._call_text,
        }  # fmt: skip

    # --- Blocks, one after the other ---------------------------------------------------------------------------------

    def run(self, program: Program, at: int, line: int, stop: int) -> str:
        """Executes blocks from a place to a position. Returns "done", "return" (M17, RET) or "end" (M30)."""
        before = self.program, self.recorder.file, self.recorder.line
        if program.loop_of_other_controls:
            raise program.loop_of_other_controls
        if not self.iso:
            _ = program.structure  # what is open or closed too often is a fault, whether it is reached or not
        self.program, self.recorder.file = program, program.index
        code, recorder, begin, is_plain = program.code, self.recorder, at, _PLAIN_BLOCK[self.iso].fullmatch
        result = "done"
        while at < stop:
            end = code.find("\n", at)
            if end < 0:
                end = len(code)
            recorder.line = line
            text = code[at:end]
            if is_plain(text):
                words = [(name, float(number)) for name, number in _PLAIN_WORD.findall(text)]
                if not self._execute_line(words):
                    self.execute(words)
            else:
                self.here = (at, line)
                self.block(text)
            if self.flow is not None:
                flow, self.flow = self.flow, None
                if isinstance(flow, str):
                    result = flow
                    break
                if not begin <= flow[0] <= stop:
                    raise Fault("GOTO", "a jump leaves a section that is repeated, which is not supported")
                if flow[1] <= line:
                    self._spend(line - flow[1] + 1)
                    if self.passed.get((program.index, line)) == self.changes:
                        raise Fault("loop", "the program repeats blocks without end: no variable changes meanwhile")
                    self.passed[program.index, line] = self.changes
                at, line = flow
                continue
            at, line = end + 1, line + 1
        if len(self.calls) > 1:  # what is said of the whole program is said of its last line
            self.program, recorder.file, recorder.line = before
        return result

    def _spend(self, blocks: int) -> None:
        self.repeated += blocks
        if self.repeated > MAX_REPEATED:
            raise Fault(
                "loop", f"loops and subprograms have executed more than {MAX_REPEATED:,} blocks: an endless loop?"
            )

    def finish(self) -> None:
        if self.open_line is not None:
            raise Fault(
                "ANG",
                "the end of the line is missing: the next block must have ANG and both coordinates",
                self.open_line[1],
            )

    def _uncommented(self, text: str) -> str:
        """A block without its comment; a ; in a text is none."""
        if ";" in text:
            quoted = False
            for place, letter in enumerate(text):
                if letter == '"':
                    quoted = not quoted
                elif letter == ";" and not quoted:
                    text = text[:place]
                    break
        if self.iso and ("(" in text or ")" in text):
            text = _ISO_COMMENT.sub(" ", text)
            if "(" in text or ")" in text:
                raise Fault("(", "a comment in parentheses is not closed, or has parentheses itself")
        return text

    def block(self, text: str) -> None:
        """A block with more than letters and numbers."""
        text = self._uncommented(text).strip()
        if not text or self._is_mark(text):
            return
        scan = Scanner(text, self._read_iso if self.iso else self._read, self.iso)
        if scan.take(_SKIP):
            if self.skip:
                return
            self.recorder.note("/")
        if scan.take(_NUMBERED) and not self.iso:
            scan.skip_space()
            if _NUMBERED.match(scan.text, scan.at):
                raise Fault("N", "the block number stands twice")
        if self.iso:
            self._iso_words(scan)
            return
        while scan.take(_LABEL):
            pass
        words: list[tuple[str, Any]] = []
        while scan.rest():
            if not self._word(scan, words):
                return
        if words:
            self.execute(words)

    def _is_mark(self, text: str) -> bool:
        """% at the beginning and end of a tape, O1000, %_N_NAME_MPF."""
        if not text.startswith("%"):
            return False
        if text == "%" and not self.iso:
            return True
        assert self.program
        before = self.program.code[: self.here[0]].strip()
        if not self.iso:
            if re.sub(r";.*", "", before).strip():
                raise Fault(text[:20], "another program begins in the file; split it into one file each")
        elif before.startswith("%") or (before and not before.startswith("(")):
            self.flow = "end"
        return True

    def _word(self, scan: Scanner, words: list[tuple[str, Any]]) -> bool:
        """Reads the next word into words, or executes the statement that it begins. False: the block is done."""
        scan.skip_space()
        if scan.text[scan.at] == "(":
            # A comment: values in parentheses belong to names, which have taken them.
            end = scan.text.find(")", scan.at)
            if end < 0:
                raise Fault("(", "a comment in parentheses is not closed")
            scan.at = end + 1
            return True
        match = scan.take(_ASSIGNED)
        if match:
            self._assigned(scan, match[1], words)
            return True
        match = scan.take(_ADDRESS)
        if match and match[1] == "L":
            if words:
                raise Fault(match[0], "a subprogram is called in a block of its own")
            self._call(match[0].replace(" ", ""), scan)
            return False
        if match:
            self._address(scan, match, words)
            return True
        match = scan.take(_INDEXED)
        if match and match[1] not in NOTED:
            self._assign_indexed(scan, match[1])
            return True
        match = match or scan.take(NAME)
        if not match:
            raise Fault(scan.rest().split()[0][:20], "the word is not understood")
        return self._named(scan, match[0].strip(), words)

    def _address(self, scan: Scanner, match: re.Match[str], words: list[tuple[str, Any]]) -> None:
        name, number = match[1], match[2]
        following = scan.text[scan.at : scan.at + 2]
        if following[:1] == "." or re.match(r"E[-+\d]", following):
            whole_word = re.match(r"[-+.\w]*", scan.text[match.start() :])
            raise Fault(whole_word[0] if whole_word else name, badly_written(following))
        if following[:1] == ",":
            raise Fault(f"{name}{number},", "a decimal point is expected, not a comma")
        words.append((name, scan.finite(float(number.replace("EX", "E")), name)))

    def _assigned(self, scan: Scanner, name: str, words: list[tuple[str, Any]]) -> None:
        """NAME= value: an axis, a value of the block, an R parameter or a variable."""
        if name not in self.places and (name in self.variables or (name[0] == "R" and name[1:].isdigit())):
            self._assign(scan, name, ())
            return
        if name in self.places or name in VALUES or (name in "FGP" and len(name) == 1) or (self.iso and len(name) == 1):
            scan.skip_space()
            way = scan.take(_WAY)
            if way:
                if way[0] not in ("AC", "IC"):
                    raise Fault(name, f"{way[0]} is for rotary axes and tables, which are not supported")
                if name not in self.places and name not in WITH_WAY:
                    raise Fault(name, f"{way[0]} has no meaning here")
                scan.expect("(", name)
            elif not scan.rest():
                raise Fault(name, "the value after = is missing")
            value = scan.number(name)
            if way:
                scan.expect(")", name)
            words.append((name, (way[0], value) if way else value))
            return
        if name in NOTED_VALUES or (name[0] in "MSTDH" and name[1:].isdigit()):
            if not scan.rest():
                raise Fault(name, "the value after = is missing")
            given = scan.value(name)
            if name in ("S", "M") and not isinstance(given, str):
                words.append((name, float(given)))
            else:
                self.recorder.note(name)
            return
        raise self._unknown(name)

    def _named(self, scan: Scanner, name: str, words: list[tuple[str, Any]]) -> bool:
        """A word of letters without a value."""
        if name in self.control:
            if words:
                raise Fault(name, f"{name} stands in a block of its own")
            self.control[name](scan, name)
            if self.flow is None and scan.rest() and name not in ("IF", "GOTOC"):
                raise Fault(scan.rest().split()[0], f"{name} stands in a block of its own")
            return False
        if name in FRAMES:
            if words:
                raise Fault(name, f"{name} stands in a block of its own")
            self._frame(scan, name)
            return False
        if name in NAMED_CODES:
            words.append(("code", name))
            return True
        if name in NOTED:
            self.recorder.note(name)
            if name in NOTED_WITH_ARGUMENTS:
                if scan.rest()[:1] in ("(", "["):
                    _skip_parentheses(scan, name)
                if scan.accept("="):
                    scan.value(name)
            return True
        if len(name) == 1 or (name[1:].isdigit() and name[0] in "RXYZIJK"):
            if name in self.places or name in "GFMNIJK":
                raise Fault(name, "a value is missing")
            raise self._unknown(name)
        if (name in VALUES or name in NOTED_VALUES) and not scan.rest().startswith("("):
            raise Fault(name, "a value is missing: = is expected")
        reason = refusal_of(name)
        if reason:
            raise Fault(name, reason)
        if words:
            raise Fault(
                name,
                "the word is not understood"
                if self.find(name) is None
                else "a subprogram is called in a block of its own",
            )
        self._call(name, scan)
        return False

    def _unknown(self, name: str) -> Fault:
        if name in self.missing:
            return Fault(name, f"the machine has no axis {name}; it has {', '.join(self.recorder.axes)}")
        reason = refusal_of(name)
        if reason:
            return Fault(name, reason)
        if re.fullmatch(r"[ABCUVWQE]\d*|[XYZ]\d+", name):
            return Fault(
                name, f"no linear axis of the machine ({', '.join(self.recorder.axes)}); rotary axes are not supported"
            )
        if re.fullmatch(r"R\d*", name):
            return Fault(name, "a parameter needs a value: R1=...")
        return Fault(name, "the word is not known" if len(name) == 1 else "the variable is not defined")

    # --- Values ------------------------------------------------------------------------------------------------------

    @property
    def variables(self) -> dict[str, Variable]:
        return self.calls[-1].variables

    def _read(self, scan: Scanner, name: str) -> Value | None:
        """Of an R parameter or a variable."""
        if name[0] == "R" and (name[1:].isdigit() or (name == "R" and "R" not in self.variables)):
            index = _parameter(name[1:]) if len(name) > 1 else None
            if index is None:
                match = scan.indices(name)
                if len(match) != 1:
                    return None
                index = match[0]
            return self.parameters.get(index, 0.0)
        variable = self.variables.get(name)
        if variable is None:
            reason = refusal_of(name)
            if reason:
                raise Fault(name, reason)
            return None
        if not variable.shape:
            return variable.value
        return variable.elements.get(self._element(variable, name, scan.indices(name)), variable.value)

    @staticmethod
    def _element(variable: Variable, name: str, index: tuple[int, ...]) -> tuple[int, ...]:
        if len(index) != len(variable.shape) or not all(
            0 <= i < n for i, n in zip(index, variable.shape, strict=False)
        ):
            raise Fault(
                name, f"the index {list(index)} is beyond the array {list(variable.shape)}, which counts from 0"
            )
        return index

    def _assign_indexed(self, scan: Scanner, name: str) -> None:
        if name != "R" and name not in self.variables:
            raise self._unknown(name)
        index = scan.indices(name)
        scan.expect("=", name)
        if name == "R" and name not in self.variables:
            if len(index) != 1 or index[0] < 0:
                raise Fault(name, "R has one index, from 0")
            name, index = f"R{index[0]}", ()
        self._assign(scan, name, index)

    def _assign(self, scan: Scanner, name: str, index: tuple[int, ...]) -> None:
        if not scan.rest():
            raise Fault(name, "the value after = is missing")
        self._set(name, scan.value(name), index)

    def _set(self, name: str, value: Value, index: tuple[int, ...] = ()) -> None:
        variable = self.variables.get(name)
        if variable is None:
            if isinstance(value, str):
                raise Fault(name, "an R parameter is a number")
            number = _parameter(name[1:])
            self.changes += self.parameters.get(number, 0.0) != value
            self.parameters[number] = float(value)
            return
        value = variable.converted(value, name)
        if variable.shape or index:
            element = self._element(variable, name, index)
            self.changes += variable.elements.get(element, variable.value) != value
            variable.elements[element] = value
        else:
            self.changes += variable.value != value
            variable.value = value

    # --- Branches and loops ------------------------------------------------------------------------------------------

    def _nothing(self, scan: Scanner, word: str) -> None:
        """Stands for a place alone: LOOP, ENDIF."""

    def _skip_rest(self, scan: Scanner, word: str) -> None:
        scan.at = len(scan.text)

    def _partner(self) -> Place:
        assert self.program
        place = self.program.structure.get(self.here[1])
        if place is None:
            raise Fault("loop", "the statement does not stand at the beginning of its block")
        return place

    def _if(self, scan: Scanner, word: str) -> None:
        true = scan.condition(word)
        jump = scan.take(_GOTO)
        if jump:
            if true:
                self._goto(scan, jump[1])
            return
        if scan.rest():
            raise Fault(
                scan.rest().split()[0], "IF is followed by a jump, or by nothing: its branch begins in the next block"
            )
        if not true:
            self.flow = self._partner()

    def _else(self, scan: Scanner, word: str) -> None:
        self.flow = self._partner()

    def _while(self, scan: Scanner, word: str) -> None:
        if not scan.condition(word):
            self.flow = self._partner()

    def _back(self, scan: Scanner, word: str) -> None:
        self.flow = self._partner()

    def _until(self, scan: Scanner, word: str) -> None:
        if not scan.condition(word):
            self.flow = self._partner()

    def _for(self, scan: Scanner, word: str) -> None:
        match = scan.take(_ASSIGNED)
        if not match or not (match[1] in self.variables or re.fullmatch(r"R\d+", match[1])):
            raise Fault(word, f"a variable is expected before {scan.rest() or 'the end of the block'}: FOR I = 1 TO 10")
        first = scan.number(word)
        if not scan.accept("TO"):
            raise Fault(word, f"TO is missing before {scan.rest() or 'the end of the block'}")
        last = scan.number(word)
        self._set(match[1], first)
        self.calls[-1].counting[self.here[1]] = (match[1], last)
        if self._number_of(match[1]) > last:
            self.flow = self._partner()

    def _number_of(self, name: str) -> float:
        variable = self.variables.get(name)
        return float(variable.value) if variable else self.parameters.get(_parameter(name[1:]), 0.0)

    def _end_for(self, scan: Scanner, word: str) -> None:
        assert self.program
        begun = self._partner()
        counted = self.calls[-1].counting.get(begun[1])
        if counted is None:
            raise Fault(word, f"the loop of line {begun[1]} was entered by a jump")
        name, last = counted
        self._set(name, self._number_of(name) + 1)
        if self._number_of(name) <= last:
            self.flow = (self.program.end_of_line(begun[0]) + 1, begun[1] + 1)

    def _case(self, scan: Scanner, word: str) -> None:
        value = scan.value(word)
        if not scan.accept("OF"):
            raise Fault(word, "OF is missing")
        while scan.rest():
            default = scan.accept("DEFAULT")
            hit = True if default else scan.value(word) == value
            jump = scan.take(_GOTO)
            if not jump:
                raise Fault(word, f"a jump is missing before {scan.rest() or 'the end of the block'}")
            if hit:
                self._goto(scan, jump[1])
                return
            scan.take(_TARGET)

    def _target(self, scan: Scanner, word: str) -> str:
        match = scan.take(_TARGET)
        if not match:
            value = scan.value(word) if scan.rest() else ""
            if not isinstance(value, str) or not value:
                raise Fault(word, "a label or block number is missing")
            return value
        name = match[0]
        variable = self.variables.get(name)
        if variable is not None and isinstance(variable.value, str):
            name = variable.value
        number = re.fullmatch(r"[N:](\d+)", name)
        return f"N{number[1].lstrip('0') or '0'}" if number else name

    def _goto(self, scan: Scanner, word: str) -> None:
        assert self.program
        if word == "GOTOS":
            self.flow = (0, 1)
            return
        name = self._target(scan, word)
        place = self.program.find_target(name, self.here[0], {"GOTOF": "F", "GOTOB": "B"}.get(word, "FB"))
        if place is None:
            if word == "GOTOC":
                return
            other = self.program.find_target(name, self.here[0], "FB")
            way = {"GOTOF": " after this block", "GOTOB": " before this block"}.get(word, "")
            hint = f"; line {other[1]} has it" if other else ""
            raise Fault(name, f"no such label or block number{way}{hint}")
        self.flow = place

    def _repeats(self, scan: Scanner, word: str) -> int:
        """P=3 or P3; 1 where it is not there."""
        if not scan.take(_REPEATS):
            return 1
        number = whole(rounded(scan.number(word)), "P")
        if not 0 <= number <= 9999:
            raise Fault("P", f"{number} repetitions; 0 to 9999 are allowed")
        return number

    def _repeat(self, scan: Scanner, word: str) -> None:
        """The loop REPEAT, or REPEAT LABEL, REPEAT FIRST LAST, REPEATB LABEL."""
        if not scan.rest():
            return
        assert self.program
        program = self.program
        names: list[str] = []
        while len(names) < 2 and scan.rest() and not _REPEATS.match(scan.text, scan.at):
            names.append(self._target(scan, word))
        if not names:
            raise Fault(word, "a label or block number is missing")
        times = self._repeats(scan, word)
        places = [program.find_target(name, self.here[0], "BF") for name in names]
        for name, place in zip(names, places, strict=True):
            if place is None:
                raise Fault(name, "no such label or block number")
        begin = places[0]
        assert begin
        if word == "REPEATB":
            stop, last = program.end_of_line(begin[0]), begin[1]
        elif len(places) == 2:
            assert places[1]
            stop, last = program.end_of_line(places[1][0]), places[1][1]
        else:
            closing = program.find_target("ENDLABEL", begin[0], "F")
            if closing is not None:
                stop, last = program.end_of_line(closing[0]), closing[1]
            else:
                stop, last = self.here[0], self.here[1] - 1
        if stop <= begin[0]:
            raise Fault(names[-1], "the section ends before it begins")
        here = self.here
        for _ in range(times):
            self._enter(Called(self.variables, {}), word)
            self.changes += 1
            ended = self.run(program, *begin, stop)
            self.calls.pop()
            self._spend(max(last - begin[1] + 1, 1))
            if ended != "done":
                self.flow = ended
                return
        self.here = here

    # --- Variables and subprograms -----------------------------------------------------------------------------------

    def _kind(self, scan: Scanner, word: str) -> str:
        match = scan.take(_DEF_KIND)
        if not match or match[1] in ("AXIS", "FRAME"):
            raise Fault(
                word, f"a type is expected before {scan.rest() or 'the end'}: REAL, INT, BOOL, CHAR or STRING[n]"
            )
        if match[1] == "STRING":
            scan.indices(word)
        return match[1]

    def _new_variable(self, scan: Scanner, word: str, kind: str) -> str:
        match = scan.take(NAME)
        if not match:
            raise Fault(word, f"a name is expected before {scan.rest() or 'the end of the block'}")
        name = match[0]
        if name in self.places or name in VALUES or re.fullmatch(r"R\d*|[GFNMSTDH]\d*", name) or name in self.control:
            raise Fault(name, "the name has another meaning")
        if name in self.variables:
            raise Fault(name, "the variable is defined twice")
        shape = scan.indices(name)
        if not all(n > 0 for n in shape) or math.prod(shape) > MAX_ELEMENTS:
            raise Fault(name, f"an array has 1 to {MAX_ELEMENTS:,} elements")
        self.variables[name] = Variable(kind, zero(kind), shape)
        return name

    def _def(self, scan: Scanner, word: str) -> None:
        """DEF REAL A=1, B[3]."""
        while re.match(r"(?:NCK|CHAN|SYN[RW]*|PHU)[ \t]", scan.text[scan.at :].lstrip()):
            scan.take(NAME)
        kind = self._kind(scan, word)
        while True:
            name = self._new_variable(scan, word, kind)
            variable = self.variables[name]
            if scan.accept("="):
                if variable.shape:
                    raise Fault(name, "values of an array are assigned one by one here")
                variable.value = variable.converted(scan.value(name), name)
            if not scan.accept(","):
                break

    def _proc(self, scan: Scanner, word: str) -> None:
        """PROC NAME(REAL A, INT B=2, VAR REAL C) SAVE: takes the arguments of the call."""
        call = self.calls[-1]
        if not scan.take(NAME):
            raise Fault(word, "the name of the program is missing")
        arguments = list(call.arguments or [])
        call.arguments, call.returned = None, {}
        if scan.accept("(") and not scan.accept(")"):
            while True:
                by_name = bool(scan.take(re.compile(r"VAR(?![A-Z0-9_])")))
                kind = self._kind(scan, word)
                name = self._new_variable(scan, word, kind)
                value, theirs = arguments.pop(0) if arguments else (None, "")
                if scan.accept("="):
                    default = scan.value(name)
                    value = default if value is None else value
                if value is not None:
                    self.variables[name].value = self.variables[name].converted(value, name)
                if by_name and theirs:
                    call.returned[name] = theirs
                if scan.accept(")"):
                    break
                scan.expect(",", word)
        if arguments:
            raise Fault(word, f"the call has {len(arguments)} arguments more than the program")
        while scan.rest():
            match = scan.take(NAME)
            if not match or match[0] not in ("SAVE", "DISPLOF", "DISPLON", "SBLOF", "ICYCOF", "ACTBLOCNO", "PREPRO"):
                raise Fault(scan.rest() or (match[0] if match else word), "the word is not understood after PROC")
            if match[0] == "SAVE":
                call.returned["SAVE"] = ""

    def _arguments(self, scan: Scanner, name: str) -> list[tuple[Value | None, str]]:
        result: list[tuple[Value | None, str]] = []
        if not scan.accept("("):
            return result
        if scan.accept(")"):
            return result
        while True:
            scan.skip_space()
            if scan.text[scan.at : scan.at + 1] in (",", ")"):
                result.append((None, ""))
            else:
                begun = scan.at
                value = scan.value(name)
                result.append((value, scan.text[begun : scan.at].strip()))
            if scan.accept(")"):
                return result
            scan.expect(",", name)

    def _call_text(self, scan: Scanner, word: str) -> None:
        """CALL "NAME", EXTCALL("NAME")."""
        inside = scan.accept("(")
        name = scan.value(word)
        if inside:
            scan.expect(")", word)
        if not isinstance(name, str):
            raise Fault(word, "the name of a program is expected, as a text")
        self._call(re.sub(r"^.*[/\\]|\.[A-Z]{3}$", "", name.strip().upper()), scan)

    def _enter(self, call: Called, word: str) -> None:
        if len(self.calls) > MAX_CALLS:
            raise Fault(word, f"more than {MAX_CALLS} levels of subprograms and repetitions: does it call itself?")
        self.calls.append(call)

    def _call(self, name: str, scan: Scanner) -> None:
        arguments = self._arguments(scan, name)
        times = self._repeats(scan, name)
        if scan.rest():
            raise Fault(scan.rest().split()[0], f"the word is not understood after the call of {name}")
        program = self.find(name)
        if program is None:
            raise Fault(name, f"the subprogram is not found: no file {name}.SPF or {name}.MPF beside the program")
        if arguments and not _PROC.search(program.code):
            raise Fault(name, f"the call has arguments, but {program.name} has no PROC")
        here = self.here
        for _ in range(times):
            self._enter(Called({}, {}, list(arguments)), name)
            kept = copy.copy(self.modal), self.programmed
            self.changes += 1
            ended = self.run(program, 0, 1, len(program.code))
            call = self.calls.pop()
            returned = call.returned or {}
            if "SAVE" in returned:
                self.modal, self.programmed = kept
                self._update_options()
                self._update_speed()
                self._update_frame()
            for ours, theirs in returned.items():
                if ours != "SAVE" and (theirs in self.variables or re.fullmatch(r"R\d+", theirs)):
                    self._set(theirs, call.variables[ours].value)
            self._spend(max(program.code.count("\n", 0, len(program.code)), 1))
            if ended == "end" and self.iso:
                self.flow = "end"
                return
        self.here = here

    def _return(self, scan: Scanner, word: str) -> None:
        if scan.accept("(") and not scan.accept(")"):
            raise Fault(word, "RET with a target is not supported")
        self.flow = "return"

    # --- Words of a block --------------------------------------------------------------------------------------------

    def execute(self, words: Sequence[tuple[str, Any]]) -> None:
        """All words of a block together: codes first, then values, then the movement."""
        axes: dict[int, Any] = {}
        values: dict[str, Any] = {}
        codes: dict[str, tuple[str, str, Any]] = {}
        functions: list[float] = []
        for name, value in words:
            place = self.places.get(name)
            if place is not None:
                if place in axes:
                    raise Fault(name, "the axis stands twice in the block")
                axes[place] = value
                size = value[1] if type(value) is tuple else value
                if not -MAX_COORDINATE <= size <= MAX_COORDINATE:
                    raise Fault(name, f"{size:g} is beyond 10 km")
            elif name == "G" or name == "code":
                self._code(name, value, codes)
            elif name == "M":
                functions.append(value)
            elif name in values:
                raise Fault(
                    name, "the block number stands twice" if name == "N" else "the word stands twice in the block"
                )
            else:
                values[name] = value
        done: dict[str, Any] = {}
        if codes:
            for spelling, field, value in codes.values():
                if field == "feed_mode" and value != self.modal.feed_mode:
                    self.modal.feed = self.speed = 0.0
                if field in _MODAL_FIELDS:
                    setattr(self.modal, field, value)
                elif field:
                    done[field] = (spelling, value)
            if not codes.keys() <= {"motion"}:
                self._apply(done)
        values.pop("N", None)
        if self.iso and _PATH_MODE in codes:
            self._iso_path_mode(values)
        if values:
            self._apply_values(values, done)
        ended = self._functions(functions, values) if functions else None
        if axes or values or done:
            self._act(axes, values, done)
        if ended:
            self.flow = ended

    def _execute_line(self, words: Sequence[tuple[str, float]]) -> bool:
        """G0 or G1 with absolute coordinates and F, as most blocks are; as execute() does it. False: another block."""
        modal, recorder, places = self.modal, self.recorder, self.places
        if modal.incremental or modal.rounding or self.pending or self.open_line or modal.feed_mode == "G93":
            return False
        point, length, motion, feed = self.point.copy(), modal.length, modal.motion, 0.0
        numbered = coded = False
        programmed = 0  # a bit for each axis
        for name, value in words:
            place = places.get(name)
            if place is not None:
                if programmed >> place & 1 or not -MAX_COORDINATE <= value <= MAX_COORDINATE:
                    return False
                programmed |= 1 << place
                point[place] = value * length
            elif name == "G" and not coded and (value == 1.0 or value == 0.0):
                motion, coded = "G1" if value else "G0", True
            elif name == "F" and not feed and 0 < value <= MAX_FEED:
                feed = value
            elif name == "N" and not numbered:
                numbered = True
            else:
                return False
        if not programmed or (motion != "G0" and (motion != "G1" or (not feed and self.speed <= 0))):
            return False
        if feed:
            if modal.feed_mode == "G95" and self.spindle <= 0:
                return False
            modal.feed = feed * modal.feed_length
            self._update_speed()
        modal.motion, self.point = motion, point
        rapid = motion == "G0"
        recorder.straight(point, rapid, math.nan if rapid else self.speed, self.options[rapid])
        return True

    def _code(self, name: str, value: Any, codes: dict[str, tuple[str, str, Any]]) -> None:
        if name == "code":
            spelling, code = value, NAMED_CODES[value]
        else:
            match = self.codes.get(value) if isinstance(value, float) else None
            spelling = spelled(value) if isinstance(value, float) else "G"
            if match is None:
                reason = self.refused.get(value, "the G code is not known")
                if not self.iso and value not in self.refused and (value in ISO_CODES or value in ISO_REFUSED):
                    reason = "a code of the ISO dialect: read the program with it"
                raise Fault(spelling, reason)
            code = match
        if code[0] in codes:
            raise Fault(
                spelling, f"two G codes of one group ({code[0]}) in a block: {codes[code[0]][0]} and {spelling}"
            )
        codes[code[0]] = (spelling, code[1], code[2])

    def _apply(self, done: dict[str, Any]) -> None:
        """What codes other than of motion change."""
        if "units" in done:
            self.modal.length, self.modal.feed_length = done.pop("units")[1]
        if "tool_length" in done:
            self.recorder.note("G43")
            del done["tool_length"]
        self._update_frame()
        self._update_options()
        self._update_speed()

    def _functions(self, functions: list[float], values: dict[str, Any]) -> str | None:
        """M words. Returns how the program goes on after the block."""
        result = None
        for function in functions:
            if function in (2, 30):
                result = "end" if self.iso or len(self.calls) == 1 else "return"
            elif function == 17 and not self.iso:
                result = "return" if len(self.calls) > 1 else "end"
            elif function == 99 and self.iso:
                if len(self.calls) == 1:
                    raise Fault("M99", "in a main program it repeats the program without end")
                result = "return"
            elif function == 98 and self.iso:
                self._iso_call(values)
            else:
                self.recorder.note(f"M{function:.10g}")
        return result

    def _apply_values(self, values: dict[str, Any], done: dict[str, Any]) -> None:
        """Words that set something, ahead of the movement; they leave `values`."""
        modal = self.modal
        for name in [name for name in values if name in NOTED_VALUES or name in ("S", "T", "D", "H")]:
            value = values[name]
            if name == "S":
                if "dwell" in done:
                    continue
                if value < 0:
                    raise Fault("S", f"the spindle speed {value:g} is negative")
                self.spindle = value
                self._update_speed()
            self.recorder.note(name)
            del values[name]
        if "F" in values and "dwell" not in done:
            feed = values.pop("F")
            if not 0 < feed <= MAX_FEED:
                raise Fault("F", f"the feed {feed:g} must be above 0")
            modal.feed = feed * (1.0 if modal.feed_mode == "G93" else modal.feed_length)
            self._update_speed()
            done["feed"] = True
        smoothing = False
        for name in ("ADIS", "ADISPOS", "CTOL"):
            if name in values:
                size = values.pop(name) * modal.feed_length
                if size < 0 and name != "CTOL":
                    raise Fault(name, f"the distance {size:g} mm is negative")
                setattr(modal, name.lower(), None if size < 0 else size)
                smoothing = True
        if smoothing:
            self._update_options()
        for name, field in (("RNDM", "rounding"), ("FRCM", "corner_feed")):
            if name in values:
                size = values.pop(name) * (modal.length if name == "RNDM" else modal.feed_length / 60)
                if size < 0:
                    raise Fault(name, f"{size:g} is negative")
                setattr(modal, field, size)

    def _update_options(self) -> None:
        modal = self.modal
        self.options = []
        for rapid in (False, True):
            blending, tolerance = modal.blending, math.nan
            within = self.tolerance if modal.ctol is None else modal.ctol
            compressed = modal.compressed and not rapid
            if (blending == Blending.TOLERANCE or compressed) and within == 0:
                raise Fault("CTOL", "the tolerance is 0: give one above, or use G64 or G60")
            if blending == Blending.DISTANCE:
                tolerance = modal.adispos if rapid else modal.adis
                if tolerance == 0:
                    blending, tolerance = Blending.CONTINUOUS, math.nan
            elif blending == Blending.TOLERANCE or compressed:
                tolerance = within
            self.options.append((int(blending), tolerance, modal.jerk_limited, modal.feedforward, compressed))

    def _update_speed(self) -> None:
        """Speed along the path [mm/s]; 0: none is programmed. That of G93 follows from each path."""
        modal = self.modal
        self.speed = modal.feed / 60 * (self.spindle if modal.feed_mode == "G95" else 1.0)

    def _feed(self, word: str, length: float) -> float:
        """[mm/s] of a path of a length [mm]."""
        modal = self.modal
        if modal.feed_mode == "G93":
            if not self._feed_given:
                raise Fault(word, "no feed: under G93 each block has its F")
            return modal.feed / 60 * (length if length > 0 else 1.0)
        if self.speed <= 0:
            if modal.feed > 0:
                raise Fault(word, "no feed: the feed per revolution (G95) needs a spindle speed S")
            raise Fault(word, "no feed: F is missing")
        return self.speed

    _feed_given = False

    # --- Frames ------------------------------------------------------------------------------------------------------

    def _update_frame(self) -> None:
        modal = self.modal
        offset = self.offsets.get(modal.offset, {})
        settable = Frame(IDENTITY, tuple(offset.get(name, 0.0) for name in self.recorder.names))
        frame = settable.then(self.programmed)
        old = self.recorder.frame
        if frame == old:
            return
        self.recorder.set_frame(frame)
        self.point = frame.program(self.recorder.position)
        if self.iso:
            self.pending = {}
        else:
            # An incremental word traverses the shift too (SD42440, standard), whatever the rotation.
            before = [x - shift for x, shift in zip(self.recorder.position, old.offset, strict=True)]
            based = [*frame.unlinear(before[:3]), *before[3:]]
            shifts = {
                place: self.pending.get(place, 0.0) + base - now
                for place, (base, now) in enumerate(zip(based, self.point, strict=True))
            }  # fmt: skip
            self.pending = {place: shift for place, shift in shifts.items() if shift}

    def _frame(self, scan: Scanner, name: str) -> None:
        """TRANS, ROT, SCALE, MIRROR replace all programmable frames; ATRANS, ... add to them."""
        words: list[tuple[str, Any]] = []
        while scan.rest():
            if not self._word(scan, words):
                raise Fault(name, f"{name} stands in a block of its own")
        given: dict[str, float] = {}
        for word, value in words:
            if word in given:
                raise Fault(word, "the word stands twice in the block")
            if isinstance(value, tuple) or not (word in self.places or (word == "RPL" and name.endswith("ROT"))):
                raise Fault(word, f"{name} does not take the word")
            given[word] = value
        kind = name.removeprefix("A")
        count = len(self.recorder.names)
        matrix, offset = IDENTITY, [0.0] * count
        if kind == "TRANS":
            for word, value in given.items():
                offset[self.places[word]] = value * self.modal.length
        elif kind == "ROT" and "RPL" in given:
            if len(given) > 1:
                raise Fault("RPL", "a rotation has RPL, or angles about axes")
            angles = [0.0, 0.0, 0.0]
            angles[self.modal.plane[2]] = given["RPL"]
            matrix = rotation(*angles)
        else:
            if any(self.places[word] > 2 for word in given):
                raise Fault(name, "only X, Y and Z rotate, scale or mirror")
            if kind == "ROT":
                matrix = rotation(given.get("X", 0.0), given.get("Y", 0.0), given.get("Z", 0.0))
            else:
                factors = [
                    given.get(axis, 1.0) if kind == "SCALE" else -1.0 if axis in given else 1.0 for axis in "XYZ"
                ]
                if not all(factors):
                    raise Fault(name, "a scale of 0")
                matrix = tuple(tuple(f if i == j else 0.0 for j in range(3)) for i, f in enumerate(factors))  # type: ignore[assignment]
        frame = Frame(matrix, tuple(offset))
        if name.startswith("A"):
            frame = self.programmed.then(frame)
        self.programmed = frame
        try:
            self._update_frame()
        except (ValueError, ZeroDivisionError, OverflowError) as error:
            raise Fault(name, str(error)) from None

    # --- Movements ---------------------------------------------------------------------------------------------------

    def _act(self, axes: dict[int, Any], values: dict[str, Any], done: dict[str, Any]) -> None:
        """Dwell, pole or movement of a block."""
        self._feed_given = "feed" in done
        done.pop("feed", None)
        if "dwell" in done:
            self._dwell(axes, values)
        elif "pole" in done:
            self._set_pole(axes, values, *done["pole"])
        elif axes or values:
            try:
                self._move(axes, values, done)
            except ValueError as error:
                raise Fault(self.modal.motion, str(error)) from None
            except (OverflowError, ZeroDivisionError):
                raise Fault(self.modal.motion, "a value is too large or too small to compute with") from None
            if values:
                raise Fault(next(iter(values)), self._meaningless(next(iter(values))))

    def _meaningless(self, name: str) -> str:
        if name in VALUES or name in "PLR" or (self.iso and name == "Q"):
            return f"the word has no meaning in this block ({self.modal.motion or 'no motion'})"
        return self._unknown(name).reason

    def _dwell(self, axes: dict[int, Any], values: dict[str, Any]) -> None:
        if self.iso:
            seconds = values.pop("P", None)
            if seconds is None and len(axes) == 1 and 0 in axes:
                seconds = axes.pop(0)
        elif "F" in values:
            seconds = values.pop("F")
        else:
            seconds = values.pop("S", None)
            if seconds is not None:
                if self.spindle <= 0:
                    raise Fault("G4", "a dwell in revolutions needs a spindle speed S")
                seconds = seconds * 60 / self.spindle
        if axes or values:
            word = next(iter(values), "") or self.recorder.names[next(iter(axes))]
            raise Fault(word, "a dwell (G4) stands in a block of its own")
        if seconds is None:
            raise Fault(
                "G4", "the time is missing: " + ("P, in seconds" if self.iso else "F, in seconds, or S, in revolutions")
            )
        if not 0 <= seconds <= 1e6:
            raise Fault("G4", f"the time {seconds:g} s must be 0 to 1,000,000 s")
        self.recorder.dwell(seconds, self.options[0])

    def _wanted(self, place: int, value: float | WayValue, base: Sequence[float]) -> float:
        """Coordinate that a word of an axis asks for, absolute or from a base."""
        incremental = self.modal.incremental
        if isinstance(value, tuple):
            incremental, value = value[0] == "IC", value[1]
        value *= self.modal.length
        return base[place] + self.pending.get(place, 0.0) + value if incremental else value

    def _plain(self, values: dict[str, Any], name: str) -> float | None:
        """Takes a value that has no AC or IC; lengths in mm."""
        value = values.pop(name, None)
        if value is None:
            return None
        if isinstance(value, tuple):
            raise Fault(name, f"{value[0]} has no meaning here")
        return float(value) * (self.modal.length if name in WORKPIECE_LENGTHS else 1.0)

    def _polar_end(self, values: dict[str, Any], axes: dict[int, Any]) -> tuple[float, float] | None:
        """End in the plane that AP and RP give."""
        if "AP" not in values and "RP" not in values:
            return None
        first, second, _ = self.modal.plane
        for place in (first, second):
            if place in axes:
                raise Fault(self.recorder.names[place], "an axis of the plane stands beside polar coordinates")
        radius, angle = self.polar
        given = values.pop("AP", None)
        x, y = self.point[first] - self.pole[first], self.point[second] - self.pole[second]
        if given is not None:
            relative = given[0] == "IC" if isinstance(given, tuple) else self.modal.incremental and angle is not None
            size = given[1] if isinstance(given, tuple) else given
            if relative:
                size += math.degrees(math.atan2(y, x)) if angle is None else angle
            angle = size
        elif angle is None:
            angle = math.degrees(math.atan2(y, x))
        if isinstance(values.get("RP"), tuple) and values["RP"][0] == "IC":
            radius = (math.hypot(x, y) if radius is None else radius) + values.pop("RP")[1] * self.modal.length
        else:
            if isinstance(values.get("RP"), tuple):
                values["RP"] = values["RP"][1]
            new = self._plain(values, "RP")
            radius = new if new is not None else math.hypot(x, y) if radius is None else radius
        if radius < 0:
            raise Fault("RP", f"the polar radius {radius:g} mm is negative")
        self.polar = (radius, angle)
        return self.pole[first] + radius * sine(angle + 90.0), self.pole[second] + radius * sine(angle)

    def _set_pole(self, axes: dict[int, Any], values: dict[str, Any], spelling: str, origin: str) -> None:
        """G110: from the position; G111: from the zero of the workpiece; G112: from the last pole."""
        base = {"position": self.point[:3], "zero": [0.0] * 3, "pole": self.pole}[origin]
        pole = list(base)
        if axes and values:
            raise Fault(spelling, "a pole has coordinates, or a polar radius and angle")
        for place, value in axes.items():
            if place > 2:
                raise Fault(self.recorder.names[place], "a pole has X, Y and Z alone")
            pole[place] = base[place] + (value[1] if isinstance(value, tuple) else value) * self.modal.length
        if values:
            radius, angle = self._plain(values, "RP"), self._plain(values, "AP")
            if values or radius is None or angle is None:
                raise Fault(spelling, "a polar pole needs RP and AP, and nothing else")
            first, second, _ = self.modal.plane
            pole[first] += radius * sine(angle + 90.0)
            pole[second] += radius * sine(angle)
        self.pole, self.polar = pole, (None, None)

    def _move(self, axes: dict[int, Any], values: dict[str, Any], done: dict[str, Any]) -> None:
        modal, recorder = self.modal, self.recorder
        motion = modal.motion
        if not motion:
            raise Fault(
                recorder.names[next(iter(axes))] if axes else next(iter(values)),
                "no motion: G0, G1, G2 or G3 is missing",
            )
        if "suppress" in done:
            self._move_in_machine(axes, values, done["suppress"][0])
            return
        corner, once = self._corner(values), self._plain(values, "FB")
        if once is not None:
            if not 0 < once <= MAX_FEED:
                raise Fault("FB", f"the feed {once:g} must be above 0")
            kept, kept_given = (modal.feed, self.speed), self._feed_given
            modal.feed, self._feed_given = once * modal.feed_length, True
            self._update_speed()
        options = self.options[motion == "G0"]
        if "exact" in done:
            options = (int(Blending.EXACT_STOP), math.nan, *options[2:])
        target = list(self.point)
        for place, value in axes.items():
            target[place] = self._wanted(place, value, self.point)
        first, second, _ = modal.plane
        is_polar = "AP" in values or "RP" in values
        if is_polar and motion in ("G0", "G1", "G2", "G3"):
            self._need_plane()
            target[first], target[second] = self._polar_end(values, axes) or (0.0, 0.0)
        if motion in ("G0", "G1"):
            if "ANG" in values or self.open_line is not None:
                if not self._angled_line(target, axes, values, corner):
                    return
            elif not axes and not is_polar:
                if corner is not None and not corner.modal:
                    raise Fault(corner.word, "a corner stands in a block with a movement")
                return
            self._straight(motion, target, options)
        elif self.open_line is not None:
            raise Fault("ANG", "the end of the line before is missing: this block must have ANG and both coordinates")
        elif motion == "CT":
            self._tangent_arc(target, options)
        elif motion == "CIP":
            self._arc_by_point(target, axes, values, options)
        else:
            if not axes and not is_polar and not values.keys() & {"I", "J", "K", "CR", "AR", "R"}:
                return
            self._arc(motion, target, axes, values, is_polar, options)
        self.point = target
        for place in axes:
            self.pending.pop(place, None)
        if corner is not None:
            recorder.corner = corner
        if once is not None:
            modal.feed, self.speed = kept
            self._feed_given = kept_given

    def _straight(self, motion: str, target: Sequence[float], options: Options) -> None:
        if motion == "G0":
            self.recorder.straight(target, True, math.nan, options)
            return
        length = 0.0
        if self.modal.feed_mode == "G93":
            length = math.dist(self.recorder.frame.machine(target), self.recorder.position)
        self.recorder.straight(target, False, self._feed(motion, length), options)

    def _move_in_machine(self, axes: dict[int, Any], values: dict[str, Any], spelling: str) -> None:
        """G53: positions of the machine, in this block."""
        motion, recorder = self.modal.motion, self.recorder
        if motion not in ("G0", "G1") or values:
            raise Fault(spelling, "only G0 and G1 go to positions of the machine, with axes alone")
        if self.modal.incremental or any(isinstance(value, tuple) and value[0] == "IC" for value in axes.values()):
            raise Fault(spelling, "a position of the machine is absolute (G90)")
        kept = recorder.frame
        recorder.set_frame(Frame(IDENTITY, (0.0,) * len(recorder.names)))
        target = list(recorder.position)
        for place, value in axes.items():
            target[place] = (value[1] if isinstance(value, tuple) else value) * self.modal.length
        try:
            self._straight(motion, target, self.options[motion == "G0"])
        finally:
            recorder.set_frame(kept)
        self.point = kept.program(recorder.position)
        self.pending = {}

    def _need_plane(self) -> None:
        for place in self.modal.plane[:2]:
            name = self.recorder.names[place]
            if name in self.missing:
                raise Fault(
                    self.modal.motion,
                    f"the plane needs the axis {name}, which the machine does not have (G17, G18, G19)",
                )

    def _corner(self, values: dict[str, Any]) -> Corner | None:
        """What stands at the end of the block: RND, CHF, CHR, or RNDM of before."""
        match = [(name, size) for name in ("RND", "CHF", "CHR") if (size := self._plain(values, name)) is not None]
        feed = self._plain(values, "FRC")
        if feed is not None:
            if not 0 < feed <= MAX_FEED:
                raise Fault("FRC", f"the feed {feed:g} must be above 0")
            feed *= self.modal.feed_length / 60
        if len(match) > 1:
            raise Fault(match[1][0], f"a corner has {match[0][0]} or {match[1][0]}")
        modal = not match
        name, size = match[0] if match else ("RNDM", self.modal.rounding)
        if not 0 <= size <= MAX_COORDINATE:
            raise Fault(name, f"{size:g} mm must not be negative")
        if size == 0:
            return None
        plane, scale = self.recorder.plane(self.modal.plane)
        return Corner(
            name,
            size * scale,
            feed or self.modal.corner_feed or None,
            plane,
            self.recorder.line,
            self.recorder.file,
            modal,
            name == "CHR",
        )

    def _angled_line(
        self, target: list[float], axes: dict[int, Any], values: dict[str, Any], corner: Corner | None
    ) -> bool:
        """Line with ANG, its angle to the plane's first axis. False: its end comes with the next block."""
        first, second, _ = self.modal.plane
        self._need_plane()
        angle = self._plain(values, "ANG")
        if angle is None:
            raise Fault("ANG", "the end of the line before is missing: this block must have ANG and both coordinates")
        if values:
            return True
        u, v = sine(angle + 90.0), sine(angle)
        given = [place for place in (first, second) if place in axes]
        if self.open_line is not None:
            if len(given) < 2:
                raise Fault("ANG", "the second of two lines needs both coordinates of its end")
            before, line, first_corner = self.open_line
            p, q = sine(before + 90.0), sine(before)
            x, y = target[first] - self.point[first], target[second] - self.point[second]
            determinant = p * v - q * u
            if abs(determinant) < 1e-9:
                raise Fault("ANG", f"the lines of {before:g} and {angle:g} degrees are parallel")
            way, last = (x * v - y * u) / determinant, (p * y - q * x) / determinant
            if way < -MIN_DISTANCE or last < -MIN_DISTANCE:
                raise Fault("ANG", f"lines of {before:g} and {angle:g} degrees do not lead to the end")
            middle = list(self.point)
            middle[first] += way * p
            middle[second] += way * q
            here, self.recorder.line, self.open_line = self.recorder.line, line, None
            self._straight(self.modal.motion, middle, self.options[self.modal.motion == "G0"])
            self.recorder.line, self.recorder.corner = here, first_corner
            return True
        if not given:
            if axes:
                raise Fault("ANG", "a line whose end comes with the next block has no other axis")
            self.open_line = (angle, self.recorder.line, corner)
            return False
        if len(given) == 2:
            raise Fault("ANG", "a line has ANG and one coordinate of the plane, or both coordinates")
        along, across, cosine, sinus = (first, second, u, v) if given[0] == first else (second, first, v, u)
        way = target[along] - self.point[along]
        if abs(cosine) < 1e-12 or way / cosine < 0:
            name = self.recorder.names[along]
            raise Fault(
                "ANG", f"a line of {angle:g} degrees does not lead to {name}{target[along] / self.modal.length:g}"
            )
        target[across] = self.point[across] + way * sinus / cosine
        return True

    # --- Arcs --------------------------------------------------------------------------------------------------------

    def _turns(self, values: dict[str, Any]) -> int:
        """Additional turns: TURN; of ISO P, which counts the first one."""
        name = "P" if self.iso else "TURN"
        if name not in values:
            return 0
        turns = whole(self._plain(values, name) or 0.0, name) - self.iso
        if not 0 <= turns <= 999:
            raise Fault(name, f"{turns} additional turns; 0 to 999 are allowed")
        return turns

    def _emit_arc(self, target: Sequence[float], arc: Arc, turns: int, options: Options) -> None:
        recorder = self.recorder
        curve = recorder.arc_in_space(self.modal.plane, self.point, arc, turns)
        self._emit_curve(recorder.frame.machine(target), curve, options)

    def _emit_curve(
        self, end: Sequence[float], curve: tuple[Sequence[float], Sequence[float], float], options: Options
    ) -> None:
        recorder = self.recorder
        start, (centre, normal, angle) = recorder.position, curve
        rise = sum(n * (b - a) for n, a, b in zip(normal, start, end, strict=False))
        length = math.hypot(math.dist(centre, start[:3]) * angle, rise)
        feed = self._feed(self.modal.motion, length)
        recorder.move(ARC, tuple(end), (tuple(centre), tuple(normal), angle), feed, options)

    def _arc(
        self, motion: str, target: list[float], axes: dict[int, Any], values: dict[str, Any], is_polar: bool,
        options: Options,
    ) -> None:  # fmt: skip
        self._need_plane()
        first, second, normal = self.modal.plane
        sense = -1 if motion == "G2" else 1
        start, end = (self.point[first], self.point[second]), (target[first], target[second])
        turns = self._turns(values)
        words = "IJK"
        if words[normal] in values:
            raise Fault(words[normal], f"the centre of an arc in this plane has {words[first]} and {words[second]}")
        centre = None
        if words[first] in values or words[second] in values:
            centre = list(start)
            for number, place in enumerate((first, second)):
                value = values.pop(words[place], None)
                if value is not None:
                    absolute = self.modal.centre_absolute
                    if isinstance(value, tuple):
                        absolute, value = value[0] == "AC", value[1]
                    centre[number] = value * self.modal.length + (0.0 if absolute else start[number])
                elif self.modal.centre_absolute:
                    raise Fault(words[place], "an absolute centre (G90.1) needs both coordinates")
        radius = self._plain(values, "R" if self.iso else "CR")
        if radius is not None and self.iso:
            radius *= self.modal.length
        angle = self._plain(values, "AR")
        if angle is not None and not 0 < angle < 360:
            raise Fault("AR", f"the angle {angle:g} must be above 0 and below 360 degrees")
        if centre is not None and radius is not None:
            raise Fault("R" if self.iso else "CR", "an arc has a centre or a radius")
        has_end = is_polar or first in axes or second in axes
        if angle is not None:
            if radius is not None or (centre is not None) == has_end:
                raise Fault("AR", "an arc with an opening angle has its centre or its end besides")
            if centre is not None:
                x, y = start[0] - centre[0], start[1] - centre[1]
                if math.hypot(x, y) < MIN_DISTANCE:
                    raise Fault("AR", "the centre of the arc is its start: radius 0 mm")
                c, s = sine(angle + 90.0), sense * sine(angle)
                target[first], target[second] = centre[0] + c * x - s * y, centre[1] + s * x + c * y
                arc = Arc((centre[0], centre[1]), sense, math.radians(angle))
            else:
                arc = arc_of_angle(start, end, math.radians(angle), sense)
        elif radius is not None:
            if radius == 0:
                raise Fault("R" if self.iso else "CR", "a radius of 0 mm")
            arc = arc_of_radius(start, end, radius, sense)
        elif centre is not None:
            arc = arc_about(start, end, (centre[0], centre[1]), sense)
        elif is_polar:
            arc = arc_about(start, end, (self.pole[first], self.pole[second]), sense)
        else:
            if "R" in values:
                raise Fault("R", "a radius is written CR= in this dialect, and R in the ISO dialect")
            raise Fault(motion, "an arc without centre or radius")
        self._emit_arc(target, arc, turns, options)

    def _tangent_arc(self, target: list[float], options: Options) -> None:
        self._need_plane()
        first, second, _ = self.modal.plane
        direction = self.recorder.tangent()
        if direction is None:
            raise Fault("CT", "no movement is before it, whose direction it could take")
        size = math.hypot(direction[first], direction[second])
        if size < 1e-9 * math.hypot(*direction):
            raise Fault("CT", "the movement before has no direction in the plane")
        heading = (direction[first] / size, direction[second] / size)
        arc = arc_tangent((self.point[first], self.point[second]), (target[first], target[second]), heading)
        if arc is None:
            self._straight("CT", target, options)
        else:
            self._emit_arc(target, arc, 0, options)

    def _arc_by_point(
        self, target: list[float], axes: dict[int, Any], values: dict[str, Any], options: Options
    ) -> None:
        """CIP: through an intermediate point, in space."""
        if self.missing:
            raise Fault("CIP", f"an arc in space needs X, Y and Z; the machine has {', '.join(self.recorder.axes)}")
        middle = list(self.point)
        if not values.keys() & {"I1", "J1", "K1"}:
            raise Fault("CIP", "the intermediate point is missing: I1=, J1=, K1=")
        for place, name in enumerate(("I1", "J1", "K1")):
            if name in values:
                value = values.pop(name)
                incremental = self.modal.incremental
                if isinstance(value, tuple):
                    incremental, value = value[0] == "IC", value[1]
                middle[place] = value * self.modal.length + (self.point[place] if incremental else 0.0)
        turns = self._turns(values)
        frame = self.recorder.frame
        sizes = [math.hypot(*frame.linear([float(i == axis) for i in range(3)])) for axis in range(3)]
        if max(sizes) - min(sizes) > 1e-9 * max(sizes):
            raise Fault("CIP", "the frame scales the axes differently, which makes the arc an ellipse")
        start, end = self.recorder.position, frame.machine(target)
        centre, normal, angle = arc_through(start[:3], frame.machine(middle)[:3], end[:3])  # type: ignore[arg-type]
        self._emit_curve(end, (centre, normal, angle + 2 * math.pi * turns), options)

    # --- ISO dialect -------------------------------------------------------------------------------------------------

    def _read_iso(self, scan: Scanner, name: str) -> Value | None:
        return self.parameters.get(self._iso_index(scan), 0.0) if name == "#" else None

    @staticmethod
    def _iso_index(scan: Scanner) -> int:
        """Number of a parameter, after #."""
        match = scan.take(re.compile(r"\d+"))
        if not match and not scan.rest().startswith("["):
            raise Fault(
                "#", "the number of a parameter is expected; names and parameters of parameters are not supported"
            )
        index = _parameter(match[0]) if match else whole(scan.number("#"), "#")
        if not 0 < index < 5000:
            raise Fault(f"#{index}", "parameters #1 to #4999 are known; those beyond are the control's")
        return index

    def _iso_words(self, scan: Scanner) -> None:
        """Words of a block: a letter, and a number, #parameter or [expression]. Parameters change after the block."""
        words: list[tuple[str, Any]] = []
        assigned: dict[int, float] = {}
        while scan.rest():
            if scan.accept("#"):
                index = self._iso_index(scan)
                if not scan.accept("="):
                    raise Fault(f"#{index}", "= is missing")
                assigned[index] = scan.number(f"#{index}")
                continue
            match = scan.take(_ADDRESS)
            if match:
                self._address(scan, match, words)
                continue
            name = scan.take(
                re.compile(r"[A-Z](?![A-Z])|[A-Z](?=(?:SIN|COS|TAN|ASIN|ACOS|ATAN|SQRT|ABS|ROUND|FIX|FUP|EXP|LN)\[)")
            )
            if not name:
                word = re.match(r"[A-Z]+|.", scan.rest())
                raise Fault(word[0] if word else "block", "the word is not understood in the ISO dialect")
            if not scan.rest():
                raise Fault(name[0], "a value is missing")
            words.append((name[0], scan.number(name[0])))
        if words and words[0][0] == "O":
            if len(words) > 1:
                raise Fault("O", "words with O are not understood in the ISO dialect")
            words = []
        if words:
            self.execute(words)
        for index, value in assigned.items():
            self.changes += self.parameters.get(index, 0.0) != value
            self.parameters[index] = value

    def _iso_path_mode(self, values: dict[str, Any]) -> None:
        """G64 P0.01: continuous path within a tolerance; Q, that of a simplification, is passed over."""
        if self.modal.blending == Blending.CONTINUOUS:
            self.modal.ctol = (values.pop("P", 0.0) or 0.0) * self.modal.length
            if self.modal.ctol < 0:
                raise Fault("P", "the tolerance is negative")
            if self.modal.ctol:
                self.modal.blending = Blending.TOLERANCE
            if values.pop("Q", None) is not None:
                self.recorder.note("Q")
        self._update_options()

    def _iso_call(self, values: dict[str, Any]) -> None:
        """M98 P1000 L3: a program of the same file that begins with O1000, or a file."""
        assert self.program
        if "P" not in values:
            raise Fault("M98", "the number of the subprogram is missing: P")
        number, times = whole(values.pop("P"), "P"), whole(values.pop("L", 1.0), "L")
        if not 0 <= times <= 9999:
            raise Fault("L", f"{times} repetitions; 0 to 9999 are allowed")
        places = self.program.numbered.get(str(number))
        program = self.program
        if places:
            at, line = places[0]
            at, line = program.end_of_line(at) + 1, line + 1
        else:
            other = self.find(f"O{number}") or self.find(f"O{number:04d}") or self.find(str(number))
            if other is None:
                raise Fault(
                    f"P{number}", f"the subprogram is not found: no O{number} in the file, no file O{number} beside it"
                )
            program, at, line = other, 0, 1
        for _ in range(times):
            self._enter(Called({}, {}), "M98")
            ended = self.run(program, at, line, len(program.code))
            self.calls.pop()
            self._spend(max(program.code.count("\n", at), 1))
            if ended == "end":
                self.flow = "end"
                return


_PATH_MODE = "exact stop, continuous path"
_MODAL_FIELDS = frozenset(Modal.__dataclass_fields__)


def _parameter(number: str) -> int:
    if len(number) > 9:
        raise Fault(f"R{number[:9]}", "the number of the parameter is too large")
    return int(number)


def _skip_parentheses(scan: Scanner, word: str) -> None:
    """Passes over ( ... ), texts in it included."""
    depth, quoted = 0, False
    for place in range(scan.at, len(scan.text)):
        letter = scan.text[place]
        if letter == '"':
            quoted = not quoted
        elif not quoted:
            depth += (letter in "([") - (letter in ")]")
            if depth == 0:
                scan.at = place + 1
                return
    raise Fault(word, "a parenthesis is not closed")
