"""The report of a replay: its page, summary.json and replay.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.analysis import Figure
from feedsim.identify import Provenance
from feedsim.identify.read import recording_day
from feedsim.replay.compare import Comparison
from feedsim.report.changes import change_lines, changes_part, changes_section
from feedsim.report.content import Report, Section, Step, Table, Tile, tile_value
from feedsim.report.control import control_section
from feedsim.report.formatting import typeset
from feedsim.report.provenance import figures_part, hashed, inputs_part, machine_part, quantity, software
from feedsim.report.replay.plots import pictures_of
from feedsim.report.sections import figures_footer, figures_section, parameters_section, provenance_section
from feedsim.report.style import remarked
from feedsim.scenario import Subject
from feedsim.trace import Mark, Trace
from feedsim.tune import Proposal

REPLAY = "replay.csv"
FILES = (REPLAY,)  # besides report.html and summary.json
LEADING = {
    "position_rms": "position error, rms", "torque_rms": "torque error, rms",
    "share_of_lag": "position error, share of the lag",
}  # fmt: skip
MOST_MARKS = 200


@dataclass(frozen=True, eq=False)
class Replayed:
    """A replay with what it rests on.

    comparisons: of the axes. subject: the machine. sources: of the records. marks: events of the record, such as NC
    blocks. settings: option -> value, as the user gave them. proposals: what of the drives does not fit together.
    """

    comparisons: Sequence[Comparison]
    subject: Subject
    sources: Sequence[Provenance]
    marks: Sequence[Mark]
    settings: Mapping[str, str]
    warnings: Sequence[str]
    proposals: Sequence[Proposal] = ()

    @property
    def figures(self) -> dict[str, Figure]:
        """Of all axes."""
        return {name: figure for comparison in self.comparisons for name, figure in comparison.figures.items()}


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


def report_of(replayed: Replayed) -> Report:
    """Content of the report."""
    machine = replayed.subject.machine
    pictures = []
    with remarked(f"{machine.name}. {machine.note}"):
        for comparison in replayed.comparisons:
            pictures += pictures_of(comparison, replayed.marks)
    record = replayed.sources[0].file.name
    rows = [("Record", record), ("Machine", machine.name)]
    return Report(
        f"Replay of {record}",
        f"{machine.name} · axes {', '.join(entry.axis for entry in replayed.comparisons)}",
        warnings=replayed.warnings,
        notes=[note for note in (*replayed.subject.notes, *(source.note for source in replayed.sources)) if note],
        answer=answers(replayed),
        tiles=list(_tiles(replayed.figures)),
        next_step=Step("Identify the drives from the record", "identify drive"),
        main=[
            *pictures,
            figures_section(replayed.figures),
            changes_section(replayed.proposals, machine),
            _events(replayed),
            control_section(machine),
            parameters_section(machine),
        ],
        provenance=provenance_section(rows, hashed(_files(replayed))),
        footer=figures_footer("Values in full precision: summary.json; time series: replay.csv.", "docs/replay.md"),
    )


def _tiles(figures: Mapping[str, Figure]) -> list[Tile]:
    tiles = []
    for name, figure in figures.items():
        axis, _, key = name.partition(".")
        if key in LEADING:
            tiles.append(Tile(tile_value(figure), f"{axis}: {LEADING[key]}", typeset(figure.meaning)))
    return tiles


def _events(replayed: Replayed) -> Section | None:
    time = replayed.comparisons[0].each.record.time[replayed.comparisons[0].each.rows]
    rows = [(f"{mark.time:.3f}", mark.text) for mark in replayed.marks if time[0] <= mark.time <= time[-1]]
    if not rows:
        return None
    note = f"The first {MOST_MARKS} of {len(rows)}." if len(rows) > MOST_MARKS else ""
    return Section("Events in the record", [Table("rp", ("time [s]", "what"), rows[:MOST_MARKS], note)])


def _files(replayed: Replayed) -> list[tuple[str, Path]]:
    result = [("record", source.file) for source in replayed.sources]
    result += [("mapping", source.mapping) for source in replayed.sources if source.mapping is not None]
    return [*result, *replayed.subject.files, ("modes", replayed.subject.machine.modes)]


def summary(replayed: Replayed, files: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json."""
    axis_record = replayed.comparisons[0].each
    time = axis_record.record.time[axis_record.rows]
    return {
        "kind": "replay",
        "answer": answers(replayed),
        "recorded": recording_day(replayed.sources),
        "machine": machine_part(replayed.subject.machine),
        "settings": dict(replayed.settings),
        "window": [quantity(float(time[0]), "s"), quantity(float(time[-1]), "s")],
        **({"changes": changes_part(replayed.proposals)} if replayed.proposals else {}),
        "figures": figures_part(replayed.figures),
        "software": software(),
        "inputs": inputs_part(hashed(_files(replayed))),
        "files": list(files),
    }


SAME_POSITION = 1e-6  # [um] of a position, below which records show nothing but rounding


def answers(replayed: Replayed) -> list[str]:
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


def lines(replayed: Replayed) -> list[str]:
    """For the terminal: the answers, and what to change."""
    return [f"  {line}" for line in (*answers(replayed), *change_lines(replayed.proposals))]
