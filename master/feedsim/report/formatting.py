"""Numbers, units and durations as a person reads them; SI values in the units that read best: µm, ms, mm/min."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from feedsim.analysis import Figure


# --- Colours of figures, what each means, and what is said in all pictures of a report --------------------------------
# They are Okabe and Ito's, which stay apart for the colour-blind and in grey print. In an SVG each colour of the
# palette is a CSS variable, so that one drawing serves light, dark and paper; a PNG is drawn on white.


Array = NDArray[np.float64]

INK, MUTED, GRID, PAPER = "#1b1f24", "#59636e", "#d4dae1", "#fefefe"
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#b0528a", "#b87a00", "#3d9bd0"
WINE = "#a8325a"  # none of theirs
# What a colour means, in every picture. Panel or label names the axis.
SIMULATED_COLOUR = AFTER_COLOUR = BLUE
RECORDED_COLOUR = BEFORE_COLOUR = INK
SETPOINT_COLOUR = MUTED
AT_TOOL = ORANGE
RESIDUAL_COLOUR = VERMILLION  # what is left, stands out or lies outside
ALLOWED_COLOUR = GREEN  # bands that are allowed or targets
FRICTION_COLOUR = PURPLE
ALTERNATIVE_COLOUR = SKY  # simulated in another way: another set, another side
CLOCKWISE = WINE  # second direction of a circle, simulated or recorded; dashed besides

# CSS variable, colour on light ground (= in the drawing), colour on dark ground
PALETTE = (
    ("ink", INK, "#e6e9ed"),
    ("muted", MUTED, "#a3adb8"),
    ("grid", GRID, "#3a424c"),
    ("paper", PAPER, "#14181d"),
    ("blue", BLUE, "#5bb8f0"),
    ("vermillion", VERMILLION, "#ff9152"),
    ("green", GREEN, "#3fd0a3"),
    ("purple", PURPLE, "#e29ac5"),
    ("orange", ORANGE, "#e8b04a"),
    ("sky", SKY, "#8fd0f5"),
    ("wine", WINE, "#f06a8a"),
)


def colour_name(colour: str) -> str:
    """The name of a colour of the palette."""
    return _NAMES[colour]


_NAMES = {on_light: name for name, on_light, _ in PALETTE}
# Colours by their variables, as on white paper.
PAGE_COLOURS = {name: colour for name, colour, _ in PALETTE} | {"ground": "#ffffff"}

NARROW = 95, 2  # characters of a line and lines of a remark that fit the narrowest figure


# --- Numbers, units and durations as a person reads them; SI values in the units that read best: µm, ms, mm/min -------


SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
EXPONENT_BELOW = Decimal("1e-4")  # below which a number is written with a power of ten
DISPLAY_UNITS = {"um": "µm", "1": "", "deg": "°"}
NOT_DETERMINED = "not determined"
SHORT_DELAY = 10.0  # [ms] a delay, of which microseconds are shown
# SI unit -> (largest magnitude up to which the unit is taken, factor, unit), from small to large.
_SCALES: dict[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((0.999e-3, 1e6, "um"), (10.0, 1e3, "mm")),
    "s": ((0.999e-3, 1e6, "us"), (0.999, 1e3, "ms")),
    "m/s": ((np.inf, 60e3, "mm/min"),),
    "1/s": ((np.inf, 0.06, "(m/min)/mm"),),  # the position controller's gain
    "H": ((0.999, 1e3, "mH"),),
    "J": ((0.999, 1e3, "mJ"),),
}


def figure_text(figure: Figure) -> tuple[str, str]:
    """Value and unit for display; "not determined" and no unit where there is no value."""
    if not math.isfinite(figure.value):
        return NOT_DETERMINED, ""
    digits = {"um": 2, "um/m": 2, "ms": 1, "Hz": 2, "N.m": 3, "s": 4}.get(figure.unit)
    if figure.unit == "ms" and abs(figure.value) < SHORT_DELAY:
        digits = 3
    text = f"{figure.value:.{digits}f}" if digits is not None else powers(f"{figure.value:.5g}")
    return minus(text), display_unit(figure.unit)


def display_unit(unit: str) -> str:
    """A unit as it is printed: µm, N·m, kg·m²; nothing for a plain number."""
    if unit in DISPLAY_UNITS:
        return DISPLAY_UNITS[unit]
    raised = re.sub(r"(?<=[a-z])\^?([23])\b", lambda match: match[1].translate(SUPERSCRIPTS), unit.replace(".", "·"))
    return typeset(raised)


def plain_unit(unit: str) -> str:
    """A unit as it is typed; nothing for a plain number."""
    return "" if unit == "1" else unit


def minus(text: str) -> str:
    """A number with a minus sign in place of the hyphen; a zero has none."""
    return re.sub(r"^-(?=0(\.0*)?$)", "", text).replace("-", "−")


def powers(text: str) -> str:
    """Numbers of a text that are smaller than EXPONENT_BELOW, digit by digit, with a power of ten: 1.47×10⁻⁵."""

    def written(match: re.Match[str]) -> str:
        number = Decimal(match[0])
        if not 0 < abs(number) < EXPONENT_BELOW:
            return match[0]
        mantissa, _, exponent = f"{number:e}".partition("e")
        return f"{mantissa}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"

    return re.sub(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", written, text)


def count_things(number: int, one: str, many: str = "") -> str:
    """ "1 stretch", "2 stretches"; many: plural where an s alone does not make it."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def typeset(text: str) -> str:
    """Words as the analyses write them (ASCII) with the signs of print: 3 µm, ±, −3 dB, N·m, 45°, n², 4.5×10⁻⁷, →.

    What stands in quotation marks is to be typed, and stays as it is.
    """
    said = text.split('"')
    return '"'.join(part if k % 2 else _signs(part) for k, part in enumerate(said))


def _signs(text: str) -> str:
    text = re.sub(r"\bum\b", "µm", text.replace("+-", "±").replace(" -> ", " → "))
    text = re.sub(r"\bN\.m\b(\.s\b)?", lambda match: match[0].replace(".", "·"), text)
    text = re.sub(r"(?<=\d) deg\b", "°", text)
    text = re.sub(r"(?<=[a-z])\^([23])\b", lambda match: match[1].translate(SUPERSCRIPTS), text)
    text = re.sub(r"(?<![\w.])\d+(\.\d+)?e[-+]\d+\b", _with_power, text)
    return re.sub(r"(?:(?<=[\s(])|^)-(?=\d)", "−", text)


def _with_power(match: re.Match[str]) -> str:
    mantissa, _, exponent = match[0].partition("e")
    return f"{mantissa}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def duration(seconds: float) -> str:
    """A time in the unit that reads best: 125 µs, 1 ms, 2 s."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1 - 1e-9:
            return f"{seconds * scale:.6g} {unit}"
    return f"{seconds * 1e6:.6g} µs"


@dataclass(frozen=True)
class Scale:
    """A unit for people and the factor from SI to it."""

    factor: float
    unit: str

    @property
    def shown_unit(self) -> str:
        """The unit as it is printed: µm; nothing for a plain number."""
        return display_unit(self.unit)


def scale(unit: str, values: Array) -> Scale:
    """The unit in which values of an SI unit read best, by the largest of them."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if len(finite) else 0.0
    fitting = ((factor, shown) for limit, factor, shown in _SCALES.get(unit, ()) if largest <= limit)
    return Scale(*next(fitting, (1.0, unit)))


def number(value: float, digits: int = 4) -> str:
    """A number of a table; a dash where there is none."""
    return minus(powers(f"{value:.{digits}g}")) if np.isfinite(value) else "–"


def three_digits(value: float) -> str:
    """Three digits that count, zeros at the end among them; a dash where there is no number."""
    if not np.isfinite(value):
        return "–"
    whole = abs(value) >= 100 or 0 < abs(value) < EXPONENT_BELOW
    return minus(powers(f"{value:.3g}" if whole else f"{value:#.3g}".rstrip(".")))


def two_digits(value: float) -> str:
    """Two digits that count, and all places before the point; a dash where there is no number."""
    if not np.isfinite(value):
        return "–"
    exponent = int(f"{value:.1e}".partition("e")[2])
    return minus(f"{value:.{min(max(0, 1 - exponent), 3)}f}")


def with_interval(value: float, ends: tuple[float, float]) -> str:
    """A value with its interval, both with the digits that the interval leaves."""
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)):
        return number(value, 3)
    width = max(value - low, high - value)
    return " ".join([round_to_doubt(value, width), f"({round_to_doubt(low, width)} to {round_to_doubt(high, width)})"])


def round_to_doubt(value: float, doubt: float) -> str:
    """A number to the second digit of its doubt."""
    if not (math.isfinite(value) and math.isfinite(doubt) and doubt > 0):
        return number(value)
    return minus(f"{value:.{max(0, 1 - math.floor(math.log10(doubt)))}f}")
