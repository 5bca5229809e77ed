"""Executes the words of blocks of SINUMERIK and of ISO: modal codes, feeds, frames, lines and arcs, for a Recorder.

Sources of the rules: Siemens, SINUMERIK 840D sl / 828D, programming manuals "Fundamentals" and "Job planning"; of the
ISO dialect: ISO 6983-1, and what LinuxCNC documents of its interpreter RS274/NGC.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from feedsim.motions.part_program.expressions import whole_number
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
from feedsim.motions.part_program.words import (  # fmt: skip
    ISO_CODES,
    ISO_REFUSED,
    NAMED_CODES,
    NOTED_VALUES,
    SINUMERIK_CODES,
    SINUMERIK_REFUSED,
    VALUES,
    WORKPIECE_LENGTHS,
    Blending,
    Modal,
    refusal_of,
    spell_code,
)

MAX_FEED = 1e9  # as programmed
_PATH_MODE = "exact stop, continuous path"
_MODAL_FIELDS = frozenset(Modal.__dataclass_fields__)

WayValue = tuple[str, float]  # AC or IC, value


class Movements:
    """Modal state of a program, and its movements.

    recorder: takes the movements. offsets [mm]: G54 ... -> axis -> value. tolerance [mm]: of G642, G645 and compressors
    without CTOL. functions: executes M words of a block, which may take values of it; returns how the program goes on,
    None: with the next block.
    """

    def __init__(
        self, recorder: Recorder, *, iso: bool, tolerance: float, offsets: Mapping[str, Mapping[str, float]],
        functions: Callable[[Sequence[float], dict[str, Any]], str | None],
    ) -> None:  # fmt: skip
        self.recorder, self.iso, self.tolerance, self.offsets, self.functions = (
            recorder, iso, tolerance, offsets, functions,
        )  # fmt: skip
        self.missing = {name for name in "XYZ" if name not in recorder.axes}
        self.places = {name: place for place, name in enumerate(recorder.names) if name not in self.missing}
        self.codes, self.refused = (ISO_CODES, ISO_REFUSED) if iso else (SINUMERIK_CODES, SINUMERIK_REFUSED)
        self.modal = Modal(motion="", blending=Blending.CONTINUOUS) if iso else Modal()
        self.programmed = Frame(IDENTITY, (0.0,) * len(recorder.names))
        self.point: list[float] = list(recorder.position)  # of the program, in its frame
        self.pending: dict[int, float] = {}  # shifts of the frame that an incremental word of the axis still makes
        self.pole = [0.0, 0.0, 0.0]
        self.polar: tuple[float | None, float | None] = (None, None)  # radius, angle [degrees] programmed last
        self.spindle = 0.0
        self.speed = 0.0  # [mm/s] of G94 and G95
        self.open_line: tuple[float, int, Corner | None] | None = None  # ANG without an end: angle, line
        self.options: list[Options] = []
        self._feed_given = False
        self._update_options()

    def finish(self) -> None:
        """Raises Fault: the program ends within a line."""
        if self.open_line is not None:
            raise Fault(
                "ANG",
                "the end of the line is missing: the next block must have ANG and both coordinates",
                self.open_line[1],
            )

    def saved(self) -> tuple[Modal, Frame]:
        """Modal state and frame, for restore()."""
        return copy.copy(self.modal), self.programmed

    def restore(self, modal: Modal, programmed: Frame) -> None:
        """Modal state and frame of before a subprogram with SAVE."""
        self.modal, self.programmed = modal, programmed
        self._update_options()
        self._update_speed()
        self._update_frame()

    # --- Words of a block --------------------------------------------------------------------------------------------

    def execute(self, words: Sequence[tuple[str, Any]]) -> str | None:
        """All words of a block together: codes first, then values, then the movement. Returns what `functions` does."""
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
            self._set_path_tolerance(values)
        if values:
            self._apply_values(values, done)
        ended = self.functions(functions, values) if functions else None
        if axes or values or done:
            self._act(axes, values, done)
        return ended

    def execute_line(self, words: Sequence[tuple[str, float]]) -> bool:
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
            spelling = spell_code(value) if isinstance(value, float) else "G"
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

    def _set_path_tolerance(self, values: dict[str, Any]) -> None:
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

    def unknown_word(self, name: str) -> Fault:
        """What is the matter with a word that the control does not know, or the machine has no axis for."""
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

    def change_frame(self, name: str, words: Sequence[tuple[str, Any]]) -> None:
        """TRANS, ROT, SCALE, MIRROR replace all programmable frames; ATRANS, ... add to them."""
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
        return self.unknown_word(name).reason

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
        turns = whole_number(self._plain(values, name) or 0.0, name) - self.iso
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
