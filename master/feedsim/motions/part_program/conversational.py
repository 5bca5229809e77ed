"""Executes programs of Heidenhain's conversational language: L, C, CR, CT, LP, CP, CTP, RND, CHF, labels, Q parameters.

Source of the rules: Heidenhain, TNC 640 user's manual for conversational programming.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from feedsim.motions.part_program.expressions import (
    FUNCTIONS,
    Scanner,
    Value,
    calculate,
    equal,
    round_half_away,
    whole_number,
)
from feedsim.motions.part_program.geometry import Arc, arc_about, arc_of_radius, arc_tangent, sine
from feedsim.motions.part_program.interpreter import MAX_CALLS, MAX_REPEATED
from feedsim.motions.part_program.recorder import ARC, MAX_COORDINATE, Corner, Fault, Options, Recorder
from feedsim.motions.part_program.source import Place, Program
from feedsim.motions.part_program.words import INCH, XY, YZ, ZX, Blending

_DECIMAL = re.compile(r"\d+\.?\d*|\.\d+")
_Q = re.compile(r"Q(\d{1,4})(?![A-Z0-9])")
_BLOCK_NUMBER = re.compile(r"[ \t]*(\d+)?(?:[ \t]+|$)")
_LABEL = re.compile(r'^[ \t]*(?:\d+[ \t]+)?LBL[ \t]+(?:"([^"\n]+)"|(\d+))[ \t]*(?:;.*)?$', re.MULTILINE)
_LABEL_NAME = re.compile(r'"([^"]+)"|(\d+)')
_STATEMENT = re.compile(r"[A-Z]+")
_COORDINATE = re.compile(r"(I?)(PR|PA|[XYZUVWABC])(?=[ \t]*[-+.\dQ])")
_FEED = re.compile(r"F[ \t]*(MAX|AUTO|(?=[-+.\dQ]))")
_NO_COMPENSATION = re.compile(r"R0(?![\d.])")
_COMPENSATION = re.compile(r"R[LR]|R[-+](?=[ \t]|$)")
_ASSIGNMENT = re.compile(r"(?:FN[ \t]*0[ \t]*:[ \t]*)?Q(\d{1,4})[ \t]*=")
_FUNCTION = re.compile(r"FN[ \t]*(\d+)[ \t]*:")
_NOTED_WORDS = frozenset({"BLK", "TOOL", "STOP", "END"})
_MOVES = frozenset({"L", "LP", "C", "CR", "CP", "CT", "CTP"})
_REFUSAL_REASONS = {
    **dict.fromkeys(("APPR", "DEP"), "approach and departure are not supported: write out their movements"),
    **dict.fromkeys(("FL", "FC", "FLT", "FCT", "FPOL", "FSELECT"), "free contour programming is not supported"),
    **dict.fromkeys(("PLANE", "FUNCTION"), "inclined planes and functions are not supported"),
    **dict.fromkeys(("TCH", "LN", "SPL"), "probing, surface normals and splines are not supported"),
}
_M_REFUSED = {
    **dict.fromkeys((89, 99), "cycles are not supported: write out their movements"),
    **dict.fromkeys(
        (92, 118, 128, 130, 136, 140, 144), "the function moves axes, or changes the feed, in ways not supported"
    ),
}
MAX_REPETITIONS = 65534


@dataclass
class Words:
    """What a movement has besides its coordinates."""

    axes: dict[int, tuple[bool, float]]
    polar: dict[str, tuple[bool, float]]
    rapid: bool = False
    sense: int = 0
    radius: float | None = None
    ends: bool = False
    feed: float | None = None  # of RND and CHF


class Conversational:
    """State of a program that is being read. recorder, find, tolerance [mm]: as of Interpreter."""

    def __init__(self, recorder: Recorder, find: Callable[[str], Program | None]) -> None:
        self.recorder, self.find = recorder, find
        self.missing = {name for name in "XYZ" if name not in recorder.axes}
        self.places = {name: place for place, name in enumerate(recorder.names) if name not in self.missing}
        self.point = list(recorder.position)
        self.plane = XY
        self.length, self.feed_length = 1.0, 1.0
        self.feed, self.tool_feed = 0.0, 0.0  # [mm/s]
        self.pole: tuple[float, float] | None = None
        self.parameters: dict[int, float] = {}
        self.tolerance = 0.0
        self.depth, self.repeated = 0, 0
        self.program: Program | None = None
        self.here: Place = (0, 1)  # of the block, where a jump leads, and what follows the block
        self.jump: Place | None = None
        self.behind = 0

    # --- Blocks ------------------------------------------------------------------------------------------------------

    @cached_property
    def _labels(self) -> dict[int, dict[str, Place]]:
        return {}

    def _places_of_labels(self, program: Program) -> dict[str, Place]:
        if program.index not in self._labels:
            labels: dict[str, Place] = {}
            line, counted = 1, 0
            for match in _LABEL.finditer(program.code):
                line += program.code.count("\n", counted, match.start())
                counted = match.start()
                name = match[1] or match[2].lstrip("0") or "0"
                if name != "0" and name in labels:
                    raise Fault(f"LBL {name}", f"the label stands in line {labels[name][1]} too", line, program.index)
                labels[name] = (match.start(), line)
            self._labels[program.index] = labels
        return self._labels[program.index]

    def run(self, program: Program, at: int, line: int, stop: int, *, subprogram: bool = False) -> bool:
        """Executes blocks from a place to a position, a subprogram to LBL 0. False: the program has ended."""
        self.depth += 1
        if self.depth > MAX_CALLS:
            raise Fault("CALL", f"more than {MAX_CALLS} levels of calls and repetitions: does it call itself?")
        before = self.program, self.recorder.file, self.recorder.line
        self.program, self.recorder.file = program, program.index
        going = True
        while at < stop:
            end = program.end_of_line(at)
            self.recorder.line = line
            text = program.code[at:end]
            self.here, self.jump, self.behind = (at, line), None, end + 1
            kind = self._block(text)
            if kind == "end":
                going = False
                break
            if kind == "return" and subprogram:
                break
            if self.jump is not None:
                if self.jump[1] <= line:
                    self._spend(line - self.jump[1] + 1)
                at, line = self.jump
            else:
                at, line = self.behind, line + program.code.count("\n", at, self.behind)
        self.depth -= 1
        if self.depth:  # what is said of the whole program is said of its last line
            self.program, self.recorder.file, self.recorder.line = before
        return going

    def _spend(self, blocks: int) -> None:
        self.repeated += blocks
        if self.repeated > MAX_REPEATED:
            raise Fault("LBL", f"calls and jumps have executed more than {MAX_REPEATED:,} blocks: an endless loop?")

    def finish(self) -> None:
        """Nothing is left open."""

    def _block(self, text: str) -> str:
        text = text.split(";")[0].rstrip(" \t~")
        numbered = _BLOCK_NUMBER.match(text)
        at = numbered.end() if numbered else 0
        scan = Scanner(text, self._read, iso=False)
        scan.at = at
        if not scan.rest() or scan.rest()[0] in "*%":
            return ""
        assigned = scan.take(_ASSIGNMENT)
        if assigned:
            self.parameters[int(assigned[1])] = scan.number(f"Q{assigned[1]}")
            return self._ended(scan, "")
        function = scan.take(_FUNCTION)
        if function:
            return self._ended(scan, self._function(scan, int(function[1][:4])))
        if re.match(r"M[ \t]*\d", scan.rest()):
            words = self._words(scan, "M")
            return "end" if words.ends else ""
        match = scan.take(_STATEMENT)
        word = match[0] if match else scan.rest().split()[0]
        if word in _MOVES:
            return self._move(word, scan)
        if word == "CC":
            self._centre(scan)
        elif word in ("RND", "CHF"):
            self._corner(word, scan)
        elif word == "LBL":
            name = scan.take(_LABEL_NAME)
            if not name:
                raise Fault("LBL", "the label's number or name is missing")
            return self._ended(scan, "return" if not name[1] and int(name[2][:9]) == 0 else "")
        elif word == "CALL":
            return self._call(scan)
        elif word == "BEGIN":
            unit_ = re.match(r"PGM[ \t]+\S+[ \t]+(MM|INCH)[ \t]*$", scan.text[scan.at :].lstrip())
            if not unit_:
                raise Fault("BEGIN", "BEGIN PGM NAME MM, or INCH, is expected")
            # Of inch programs F is in 0.1 inch/min.
            self.length, self.feed_length = (INCH, INCH / 10) if unit_[1] == "INCH" else (1.0, 1.0)
        elif word == "END":
            return "end"
        elif word == "TOOL":
            self._tool(scan)
        elif word == "CYCL":
            self._cycle(scan)
        elif word in _NOTED_WORDS:
            self.recorder.note(word)
        else:
            raise Fault(word, _REFUSAL_REASONS.get(word, "the word is not understood"))
        return ""

    @staticmethod
    def _ended(scan: Scanner, result: str) -> str:
        if scan.rest():
            raise Fault(scan.rest().split()[0], "the word is not understood")
        return result

    def _read(self, scan: Scanner, name: str) -> Value | None:
        return self.parameters.get(int(name[1:5]), 0.0) if _Q.fullmatch(name) else None

    def _number(self, scan: Scanner, word: str) -> float:
        """A number or Q parameter with its sign."""
        sign = -1.0 if scan.accept("-") else 1.0
        if sign > 0:
            scan.accept("+")
        q = scan.take(_Q)
        if q:
            return sign * self.parameters.get(int(q[1]), 0.0)
        match = scan.take(_DECIMAL)
        if not match:
            raise Fault(word, f"a value is missing before {scan.rest() or 'the end of the block'}")
        if scan.text[scan.at : scan.at + 1] in (".", ","):
            raise Fault(f"{word}{match[0]}", "the number is badly written")
        value = sign * scan.finite(float(match[0]), word)
        if abs(value) > MAX_COORDINATE:
            raise Fault(word, f"{value:g} is too large")
        return value

    def _function(self, scan: Scanner, number: int) -> str:
        """FN 0 to FN 13: arithmetic and jumps."""
        word = f"FN {number}"
        if number in (9, 10, 11, 12):
            if not scan.accept("IF"):
                raise Fault(word, "IF is missing")
            a = self._number(scan, word)
            if not scan.accept({9: "EQU", 10: "NE", 11: "GT", 12: "LT"}[number]):
                raise Fault(word, f"{ {9: 'EQU', 10: 'NE', 11: 'GT', 12: 'LT'}[number] } is missing")
            b = self._number(scan, word)
            if not (scan.accept("GOTO") and scan.accept("LBL")):
                raise Fault(word, "GOTO LBL is missing")
            place = self._place(scan)
            same = equal(a, b)
            if {9: same, 10: not same, 11: a > b and not same, 12: a < b and not same}[number]:
                self.jump = place
            return ""
        target = scan.take(_Q)
        if number not in (1, 2, 3, 4, 5, 6, 7, 8, 13) or not target or not scan.accept("="):
            raise Fault(word, "the function is not understood: FN 0 to FN 13 are, as FN 1: Q1 = +Q2 + +5")
        if number in (5, 6, 7):
            name = {5: "SQRT", 6: "SIN", 7: "COS"}[number]
            scan.accept(name)
            value = FUNCTIONS[name][1](self._number(scan, word))
        else:
            a = self._number(scan, word)
            sign = {1: "+", 2: "-", 3: "*", 4: "DIV", 8: "LEN", 13: "ANG"}[number]
            if not scan.accept(sign):
                raise Fault(word, f"{sign} is missing before {scan.rest() or 'the end of the block'}")
            b = self._number(scan, word)
            value = (
                math.hypot(a, b) if number == 8
                else math.degrees(math.atan2(a, b)) if number == 13
                else calculate("/" if number == 4 else sign, a, b, False)
            )  # fmt: skip
        self.parameters[int(target[1])] = scan.finite(value, word)
        return ""

    # --- Labels and calls --------------------------------------------------------------------------------------------

    def _place(self, scan: Scanner) -> Place:
        assert self.program
        match = scan.take(_LABEL_NAME)
        name = (match[1] or match[2].lstrip("0")) if match else ""
        place = self._places_of_labels(self.program).get(name)
        if not name or place is None:
            raise Fault(f"LBL {name}".strip(), "no such label")
        return place

    def _call(self, scan: Scanner) -> str:
        assert self.program
        program, here, behind = self.program, self.here, self.behind
        going = True
        if scan.accept("PGM"):
            name = re.sub(r"^.*[/\\:]|\.H$", "", scan.text[scan.at :].strip().strip('"'))
            other = self.find(name) if re.fullmatch(r"[\w-]+", name) else None
            if other is None:
                raise Fault(name or "CALL PGM", f"the program is not found: no file {name}.H beside this one")
            self.run(other, 0, 1, len(other.code))
            self._spend(max(other.code.count("\n"), 1))
        elif scan.accept("LBL"):
            at, line = self._place(scan)
            times = 0
            if scan.accept("REP"):
                times = whole_number(round_half_away(self._number(scan, "REP")), "REP")
                if scan.accept("/"):
                    self._number(scan, "REP")
                if not 0 <= times <= MAX_REPETITIONS:
                    raise Fault("REP", f"{times} repetitions; 0 to {MAX_REPETITIONS} are allowed")
            self._ended(scan, "")
            if times:
                if line > here[1]:
                    raise Fault("CALL LBL", "the label of a repetition stands before its call")
                for _ in range(times):
                    going = self.run(program, at, line, here[0])
                    self._spend(here[1] - line + 1)
                    if not going:
                        break
            else:
                begun = self.recorder.line
                going = self.run(program, program.end_of_line(at) + 1, line + 1, len(program.code), subprogram=True)
                self._spend(max(begun - line, 1))
        else:
            raise Fault("CALL", "LBL or PGM is expected")
        self.here, self.behind, self.jump = here, behind, None
        return "" if going else "end"

    # --- Words of movements ------------------------------------------------------------------------------------------

    def _words(self, scan: Scanner, statement: str) -> Words:
        """Coordinates, radius compensation, feed, direction and M functions, in any order."""
        words = Words({}, {})
        feed_given = False
        while scan.rest():
            match = scan.take(_COORDINATE)
            if match:
                name, incremental = match[2], bool(match[1])
                value = self._number(scan, name)
                if name in ("PR", "PA"):
                    if name in words.polar:
                        raise Fault(name, "the word stands twice in the block")
                    words.polar[name] = (incremental, value * (self.length if name == "PR" else 1.0))
                    continue
                if name not in self.places:
                    what = "the machine has no such axis" if name in self.missing else "rotary axes are not supported"
                    raise Fault(name, f"{what}; it has {', '.join(self.recorder.axes)}")
                if self.places[name] in words.axes:
                    raise Fault(name, "the axis stands twice in the block")
                words.axes[self.places[name]] = (incremental, value * self.length)
                continue
            feed = scan.take(_FEED)
            if feed:
                if feed_given:
                    raise Fault("F", "the word stands twice in the block")
                feed_given = True
                if feed[1] == "MAX":
                    words.rapid = True
                    continue
                value = self.tool_feed if feed[1] else self._number(scan, "F") * self.feed_length / 60
                if value <= 0:
                    raise Fault("F", "the feed must be above 0" if not feed[1] else "TOOL CALL gives no feed F")
                if statement in ("RND", "CHF"):
                    words.feed = value
                else:
                    self.feed = value
                continue
            if scan.accept("DR+") or scan.accept("DR-"):
                words.sense = 1 if scan.text[scan.at - 1] == "+" else -1
                continue
            if scan.take(_NO_COMPENSATION):
                continue
            if scan.take(_COMPENSATION):
                raise Fault("R", "radius compensation is not supported: program the path of the tool's centre (R0)")
            if scan.accept("R"):
                words.radius = self._number(scan, "R") * self.length
                continue
            if scan.accept("M"):
                self._function_m(scan, words)
                continue
            raise Fault(scan.rest().split()[0], f"the word is not understood after {statement}")
        return words

    def _function_m(self, scan: Scanner, words: Words) -> None:
        number = self._number(scan, "M")
        if number in (2, 30):
            words.ends = True
        elif number in _M_REFUSED:
            raise Fault(f"M{number:g}", _M_REFUSED[int(number)])
        else:
            self.recorder.note(f"M{number:g}")

    def _tool(self, scan: Scanner) -> None:
        """TOOL CALL 5 Z S3000 F500: its axis decides on the plane."""
        self.recorder.note("TOOL")
        rest = scan.text[scan.at :].lstrip()
        if not rest.startswith("CALL"):
            return
        axis = re.search(r"[ \t]([XYZ])(?=[ \t]|$)", rest)
        if axis:
            self.plane = {"X": YZ, "Y": ZX, "Z": XY}[axis[1]]
        feed = re.search(r"[ \t]F[ \t]*(\d+\.?\d*|\.\d+)", rest)
        if feed:
            self.feed = self.tool_feed = float(feed[1]) * self.feed_length / 60

    def _cycle(self, scan: Scanner) -> None:
        """CYCL DEF 32, the tolerance of the path; all others are refused."""
        match = re.match(r"DEF[ \t]+32\.(\d)(.*)", scan.text[scan.at :].lstrip())
        if not match:
            raise Fault("CYCL", "cycles are not supported (but CYCL DEF 32, tolerance): write out their movements")
        if match[1] == "1":
            size = re.match(r"[ \t]*T[ \t]*\+?(\d+\.?\d*|\.\d+)", match[2])
            self.tolerance = float(size[1]) * self.length if size else 0.0

    def _options(self) -> Options:
        within = self.tolerance > 0
        kind = Blending.TOLERANCE if within else Blending.CONTINUOUS
        return int(kind), self.tolerance if within else math.nan, True, False, False

    # --- Movements ---------------------------------------------------------------------------------------------------

    def _need_plane(self, word: str) -> None:
        for place in self.plane[:2]:
            if self.recorder.names[place] in self.missing:
                raise Fault(
                    word, f"the plane needs the axis {self.recorder.names[place]}, which the machine does not have"
                )

    def _centre(self, scan: Scanner) -> None:
        words = self._words(scan, "CC")
        self._need_plane("CC")
        first, second, _ = self.plane
        if not words.axes:
            self.pole = (self.point[first], self.point[second])
            return
        if words.axes.keys() != {first, second}:
            names = " and ".join(self.recorder.names[place] for place in (first, second))
            raise Fault("CC", f"a centre has both coordinates of the plane, {names}, or none")
        self.pole = tuple(
            words.axes[place][1] + (self.point[place] if words.axes[place][0] else 0.0) for place in (first, second)
        )  # type: ignore[assignment]

    def _corner(self, word: str, scan: Scanner) -> None:
        """A block of its own between two movements: RND R5 F200, CHF 2."""
        size = None
        if word == "CHF":
            scan.accept("L")
            size = self._number(scan, word) * self.length
        words = self._words(scan, word)
        size = words.radius if size is None else size
        if size is None or size <= 0 or words.axes or words.polar:
            raise Fault(word, "RND has a radius R above 0, CHF a length above 0")
        plane, _ = self.recorder.plane(self.plane)
        self.recorder.corner = Corner(
            word, size, words.feed, plane, self.recorder.line, self.recorder.file, leg=word == "CHF"
        )

    def _polar(self, words: Words, word: str) -> tuple[float, float]:
        """Polar radius and angle [degrees] of the end, about the pole CC."""
        if self.pole is None:
            raise Fault(word, "no pole: CC is missing")
        first, second, _ = self.plane
        x, y = self.point[first] - self.pole[0], self.point[second] - self.pole[1]
        incremental, radius = words.polar.get("PR", (True, 0.0))
        radius += math.hypot(x, y) if incremental else 0.0
        incremental, angle = words.polar.get("PA", (True, 0.0))
        angle += math.degrees(math.atan2(y, x)) if incremental else 0.0
        return radius, angle

    def _move(self, word: str, scan: Scanner) -> str:
        words = self._words(scan, word)
        try:
            self._movement(word, words)
        except (ValueError, OverflowError, ZeroDivisionError) as error:
            raise Fault(word, str(error)) from None
        return "end" if words.ends else ""

    def _movement(self, word: str, words: Words) -> None:
        first, second, _ = self.plane
        target = list(self.point)
        for place, (incremental, value) in words.axes.items():
            target[place] = value + (self.point[place] if incremental else 0.0)
        angle = None
        if word in ("LP", "CP", "CTP"):
            self._need_plane(word)
            if first in words.axes or second in words.axes:
                raise Fault(word, "an axis of the plane stands beside polar coordinates")
            radius, polar = self._polar(words, word)
            assert self.pole
            target[first] = self.pole[0] + radius * sine(polar + 90.0)
            target[second] = self.pole[1] + radius * sine(polar)
            if word == "CP" and words.polar.get("PA", (False, 0.0))[0]:
                angle = words.polar["PA"][1]
        elif words.polar:
            raise Fault(next(iter(words.polar)), f"{word} has no polar coordinates")
        options = self._options()
        if words.rapid:
            if word not in ("L", "LP"):
                raise Fault("FMAX", "arcs run at a feed")
            if words.axes or words.polar:
                self.recorder.straight(target, True, math.nan, options)
        elif words.axes or words.polar:
            if self.feed <= 0:
                raise Fault(word, "no feed: F is missing")
            if word in ("L", "LP"):
                self.recorder.straight(target, False, self.feed, options)
            else:
                self._curve(word, words, target, angle, options)
        elif word != "L":
            raise Fault(word, "the coordinates are missing")
        self.point = target

    def _curve(self, word: str, words: Words, target: Sequence[float], angle: float | None, options: Options) -> None:
        self._need_plane(word)
        recorder = self.recorder
        first, second, _ = self.plane
        start, end = (self.point[first], self.point[second]), (target[first], target[second])
        turns = 0
        if word in ("CT", "CTP"):
            direction = recorder.tangent()
            size = math.hypot(direction[first], direction[second]) if direction else 0.0
            if direction is None or size == 0:
                raise Fault(word, "no movement in the plane is before it, whose direction it could take")
            tangent = arc_tangent(start, end, (direction[first] / size, direction[second] / size))
            if tangent is None:
                recorder.straight(target, False, self.feed, options)
                return
            arc = tangent
        else:
            if not words.sense:
                raise Fault(word, "the direction is missing: DR+ or DR-")
            if word == "CR":
                if words.radius is None or words.radius == 0:
                    raise Fault("R", "the radius is missing")
                arc = arc_of_radius(start, end, words.radius, words.sense)
            else:
                if self.pole is None:
                    raise Fault(word, "no centre: CC is missing")
                arc = arc_about(start, end, self.pole, words.sense)
                if angle is not None:
                    if angle * words.sense <= 0:
                        raise Fault("IPA", f"the angle {angle:g} and the direction DR do not agree")
                    arc = Arc(arc.centre, arc.sense, math.radians(abs(angle)))
        curve = recorder.arc_in_space(self.plane, self.point, arc, turns)
        recorder.move(ARC, tuple(target), (tuple(curve[0]), curve[1], curve[2]), self.feed, options)
