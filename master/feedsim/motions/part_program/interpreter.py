"""Executes programs of SINUMERIK and of ISO: blocks, variables, branches, loops and subprograms (words: movements.py).

Sources of the rules: Siemens, SINUMERIK 840D sl / 828D, programming manuals "Fundamentals" and "Job planning"; of the
ISO dialect: ISO 6983-1, and what LinuxCNC documents of its interpreter RS274/NGC.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feedsim.motions.part_program.expressions import (
    NAME,
    Scanner,
    Value,
    Variable,
    badly_written,
    round_half_away,
    whole_number,
    zero,
)
from feedsim.motions.part_program.movements import Movements
from feedsim.motions.part_program.recorder import Fault, Recorder
from feedsim.motions.part_program.source import Place, Program
from feedsim.motions.part_program.words import (  # fmt: skip
    FRAMES,
    NAMED_CODES,
    NOTED_VALUES,
    NOTED_WITH_ARGUMENTS,
    NOTED_WORDS,
    VALUES,
    WITH_WAY,
    refusal_of,
)

MAX_REPEATED = 2_000_000  # blocks that loops, jumps back and subprograms execute in all
MAX_CALLS = 16  # levels of subprograms and repeated sections
MAX_ELEMENTS = 100_000  # of an array

# What most blocks have alone: letters and named values with a number. L and O call and name subprograms.
_WORD = r"([A-KMNP-Z]|(?:CR|AR|TURN|RP|AP|ANG|RND|CHF|CHR)(?=[ \t]*=))[ \t]*=?[ \t]*([-+]?[\d.]+)"
_DECIMAL = r"[-+]?(?:\d+\.?\d*|\.\d+)(?![.\d]|E[-+\d])"
_PLAIN_BLOCK = {
    True: re.compile(rf"(?:[ \t]*[A-KMNP-Z][ \t]*{_DECIMAL})*[ \t]*"),
    False: re.compile(rf"(?:[ \t]*(?:[A-KMNP-Z]|(?:CR|AR|TURN|RP|AP|ANG|RND|CHF|CHR)[ \t]*=)[ \t]*{_DECIMAL})*[ \t]*"),
}
_PLAIN_WORD = re.compile(_WORD)
_ADDRESS = re.compile(r"([A-Z])[ \t]*([-+]?(?:\d+\.?\d*|\.\d+)(?:EX[-+]?\d+)?)")
_ASSIGNMENT = re.compile(r"([A-Z_$][A-Z_$][A-Z0-9_$]*|[A-Z]\d*)[ \t]*=(?!=)")
_INDEXED_NAME = re.compile(r"([A-Z_$][A-Z_$][A-Z0-9_$]*|[A-Z])[ \t]*(?=\[)")
_LABEL = re.compile(r"([A-Z_][A-Z0-9_]*)[ \t]*:(?!=)")
_SKIP = re.compile(r"/\d?(?!\d)")
_BLOCK_NUMBER = re.compile(r"(?:N|:)[ \t]*\d+(?![.\d]|[ \t]*=)")
_WAY = re.compile(r"(?:IC|AC|DC|ACP|ACN|CAC|CIC|CDC|CACP|CACN)(?=[ \t]*\()")
_GOTO = re.compile(r"(GOTO[BFC]?)(?![A-Z0-9_])")
_TARGET = re.compile(r"N\d+|[A-Z_][A-Z0-9_]*|:\d+")
_REPEATS = re.compile(r"P[ \t]*(?:=[ \t]*(?=.)|(?=\d))")
_DEF_KIND = re.compile(r"(REAL|INT|BOOL|CHAR|STRING|AXIS|FRAME)(?![A-Z0-9_])")
_PROC = re.compile(r"^[ \t]*(?:N\d+[ \t]*)?PROC[ \t]+[A-Z_]", re.MULTILINE)
_ISO_COMMENT = re.compile(r"\([^()\n]*\)")


@dataclass
class SubprogramCall:
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
        self.recorder, self.find, self.iso, self.skip = recorder, find, iso, skip
        self.movements = Movements(
            recorder, iso=iso, tolerance=tolerance, offsets=offsets, functions=self._execute_functions
        )
        self.places = self.movements.places
        self.parameters: dict[int, float] = {}
        self.calls = [SubprogramCall({}, {})]
        self.program: Program | None = None
        self.flow: Place | str | None = None  # jump, "return" or "end", after the block
        self.repeated = 0
        self.changes = 0  # of variables: a loop in which nothing changes does not end
        self.passed: dict[tuple[int, int], int] = {}  # jump back -> changes when it was last made
        self.control = {
            "IF": self._if,
            "ELSE": self._else,
            "ENDIF": self._mark_place,
            "WHILE": self._while,
            "ENDWHILE": self._jump_back,
            "LOOP": self._mark_place,
            "ENDLOOP": self._jump_back,
            "FOR": self._for,
            "ENDFOR": self._end_for,
            "REPEAT": self._repeat,
            "REPEATB": self._repeat,
            "UNTIL": self._until,
            "CASE": self._case,
            "GOTO": self._goto,
            "GOTOF": self._goto,
            "GOTOB": self._goto,
            "GOTOC": self._goto,
            "GOTOS": self._goto,
            "DEF": self._def,
            "PROC": self._proc,
            "EXTERN": self._skip_rest,
            "RET": self._return,
            "CALL": self._call_text,
            "EXTCALL": self._call_text,
        }

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
        execute_line, result = self.movements.execute_line, "done"
        while at < stop:
            end = code.find("\n", at)
            if end < 0:
                end = len(code)
            recorder.line = line
            text = code[at:end]
            if is_plain(text):
                words = [(name, float(number)) for name, number in _PLAIN_WORD.findall(text)]
                if not execute_line(words):
                    self._execute(words)
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
        self.movements.finish()

    def _strip_comment(self, text: str) -> str:
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
        text = self._strip_comment(text).strip()
        if not text or self._is_mark(text):
            return
        scan = Scanner(text, self._read_iso if self.iso else self._read, self.iso)
        if scan.take(_SKIP):
            if self.skip:
                return
            self.recorder.note("/")
        if scan.take(_BLOCK_NUMBER) and not self.iso:
            scan.skip_space()
            if _BLOCK_NUMBER.match(scan.text, scan.at):
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
            self._execute(words)

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
        match = scan.take(_ASSIGNMENT)
        if match:
            self._read_assignment(scan, match[1], words)
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
        match = scan.take(_INDEXED_NAME)
        if match and match[1] not in NOTED_WORDS:
            self._assign_indexed(scan, match[1])
            return True
        match = match or scan.take(NAME)
        if not match:
            raise Fault(scan.rest().split()[0][:20], "the word is not understood")
        return self._read_word(scan, match[0].strip(), words)

    def _address(self, scan: Scanner, match: re.Match[str], words: list[tuple[str, Any]]) -> None:
        name, number = match[1], match[2]
        following = scan.text[scan.at : scan.at + 2]
        if following[:1] == "." or re.match(r"E[-+\d]", following):
            whole_word = re.match(r"[-+.\w]*", scan.text[match.start() :])
            raise Fault(whole_word[0] if whole_word else name, badly_written(following))
        if following[:1] == ",":
            raise Fault(f"{name}{number},", "a decimal point is expected, not a comma")
        words.append((name, scan.finite(float(number.replace("EX", "E")), name)))

    def _read_assignment(self, scan: Scanner, name: str, words: list[tuple[str, Any]]) -> None:
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
        raise self.movements.unknown_word(name)

    def _read_word(self, scan: Scanner, name: str, words: list[tuple[str, Any]]) -> bool:
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
            framed: list[tuple[str, Any]] = []
            while scan.rest():
                if not self._word(scan, framed):
                    raise Fault(name, f"{name} stands in a block of its own")
            self.movements.change_frame(name, framed)
            return False
        if name in NAMED_CODES:
            words.append(("code", name))
            return True
        if name in NOTED_WORDS:
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
            raise self.movements.unknown_word(name)
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

    def _execute(self, words: Sequence[tuple[str, Any]]) -> None:
        """Words of a block, together."""
        ended = self.movements.execute(words)
        if ended:
            self.flow = ended

    def _execute_functions(self, functions: Sequence[float], values: dict[str, Any]) -> str | None:
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
            raise self.movements.unknown_word(name)
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

    def _mark_place(self, scan: Scanner, word: str) -> None:
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

    def _jump_back(self, scan: Scanner, word: str) -> None:
        self.flow = self._partner()

    def _until(self, scan: Scanner, word: str) -> None:
        if not scan.condition(word):
            self.flow = self._partner()

    def _for(self, scan: Scanner, word: str) -> None:
        match = scan.take(_ASSIGNMENT)
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
        number = whole_number(round_half_away(scan.number(word)), "P")
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
            self._enter(SubprogramCall(self.variables, {}), word)
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

    def _enter(self, call: SubprogramCall, word: str) -> None:
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
            self._enter(SubprogramCall({}, {}, list(arguments)), name)
            before = self.movements.saved()
            self.changes += 1
            ended = self.run(program, 0, 1, len(program.code))
            call = self.calls.pop()
            returned = call.returned or {}
            if "SAVE" in returned:
                self.movements.restore(*before)
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
        index = _parameter(match[0]) if match else whole_number(scan.number("#"), "#")
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
            self._execute(words)
        for index, value in assigned.items():
            self.changes += self.parameters.get(index, 0.0) != value
            self.parameters[index] = value

    def _iso_call(self, values: dict[str, Any]) -> None:
        """M98 P1000 L3: a program of the same file that begins with O1000, or a file."""
        assert self.program
        if "P" not in values:
            raise Fault("M98", "the number of the subprogram is missing: P")
        number, times = whole_number(values.pop("P"), "P"), whole_number(values.pop("L", 1.0), "L")
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
            self._enter(SubprogramCall({}, {}), "M98")
            ended = self.run(program, at, line, len(program.code))
            self.calls.pop()
            self._spend(max(program.code.count("\n", at), 1))
            if ended == "end":
                self.flow = "end"
                return


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
