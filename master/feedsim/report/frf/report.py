"""The report on frequency responses: its page, summary.json, frf.csv and frf_measured.csv."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.analysis.campaign import Campaign
from feedsim.analysis.responses import Responses
from feedsim.analysis.truncation import FULL, Truncation, deviation, structure_responses
from feedsim.files.trace.response import FrequencyResponse
from feedsim.files.trace.response_files import write_response
from feedsim.foundation.units import convert
from feedsim.linear.judgement import GAIN_MARGIN
from feedsim.linear.plant import TOOL_DIRECTIONS
from feedsim.report import content
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.content import (
    FOLDER,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import (
    BLUE,
    GREEN,
    MUTED,
    ORANGE,
    PURPLE,
    VERMILLION,
    Array,
    display_unit,
    minus,
    number,
    typeset,
)
from feedsim.report.frf.bode import Ordinate, answers
from feedsim.report.frf.bode_plots import nearest_to_its_limit, pictures_of
from feedsim.report.provenance import InputFile, hash_files, inputs_part, machine_part, quantity
from feedsim.report.results import Content
from feedsim.scenario import Drive, Subject
from feedsim.structure import Modes

# --- The full finite-element model against what was kept of it: responses and deviations in dB ------------------------


TABLES: tuple[tuple[str, Dash], ...] = (
    (BLUE, ""),
    (VERMILLION, "dashed"),
    (GREEN, "dotted"),
    (PURPLE, "dashed"),
    (ORANGE, ""),
)
MOST_COLUMNS = 3
SMALLEST_DEVIATION, LARGEST_DEVIATION = 1e-4, 100.0  # dB, of the axis of deviations
AGREEMENT_TOLERANCE = 0.1  # dB
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
            Panel(
                "",
                frequency,
                axis,
                off,
                [dropped, Level(AGREEMENT_TOLERANCE, f"{AGREEMENT_TOLERANCE:g} dB")],
                linked="f",
                height=0.8,
            )
        )
    caption = (
        "The structure alone, motors giving torque whatever the speed. Below: deviation of the magnitude from the "
        f"full model; dashed 0.1 dB, dotted the cut-off at {cutoff:g} Hz, above which modes were dropped. "
        "Dropped modes still yield statically: that is what the static correction returns."
    )
    title = f"Reduced models against the full finite-element model: {what}"
    return Picture(stem, title, caption, Chart([*above, *below], (1.0,) * len(columns)))


CURVES, MEASURED = "frf.csv", "frf_measured.csv"
FILES = (CURVES, MEASURED)  # besides report.html and summary.json
TILES = {  # figure of an axis -> label
    "speed.bandwidth_first": "speed loop, −3 dB first",
    "speed.bandwidth_last": "speed loop, −3 dB last",
    "speed.phase_margin": "speed loop, phase margin",
    "speed.gain_margin": "speed loop, gain margin",
    "position.bandwidth_first": "position loop, −3 dB",
    "position.gain_margin": "position loop, gain margin",
}
WORST_MARGINS = {"gain_margin": "gain margin", "phase_margin": "phase margin", "bandwidth_first": "bandwidth"}
AS_DECIBEL = ("gain_margin",)
MEASURED_PARTS = ("magnitude", "phase", "share")

FRF_FORMAT = 1


def files_of(responses: Responses) -> dict[str, Content]:
    """frf.csv (closed form), and frf_measured.csv where there is a measurement."""
    files: dict[str, Content] = {CURVES: partial(write_response, response=responses.closed)}
    if responses.campaign is not None:
        files[MEASURED] = partial(write_response, response=responses.campaign.response)
    return files


def draw(responses: Responses) -> list[Picture]:
    """The pictures; each says machine, pose and what its numbers are worth."""
    machine = responses.machine
    pose = ", ".join(f"{axis} {position * 1e3:.6g} mm" for axis, position in machine.pose.items())
    pictures = pictures_of(responses)
    if responses.truncation is not None:
        pictures += _truncation_pictures(responses, responses.truncation)
    return with_remark(pictures, f"{machine.name} at {pose}. {machine.note}")


def report_of(subject: Subject, responses: Responses, pictures: Sequence[Picture]) -> Report:
    """Content of the report."""
    low, high = responses.band
    measured = "closed form and measurement on the units" if responses.campaign else "closed form"
    return Report(
        f"Frequency responses: {subject.name}",
        f"{responses.machine.name} · axes {', '.join(responses.axes)} · {low:g} to {high:g} Hz · {measured}",
        warnings=responses.warnings,
        notes=subject.notes,
        answer=answers(responses),
        tiles=_tiles(responses),
        lead=nearest_to_its_limit(responses),
        next_step=_next_step(subject, responses),
        main=[*pictures, _resonances(responses), _agreement(responses), content.figures_section(responses.figures)],
        provenance=_provenance(subject, responses),
        footer=content.figures_footer(
            f"Values in full precision: summary.json; curves: frf.csv{', frf_measured.csv' * bool(responses.campaign)}."
        ),
    )


def _next_step(subject: Subject, responses: Responses) -> Step | None:
    """The drive tuned within margins, of a scenario; of a machine another gain of the axis nearest to its limit."""
    margins = {
        name.partition(".")[0]: figure.value
        for name, figure in reversed([*responses.figures.items()])
        if name.endswith("position.gain_margin")
    }
    axis = min(margins, key=lambda name: margins[name]) if margins else responses.axes[0]
    drive = responses.machine.axes[axis].drive
    if not isinstance(drive, Drive) or drive.K_v <= 0 or drive.K_p <= 0:
        return None
    if subject.scenario is not None:
        return Step(f"Tune the drive of {axis} within margins", "tune drive", {"scenario": subject.file, "axes": axis})
    factor = 1.1 if margins.get(axis, math.inf) > GAIN_MARGIN else 0.8
    gain = f"machine.axes.{axis}.drive.K_v={convert(factor * drive.K_v, '1/s', '(m/min)/mm'):.3g} (m/min)/mm"
    change = f"{'Raise' if factor > 1 else 'Lower'} K_v of {axis} by {abs(factor - 1):.0%}, and look again"
    return Step(change, "frf", {"set": [*subject.overrides, gain], "out": f"{FOLDER}_changed"})


def _tiles(responses: Responses) -> list[Tile]:
    """The least of each kind first, which says what is nearest to the limit; then all others by axis."""
    named = {f"{axis}.{key}": f"{axis}: {label}" for axis in responses.axes for key, label in TILES.items()}
    named = {name: label for name, label in named.items() if name in responses.figures}
    least = []
    for ending in WORST_MARGINS:
        own = [name for name in named if name.endswith(ending) and math.isfinite(responses.figures[name].value)]
        least += [min(own, key=lambda name: responses.figures[name].value)] if own else []
    tiles = []
    for name in [*least, *(name for name in named if name not in least)]:
        figure = shown = responses.figures[name]
        if name.rpartition(".")[2] in AS_DECIBEL and math.isfinite(figure.value) and figure.value > 0:
            shown = Figure(20 * math.log10(figure.value), "dB", figure.meaning)
        axis, loop, key = name.split(".")
        label = f"least {WORST_MARGINS[key]}, {loop} loop of {axis}" if name in least else named[name]
        tiles.append(Tile(_value(shown), label, typeset(figure.meaning)))
    return tiles


def _value(figure: Figure) -> str:
    if figure.unit in ("dB", "deg") and math.isfinite(figure.value):
        return minus(f"{figure.value:.1f} {display_unit(figure.unit)}")
    return tile_value(figure)


def _resonances(responses: Responses) -> Section | None:
    """Pairs of anti-resonance and resonance of n/M per axis."""
    rows = [
        (axis, f"{pair.antiresonance.frequency:.1f}", f"{pair.resonance.frequency:.1f}",
         f"{pair.resonance.value - pair.antiresonance.value:.1f}")
        for axis in responses.axes
        for pair in responses.result.axes[axis].pairs
        if pair.antiresonance.frequency <= responses.band[1]
    ]  # fmt: skip
    heads = ("Axis", "Anti-resonance [Hz]", "Resonance [Hz]", "Rise [dB]")
    note = "Of |n/M| J_tot ω, the speed-controlled system; pairs that rise by less than 1 dB are left out."
    return Section("Resonances", [Table("lrrr", heads, rows, note)]) if rows else None


def _agreement(responses: Responses) -> Section | None:
    """How far what was measured is from the closed form."""
    keys = [name.rpartition(".")[0] for name in responses.figures if name.endswith(".measured_magnitude")]
    if not keys:
        return None
    rows: list[tuple[Text, ...]] = [
        (code(key), *(number(responses.figures[f"{key}.measured_{part}"].value, 3) for part in MEASURED_PARTS))
        for key in keys
    ]
    note = (
        "Largest deviation of the measurement from the closed form, 5 to 500 Hz, over the lines whose coherence "
        "exceeds 0.99. The closed form knows no friction."
    )
    table = Table("lrrr", ("Response", "Magnitude [dB]", "Phase [°]", "Lines that count [%]"), rows, note)
    return Section("Measured against closed form", [table])


def _provenance(subject: Subject, responses: Responses) -> Section:
    campaign = responses.campaign
    in_scenario = [("Set in the scenario", ", ".join(subject.settings) or "nothing")]
    rows = [
        (subject.kind.capitalize(), f"{subject.name} ({subject.file.name})"),
        *(in_scenario if subject.kind == "scenario" else []),
        ("Set on the command line", ", ".join(subject.overrides) or "nothing"),
        ("Machine", responses.machine.name),
        ("Closed form", "linear, exact for the sampled system, no friction, no limits"),
        ("Measurement", _describe_campaign(campaign) if campaign else "none"),
        *(
            (
                entry.reference,
                f"RMS {entry.rms:.4g} {display_unit(entry.unit)}, peak {entry.peak:.4g}, {entry.lines} lines, "
                f"period {entry.period:g} s",
            )
            for entry in (campaign.excited if campaign else ())
        ),
    ]
    archives = content.archives_table(campaign.units) if campaign else None
    return content.provenance_section(
        rows, input_files(subject, responses), archives, content.parameters_section(responses.machine)
    )


def _describe_campaign(campaign: Campaign) -> str:
    plan = campaign.plan
    friction = "friction on" if plan.friction else "friction off"
    moving = f"axis moving at {plan.offset_speed:g} rad/s" if plan.offset_speed else "axes at rest"
    signal = "pseudo-random binary sequence" if plan.signal == "prbs" else "multisine"
    return (
        f"{signal} into {plan.inject}, {plan.realisations} realisation(s) of {plan.periods} period(s) after "
        f"{plan.settle} to settle, seed {plan.seed}, {friction}, {moving}; {campaign.simulated:.4g} s in "
        f"{campaign.wall_time:.3g} s"
    )


def _truncation_pictures(responses: Responses, truncation: Truncation) -> list[Picture]:
    low, high = responses.band
    frequency = responses.closed.frequency
    within = frequency[(frequency >= low) & (frequency <= max(high, 1.2 * truncation.cutoff))]
    axes = tuple(responses.machine.axes)
    tool = any(name.startswith("tool.") for name in responses.closed)
    return truncation_pictures(truncation.tables, axes, within, truncation.cutoff, shown=responses.axes, tool=tool)


def input_files(subject: Subject, responses: Responses) -> list[InputFile]:
    """Files of the scenario or machine, and the curves laid over."""
    return hash_files([*subject.files, *(("overlay", overlay.file) for overlay in responses.overlays)])


def details(subject: Subject, responses: Responses) -> dict[str, Any]:
    """What summary.json has besides the figures; a figure that could not be determined has the value null."""
    return {
        "format": FRF_FORMAT,
        "subject": {
            "kind": subject.kind,
            "name": subject.name,
            "file": subject.file.name,
            "notes": list(subject.notes),
            "set": list(subject.settings),
            "overrides": list(subject.overrides),
        },
        "closed_form": {
            "band": quantity(list(responses.band), "Hz"),
            "frequencies": len(responses.closed),
            "responses": {name: {"unit": responses.closed.unit(name)} for name in responses.closed},
        },
        "measurement": _measurement(responses.campaign) if responses.campaign is not None else None,
        "overlays": [
            {"response": overlay.name, "file": overlay.file.name, "unit": overlay.response.unit(overlay.name)}
            for overlay in responses.overlays
        ],
        "machine": machine_part(responses.machine),
        "inputs": inputs_part(input_files(subject, responses)),
        "units": {name: dict(unit) for name, unit in responses.campaign.units.items()} if responses.campaign else {},
    }


def _measurement(campaign: Campaign) -> dict[str, Any]:
    plan = campaign.plan
    return {
        "signal": plan.signal,
        "inject": plan.inject,
        "band": quantity(list(plan.band), "Hz"),
        "periods": plan.periods,
        "periods_to_settle": plan.settle,
        "realisations": plan.realisations,
        "seed": plan.seed,
        "friction": plan.friction,
        "offset_speed": quantity(plan.offset_speed, "rad/s"),
        "frequencies": len(campaign.response),
        "responses": {name: {"unit": campaign.response.unit(name)} for name in campaign.response},
        "excited": {
            entry.reference: {
                "rms": quantity(entry.rms, entry.unit),
                "peak": quantity(entry.peak, entry.unit),
                "lines": entry.lines,
                "period": quantity(entry.period, "s"),
            }
            for entry in campaign.excited
        },
        "simulated": quantity(campaign.simulated, "s"),
        "wall_time": quantity(campaign.wall_time, "s"),
    }
