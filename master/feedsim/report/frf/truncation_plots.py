"""The full finite-element model against what was kept of it: responses and deviations in dB."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feedsim.analysis.truncation import FULL, deviation, structure_responses
from feedsim.linear.plant import TOOL_DIRECTIONS
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.frf.bode import Ordinate
from feedsim.report.picture import Picture
from feedsim.report.style import BLUE, GREEN, MUTED, ORANGE, PURPLE, VERMILLION, Array
from feedsim.structure import Modes
from feedsim.trace.response import FrequencyResponse

TABLES: tuple[tuple[str, Dash], ...] = (
    (BLUE, ""),
    (VERMILLION, "dashed"),
    (GREEN, "dotted"),
    (PURPLE, "dashed"),
    (ORANGE, ""),
)
MOST_COLUMNS = 3
SMALLEST_DEVIATION, LARGEST_DEVIATION = 1e-4, 100.0  # dB, of the axis of deviations
AGREED = 0.1  # dB
PLOTTED_QUANTITIES = (  # stem, title, what is drawn per axis, ordinate
    ("truncation-n_M", "n/M", "{0}.n_a/{0}.M_a", Ordinate("|n_a/M_a|", "dB re 1 (rad/s)/(N·m)")),
    ("truncation-x_M", "x/M", "{0}.x_a/{0}.M_a", Ordinate("|x_a/M_a|", "µm/(N·m)", decibel=False, scale=1e6)),
    ("truncation-tool", "compliance at the tool", "tool.x_{0}/tool.F_{0}",
     Ordinate("|x_tool/F|", "µm/N", decibel=False, scale=1e6)),
)  # fmt: skip


def truncation_pictures(
    tables: Mapping[str, Modes],
    axes: Sequence[str],
    frequency: Array,
    cutoff: float,
    *,
    shown: Sequence[str] | None = None,
    tool: bool = True,
) -> list[Picture]:
    """n/M, x/M and the compliance at the tool of every mode table, and their deviations from the full model.

    Args:
        tables: name -> modes, such as "reduced", "with static correction"; "full" is what they are held against.
        axes: of the machine, in its order.
        frequency: (F,) [Hz].
        cutoff: frequency [Hz] above which modes were dropped, for a mark.
        shown: axes that are drawn; None: all.
        tool: with the compliance at the tool.
    """
    responses = {name: structure_responses(modes, axes, frequency) for name, modes in tables.items()}
    pictures = []
    for stem, what, response, ordinate in PLOTTED_QUANTITIES:
        at_tool = response.startswith("tool")
        if at_tool and not tool:
            continue
        names = list(TOOL_DIRECTIONS) if at_tool else list(shown or axes)
        for k in range(0, len(names), MOST_COLUMNS):
            part = names[k : k + MOST_COLUMNS]
            suffix = "" if len(names) <= MOST_COLUMNS else f"-{'-'.join(part)}"
            columns = {name: response.format(name) for name in part}
            pictures.append(_picture(responses, columns, ordinate, cutoff, stem + suffix, what))
    return pictures


def _picture(
    responses: Mapping[str, FrequencyResponse],
    columns: Mapping[str, str],
    ordinate: Ordinate,
    cutoff: float,
    stem: str,
    what: str,
) -> Picture:
    full = responses[FULL]
    frequency = Axis("frequency", "Hz", log=True, span=(float(full.frequency[0]), float(full.frequency[-1])))
    dropped = Level(cutoff, "cut-off", upright=True, dash="dotted")
    above, below = [], []
    for title, name in columns.items():
        curves = [Curve(FULL, full.frequency, ordinate.of(full[name]), MUTED, width=2.6, faint=True)]
        off = []
        others = {model: response for model, response in responses.items() if model != FULL}
        for (colour, dash), (model, response) in zip(TABLES, others.items(), strict=False):
            curves.append(Curve(model, response.frequency, ordinate.of(response[name]), colour, dash, 1.2))
            size = np.maximum(np.abs(deviation(response, full, name)), SMALLEST_DEVIATION)
            off.append(Curve(model, full.frequency, size, colour, dash, 1.2))
        heading = f"{'Direction' if name.startswith('tool') else 'Axis'} {title}"
        axis = Axis(ordinate.label, ordinate.unit, log=not ordinate.decibel)
        above.append(Panel(heading, frequency, axis, curves, [dropped], linked="f"))
        axis = Axis("deviation", "dB", log=True, span=(SMALLEST_DEVIATION, LARGEST_DEVIATION))
        below.append(
            Panel("", frequency, axis, off, [dropped, Level(AGREED, f"{AGREED:g} dB")], linked="f", height=0.8)
        )
    caption = (
        "The structure alone, motors giving torque whatever the speed. Below: deviation of the magnitude from the "
        f"full model; dashed 0.1 dB, dotted the cut-off at {cutoff:g} Hz, above which modes were dropped. "
        "Dropped modes still yield statically: that is what the static correction returns."
    )
    title = f"Reduced models against the full finite-element model: {what}"
    return Picture(stem, title, caption, Chart([*above, *below], (1.0,) * len(columns)))
