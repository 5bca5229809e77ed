"""The report of a replay: its page, summary.json and replay.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.analysis.proposals import Proposal
from feedsim.estimation.identify import Provenance
from feedsim.estimation.identify.read import recording_day
from feedsim.estimation.replay.compare import TO_RPM, Comparison
from feedsim.files.trace import Mark, Trace
from feedsim.foundation.errors import Finding
from feedsim.report.changes import change_lines, changes_part, changes_section, control_section
from feedsim.report.chart import Axis, Chart, Curve, Dash, Level, Panel
from feedsim.report.content import (
    Picture,
    Report,
    Section,
    Step,
    Table,
    Tile,
    figures_footer,
    figures_section,
    parameters_section,
    provenance_section,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import RECORDED_COLOUR, RESIDUAL_COLOUR, SIMULATED_COLOUR, Array, typeset
from feedsim.report.provenance import hash_files, inputs_part, machine_part, quantity
from feedsim.scenario import Subject

# --- The pictures of a replay: an axis beside its record, and what is left --------------------------------------------


SHOWN_UNITS = {"m": (1e6, "µm"), "rad/s": (TO_RPM, "rpm"), "N.m": (1.0, "N·m")}
MOST_PLOTTED_MARKS = 25  # lines in a picture that can still be separated
MOST_NAMES, MAX_NAME_CHARACTERS = 9, 16  # names of them side by side in a panel, and their characters


def pictures_of(comparison: Comparison, marks: Sequence[Mark]) -> list[Picture]:
    """Over time, and what is left as a spectrum and over the position."""
    return [_over_time(comparison, marks), _residuals(comparison)]


def _over_time(comparison: Comparison, marks: Sequence[Mark]) -> Picture:
    axis_record = comparison.each
    rows = axis_record.rows
    time = axis_record.record.time[rows]
    channels = comparison.channels
    contour = axis_record.record.deviation is not None
    what, ordinate = ("Contour deviation", "deviation") if contour else ("Following error", "setpoint less position")
    lag = 1e6 * (axis_record.setpoint - axis_record.position)[rows]
    if axis_record.record.deviation is not None:
        lag = 1e6 * axis_record.I_P * axis_record.record.deviation[rows]
    within = [mark for mark in marks if time[0] <= mark.time <= time[-1]][:MOST_PLOTTED_MARKS]
    title = f"Axis {comparison.axis}: the record and its replay"
    what_drives = (
        "The recorded torque on the simulated axis, in open loop, from the recorded position and speed on."
        if comparison.open_loop
        else "The recorded setpoints through the simulated axis, in closed loop, beside what was recorded."
    )
    dotted = " Dotted: begin of a block of the program, with its name where there is room." if within else ""
    caption = what_drives + dotted
    blocks = [Level(mark.time, upright=True, dash="dotted") for mark in within]
    titled = [replace(level, text=name) for level, name in zip(blocks, names_of(within, time), strict=True)]
    panels = []
    if not comparison.open_loop:
        simulated = lag - 1e6 * channels["position"].error[rows]
        panels.append(_panel(what, ordinate, "µm", time, simulated=simulated, recorded=lag))
    for name, channel in channels.items():
        factor, unit = SHOWN_UNITS[channel.unit]
        curves = {"what is left": factor * channel.error[rows]}
        if name == "torque":
            both = {"simulated": factor * channel.simulated[rows], "recorded": factor * channel.recorded[rows]}
            curves = {**both, **curves}
        panels.append(
            _panel(f"What is left of the {name}" if name != "torque" else "Torque", name, unit, time, **curves)
        )
    upper = replace(panels[0], levels=[*panels[0].levels, *titled])
    chart = Chart([upper, *(replace(panel, levels=[*panel.levels, *blocks]) for panel in panels[1:])])
    return Picture(f"replay-{comparison.axis}", title, caption, chart)


def names_of(marks: Sequence[Mark], time: Array) -> list[str]:
    """What stands at the line of each block; "" where the name before it takes the room."""
    result: list[str] = []
    free = -np.inf
    for mark in marks:
        text = (
            mark.text if len(mark.text) <= MAX_NAME_CHARACTERS else mark.text[: MAX_NAME_CHARACTERS - 1].rstrip() + "…"
        )
        result.append(text if mark.time >= free else "")
        free = mark.time + np.ptp(time) / MOST_NAMES if result[-1] else free
    return result


# Colour and width: the record lies on the simulation, which is wider.
CURVE_LOOKS = {
    "recorded": (RECORDED_COLOUR, 1.0),
    "simulated": (SIMULATED_COLOUR, 2.2),
    "what is left": (RESIDUAL_COLOUR, 1.2),
}


def _panel(title: str, ordinate: str, unit: str, time: Array, **curves: Array) -> Panel:
    looks = [(name.replace("_", " "), y, *CURVE_LOOKS[name]) for name, y in curves.items()]
    own = [Curve(name, time, y, colour, width=width) for name, y, colour, width in looks]
    axis = Axis("time of the record", "s")
    return Panel(title, axis, Axis(ordinate, unit), own, [Level(0.0, dash="")], linked="t", height=0.9)


def _residuals(comparison: Comparison) -> Picture:
    names = [name for name in ("position", "torque") if name in comparison.channels]
    title = f"Axis {comparison.axis}: what the replay leaves"
    caption = (
        "Simulated less recorded: amplitude spectrum over the window (Hann), and the mean over bins of position "
        "while the axis moves, by direction."
    )
    panels = []
    for name in names:
        factor, unit = SHOWN_UNITS[comparison.channels[name].unit]
        frequency, amplitude = comparison.spectrum(name)
        centre, forwards, backwards = comparison.over_position(name)
        panels.append(
            Panel(f"What is left of the {name}: spectrum", Axis("frequency", "Hz", log=True),
                  Axis("amplitude", unit, log=True),
                  [Curve("amplitude", frequency[1:], factor * amplitude[1:], RESIDUAL_COLOUR)])
        )  # fmt: skip
        over_both: tuple[tuple[str, Array, Dash], ...] = (
            ("forwards", forwards, ""),
            ("backwards", backwards, "dashed"),
        )
        seen = np.isfinite(forwards) | np.isfinite(backwards)
        over = [
            Curve(word, 1e3 * centre[seen], factor * y[seen], RESIDUAL_COLOUR, dash, 1.4) for word, y, dash in over_both
        ]
        panels.append(
            Panel(
                f"What is left of the {name}: mean over the position",
                Axis("position", "mm"),
                Axis(f"{name} left", unit),
                over,
                [Level(0.0, dash="")],
            )
        )
    return Picture(f"replay-left-{comparison.axis}", title, caption, Chart(panels, (1.0, 1.0)))


# --- The report of a replay: its page, summary.json and replay.csv ----------------------------------------------------


REPLAY = "replay.csv"
FILES = (REPLAY,)  # besides report.html and summary.json
LEADING_ERRORS = {
    "position_rms": "position error, rms", "torque_rms": "torque error, rms",
    "share_of_lag": "position error, share of the lag",
}  # fmt: skip
MOST_MARKS = 200


@dataclass(frozen=True, eq=False)
class ReplayReport:
    """A replay with what it rests on.

    comparisons: of the axes. subject: the machine. sources: of the records. marks: events of the record, such as NC
    blocks. settings: option -> value, as the user gave them. proposals: what of the drives does not fit together.
    """

    comparisons: Sequence[Comparison]
    subject: Subject
    sources: Sequence[Provenance]
    marks: Sequence[Mark]
    settings: Mapping[str, str]
    warnings: Sequence[Finding]
    proposals: Sequence[Proposal] = ()

    @property
    def figures(self) -> dict[str, Figure]:
        """Of all axes."""
        return {name: figure for comparison in self.comparisons for name, figure in comparison.figures.items()}

    @cached_property
    def trace(self) -> Trace:
        """Record and simulation side by side, "Z.x_a_recorded" and "Z.x_a_simulated", in SI units."""
        return trace_of(self.comparisons)


def trace_of(comparisons: Sequence[Comparison]) -> Trace:
    """Record and simulation side by side, within the window."""
    rows = comparisons[0].each.rows
    columns, units = {}, {}
    for comparison in comparisons:
        columns[f"{comparison.axis}.x_s"], units[f"{comparison.axis}.x_s"] = comparison.each.setpoint[rows], "m"
        names = {"position": "x_a", "torque": "M_a", "speed setpoint": "n_s"}
        for name, channel in comparison.channels.items():
            for side, values in (("recorded", channel.recorded), ("simulated", channel.simulated)):
                column = f"{comparison.axis}.{names[name]}_{side}"
                columns[column], units[column] = values[rows], channel.unit
    return Trace(comparisons[0].each.record.time[rows], columns, units)


def report_of(replayed: ReplayReport) -> Report:
    """Content of the report."""
    machine = replayed.subject.machine
    drawn = [picture for entry in replayed.comparisons for picture in pictures_of(entry, replayed.marks)]
    pictures = with_remark(drawn, f"{machine.name}. {machine.note}")
    record = replayed.sources[0].file.name
    rows = [("Record", record), ("Machine", machine.name)]
    return Report(
        f"Replay of {record}",
        f"{machine.name} · axes {', '.join(entry.axis for entry in replayed.comparisons)}",
        warnings=replayed.warnings,
        notes=[note for note in (*replayed.subject.notes, *(source.note for source in replayed.sources)) if note],
        answer=answers(replayed),
        tiles=list(_tiles(replayed.figures)),
        next_step=_next_step(replayed),
        main=[
            *pictures,
            figures_section(replayed.figures),
            changes_section(replayed.proposals, machine),
            _events(replayed),
            control_section(machine),
            parameters_section(machine),
        ],
        provenance=provenance_section(rows, hash_files(_files(replayed))),
        footer=figures_footer("Values in full precision: summary.json; time series: replay.csv.", "docs/replay.md"),
    )


def _next_step(replayed: ReplayReport) -> Step:
    """Drives that were identified already are looked at; others are identified from the record."""
    frictions = replayed.subject.machine.shipped_frictions
    for comparison in replayed.comparisons:
        friction = frictions.get(comparison.axis)
        values = friction.identified.get("parameters", {}) if friction is not None else {}
        if not any(name.startswith("drive.") for name in values):
            return Step("Identify the drives from the record", "identify drive")
    return Step("See how each axis answers", "frf", {"subject": replayed.subject.file})


def _tiles(figures: Mapping[str, Figure]) -> list[Tile]:
    tiles = []
    for name, figure in figures.items():
        axis, _, key = name.partition(".")
        if key in LEADING_ERRORS:
            tiles.append(Tile(tile_value(figure), f"{axis}: {LEADING_ERRORS[key]}", typeset(figure.meaning)))
    return tiles


def _events(replayed: ReplayReport) -> Section | None:
    time = replayed.comparisons[0].each.record.time[replayed.comparisons[0].each.rows]
    rows = [(f"{mark.time:.3f}", mark.text) for mark in replayed.marks if time[0] <= mark.time <= time[-1]]
    if not rows:
        return None
    note = f"The first {MOST_MARKS} of {len(rows)}." if len(rows) > MOST_MARKS else ""
    return Section("Events in the record", [Table("rp", ("time [s]", "what"), rows[:MOST_MARKS], note)])


def _files(replayed: ReplayReport) -> list[tuple[str, Path]]:
    result = [("record", source.file) for source in replayed.sources]
    result += [("mapping", source.mapping) for source in replayed.sources if source.mapping is not None]
    return [*result, *replayed.subject.files, ("modes", replayed.subject.machine.modes.file)]


def details(replayed: ReplayReport) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    axis_record = replayed.comparisons[0].each
    time = axis_record.record.time[axis_record.rows]
    return {
        "recorded": recording_day(replayed.sources),
        "machine": machine_part(replayed.subject.machine),
        "settings": dict(replayed.settings),
        "window": [quantity(float(time[0]), "s"), quantity(float(time[-1]), "s")],
        **({"changes": changes_part(replayed.proposals)} if replayed.proposals else {}),
        "inputs": inputs_part(hash_files(_files(replayed))),
    }


SAME_POSITION = 1e-6  # [um] of a position, below which records show nothing but rounding


def answers(replayed: ReplayReport) -> list[str]:
    """What is left, a line per axis."""
    lines = []
    for comparison in replayed.comparisons:
        own = {name.partition(".")[2]: figure for name, figure in comparison.figures.items()}
        if comparison.open_loop:
            lines.append(
                f"{comparison.axis}: in open loop, under the recorded torque, the position is off by "
                f"{own['position_rms']} rms, {own['position_largest']} at most"
            )
            continue
        if own["position_largest"].value < SAME_POSITION:
            text = f"{comparison.axis}: position the same to the last digit"
        else:
            text = f"{comparison.axis}: position off by {own['position_rms']} rms, {own['position_largest']} at most"
            text += f" ({own['share_of_lag']} of the lag)"
        text += f"; torque {own['torque_rms']} rms" if "torque_rms" in own else "; no torque is recorded"
        if "speed_setpoint_rms" in own:
            text += f"; speed setpoint {own['speed_setpoint_rms']} rms"
        lines.append(text)
    return lines


def lines(replayed: ReplayReport) -> list[str]:
    """For the terminal: the answers, and what to change."""
    return [f"  {line}" for line in (*answers(replayed), *change_lines(replayed.proposals))]
