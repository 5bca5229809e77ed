"""Colours of figures, what each means, and what is said in all pictures of a report.

They are Okabe and Ito's, which stay apart for the colour-blind and in grey print. In an SVG each colour of the palette
is a CSS variable, so that one drawing serves light, dark and paper; a PNG is drawn on white.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INK, MUTED, GRID, PAPER = "#1b1f24", "#59636e", "#d4dae1", "#fefefe"
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#b0528a", "#b87a00", "#3d9bd0"
# What a colour means, in every picture. Panel or label names the axis; dashes show the second direction of a circle.
SIMULATED = AFTER = BLUE
RECORDED = BEFORE = INK
SETPOINT = MUTED
AT_TOOL = ORANGE
RESIDUAL_COLOUR = VERMILLION  # what is left, stands out or lies outside
ALLOWED = GREEN  # bands that are allowed or targets
FRICTION = PURPLE
OTHERWISE = SKY  # simulated in another way: another set, another side

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
)


def named(colour: str) -> str:
    """The name of a colour of the palette."""
    return _NAMES[colour]


_NAMES = {on_light: name for name, on_light, _ in PALETTE}
# Colours by their variables, as on white paper.
PAGE_COLOURS = {name: colour for name, colour, _ in PALETTE} | {"ground": "#ffffff"}

# What stands in small print in every picture that is made inside remarked().
REMARK: ContextVar[str] = ContextVar("remark", default="")
NARROW = 95, 2  # characters of a line and lines of it that fit the narrowest figure


@contextmanager
def remarked(text: str, width: int = 150, lines: int = 2) -> Iterator[None]:
    """Charts made inside have `text` in their upper right corner as files: a picture travels without its page.

    width, lines: characters of a line and lines that fit the narrowest figure; what is longer ends there.
    """
    token = REMARK.set("\n".join(textwrap.wrap(text, width)[:lines]))
    try:
        yield
    finally:
        REMARK.reset(token)
