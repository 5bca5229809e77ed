"""What a report on an identification tells: the result, what it was found from, and how its numbers are worded."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from feedsim.identify.names import distinct
from feedsim.identify.read import Provenance
from feedsim.identify.record import Record
from feedsim.identify.result import NORMAL_95, Estimate, Identification, Stationary
from feedsim.report.provenance import InputFile, hashed
from feedsim.report.words import display_unit, typeset
from feedsim.scenario import Subject

SYMBOLS = {
    "sigma_0": r"$\sigma_0$",
    "sigma_1": r"$\sigma_1$",
    "sigma_2": r"$\sigma_2$",
    "F_C": "$F_C$",
    "F_S": "$F_S$",
    "v_s": "$v_s$",
    "beta": r"$\beta$",
    "F_log": "$F_{log}$",
    "v_log": "$v_{log}$",
    "asymmetry": "asym.",
    "W": "$W$",
    "gamma": r"$\gamma$",
    "M_0": "$M_0$",
    "J": "$J$",
    "delay": "delay",
}
MM_PER_MIN = 60e3  # per m/s
LEAST_SPEEDS = 3  # that make a curve
SAME_SPEED = 1.05  # ratio up to which two speeds are one: that of a direction and of the other, or of a repetition


@dataclass(frozen=True, eq=False)
class Account:
    """An identification with its surroundings.

    Attributes:
        records: what was identified from, in the order of their files.
        sources: of each file.
        subject: the machine that pitch, torque constant or inertia are from; None where none was named.
        settings: option -> value, as the user gave them.
        date: day of the identification, ISO 8601.
    """

    found: Identification
    records: tuple[Record, ...]
    sources: tuple[Provenance, ...]
    subject: Subject | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    date: str = ""

    @property
    def traces(self) -> tuple[str, ...]:
        """Names of the traces, in the order of the sources."""
        return distinct([source.file for source in self.sources])

    @property
    def warnings(self) -> list[str]:
        """Of reading and of identifying, each once."""
        reading = (warning for source in self.sources for warning in source.warnings)
        return list(dict.fromkeys((*reading, *self.found.warnings)))

    @property
    def notes(self) -> list[str]:
        """What the numbers are worth: the notes of the mappings, and the machine's with whose it is."""
        notes = [source.note for source in self.sources]
        if self.subject is not None:
            notes += [f"{self.subject.machine.name}: {note}" for note in self.subject.notes]
        return [note for note in dict.fromkeys(notes) if note]

    @property
    def remark(self) -> str:
        """The same in one line for the pictures: the traces and the machine's note."""
        traces = " from " + _listed(self.traces)
        return " ".join(f"{text.rstrip('.')}." for text in (f"Axis {self.found.axis}{traces}", *self.notes))

    def input_files(self) -> list[InputFile]:
        """Traces and mappings (hashed when they were read), and the machine's files."""
        pairs = zip(self.traces, self.sources, strict=True)
        files = [InputFile("trace", name, source.sha256) for name, source in pairs]
        named = [("mapping", source.mapping) for source in self.sources if source.mapping is not None]
        return files + hashed([*named, *(self.subject.files if self.subject is not None else ())])


def _listed(names: Iterable[str]) -> str:
    names = list(dict.fromkeys(names))
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def curve_error(stage: Stationary) -> float:
    """Half width of the curve's 95 % band, relative, where it is widest within the speeds of the plateaus [1]."""
    inside = (stage.speeds >= stage.range[0] * (1 - 1e-9)) & (stage.speeds <= stage.range[1] * (1 + 1e-9))
    if not np.any(inside):
        inside[:] = True
    return float(NORMAL_95 * np.max(stage.sigma[inside] / np.abs(stage.torque[inside])))


def speeds_of(stage: Stationary) -> int:
    """Number of distinct speeds of the plateaus, whatever their direction."""
    sizes = np.sort([abs(plateau.speed) for plateau in stage.plateaus])
    return int(1 + np.count_nonzero(sizes[1:] > SAME_SPEED * sizes[:-1])) if len(sizes) else 0


def is_curve(stage: Stationary) -> bool:
    """Whether there are enough speeds to speak of a curve and of its error."""
    return speeds_of(stage) >= LEAST_SPEEDS


def at_slide(name: str, I_P: float) -> tuple[float, str] | None:
    """Factor from the motor's side (SI) to the slide, and the unit there; None where it is the same at both.

    With x = I_P angle, F = M / I_P.
    """
    if name in ("F_C", "F_S", "F_log", "M_0"):
        return 1 / I_P, "N"
    if name == "sigma_0":
        return 1e-6 / I_P**2, "N/um"
    if name in ("sigma_1", "sigma_2"):
        return 1e-3 / I_P**2, "N.s/mm"
    if name in ("v_s", "v_log"):
        return MM_PER_MIN * I_P, "mm/min"
    if name == "W":
        return 1e6 * I_P, "um"
    return (1 / I_P**2, "kg") if name == "J" else None


def unit_text(unit: str) -> str:
    """A unit as it is printed: kg·m², N/µm."""
    return typeset(re.sub(r"(?<=[a-z])\^?2\b", "²", display_unit(unit)))


def shown_unit(estimate: Estimate) -> tuple[float, str]:
    """Factor and unit in which a value is shown on the motor's side: SI, times in ms."""
    return (1e3, "ms") if estimate.unit == "s" else (1.0, estimate.unit)


def value_text(estimate: Estimate, factor: float = 1.0) -> str:
    """A value to two digits of its interval, five where there is none."""
    if not 0 < estimate.sigma < math.inf:
        return f"{factor * estimate.value:.5g}"
    return f"{factor * estimate.value:.{_places(estimate, factor)}f}"


def interval_text(estimate: Estimate, factor: float = 1.0) -> str:
    """ "1.597 to 1.603"; empty where there is no interval."""
    if not 0 < estimate.sigma < math.inf:
        return ""
    places = _places(estimate, factor)
    return " to ".join(f"{factor * end:.{places}f}" for end in estimate.interval)


def relative_text(estimate: Estimate) -> str:
    """Half the interval in percent of the value; empty where that says nothing."""
    if not 0 < estimate.sigma < math.inf or estimate.value == 0 or estimate.name in ("delay", "M_0", "asymmetry"):
        return ""
    share = 100 * NORMAL_95 * estimate.sigma / abs(estimate.value)
    return f"{share:.2g} %" if share < 100 else "over 100 %"


def remark_text(estimate: Estimate) -> str:
    """What to know of a value that was not simply estimated."""
    word = "" if estimate.status == "estimated" or estimate.reason.startswith(estimate.status) else estimate.status
    return ": ".join(part for part in (word, estimate.reason) if part)


def _places(estimate: Estimate, factor: float) -> int:
    """Decimal places that show two digits of half the interval."""
    half = abs(factor) * NORMAL_95 * estimate.sigma
    return min(12, max(0, 1 - math.floor(math.log10(half))))
