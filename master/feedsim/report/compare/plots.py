"""Pictures of a comparison: the tube around the reference, the result, and where it is outside."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from feedsim.compare import Comparison, Curves, Variable, along, seconds
from feedsim.report.chart import Axis, Band, Chart, Curve, Level, Mark, Panel
from feedsim.report.formatting import display_unit, minus, powers
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import BLUE, GREEN, MUTED, VERMILLION, Array, Drawn, drawing, finish, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 4  # variables in a picture
AROUND = 60  # rows of the result to either side of the worst one
SHADE = 0.18
FAR = 1e30  # beyond every panel


def drawn(comparison: Comparison) -> list[Variable]:
    """Variables that are drawn: the worst ones outside, else the one nearest to its limit."""
    kept = [each for each in comparison.variables if each.curves is not None]
    outside = [each for each in kept if each.verdict == "different"]
    ranked = sorted(outside or kept, key=lambda each: (-each.ratio, -each.deviation))
    return ranked[: MOST if outside else 1]


def picture_of(comparison: Comparison, number: int) -> Picture | None:
    """The worst variables over the whole time and around the worst instant; None where nothing was compared."""
    variables = drawn(comparison)
    if not variables:
        return None

    def draw() -> Drawn:
        with drawing(10.0, 0.5 + 2.9 * len(variables)) as figure:
            rooms = figure.subplots(len(variables), 2, squeeze=False, width_ratios=[1.5, 1])
            for (whole, near), variable in zip(rooms, variables, strict=True):
                assert variable.curves is not None
                _whole(whole, variable, variable.curves)
                _near(near, variable, variable.curves)
            for axes in rooms[-1]:
                axes.set_xlabel("time [s]")
            return finish(figure, f"comparison-{number}", title, caption)

    outside = len(comparison.those("different"))
    shown = f"the {len(variables)} worst of {outside} variables outside" if outside > len(variables) else ""
    title = f"{comparison.result} against {comparison.reference}"
    caption = (
        "Left the compared time; right, around the worst instant, what is left of result and band when the "
        "reference is taken off. The band is the tolerance around the reference; where the result leaves it, the "
        "ground is shaded." + (f" Drawn are {shown}." if shown else "")
    )
    panels = [panel for variable in variables for panel in _panels(variable)]
    return Picture(f"comparison-{number}", title, caption, draw, Chart(panels, (1.5, 1.0)))


def _panels(variable: Variable) -> list[Panel]:
    """The whole time, and what is left of result and band around the worst instant when the reference is taken off."""
    curves = variable.curves
    assert curves is not None
    unit = display_unit(variable.unit)
    time = Axis("time", "s")
    reference = Curve("reference", *_held(curves), MUTED, width=1.2)
    colour = VERMILLION if variable.outside else MUTED
    whole = Panel(
        variable.name, time, Axis(variable.name, unit), [reference, Curve("result", curves.time, curves.values, BLUE)],
        [Level(variable.time, "worst", upright=True, colour=colour, dash="dotted")],
        [Band("tolerance", curves.lower, curves.upper, curves.time, GREEN), *_shaded(curves, slice(None))],
        linked=variable.name,
    )  # fmt: skip
    part = _around(variable, curves)
    near = curves.time[part]
    expected = along(curves.reference_time, curves.reference, near)
    left = [Curve("result", near, curves.values[part] - expected, BLUE)]
    band = Band("tolerance", curves.lower[part] - expected, curves.upper[part] - expected, near, GREEN)
    marks = []
    if np.isfinite(variable.value):
        there = variable.value - along(curves.reference_time, curves.reference, np.array([variable.time]))
        marks = [Mark(variable.time, float(there[0]), "", colour)]
    detail = Panel(_worst(variable), time, Axis("less the reference", unit), left, [Level(0.0, dash="")],
                   [band, *_shaded(curves, part)], marks)  # fmt: skip
    return [whole, detail]


def _held(curves: Curves) -> tuple[Array, Array]:
    """The reference, as steps where it is held."""
    if not curves.hold:
        return curves.reference_time, curves.reference
    return np.repeat(curves.reference_time, 2)[1:], np.repeat(curves.reference, 2)[:-1]


def _shaded(curves: Curves, part: slice) -> list[Band]:
    return [Band("outside", -FAR, FAR, np.array(ends), VERMILLION) for ends in _spans(curves, part)]


def _around(variable: Variable, curves: Curves) -> slice:
    """Rows about the worst instant: some tolerances in time wide, so that the tube can be read."""
    worst = int(np.argmin(np.abs(curves.time - variable.time)))
    step = float(np.ptp(curves.time)) / max(1, len(curves.time) - 1)
    rows = AROUND + int(min(3 * variable.reach / step, 2000)) if step > 0 else AROUND
    return slice(max(0, worst - rows), worst + rows + 1)


def _worst(variable: Variable) -> str:
    off = f"{variable.deviation:.3g} of {variable.allowed:.3g} {display_unit(variable.unit)}".strip()
    return (minus(powers(off)) if np.isfinite(variable.deviation) else "no number") + f" at {variable.time:.6g} s"


def _whole(axes: Axes, variable: Variable, curves: Curves) -> None:
    _band(axes, curves, slice(None))
    _outside(axes, curves, slice(None))
    axes.plot(*thinned(curves.reference_time, curves.reference), color=MUTED, linewidth=1.1, label="reference",
              drawstyle="steps-post" if curves.hold else "default")  # fmt: skip
    axes.plot(*thinned(curves.time, curves.values), color=BLUE, linewidth=1.3, label="result")
    axes.axvline(variable.time, color=VERMILLION if variable.outside else MUTED, linewidth=0.9, linestyle=(0, (1, 2)))
    unit = display_unit(variable.unit)
    axes.set_ylabel(f"{variable.name} [{unit}]" if unit else variable.name)
    axes.margins(x=0.01)
    heading(axes, variable.name)
    legend_above(axes)


def _near(axes: Axes, variable: Variable, curves: Curves) -> None:
    part = _around(variable, curves)
    time = curves.time[part]
    expected = along(curves.reference_time, curves.reference, time)
    axes.fill_between(
        time, curves.lower[part] - expected, curves.upper[part] - expected, color=GREEN, alpha=SHADE, lw=0
    )
    _outside(axes, curves, part)
    axes.axhline(0.0, color=MUTED, linewidth=1.1)
    axes.plot(time, curves.values[part] - expected, color=BLUE, linewidth=1.3, marker=".", markersize=3)
    if np.isfinite(variable.value):
        there = variable.value - along(curves.reference_time, curves.reference, np.array([variable.time]))
        colour = VERMILLION if variable.outside else BLUE
        axes.plot([variable.time], there, color=colour, marker="o", markersize=6)
    unit = display_unit(variable.unit)
    heading(axes, _worst(variable))
    axes.set_ylabel(f"less the reference [{unit}]" if unit else "less the reference")
    axes.margins(x=0.01)


def _band(axes: Axes, curves: Curves, part: slice) -> None:
    time, lower, upper = thinned(curves.time[part], curves.lower[part], curves.upper[part])
    axes.fill_between(time, lower, upper, color=GREEN, alpha=SHADE, linewidth=0, label="tolerance")
    for edge in (lower, upper):
        axes.plot(time, edge, color=GREEN, linewidth=0.6, alpha=0.8)


def _outside(axes: Axes, curves: Curves, part: slice) -> None:
    """Shade the spans of time in which the result is outside."""
    for begin, end in _spans(curves, part):
        axes.axvspan(begin, end, color=VERMILLION, alpha=SHADE, linewidth=0)


def _spans(curves: Curves, part: slice) -> list[tuple[float, float]]:
    """Spans of time in which the result is outside, each as wide as can be seen."""
    time, y = curves.time[part], curves.values[part]
    with np.errstate(invalid="ignore"):
        out = ~((y >= curves.lower[part]) & (y <= curves.upper[part]))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(int), [0]])))
    spans = [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    width = (float(time[-1] - time[0]) if len(time) else 0.0) / 400
    merged: list[tuple[float, float]] = []
    for begin, end in spans:  # what lies closer than a line is wide is one
        if merged and begin - merged[-1][1] < width:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((begin, end))
    widened = ((begin, end, max(0.0, width - (end - begin)) / 2) for begin, end in merged)
    return [(begin - more, end + more) for begin, end, more in widened]


def reach_text(variable: Variable) -> str:
    """Tolerance in time for a table."""
    return seconds(variable.reach) if variable.reach else "–"
