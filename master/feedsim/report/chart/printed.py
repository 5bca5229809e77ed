"""A chart drawn with matplotlib, for print: panels, polar panels and grids with all that is marked in them.

matplotlib is imported on first use. Labels are placed when the layout is known, where no curve is (placing.py).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.report.chart.model import Axis, Band, Chart, Curve, Grid, Mark, Panel, Polar
from feedsim.report.chart.placing import Ground, fit
from feedsim.report.chart.scales import Range, bent, ranges, ticks, unbent
from feedsim.report.chart.still import cell_text, share_of
from feedsim.report.formatting import minus
from feedsim.report.style import BLUE, GRID, INK, MUTED, PAPER, VERMILLION, Drawn, drawing, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

Place = Callable[[], None]  # what is done when the layout is known
# inches of a figure, and that a column takes at least
FIGURE_WIDTH, MAX_FIGURE_WIDTH, MIN_COLUMN_WIDTH = 10.0, 12.0, 3.6
PANEL, ENDS, ROUND, NAME_HEIGHT, CELL = 2.3, 0.5, 6.0, 0.27, (0.62, 0.31)  # inches: see _height
SIDE, TITLE_HEIGHT = 0.85, 0.35  # inches beside a panel's curves and above them
MAX_PLAIN_MARKS = 2  # marks with words that need no room of their own
DASHES: dict[str, Any] = {"": "-", "dashed": (0, (5, 1.5)), "dotted": (0, (2, 1.3))}
DOT = 2.0  # points, of a dot whose width is 1
SHAPES = ("^", "v", "o", "s")  # of large dots of several names
LINES: dict[str, Any] = {"": "-", "dashed": (0, (4, 2)), "dotted": (0, (1, 2))}  # of levels
THICK = 3.0  # wider curves are bars, as wide as pixels of a page are
CLOSED = 0.02  # of what a loop spans: ends as close as this are one
IMAGE_POINTS = 500  # points from which they are an image within an SVG
PANEL_POINTS = 8.5  # points, of what stands within panels
GREEK = "alpha|beta|gamma|delta|zeta|eta|kappa|lambda|mu|rho|sigma|tau|psi|omega"
SYMBOL = re.compile(rf"(?<![\w.$])([A-Za-z]|{GREEK})_([A-Za-z0-9]{{1,4}})(?!\w|\.\w)")


def printed(chart: Chart, stem: str, title: str, caption: str = "", *, worded: bool = False) -> Drawn:
    """The figure; worded: with title and caption above it."""
    rows = list(chart.rows())
    heights = [max(_height(chart, part, _hides(chart, i, j)) for j, part in enumerate(row))
               for i, row in enumerate(rows)]  # fmt: skip
    with drawing(_width(chart), sum(heights)) as figure:
        places: list[Place] = []
        shapes = _shapes(chart)
        shares = [_width(chart) * share / sum(chart.widths) for share in chart.widths]
        grid = figure.add_gridspec(len(rows), len(chart.widths), width_ratios=chart.widths, height_ratios=heights)
        for i, row in enumerate(rows):
            for j, part in enumerate(row):
                axes = figure.add_subplot(grid[i, j])
                if isinstance(part, Panel):
                    same = j > 0 and isinstance(left := row[j - 1], Panel) and left.y == part.y
                    bare = _hides(chart, i, j)
                    size = (shares[j] - SIDE, heights[i] - TITLE_HEIGHT - (0.0 if bare else ENDS))
                    places.append(_panel(axes, part, shapes, size, bare=bare, unnamed=same))
                elif isinstance(part, Polar):
                    places.append(_polar(axes, part))
                else:
                    _grid(axes, part)
        _legend(figure, chart, shapes)
        return finish(figure, stem, title, caption, worded=worded, then=lambda: [place() for place in places])


def _hides(chart: Chart, i: int, j: int) -> bool:
    """Whether a panel leaves its abscissa to the one below, over the same."""
    n, k = len(chart.widths), i * len(chart.widths) + j
    if k + n >= len(chart.panels):
        return False
    own, below = chart.panels[k], chart.panels[k + n]
    return (
        isinstance(own, Panel) and isinstance(below, Panel) and bool(own.linked)
        and (own.linked, own.x) == (below.linked, below.x) and ranges(own)[0] == ranges(below)[0]
    )  # fmt: skip


def _width(chart: Chart) -> float:
    if all(isinstance(part, Grid) for part in chart.panels):
        needed = max(0.6 + 0.085 * max(map(len, part.rows)) + CELL[0] * len(part.columns)
                     for part in chart.panels if isinstance(part, Grid))  # fmt: skip
        return min(max(6.0, needed), MAX_FIGURE_WIDTH)
    return min(max(FIGURE_WIDTH, MIN_COLUMN_WIDTH * len(chart.widths)), MAX_FIGURE_WIDTH)


def _height(chart: Chart, part: Panel | Polar | Grid, bare: bool) -> float:
    if isinstance(part, Polar):
        return ROUND
    if isinstance(part, Grid):
        few = max(CELL[1] * len(part.rows), min(0.6 * len(part.rows), 1.8))
        return 0.5 + 0.06 * max(map(len, part.columns)) + few
    if part.y.names:
        return 0.9 + NAME_HEIGHT * len(part.y.names)
    more = 0.35 * (part.x.also is not None)
    room = PANEL * part.height * (1.2 if len(chart.panels) == 1 or len(chart.widths) > 1 else 1.0)
    return room + (0.0 if bare else ENDS) + more


def _text(text: str) -> str:
    """Words as matplotlib writes them: a $ is one, and x_a a symbol with its index."""
    text = text.replace("$", r"\$")
    if re.fullmatch(GREEK, text):
        return rf"$\{text}$"
    return SYMBOL.sub(lambda m: f"${m[1] if len(m[1]) == 1 else f'{chr(92)}{m[1]}'}_{{{m[2]}}}$", text)


# -- panels ------------------------------------------------------------------------------------------------------------


def _panel(
    axes: Axes, panel: Panel, shapes: Mapping[str, str], size: tuple[float, float], *, bare: bool, unnamed: bool
) -> Place:
    """Curves over one pair of axes.

    shapes: of dots, by their names. size: about that of the room for the curves [inches], for the number of ticks: the
    layout needs to know how wide their texts are. bare, unnamed: without the names of abscissa or ordinate.
    """
    across, up = ranges(panel)
    up = _with_bands(panel, up)
    if sum(bool(mark.text) for mark in panel.marks) > MAX_PLAIN_MARKS and not panel.y.log:
        up = (up[0], up[1] + 0.25 * (up[1] - up[0]))  # room for what is said of them
    if panel.x.span is None:
        across = _wider(across, panel.x.log)
    axes.set_xscale("log" if panel.x.log else "linear")
    if panel.y.symlog:
        axes.set_yscale("function", functions=(partial(bent, panel.y.symlog), partial(unbent, panel.y.symlog)))
    else:
        axes.set_yscale("log" if panel.y.log else "linear")
    axes.set(xlim=across, ylim=up)
    for band in panel.bands:
        _band(axes, band, across, up)
    for level in panel.levels:
        line = axes.vlines if level.upright else axes.hlines
        first, last = level.ends or (up if level.upright else across)
        line(level.at, first, last, color=level.colour, linewidth=0.8, linestyle=LINES[level.dash], zorder=1.5)
    for curve in panel.curves:
        _curve(axes, curve.thinned(), shapes.get(curve.name, "o"), bars=bool(panel.y.names))
    for mark in panel.marks:
        face: dict[str, Any] = {"markerfacecolor": "none", "markeredgewidth": 1.3} if mark.hollow else {}
        axes.plot([mark.x], [mark.y], "o", color=mark.colour, markersize=5.0, zorder=6, clip_on=False, **face)
    title = axes.set_title(_text(panel.title))
    if not bare:
        axes.set_xlabel(_text(panel.x.title))
    if not unnamed and not panel.y.names:
        axes.set_ylabel(_text(panel.y.title))

    def place() -> None:
        room = axes.get_window_extent().transformed(axes.figure.dpi_scale_trans.inverted())  # inches
        fit(axes, title)
        for line in axes.lines if panel.y.names else ():  # bars are as wide as their rows allow
            line.set_linewidth(line.get_linewidth() * min(2.0, room.height / (up[1] - up[0]) / NAME_HEIGHT))
        _words(axes, panel, across, up)

    _marked(axes.xaxis, panel.x, across, size[0] / (1.05 if panel.x.names else 0.75), bare)
    _marked(axes.yaxis, panel.y, up, len(panel.y.names) or min(size[1] / 0.25, 9), False)
    if panel.y.names:
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    for axis, side in ((panel.x, axes.secondary_xaxis), (panel.y, axes.secondary_yaxis)):
        if axis.also is not None:
            _second(side, axis, across if axis is panel.x else up)
    return place


def _wider(span: Range, log: bool) -> Range:
    """With a little room at both ends."""
    if log:
        more = (span[1] / span[0]) ** 0.02
        return span[0] / more, span[1] * more
    more = 0.01 * (span[1] - span[0])
    return span[0] - more, span[1] + more


def _with_bands(panel: Panel, up: Range) -> Range:
    """Ordinates with the whole of the bands that follow curves."""
    if panel.y.span is not None or panel.y.log:
        return up
    edges = [np.asarray(edge) for band in panel.bands for edge in (band.low, band.high) if not isinstance(edge, float)]
    found = [finite for edge in edges if len(finite := edge[np.isfinite(edge)])]
    return float(min([up[0], *(each.min() for each in found)])), float(max([up[1], *(each.max() for each in found)]))


def _band(axes: Axes, band: Band, across: Range, up: Range) -> None:
    x = np.array(across) if band.x is None else band.x
    reach = up[1] - up[0]  # far beyond a panel numbers would be drawn nowhere
    edges = (np.broadcast_to(edge, x.shape) for edge in (band.low, band.high))
    low, high = (np.clip(edge, up[0] - reach, up[1] + reach) for edge in edges)
    axes.fill_between(x, low, high, color=band.colour, alpha=0.18, linewidth=0, zorder=0.6)


def _shapes(chart: Chart) -> dict[str, str]:
    """Large dots of several names are separated without colours, too."""
    panels = [part for part in chart.panels if isinstance(part, Panel)]
    names = dict.fromkeys(
        curve.name for panel in panels for curve in panel.curves if curve.dots and curve.width >= THICK
    )
    return {name: SHAPES[k % len(SHAPES)] for k, name in enumerate(names)} if len(names) > 1 else {}


def _curve(axes: Axes, curve: Curve, shape: str, *, bars: bool) -> None:
    look: dict[str, Any] = {"color": curve.colour, "alpha": 0.4 if curve.faint else 1.0, "zorder": 3}
    width = curve.width if curve.width < THICK else 0.75 * curve.width
    if curve.filled:
        axes.fill_between(curve.x, curve.y, color=curve.colour, alpha=0.5, linewidth=0, zorder=2)
    elif curve.dots:
        look |= {
            "rasterized": len(curve.x) > IMAGE_POINTS,
            "zorder": 2.5 if curve.width < THICK else 4,
        }  # clouds lie below curves
        axes.plot(curve.x, curve.y, shape, linestyle="none", markersize=DOT * curve.width, markeredgewidth=0, **look)
    else:
        look |= {"solid_capstyle": "butt"} if bars else {}
        x, y = curve.x, curve.y
        if len(x) > 2 and not curve.ascending and all(abs(v[-1] - v[0]) < CLOSED * float(np.ptp(v)) for v in (x, y)):
            x, y = np.append(x, x[0]), np.append(y, y[0])
        axes.plot(x, y, linewidth=width, linestyle=DASHES[curve.dash], **look)


def _marked(side: Any, axis: Axis, span: Range, most: float, bare: bool) -> None:
    """Ticks and their texts."""
    found = list(ticks(axis, span, most))
    texts = [_text(text) if axis.names else text for _, text in found]
    turned = side.axis_name == "x" and sum(map(len, axis.names)) > 8 * most and not bare
    look = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"} if turned else {}
    side.set_ticks([at for at, _ in found], ["" for _ in texts] if bare else texts, **look)
    if axis.log:
        decades = range(math.floor(math.log10(span[0])), math.ceil(math.log10(span[1])))
        parts = [part * 10.0**k for k in decades for part in range(2, 10)]
        side.set_ticks([part for part in parts if span[0] <= part <= span[1]], minor=True)
        side.set_minor_formatter("")
        side.axes.grid(visible=True, axis=side.axis_name, which="minor", linewidth=0.35)


def _second(side: Any, axis: Axis, span: Range) -> None:
    """The same quantity in another unit, at the other side."""
    assert axis.also is not None
    label, unit, factor = axis.also
    other = side("top" if side.__name__ == "secondary_xaxis" else "right",
                 functions=(lambda value: value * factor, lambda value: value / factor))  # fmt: skip
    second = Axis(label, unit, axis.log)
    line = other.xaxis if side.__name__ == "secondary_xaxis" else other.yaxis
    found = list(ticks(second, (span[0] * factor, span[1] * factor), 8))
    line.set_ticks([at for at, _ in found], [text for _, text in found])
    line.set_ticks([], minor=True)
    line.set_label_text(_text(second.title))


def _words(axes: Axes, panel: Panel, across: Range, up: Range) -> None:
    """What is said of marks and levels, and the note, each where no curve is."""
    ground = Ground(axes)
    dots = [(mark.x, mark.y) for mark in panel.marks]
    ground.take(np.array(dots).reshape(-1, 2), lines=False, about=1)
    for mark in panel.marks:
        if mark.text and across[0] <= mark.x <= across[1]:
            ground.beside(mark.x, mark.y, _text(mark.text), INK)
    for level in panel.levels:
        if level.text and not level.upright and up[0] <= level.at <= up[1]:
            ground.along(level.at, _text(level.text), level.colour, level.ends)
        elif level.text and level.upright and across[0] <= level.at <= across[1]:
            ground.upright(level.at, _text(level.text), level.colour)
    if panel.note:
        ground.corner(_text(panel.note), INK)


def _legend(figure: Drawing, chart: Chart, shapes: Mapping[str, str]) -> None:
    """One legend of all panels, in rows above them."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    found: dict[str, Any] = {}
    for part in chart.panels:
        if isinstance(part, Grid):
            continue
        for curve in part.curves:
            if curve.filled:
                found.setdefault(curve.name, Patch(color=curve.colour, alpha=0.5, linewidth=0))
            elif curve.dots:
                size = max(4.0, DOT * curve.width)
                found.setdefault(curve.name, Line2D([], [], color=curve.colour, linestyle="none",
                                                    marker=shapes.get(curve.name, "o"),
                                                    markersize=size, markeredgewidth=0))  # fmt: skip
            else:
                width = min(max(1.4, curve.width), 5.0)
                found.setdefault(curve.name, Line2D([], [], color=curve.colour, linewidth=width,
                                                    linestyle=DASHES[curve.dash], solid_capstyle="butt"))  # fmt: skip
        for band in part.bands if isinstance(part, Panel) else ():
            found.setdefault(band.name, Patch(color=band.colour, alpha=0.25, linewidth=0))
    found.pop("", None)
    if len(found) < 2:
        return
    names = list(found)
    for columns in range(min(len(names), 8), 0, -1):
        order = [k for j in range(columns) for k in range(j, len(names), columns)]  # matplotlib fills column by column
        legend = figure.legend(
            handles=[found[names[k]] for k in order], labels=[_text(names[k]) for k in order], loc="upper left",
            ncols=columns, handlelength=1.8, handletextpad=0.5, columnspacing=1.4, borderaxespad=0.0, borderpad=0.2,
        )  # fmt: skip
        legend.set_in_layout(False)
        if columns == 1 or legend.get_window_extent().width < 0.97 * figure.bbox.width:
            return
        legend.remove()


# -- polar panels ------------------------------------------------------------------------------------------------------


def _polar(axes: Axes, panel: Polar) -> Place:
    """Deviations about the programmed circle, with rings and the directions of the plane."""
    gap = panel.gap
    outer = 1 + 1.16 * gap * panel.rings
    axes.set_aspect("equal", anchor="N")
    axes.set_axis_off()
    axes.set(xlim=(-outer - 0.2, outer + 0.2), ylim=(-outer - 0.14, outer + 0.14))
    around = np.linspace(0, 2 * math.pi, 361)
    for k in range(-panel.rings, panel.rings + 1):
        look: dict[str, Any] = {"color": GRID, "linewidth": 0.9} if k else {
            "color": MUTED, "linewidth": 1.1, "linestyle": (0, (6, 3))}  # fmt: skip
        axes.plot((1 + k * gap) * np.cos(around), (1 + k * gap) * np.sin(around), **look)
    first, second = panel.axes
    for text, x, y in ((f"{first}+", 1, 0), (f"{second}+", 0, 1), (f"{first}−", -1, 0), (f"{second}−", 0, -1)):
        axes.plot([0, outer * x], [0, outer * y], color=GRID, linewidth=0.9)
        at = outer + 0.055
        axes.text(x * at, y * at, _text(text), ha="center", va="center", fontweight="bold", fontsize=11)
    for curve in panel.curves:
        kept = curve.thinned()
        angle, r = kept.x, 1 + kept.y * gap / panel.ring
        if len(r) and abs(r[-1] - r[0]) < CLOSED * gap:  # a turn with the machine's start or stop in it does not close
            angle, r = np.append(angle, angle[0]), np.append(r, r[0])
        axes.plot(r * np.cos(angle), r * np.sin(angle), color=curve.colour, linewidth=curve.width,
                  linestyle=DASHES[curve.dash], alpha=0.4 if curve.faint else 1.0, zorder=3)  # fmt: skip
    for k in range(-panel.rings, panel.rings + 1):
        away = 1 + k * gap if k else _beside_the_curves(panel, gap)
        at, text = away * math.sqrt(0.5), minus(f"{k * panel.ring:+g} µm") if k else "0"
        axes.text(
            at, at, text, color=MUTED, fontsize=PANEL_POINTS, ha="center", va="center", rotation=-45, bbox=_plain()
        )
    for mark in panel.marks:
        _glitch(axes, mark, gap, panel.ring)
    axes.text(0, 0.22, _text(panel.note), color=MUTED, ha="center", va="center", fontsize=PANEL_POINTS)
    if panel.sense:
        _sense(axes, panel.sense)
    axes.set_title(_text(panel.title))
    return lambda: None


def _beside_the_curves(panel: Polar, gap: float) -> float:
    """Radius for the label of the programmed circle: on the side of it where no curve is at 45 degrees."""
    near = [
        gap / panel.ring * curve.y[np.abs((curve.x - math.pi / 4 + math.pi) % (2 * math.pi) - math.pi) < 0.06]
        for curve in panel.curves
    ]
    taken = np.concatenate([*near, [0.0]])
    return 1 + max((-0.3 * gap, 0.3 * gap), key=lambda offset: float(np.abs(taken - offset).min()))


def _glitch(axes: Axes, mark: Mark, gap: float, ring: float) -> None:
    r = 1 + mark.y * gap / ring
    x, y = r * math.cos(mark.x), r * math.sin(mark.x)
    crossing = round(mark.x / (math.pi / 2)) * math.pi / 2  # of the axis that it belongs to
    across, up = round(math.cos(crossing)), round(math.sin(crossing))
    inside = 1 - 1.16 * gap
    if mark.text:
        axes.annotate(
            _text(mark.text), (x, y), xytext=(inside * across, inside * up), color=INK, fontsize=9, bbox=_plain(),
            ha={1: "right", 0: "center", -1: "left"}[across], va={1: "top", 0: "center", -1: "bottom"}[up],
            zorder=6,
            arrowprops={"arrowstyle": "-", "color": mark.colour, "linewidth": 0.9, "shrinkA": 2, "shrinkB": 2},
        )  # fmt: skip
    axes.plot([x], [y], "o", color=mark.colour, markersize=5, zorder=7)


def _sense(axes: Axes, sense: int) -> None:
    """Arrow in the centre that shows which way the circle is driven."""
    span = np.deg2rad(np.linspace(50, 130, 41))[::sense]
    x, y = 0.16 * np.cos(span), 0.16 * np.sin(span) - 0.36
    axes.plot(x[:-1], y[:-1], color=MUTED, linewidth=1.2)
    head = {"arrowstyle": "-|>", "color": MUTED, "linewidth": 1.2}
    axes.annotate("", (x[-1], y[-1]), xytext=(x[-4], y[-4]), arrowprops=head)


def _plain() -> dict[str, Any]:
    """Ground for a label over a grid."""
    return {"facecolor": PAPER, "edgecolor": "none", "pad": 1.0}


# -- grids -------------------------------------------------------------------------------------------------------------


def _grid(axes: Axes, grid: Grid) -> None:
    """Cells coloured by their numbers, and the numbers where there is room; else a scale of the colours."""
    from matplotlib.colors import to_rgba

    rows, columns = grid.values.shape
    cells = np.zeros((rows, columns, 4))
    for i, j in np.ndindex(rows, columns):
        value = float(grid.values[i, j])
        if math.isfinite(value):
            share, negative = share_of(value, grid)
            cells[i, j] = to_rgba(VERMILLION if negative else BLUE, share)
    lines: dict[str, Any] = (
        {"edgecolors": GRID, "linewidth": 0.6} if cells[..., 0].size <= IMAGE_POINTS else {"rasterized": True}
    )
    axes.pcolormesh(np.arange(columns + 1), np.arange(rows + 1), cells, **lines)
    axes.invert_yaxis()
    axes.grid(visible=False)
    if grid.best is not None:
        i, j = grid.best
        axes.plot([j, j + 1, j + 1, j, j], [i, i, i + 1, i + 1, i], color=INK, linewidth=1.8, zorder=6, clip_on=False)
    axes.xaxis.tick_top()
    wide = (_width(Chart([grid])) - 1.0) / columns
    axes.tick_params(length=0)
    long = max(map(len, grid.columns)) > 9 * wide
    for side, names, least in ((axes.xaxis, grid.columns, 0.2 / wide), (axes.yaxis, grid.rows, 1)):
        every = max(1, math.ceil(least))
        look: dict[str, Any] = {"rotation": 40, "ha": "left", "rotation_mode": "anchor"}
        look = look if long and side is axes.xaxis else {}
        side.set_ticks(np.arange(0, len(names), every) + 0.5, [_text(each) for each in names[::every]], **look)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(_text(grid.title))
    if wide < 0.4:
        _scale_of(axes, grid)
        return
    for i, j in np.ndindex(rows, columns):
        if math.isfinite(value := float(grid.values[i, j])):
            weight = "bold" if grid.bold is not None and grid.bold[i, j] else "normal"
            axes.text(j + 0.5, i + 0.5, cell_text(value, grid), ha="center", va="center", fontsize=PANEL_POINTS,
                      fontweight=weight)  # fmt: skip


def _scale_of(axes: Axes, grid: Grid) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize, to_rgba

    colours = []
    for value in np.linspace(*grid.span, 64):
        share, negative = share_of(float(value), grid)
        colours.append(to_rgba(VERMILLION if negative else BLUE, share))
    bar = axes.figure.colorbar(ScalarMappable(Normalize(*grid.span), ListedColormap(colours)), ax=axes, pad=0.02)
    bar.outline.set_visible(False)
