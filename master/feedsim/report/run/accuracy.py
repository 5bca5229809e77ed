"""Positioning accuracy in a report: target by target, as on acceptance sheets, as a picture and as a table."""

from __future__ import annotations

import numpy as np

from feedsim.analysis import Accuracy
from feedsim.report.chart import Axis, Band, Chart, Curve, Level, Panel
from feedsim.report.content import Section, Table
from feedsim.report.formatting import minus, number
from feedsim.report.picture import Picture
from feedsim.report.style import OTHERWISE, SIMULATED

HEADS = (
    "Target [mm]", "Mean upwards [µm]", "s upwards [µm]", "Mean downwards [µm]", "s downwards [µm]", "B [µm]", "R [µm]"
)  # fmt: skip
NOTE = (
    "Deviation of the measured position from the target at the end of each rest: mean and standard deviation s of the "
    "approaches from below (upwards) and from above (downwards), reversal value B and bidirectional repeatability R. "
    "Letters after ISO 230-2."
)
SIDES = (("approached upwards", SIMULATED), ("approached downwards", OTHERWISE))


def accuracy_picture(prefix: str, accuracy: Accuracy, stem: str) -> Picture:
    """Deviations over the targets: every reading, means, and two standard deviations to either side of them."""
    x = 1e3 * np.asarray(accuracy.targets)
    readings, mean, s = 1e6 * accuracy.deviations, 1e6 * accuracy.mean, 1e6 * accuracy.s
    runs = readings.shape[2]
    title = f"Positioning accuracy of {prefix}"
    caption = (
        "Deviation of the measured position from its target at the end of each rest, by the linear scale: every "
        "reading, the mean of each side, and the band of two standard deviations about it. "
        f"A {number(accuracy.figures['A'].value, 3)} µm is from the top of the bands to their bottom."
    )
    bands = [
        Band("", middle - 2 * spread, middle + 2 * spread, x, colour)
        for (_, colour), middle, spread in zip(SIDES, mean, s, strict=True)
    ]
    curves = [
        Curve(name, x, middle, colour, dash="dashed" if k else "")
        for k, ((name, colour), middle) in enumerate(zip(SIDES, mean, strict=True))
    ]
    curves += [
        Curve(name, np.repeat(x, runs), own.ravel(), colour, width=2.4, dots=True)
        for (name, colour), own in zip(SIDES, readings, strict=True)
    ]
    reach = 0.03 * float(np.ptp(x))
    low = min(float(np.min(mean - 2 * s)), float(np.min(readings)))
    high = max(float(np.max(mean + 2 * s)), float(np.max(readings)))
    across = Axis("target", "mm", span=(float(x[0]) - reach, float(x[-1]) + reach))
    up = Axis("deviation", "µm", span=(low - 0.05 * (high - low), high + 0.05 * (high - low)))
    panel = Panel("Deviation at the targets", across, up, curves, [Level(0.0, dash="")], bands, height=1.6)
    return Picture(stem, title, caption, Chart([panel]))


def accuracy_section(prefix: str, accuracy: Accuracy, place: str = "") -> Section:
    """Means, standard deviations, reversal value and repeatability of every target. place: "tool" by the tool point."""
    columns = (*np.transpose([accuracy.mean, accuracy.s], (1, 0, 2)).reshape(4, -1), accuracy.B, accuracy.R)
    rows = [
        (f"{1e3 * target:.6g}", *(minus(f"{1e6 * float(column[i]):.3f}") for column in columns))
        for i, target in enumerate(accuracy.targets)
    ]
    by = " by the tool point" if place else ""
    anchor = f"accuracy-{prefix}" + (f"-{place}" if place else "")
    return Section(f"Positioning accuracy of {prefix}{by}", [Table("rrrrrrr", HEADS, rows, NOTE)], anchor)
