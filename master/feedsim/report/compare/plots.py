"""Pictures of a comparison: the tube around the reference, the result, and where it is outside."""

from __future__ import annotations

import numpy as np

from feedsim.compare import Comparison, Curves, Variable, along, seconds
from feedsim.report.chart import Axis, Band, Chart, Curve, Level, Mark, Panel
from feedsim.report.formatting import display_unit, minus, powers
from feedsim.report.picture import Picture
from feedsim.report.style import ALLOWED, MUTED, RECORDED, RESIDUAL_COLOUR, SIMULATED, Array

MAX_VARIABLES = 4  # variables in a picture
ROWS_AROUND_WORST = 60  # rows of the result to either side of the worst one
OFF_PANEL = 1e30  # beyond every panel


def drawn(comparison: Comparison) -> list[Variable]:
    """Variables that are drawn: the worst ones outside, else the one nearest to its limit."""
    kept = [variable for variable in comparison.variables if variable.curves is not None]
    outside = [variable for variable in kept if variable.verdict == "different"]
    ranked = sorted(outside or kept, key=lambda variable: (-variable.ratio, -variable.deviation))
    return ranked[: MAX_VARIABLES if outside else 1]


def picture_of(comparison: Comparison, number: int) -> Picture | None:
    """The worst variables over the whole time and around the worst instant; None where nothing was compared."""
    variables = drawn(comparison)
    if not variables:
        return None
    outside = len(comparison.those("different"))
    shown = f"the {len(variables)} worst of {outside} variables outside" if outside > len(variables) else ""
    title = f"{comparison.result} against {comparison.reference}"
    caption = (
        "A pair of panels per variable: the compared time; around the worst instant, result and band "
        "less the reference. The band is the tolerance around the reference; where the result leaves it, "
        "the ground is shaded." + (f" Drawn are {shown}." if shown else "")
    )
    panels = [panel for variable in variables for panel in _panels(variable)]
    return Picture(f"comparison-{number}", title, caption, Chart(panels, (1.5, 1.0)))


def _panels(variable: Variable) -> list[Panel]:
    """The whole time, and result and band less the reference around the worst instant."""
    curves = variable.curves
    assert curves is not None
    unit = display_unit(variable.unit)
    time = Axis("time", "s")
    reference = Curve("reference", *_as_steps(curves), RECORDED, width=1.2)
    colour = RESIDUAL_COLOUR if variable.outside else MUTED
    whole = Panel(
        variable.name, time, Axis(variable.name, unit),
        [reference, Curve("result", curves.time, curves.values, SIMULATED)],
        [Level(variable.time, "worst", upright=True, colour=colour, dash="dotted")],
        [Band("tolerance", curves.lower, curves.upper, curves.time, ALLOWED), *_shaded(curves, slice(None))],
        linked=variable.name,
    )  # fmt: skip
    part = _around(variable, curves)
    near = curves.time[part]
    expected = along(curves.reference_time, curves.reference, near)
    difference = [Curve("result", near, curves.values[part] - expected, SIMULATED)]
    band = Band("tolerance", curves.lower[part] - expected, curves.upper[part] - expected, near, ALLOWED)
    marks = []
    if np.isfinite(variable.value):
        there = variable.value - along(curves.reference_time, curves.reference, np.array([variable.time]))
        marks = [Mark(variable.time, float(there[0]), "", colour)]
    detail = Panel(_worst(variable), time, Axis("less the reference", unit), difference, [Level(0.0, dash="")],
                   [band, *_shaded(curves, part)], marks)  # fmt: skip
    return [whole, detail]


def _as_steps(curves: Curves) -> tuple[Array, Array]:
    """The reference, as steps where it is held."""
    if not curves.hold:
        return curves.reference_time, curves.reference
    return np.repeat(curves.reference_time, 2)[1:], np.repeat(curves.reference, 2)[:-1]


def _shaded(curves: Curves, part: slice) -> list[Band]:
    return [Band("outside", -OFF_PANEL, OFF_PANEL, np.array(ends), RESIDUAL_COLOUR) for ends in _spans(curves, part)]


def _around(variable: Variable, curves: Curves) -> slice:
    """Rows about the worst instant: some tolerances in time wide, so that the tube can be read."""
    worst = int(np.argmin(np.abs(curves.time - variable.time)))
    step = float(np.ptp(curves.time)) / max(1, len(curves.time) - 1)
    rows = ROWS_AROUND_WORST + int(min(3 * variable.reach / step, 2000)) if step > 0 else ROWS_AROUND_WORST
    return slice(max(0, worst - rows), worst + rows + 1)


def _worst(variable: Variable) -> str:
    off = f"off by {variable.deviation:.3g}, allowed {variable.allowed:.3g} {display_unit(variable.unit)}".strip()
    return minus(powers(off)) if np.isfinite(variable.deviation) else "no number"


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
