"""What identification leaves open, in reports: intervals of figures, bands of curves, what was drawn; bands.csv."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files import sheets
from feedsim.report.chart import Axis, Band, Chart, Curve, Panel
from feedsim.report.content import Part, Picture, Report, Section, Table, Text, code
from feedsim.report.formatting import SIMULATED_COLOUR, display_unit, minus, typeset
from feedsim.report.provenance import quantity

if TYPE_CHECKING:
    from feedsim.design.uncertainty import Band as Spread
    from feedsim.design.uncertainty import Cloud, KnownValues, Uncertainty

BANDS = "bands.csv"


def intervals_section(uncertainty: Uncertainty, figures: Mapping[str, Figure]) -> Section:
    """Every figure with its interval."""
    rows: list[tuple[Text, ...]] = []
    for name, (low, high) in uncertainty.figures.items():
        figure = figures[name]
        ends = (_number(low), _number(high)) if math.isfinite(low) else ("not determined", "")
        rows.append((code(name), _number(figure.value), *ends, typeset(figure.unit)))
    note = (
        f"{uncertainty.count} draws of the machine from the intervals and correlations of its identified values. "
        f"The interval holds {100 * uncertainty.share:.0f} % of further draws. "
        "A figure that some draws do not have is not determined."
    )
    return Section(
        "What identification leaves open",
        [
            Table("lrrrl", ("Figure", "Value", "From", "To", "Unit"), rows, note),
            drawn_values(uncertainty.cloud, uncertainty.sets),
        ],
    )


def drawn_values(cloud: Cloud, sets: Mapping[str, KnownValues] | None = None) -> Table:
    """What was drawn. sets: axis -> what is known of the set that compensates, where that is drawn too."""
    from feedsim.design.uncertainty import unit_of  # a run without draws does not load them

    rows: list[tuple[Text, ...]] = []
    known_ones = [
        *cloud.known.items(),
        *((f"{axis}, compensation", known) for axis, known in (sets or {}).items()),
    ]
    for axis, known in known_ones:
        for name, mean, sigma in zip(known.names, known.mean, known.sigma, strict=True):
            half = NORMAL_95 * sigma
            rows.append((axis, code(name), _number(mean), _number(half), display_unit(unit_of(name))))
        rows += [(axis, code(name), "set otherwise", "–", display_unit(unit_of(name))) for name in known.fixed]
    note = "Values that were set otherwise than identified do not vary, nor do those without an interval."
    return Table("llrrl", ("Axis", "Drawn", "Value", "± (95 %)", "Unit"), rows, note)


def pictures_of(uncertainty: Uncertainty, of: Mapping[str, str] | None = None) -> list[Picture]:
    """A band for every circle and stop. of: prefix -> its words."""
    return [_picture(band, uncertainty, (of or {}).get(band.prefix, band.prefix)) for band in uncertainty.bands]


def _picture(band: Spread, uncertainty: Uncertainty, name: str) -> Picture:
    if band.kind == "contour":
        order = np.argsort(band.at % (2 * math.pi), kind="stable")
        x = np.degrees(band.at % (2 * math.pi))[order]
        across = Axis("angle from the first axis", "°", span=(0.0, 360.0))
        up, what = "radius deviation", "Contour"
    else:
        order, x = np.arange(len(band.at)), 1e3 * band.at
        across, up, what = Axis("time since the end of the motion", "ms"), "position beyond the target", "Stop"
    low, high, nominal = (1e6 * values[order] for values in (band.low, band.high, band.nominal))
    panel = Panel(
        "", across, Axis(up, "µm"), [Curve("machine as it is", x, nominal, SIMULATED_COLOUR)],
        bands=[Band(f"{100 * uncertainty.share:.0f} % of draws", low, high, x, SIMULATED_COLOUR)],
    )  # fmt: skip
    stem = f"band-{band.prefix.replace('#', '-').replace(' ', '-')}-{band.kind}"
    return Picture(
        stem, f"{what} of {name}, with what identification leaves open",
        f"Band: {100 * uncertainty.share:.0f} % of draws of the machine, point by point; {uncertainty.count} draws.",
        Chart([panel]),
    )  # fmt: skip


def answers(uncertainty: Uncertainty, figures: Mapping[str, Figure], leading: Sequence[str]) -> list[str]:
    """The leading figures with their intervals, in a sentence."""
    result = []
    for name in leading:
        low, high = uncertainty.figures.get(name, (math.nan, math.nan))
        if math.isfinite(low):
            result.append(f"{name} {low:.4g} to {high:.4g} {figures[name].unit}")
    if not result:
        return []
    of = f"{100 * uncertainty.share:.0f} %, {uncertainty.count} draws"
    return [f"With what identification leaves open: {', '.join(result)} ({of})."]


def bands_csv(uncertainty: Uncertainty) -> str:
    """All bands as CSV: which, abscissa, value, and the ends of the interval [um]."""
    rows: list[Sequence[str]] = [["of", "curve", "angle [deg] or time [ms]", "value [um]", "from [um]", "to [um]"]]
    for band in uncertainty.bands:
        at = np.degrees(band.at) if band.kind == "contour" else 1e3 * band.at
        for row in zip(at, *(1e6 * values for values in (band.nominal, band.low, band.high)), strict=True):
            rows.append([band.prefix, band.kind, *(f"{value:.6g}" for value in row)])
    return sheets.text_of(rows)


def summary_part(uncertainty: Uncertainty, figures: Mapping[str, Figure]) -> dict[str, Any]:
    """Of summary.json."""
    from feedsim.design.uncertainty import unit_of

    return {
        "draws": uncertainty.count,
        "share": uncertainty.share,
        "figures": {
            name: quantity([low, high] if math.isfinite(low) else None, figures[name].unit)
            for name, (low, high) in uncertainty.figures.items()
        },
        "drawn": {
            axis: {
                name: quantity([float(m - NORMAL_95 * s), float(m + NORMAL_95 * s)], unit_of(name))
                for name, m, s in zip(known.names, known.mean, known.sigma, strict=True)
            }
            for axis, known in uncertainty.cloud.known.items()
        },
        "drawn_compensation": sorted(uncertainty.sets),
        "set_otherwise": {axis: list(known.fixed) for axis, known in uncertainty.cloud.known.items() if known.fixed},
    }


def _number(value: float) -> str:
    return minus(f"{value:.4g}") if math.isfinite(value) else "not determined"


def with_intervals(
    report: Report, uncertainty: Uncertainty, figures: Mapping[str, Figure], leading: Sequence[str]
) -> Report:
    """A report with the intervals of a run ahead of all else. leading: names of figures that the answer has."""
    more: list[Part | None] = [*pictures_of(uncertainty), intervals_section(uncertainty, figures)]
    return replace(report, answer=[*report.answer, *answers(uncertainty, figures, leading)], main=[*more, *report.main])
