"""Figures of the benchmarks: curves told apart by marker and dash as well as by colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harness import RESULTS

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Drawing
from matplotlib.layout_engine import ConstrainedLayoutEngine

from feedsim.report.formatting import BLUE, GREEN, GRID, INK, MUTED, ORANGE, PAPER, PURPLE, SKY, VERMILLION

LOOKS = (
    (BLUE, "o", "-"),
    (VERMILLION, "s", "--"),
    (GREEN, "^", "-."),
    (PURPLE, "D", ":"),
    (ORANGE, "v", (0, (5, 1, 1, 1, 1, 1))),
    (SKY, "P", (0, (1, 2))),
    (INK, "X", (0, (8, 2, 1, 2))),
)
# Names beyond this length stand one below the other, lest the legend be wider than its panel.
LONGEST_IN_COLUMNS = 22


@contextmanager
def drawing(width: float, height: float) -> Iterator[Drawing]:
    """An empty figure of ``width`` x ``height`` inches in the style of reports."""
    settings: Any = {
        "font.family": "DejaVu Sans",
        "font.size": 10,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.labelsize": 10,
        "axes.edgecolor": MUTED,
        "axes.linewidth": 0.8,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.facecolor": "none",
        "figure.facecolor": PAPER,
        "grid.color": GRID,
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.4,
        "lines.solid_capstyle": "round",
        "legend.frameon": False,
        "legend.fontsize": 9,
        "xtick.labelsize": 9,
        "ytick.labelsize": 9,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.titlecolor": INK,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "axes.formatter.useoffset": False,
        "axes.unicode_minus": True,
        "path.simplify_threshold": 0.15,
        "svg.fonttype": "path",
        "svg.hashsalt": "feedsim",
    }
    with rc_context(settings):
        figure = Drawing(figsize=(width, height), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06))
        FigureCanvasAgg(figure)
        yield figure


@dataclass(frozen=True)
class Curve:
    """Points with a name; `labels` stand beside the points, "" beside none. `ring`: index of a point made to stand out.

    `markers`: False where there are too many points for them.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    labels: Sequence[str] = ()
    ring: int | None = None
    markers: bool = True


@dataclass(frozen=True)
class Panel:
    """Curves over one pair of axes.

    Attributes:
        scales: "log" or "linear", of x and y; a linear axis begins at 0.
        ticks: where the x axis is marked; none: where it falls.
        level: y and name of a line across the panel.
    """

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    ticks: Sequence[float] = ()
    scales: tuple[str, str] = ("log", "log")
    level: tuple[float, str] | None = None


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
        shown = marker if curve.markers else ""
        axes.plot(curve.x, curve.y, color=colour, marker=shown, linestyle=dashes, markersize=4.5, label=curve.name)
        for x, y, label in zip(curve.x, curve.y, curve.labels, strict=False):
            if label:
                place = {"xytext": (-3, -4), "ha": "right", "va": "top"}
                axes.annotate(label, (x, y), textcoords="offset points", fontsize=7.5, color=INK, **place)
        if curve.ring is not None:
            i = curve.ring
            axes.plot(curve.x[i], curve.y[i], "o", color=colour, markersize=11, fillstyle="none", markeredgewidth=1.4)
    for axis, scale in zip("xy", panel.scales, strict=True):
        if scale == "log":
            axes.set(**{f"{axis}scale": "log"})
        else:
            axes.set(**{f"{axis}lim": (0, 1.06 * max(max(getattr(curve, axis)) for curve in panel.curves))})
    if panel.level is not None:
        level, name = panel.level
        axes.axhline(level, color=MUTED, linewidth=1.0, linestyle=(0, (6, 3)))
        axes.annotate(
            name, (0, level), xycoords=("axes fraction", "data"), xytext=(4, 2), textcoords="offset points",
            fontsize=7.5, color=MUTED, va="bottom",
        )  # fmt: skip
    if panel.ticks:
        axes.set_xticks(panel.ticks, labels=[f"{tick:g}" for tick in panel.ticks])
        axes.minorticks_off()
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    columns = 2 if max(len(curve.name) for curve in panel.curves) <= LONGEST_IN_COLUMNS else 1
    axes.legend(fontsize=7.5, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns)
