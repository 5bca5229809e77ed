"""Radius and feed that an instrument writes ahead of the columns of a circle, such as "Radius: 150 mm".

Instruments of several makers, and controls, export circles as text; how their own files are built is not public. What
is common to the texts are lines of a label and a value with its unit, before or behind it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from feedsim import units
from feedsim.errors import InputError
from feedsim.files.spellings import spelled

# Label, as it may stand in a line, and the unit of its kind.
LABELS = {
    "radius": ("m", ("radius", "nominal radius", "programmed radius", "test radius", "circle radius", "ballbar length",
                     "nominal length", "path radius", "measuring radius", "sollradius", "nennradius", "kreisradius",
                     "programmierter radius", "bahnradius", "prüfradius", "messradius", "rayon", "rayon nominal")),
    "diameter": ("m", ("diameter", "nominal diameter", "programmed diameter", "test diameter", "circle diameter",
                       "durchmesser", "solldurchmesser", "nenndurchmesser", "kreisdurchmesser", "diamètre",
                       "diamètre nominal")),
    "feed": ("m/s", ("feed", "feed rate", "feedrate", "path feed", "path speed", "programmed feed", "feed speed",
                     "vorschub", "bahnvorschub", "bahngeschwindigkeit", "vorschubgeschwindigkeit", "avance",
                     "vitesse d'avance")),
}  # fmt: skip
_LINE = re.compile(
    r"""^["'\s#;,%*]*(?P<label>[^\W\d][^:=;,\t\[(\d"]*?)\s*       # a label,
        (?:[\[(](?P<before>[^\])]*)[\])])?["'\s]*[:=;,\t\s]\s*["']?  # its unit in brackets, a separator,
        (?P<value>[+]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*["']?[;,\t]?\s*["']?   # a number,
        (?:[\[(]?(?P<behind>[^\s;,"\])]+)[\])]?)?                 # and its unit behind it
    """,
    re.VERBOSE,
)


def header_values(lines: Sequence[str]) -> tuple[dict[str, float], list[str]]:
    """Of "radius" [m] and "feed" [m/s] those that lines give, and words of those that they do not give clearly."""
    values: dict[str, float] = {}
    notes: list[str] = []
    for line in lines:
        match = _LINE.match(line)
        if match is None:
            continue
        label = " ".join(re.split(r"[\s_-]+", match["label"].strip().lower()))
        for what, (kind, labels) in LABELS.items():
            if label not in labels:
                continue
            unit = (match["before"] or match["behind"] or "").strip()
            value = float(match["value"].replace(",", "."))
            try:
                size = value * float(units.factor(spelled(unit), kind)) if unit else None
            except InputError:
                size = None
            if what == "diameter":
                what, size = "radius", None if size is None else size / 2
            if size is None or not size > 0:
                notes.append(f"{line.strip()!r} may be the {what}, and is not read: its unit is not known")
            elif what in values and abs(values[what] / size - 1) > 1e-9:
                notes.append(f"{line.strip()!r} is another {what} than the one ahead of it, and is not read")
            else:
                values[what] = size
    return values, notes


class Told:
    """What the headers of several files give of one circle. given: what is known without them; notes, doubts: words."""

    def __init__(self, radius: float | None, feed: float | None) -> None:
        self._given = {"radius": radius, "feed": feed}
        self._ahead: dict[str, tuple[Path, float]] = {}
        self.notes: list[str] = []
        self.doubts: list[str] = []

    def add(self, file: Path, lines: Sequence[str]) -> None:
        """InputError: the file is of another circle than those ahead of it."""
        values, unclear = header_values(lines)
        self.doubts += [f"{file}: {name}" for name in unclear]
        for what, value in values.items():
            if self._given[what] is not None:
                continue
            self.notes.append(f"{file}: the {what} is {_shown(what, value)}, as its header says")
            first, other = self._ahead.setdefault(what, (file, value))
            if abs(other / value - 1) > 1e-9:
                raise InputError(
                    f"{file}: its header gives a {what} of {_shown(what, value)}, that of {first} one of "
                    f"{_shown(what, other)}; give files of one circle"
                )

    @property
    def radius(self) -> float | None:
        """[m]"""
        return self._known("radius")

    @property
    def feed(self) -> float | None:
        """[m/s]"""
        return self._known("feed")

    def _known(self, what: str) -> float | None:
        return self._ahead[what][1] if what in self._ahead else self._given[what]


def _shown(what: str, value: float) -> str:
    return f"{value * 1e3:.6g} mm" if what == "radius" else f"{value * 6e4:.6g} mm/min"
