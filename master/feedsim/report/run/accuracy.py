"""Positioning accuracy as a section of a report: target by target, as on acceptance sheets."""

from __future__ import annotations

import numpy as np

from feedsim.analysis import Accuracy
from feedsim.report.content import Section, Table
from feedsim.report.formatting import minus, number

HEADS = (
    "Target [mm]", "Mean upwards [µm]", "s upwards [µm]", "Mean downwards [µm]", "s downwards [µm]", "B [µm]", "R [µm]"
)  # fmt: skip
NOTE = (
    "Deviation of the measured position from the target at the end of each rest: mean and standard deviation s of the "
    "approaches from below (upwards) and from above (downwards), reversal value B and bidirectional repeatability R. "
    "Letters after ISO 230-2."
)


def accuracy_section(prefix: str, found: Accuracy, place: str = "") -> Section:
    """Means, standard deviations, reversal value and repeatability of every target. place: "tool" by the tool point."""
    columns = (*np.transpose([found.mean, found.s], (1, 0, 2)).reshape(4, -1), found.B, found.R)
    rows = [
        (f"{1e3 * target:.6g}", *(minus(number(1e6 * float(column[i]), 3)) for column in columns))
        for i, target in enumerate(found.targets)
    ]
    by = " by the tool point" if place else ""
    anchor = f"accuracy-{prefix}" + (f"-{place}" if place else "")
    return Section(f"Positioning accuracy of {prefix}{by}", [Table("rrrrrrr", HEADS, rows, NOTE)], anchor)
