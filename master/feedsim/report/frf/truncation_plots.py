"""The full finite-element model against what was kept of it: responses and deviations in dB."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.analysis.truncation import FULL, deviation, structure_responses
from feedsim.linear.plant import TOOL_DIRECTIONS
from feedsim.report.frf.bode import Ordinate, frequency_axis
from feedsim.report.frf.charts import truncation_chart
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import BLUE, GREEN, MUTED, ORANGE, PURPLE, VERMILLION, Array, Drawn, drawing, finish
from feedsim.structure import Modes
from feedsim.trace.response import FrequencyResponse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLES: list[dict[str, Any]] = [
    {"color": BLUE, "linestyle": "-", "linewidth": 1.2},
    {"color": VERMILLION, "linestyle": (0, (5, 1.5)), "linewidth": 1.2},
    {"color": GREEN, "linestyle": (0, (2, 1.2)), "linewidth": 1.2},
    {"color": PURPLE, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 1.2},
    {"color": ORANGE, "linestyle": "-", "linewidth": 1.2},
]
MOST_COLUMNS = 3
FINEST, COARSEST = 1e-4, 100.0  # dB, of the axis of deviations
AGREED = 0.1  # dB
QUANTITIES = (  # stem, title, what is drawn per axis, ordinate
    ("truncation-n_M", "n/M", "{0}.n_a/{0}.M_a", Ordinate("$|n_a/M_a|$ [dB re 1 (rad/s)/(N·m)]")),
    ("truncation-x_M", "x/M", "{0}.x_a/{0}.M_a", Ordinate("$|x_a/M_a|$ [µm/(N·m)]", decibel=False, scale=1e6)),
    ("truncation-tool", "compliance at the tool", "tool.x_{0}/tool.F_{0}",
     Ordinate("$|x_{tool}/F|$ [µm/N]", decibel=False, scale=1e6)),
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
    for stem, what, response, ordinate in QUANTITIES:
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
    others = [(name, response) for name, response in responses.items() if name != FULL]

    off = {
        (title, model): np.maximum(np.abs(deviation(response, full, name)), FINEST)
        for title, name in columns.items()
        for model, response in others
    }

    def draw() -> Drawn:
        with drawing(max(4.0 * len(columns), 9.0), 6.0) as figure:
            rooms = figure.subplots(2, len(columns), sharex="all", sharey="row", squeeze=False, height_ratios=[1.5, 1])
            for j, (title, name) in enumerate(columns.items()):
                above, below = rooms[0, j], rooms[1, j]
                heading(above, f"{'Direction' if name.startswith('tool') else 'Axis'} {title}")
                above.plot(full.frequency, ordinate.of(full[name]), color=MUTED, linewidth=2.6, alpha=0.6, label=FULL)
                for style, (model, response) in zip(STYLES, others, strict=False):
                    above.plot(response.frequency, ordinate.of(response[name]), label=model, **style)
                    size = off[title, model]
                    below.plot(response.frequency, size, **style)
                for room in (above, below):
                    room.axvline(cutoff, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)))
                below.axhline(AGREED, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)))
                below.set_xlabel("frequency [Hz]")
                legend_above(above)
            _axes(rooms[0, 0], rooms[1, 0], full, ordinate)
            for room in rooms[0]:
                frequency_axis(room)
            return finish(figure, stem, f"Reduced models against the full finite-element model: {what}", caption)

    caption = (
        "The structure alone, motors giving torque whatever the speed. Below: deviation of the magnitude from the "
        f"full model; dashed 0.1 dB, dotted the cut-off at {cutoff:g} Hz, above which modes were dropped. "
        "Dropped modes still yield statically: that is what the static correction returns."
    )
    chart = truncation_chart(full, others, columns, off, ordinate, cutoff, AGREED, (FINEST, COARSEST))
    return Picture(stem, f"Reduced models against the full finite-element model: {what}", caption, draw, chart)


def _axes(above: Axes, below: Axes, full: FrequencyResponse, ordinate: Ordinate) -> None:
    from matplotlib.ticker import FuncFormatter

    plain = FuncFormatter(lambda value, _: f"{value:g}")
    if not ordinate.decibel:
        above.set_yscale("log")
        above.yaxis.set_major_formatter(plain)
    above.set_ylabel(ordinate.label)
    above.set_xscale("log")
    above.set_xlim(float(full.frequency[0]), float(full.frequency[-1]))
    below.set_yscale("log")
    below.set_ylim(FINEST, COARSEST)
    below.yaxis.set_major_formatter(plain)
    below.set_ylabel("deviation [dB]")
