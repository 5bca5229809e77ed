"""Figures of the benchmarks: curves on logarithmic scales, told apart by marker and dash as well as by colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from harness import RESULTS
from matplotlib import rc_context

from feedsim.report.style import BLUE, GREEN, INK, ORANGE, PURPLE, SKY, VERMILLION, drawing

LOOKS = (
    (BLUE, "o", "-"),
    (VERMILLION, "s", "--"),
    (GREEN, "^", "-."),
    (PURPLE, "D", ":"),
    (ORANGE, "v", (0, (5, 1, 1, 1, 1, 1))),
    (SKY, "P", (0, (1, 2))),
)


@dataclass(frozen=True)
class Curve:
    """Points with a name; `labels` stand beside the points, "" beside none."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    labels: Sequence[str] = ()


@dataclass(frozen=True)
class Panel:
    """Curves over one pair of logarithmic axes. `ticks`: where the x axis is marked; none: decades."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    ticks: Sequence[float] = field(default=())


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of y over x on logarithmic scales, by least squares: the exponent of a power law."""
    return float(np.polyfit(np.log(np.asarray(x)), np.log(np.asarray(y)), 1)[0])


def write_svg(name: str, panels: Sequence[Panel], directory: Path = RESULTS) -> Path:
    """Write `<name>.svg`, the panels side by side; the same numbers give the same bytes."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}.svg"
    with drawing(4.6 * len(panels), 4.7) as figure:
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            _draw(axes, panel)
        with rc_context({"svg.fonttype": "none"}):  # letters as text, not as outlines: a third of the size
            figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})
    return path


def _draw(axes: Any, panel: Panel) -> None:
    for curve, (colour, marker, dashes) in zip(panel.curves, LOOKS, strict=False):
        axes.plot(curve.x, curve.y, color=colour, marker=marker, linestyle=dashes, markersize=4.5, label=curve.name)
        for x, y, label in zip(curve.x, curve.y, curve.labels, strict=False):
            if label:
                axes.annotate(label, (x, y), (4, 3), textcoords="offset points", fontsize=7, color=INK)
    axes.set_xscale("log")
    axes.set_yscale("log")
    if panel.ticks:
        axes.set_xticks(panel.ticks, labels=[f"{tick:g}" for tick in panel.ticks])
        axes.minorticks_off()
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.legend(fontsize=7.5, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
