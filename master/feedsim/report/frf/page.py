"""report.html of frequency responses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

from feedsim.analysis import Figure
from feedsim.analysis.campaign import Campaign
from feedsim.analysis.responses import Responses
from feedsim.report.frame import Tile, frame, picture_section, tile_value
from feedsim.report.frf.summary import input_files
from feedsim.report.parts import software
from feedsim.report.style import Picture
from feedsim.report.tables import archives_table, figures_table, files_table, pairs_table, parameters_table, table
from feedsim.report.words import display_unit, minus, typeset
from feedsim.scenario import Subject

TILES = {  # figure of an axis -> label
    "speed.bandwidth_first": "speed loop, −3 dB first",
    "speed.bandwidth_last": "speed loop, −3 dB last",
    "speed.phase_margin": "speed loop, phase margin",
    "speed.gain_margin": "speed loop, gain margin",
    "position.bandwidth_first": "position loop, −3 dB",
    "position.gain_margin": "position loop, gain margin",
}
AS_DECIBEL = ("gain_margin",)


def page(subject: Subject, responses: Responses, pictures: Sequence[Picture]) -> str:
    """HTML text of the report."""
    low, high = responses.band
    measured = "closed form and measurement on the units" if responses.campaign else "closed form"
    return frame(
        f"Frequency responses: {subject.name}",
        f"{responses.machine.name} · axes {', '.join(responses.axes)} · {low:g} to {high:g} Hz · {measured}",
        warnings=responses.warnings,
        notes=subject.notes,
        tiles=list(_tiles(responses)),
        main=[
            *(picture_section(picture) for picture in pictures),
            _resonances(responses),
            _agreement(responses),
            figures_table(responses.figures),
            _provenance(subject, responses),
        ],
        footer='What each figure means stands beside it in the table <a href="#figures">Derived figures</a>; the full '
        "definitions come with the software (docs/figures.md). Values in full precision: summary.json; curves: frf.csv"
        f"{', frf_measured.csv' if responses.campaign else ''}.",
    )


def _tiles(responses: Responses) -> Iterable[Tile]:
    for axis in responses.axes:
        for key, label in TILES.items():
            if (figure := responses.figures.get(f"{axis}.{key}")) is not None:
                shown = figure
                if key.rpartition(".")[2] in AS_DECIBEL and math.isfinite(figure.value) and figure.value > 0:
                    shown = Figure(20 * math.log10(figure.value), "dB", figure.meaning)
                yield Tile(_value(shown), f"{axis}: {label}", typeset(figure.meaning))


def _value(figure: Figure) -> str:
    if figure.unit in ("dB", "deg") and math.isfinite(figure.value):
        return minus(f"{figure.value:.1f} {display_unit(figure.unit)}")
    return tile_value(figure)


def _resonances(responses: Responses) -> str:
    """Pairs of anti-resonance and resonance of n/M per axis."""
    rows = [
        f'<tr><td>{escape(axis)}</td><td class="number">{pair.antiresonance.frequency:.1f}</td>'
        f'<td class="number">{pair.resonance.frequency:.1f}</td>'
        f'<td class="number">{pair.resonance.value - pair.antiresonance.value:.1f}</td></tr>'
        for axis in responses.axes
        for pair in responses.result.axes[axis].pairs
        if pair.antiresonance.frequency <= responses.band[1]
    ]
    heads = [("Axis", False), ("Anti-resonance [Hz]", True), ("Resonance [Hz]", True), ("Rise [dB]", True)]
    note = (
        '<p class="muted">Of |n/M| J_tot ω, the speed-controlled system; pairs that rise by less than 1 dB are left '
        "out.</p>"
    )
    return "<h2>Resonances</h2>\n" + table(heads, rows) + note if rows else ""


def _agreement(responses: Responses) -> str:
    """How far what was measured is from the closed form."""
    keys = [name.rpartition(".")[0] for name in responses.figures if name.endswith(".measured_magnitude")]
    if not keys:
        return ""
    rows = []
    for key in keys:
        values = [responses.figures[f"{key}.measured_{part}"].value for part in ("magnitude", "phase", "share")]
        cells = "".join(
            f'<td class="number">{minus(f"{value:.3g}") if math.isfinite(value) else "–"}</td>' for value in values
        )
        rows.append(f"<tr><td><code>{escape(key)}</code></td>{cells}</tr>")
    heads = [("Response", False), ("Magnitude [dB]", True), ("Phase [°]", True), ("Lines that count [%]", True)]
    note = (
        '<p class="muted">Largest deviation of the measurement from the closed form, 5 to 500 Hz, over the lines whose '
        "coherence exceeds 0.99. The closed form knows no friction.</p>"
    )
    return "<h2>Measured against closed form</h2>\n" + table(heads, rows) + note


def _provenance(subject: Subject, responses: Responses) -> str:
    rows = [
        (subject.kind.capitalize(), f"{subject.name} ({subject.file.name})"),
        ("Set in the scenario", ", ".join(subject.settings) or "nothing"),
        ("Set on the command line", ", ".join(subject.overrides) or "nothing"),
        ("Machine", responses.machine.name),
        ("Closed form", "linear, exact for the sampled system, no friction, no limits"),
        ("Measurement", _measured(responses.campaign) if responses.campaign else "none"),
        *((each.reference, f"RMS {each.rms:.4g} {display_unit(each.unit)}, peak {each.peak:.4g}, {each.lines} lines, "
           f"period {each.period:g} s") for each in (responses.campaign.excited if responses.campaign else ())),
        ("Software", ", ".join(f"{name} {text}" for name, text in software().items())),
    ]  # fmt: skip
    if subject.kind != "scenario":
        del rows[1]
    parts = [
        '<section class="provenance">\n<h2>Where the numbers come from</h2>',
        pairs_table(rows),
        files_table(input_files(subject, responses)),
        archives_table(responses.campaign.units) if responses.campaign else "",
        parameters_table(responses.machine),
        "</section>",
    ]
    return "\n".join(part for part in parts if part)


def _measured(campaign: Campaign) -> str:
    plan = campaign.plan
    friction = "friction on" if plan.friction else "friction off"
    moving = f"axis moving at {plan.offset_speed:g} rad/s" if plan.offset_speed else "axes at rest"
    signal = "pseudo-random binary sequence" if plan.signal == "prbs" else "multisine"
    return (
        f"{signal} into {plan.inject}, {plan.realisations} realisation(s) of {plan.periods} period(s) after "
        f"{plan.settle} to settle, seed {plan.seed}, {friction}, {moving}; {campaign.simulated:.4g} s in "
        f"{campaign.wall_time:.3g} s"
    )
