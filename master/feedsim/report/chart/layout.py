"""What the page and the SVG draw alike: sizes [pixels], dashes, steps of ticks. The page's script is handed LAYOUT."""

from __future__ import annotations

from typing import Any

LEFT, RIGHT, TOP, BOTTOM = 62.0, 14.0, 28.0, 44.0  # beside the curves of a panel
SECOND = 34.0  # above them, of a second scale
HEIGHT, ROUND, GAP = 235.0, 520.0, 18.0  # of a panel without what is below, of a polar one, between columns
ROW, CELL_WITH_NUMBER, CELL_WITH_NAME = 24.0, 30.0, 12.0  # of a grid: height; least widths
SCALE_STEPS, SCALE_STEP = 12, 10.0  # of a grid without numbers: colours of its scale, and the width of each
SLANTED = 4.8  # that a letter of a slanted name takes across
LINE_PITCH = 1.15  # from line to line of words, in heights of a letter
LETTER = 6.3  # of words over curves
BLOCK = 4  # how finely a panel is looked at for room
LEADER = 24.0  # distance of a label from its point from which a line leads to it
FILL, BAND = 0.5, 0.18  # opacity of filled areas and bands
DEPTH = 0.75  # opacity of the deepest cell
CLOSED = 0.02  # of the outermost ring: ends of a turn as close as this are one
NEXT = 0.05  # sine of half the angle between the ends of a turn, at most
FAINT = 0.4  # opacity of faint curves
RING_GAPS = {1: 0.36, 2: 0.24}  # between rings, by their number to either side; the programmed circle's radius is 1
OUTER = 1.16  # outermost radius, in gaps beyond the outermost ring
DASHES = {"": "", "dashed": "6 3", "dotted": "2 3"}
ROOM = 0.07  # of their range, above and below the curves
MIN_TICKS, TICK_WIDTH, TICK_HEIGHT = 3, 74.0, 34.0
MAX_DIGITS = 7  # of a tick; with more, what ticks have in common stands at the axis
PHASES = (15, 30, 45, 90, 180, 360, 720, 1440)
NARROWEST = 4e-9  # span against the largest value: 4 nm of 1 m
FINER_UNITS = {
    "m": ((1, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm")), "mm": ((1, "mm"), (1e3, "µm"), (1e6, "nm")),
    "µm": ((1, "µm"), (1e3, "nm")), "s": ((1, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")),
    "ms": ((1, "ms"), (1e3, "µs"), (1e6, "ns")), "Hz": ((1, "Hz"), (1e3, "mHz"), (1e6, "µHz")),
}  # fmt: skip

LAYOUT: dict[str, Any] = {name: value for name, value in globals().items() if name.isupper() and name != "LAYOUT"}
