"""The report of a run: result.csv, log.csv, summary.json, report.html and figures, written whole or not at all."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from feedsim.analysis import (
    AccuracyTask,
    CircleTask,
    Diagnosis,
    Figure,
    PositioningTask,
    answer,
    diagnoses,
    doubts,
    tasks,
)
from feedsim.cosim import Run
from feedsim.motions.circular import DIRECTIONS
from feedsim.report import sections
from feedsim.report.changes import changes_part, changes_section, first_change
from feedsim.report.chart import Chart, Panel
from feedsim.report.content import Paragraph, Report, Section, Span, Table, Tile, tile_value
from feedsim.report.control import control_section
from feedsim.report.formatting import counted, duration, number, typeset
from feedsim.report.page import sheet_html
from feedsim.report.partial import PARTIAL, Partial
from feedsim.report.picture import Picture
from feedsim.report.provenance import (
    figures_part,
    friction_origins,
    input_files,
    inputs_part,
    machine_part,
    quantity,
    software,
)
from feedsim.report.results import REPORT, SUMMARY, Content, check_place, write_report
from feedsim.report.run import sheet
from feedsim.report.run.accuracy import accuracy_picture, accuracy_section
from feedsim.report.run.axis_plots import BEYOND, overview_picture, positioning_picture
from feedsim.report.run.circle_plots import contour_picture, torque_picture
from feedsim.report.run.diagnosis import diagnosis_part, diagnosis_section
from feedsim.report.run.pose import pose_part, pose_section
from feedsim.report.run.words import accuracy_words, moved_words, next_step, stop_words
from feedsim.scenario import Level, Logging
from feedsim.trace import Trace, write_csv
from feedsim.tune import of_run
from feedsim.units import show

RESULT, LOG, PAGE = "result.csv", "log.csv", "machine.html"
TILES = {
    "overshoot": "overshoot",
    "settling_time": "settling time",
    "duration": "duration of the motion",
    "peak_torque": "largest motor torque",
    "plateau_torque": "motor torque at constant speed",
    "rest_torque": "friction torque at rest",
    "ringing_frequency": "ringing frequency",
    "G": "circular deviation G",
    "F_max": "largest radial deviation F max",
    "F_min": "smallest radial deviation F min",
    "mean": "mean radius deviation",
    "A": "accuracy of positioning A",
    "R": "repeatability R",
    "B": "largest reversal value B",
    "E": "systematic deviation E",
    "M": "range of the mean deviations M",
}
OF_REVERSALS = {"peak": "reversal peak", "glitch": "quadrant glitch"}  # of an axis: peak_X
MOST_MOTIONS = 200
LINE = ("overshoot", "settling_time", "peak_torque", "G", "A", "R", "B")
FIRST = ("overshoot", "settling_time", "ringing_frequency", "G", "peak", "A", "R", "B")
HEADER = (*LINE, "duration", "ringing_frequency", "plateau_torque", "rest_torque", "F_max", "F_min", "mean", "E", "M")
FORMAT = 1
COUPLING = {
    "residual": "interface energy residual: what the plant gave to the friction bond less what friction took from it",
    "residual_peak": "largest magnitude of the interface energy residual during the run",
    "friction_work": "work of the friction torque, to hold the residual against",
}


TRY_IT = Paragraph(
    (Span("Try it: turn the knobs of this machine", "file", PAGE), ", and see what becomes of the pictures below.")
)


SHEETS = Paragraph((Span("Acceptance sheet for print", "file", sheet.HTML), ": readings, conditions, limits."))


def check_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless a run's results can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(
        directory,
        (RESULT, REPORT, SUMMARY, LOG, PAGE, sheet.HTML, sheet.CSV, PARTIAL),
        inputs,
        kind="run",
        own=(PARTIAL,),
    )


def growing(directory: Path | str) -> Partial:
    """What takes a run's rows while it goes on, for :func:`write`."""
    return Partial(directory, RESULT)


def write(
    run: Run,
    figures: Mapping[str, Figure],
    directory: Path | str,
    recorded: Partial | None = None,
    causes: Mapping[str, Diagnosis] | None = None,
    *,
    drawn: Sequence[str] = (),
    page: str = "",
) -> tuple[Path, ...]:
    """Write result.csv, summary.json, report.html, log.csv, if there is one, and figures; returns their paths.

    figures: as from ``analysis.evaluate``. recorded: the run's rows where they have been written already, in the same
    directory; the file becomes result.csv, or stays as it is where the results cannot be written. Files of an earlier
    run are replaced. causes: as from ``analysis.diagnoses``, which is asked where they are not given. drawn: kinds of
    files that figures/* are drawn as. page: the machine as a page that computes, which the report links. Raises
    OutputError.
    """
    files = files_of(run, page, recorded)
    causes = diagnoses(run) if causes is None else causes
    report = report_of(run, figures, draw(run, figures, causes), causes)
    if page:
        report = replace(report, main=[TRY_IT, *report.main])
    return write_report(
        directory, report, partial(summary, run, figures, causes=causes), files, drawn, kind="run", own=(PARTIAL,)
    )


def files_of(run: Run, page: str = "", recorded: Partial | None = None) -> dict[str, Content]:
    """Name -> content of all files besides the report; arguments as of :func:`write`."""

    def result(path: Path) -> Path | None:
        if recorded is None or not recorded.left:
            write_csv(path, run.trace)
            return None
        recorded.finished()
        return recorded.path

    files: dict[str, Content] = {RESULT: result}
    if run.log is not None:
        files[LOG] = partial(write_csv, trace=run.log)
    if page:
        files[PAGE] = page
    if sheets := sheet.sheets_of(run):
        files[sheet.HTML] = sheet_html(run.scenario.name, sheets, sheet.RULE)
        files[sheet.CSV] = sheet.table(sheets)
    return files


def report_of(
    run: Run, figures: Mapping[str, Figure], pictures: Sequence[Picture], causes: Mapping[str, Diagnosis] | None = None
) -> Report:
    """Content of the report. causes: prefix of a circle's figures -> why it is not round."""
    causes = causes or {}
    scenario, machine = run.scenario, run.scenario.machine
    factor, proposals = real_time_factor(run), of_run(run, causes)
    speed = f" ({factor:.2g} times real time)" if factor is not None else ""
    footer = (
        "Values in full precision: summary.json; time series: result.csv. "
        f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}."
    )
    return Report(
        scenario.name,
        f"{machine.name} · {counted(len(scenario.motions), 'motion')}, {run.program.duration:.4g} s",
        answer=answers(run, figures, causes) or moved_words(run.trace),
        warnings=(*run.warnings, *doubts(figures, causes)),
        notes=(machine.note, scenario.note),
        tiles=tiles(figures),
        lead=lead(run, pictures),
        next_step=next_step(run, causes, first_change(proposals)),
        main=[
            *([SHEETS] if sheet.sheets_of(run) else []),
            *pictures,
            *(diagnosis_section(prefix, diagnosis) for prefix, diagnosis in causes.items()),
            changes_section(proposals, machine),
            *accuracy_sections(run),
            sections.figures_section(figures),
            motions_section(run),
            loads_section(run),
            pose_section(run.pose),
            control_section(machine),
        ],
        provenance=provenance(run),
        footer=sections.figures_footer(footer) if figures else footer,
    )


def accuracy_sections(run: Run) -> list[Section]:
    """Every positioning cycle, by the scale and by the tool point."""
    asked = [task for task in tasks(run.scenario, run.program) if isinstance(task, AccuracyTask)]
    return [
        accuracy_section(task.prefix, found, place.rstrip("."))
        for task in asked
        for place, found in task.found(run.trace).items()
    ]


def answers(run: Run, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis]) -> list[str]:
    """What circles, stops and positioning cycles are, why, and what to do: a line each."""
    found = [f"{prefix}: {answer(diagnosis)}" for prefix, diagnosis in causes.items()]
    for task in tasks(run.scenario, run.program):
        own = {
            name.removeprefix(f"{task.prefix}."): f for name, f in figures.items() if name.startswith(f"{task.prefix}.")
        }
        if own and not isinstance(task, CircleTask):
            words = stop_words(own, task.band) if isinstance(task, PositioningTask) else accuracy_words(own)
            found.append(f"{task.prefix}: {words}")
    return [*filter(None, map(sheet.verdict_line, sheet.sheets_of(run))), *found]


def tiles(figures: Mapping[str, Figure]) -> list[Tile]:
    """Leading figures, those first that answer what is asked. A reversal has one height: over the fitted rest of the
    circle where that is known, else the quadrant glitch."""
    named = [name for name in figures if is_leading(name, HEADER) and not _has_peak(name, figures)]

    def place(name: str) -> tuple[int, int]:
        key = re.sub("^(peak|glitch)_.*", "peak", name.partition(".")[2])
        size = abs(figures[name].value) if key == "peak" else 0
        return FIRST.index(key) if key in FIRST else len(FIRST), -round(1e3 * size) if math.isfinite(size) else 0

    return [tile(name, figures[name]) for name in sorted(named, key=place)]


def _has_peak(name: str, figures: Mapping[str, Figure]) -> bool:
    """Whether a figure is a glitch whose height over the fitted rest is known, too."""
    return ".glitch_" in name and name.replace(".glitch_", ".peak_") in figures


def lead(run: Run, pictures: Sequence[Picture]) -> Picture | None:
    """The picture of the first screen, where it is not the first one: a stop without the way to it."""
    for task in tasks(run.scenario, run.program)[:1]:
        if isinstance(task, PositioningTask) and pictures and (chart := pictures[0].chart) is not None:
            panel = next((each for each in chart.panels if isinstance(each, Panel) and each.title == BEYOND), None)
            if panel is not None:
                title = f"Axis {task.approach.axis} about its target"
                shown = Chart([replace(panel, title="", height=1.9)])
                return replace(pictures[0], stem=f"{pictures[0].stem}-first", title=title, shows=shown)
    return None


def tile(name: str, figure: Figure) -> Tile:
    """A figure with its name in words."""
    prefix, _, key = name.partition(".")
    what, _, axis = key.partition("_")
    label = TILES.get(key, f"{OF_REVERSALS[what]}, {axis} reverses" if what in OF_REVERSALS and axis else key)
    return Tile(tile_value(figure), f"{prefix.replace('#', ' no. ')}: {label}", typeset(figure.meaning))


def draw(run: Run, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis] | None = None) -> list[Picture]:
    """The figures of a report: those of every evaluation, and an overview of all axes. causes: as of report_of()."""
    signs = {name: axis.display_sign for name, axis in run.scenario.machine.axes.items()}
    pictures: list[Picture] = []
    for task in tasks(run.scenario, run.program):
        stem = task.prefix.replace("#", "-")
        own = {
            name.removeprefix(f"{task.prefix}."): f for name, f in figures.items() if name.startswith(f"{task.prefix}.")
        }
        if not own:
            continue
        if isinstance(task, PositioningTask):
            axis = task.approach.axis
            pictures.append(
                positioning_picture(
                    run.trace, task.approach, own, f"positioning-{stem}", band=task.band, torque_sign=signs[axis]
                )
            )
        elif isinstance(task, CircleTask):
            pictures.append(
                contour_picture(run.trace, task.turn, f"contour-{stem}", task.back, (causes or {}).get(task.prefix))
            )
            torques = torque_picture(run.trace, task.turn, signs, f"torque-{stem}")
            pictures += [torques] if torques is not None else []
        else:
            pictures.append(accuracy_picture(task.prefix, task.found(run.trace)[""], f"accuracy-{stem}"))
    overview = overview_picture(run.trace, list(run.scenario.machine.axes), signs, "overview")
    return [*pictures, overview] if overview is not None else pictures


def motions_section(run: Run) -> Section:
    """Every motion with its path, its start and its exact end."""
    segments = run.program.segments
    rows = [
        (str(segment.index), segment.description, segment.way, f"{segment.start:.4f}", f"{segment.end:.4f}")
        for segment in segments[:MOST_MOTIONS]
    ]
    more = len(segments) - MOST_MOTIONS
    note = (
        "Every motion ends exactly where its profile does; the next one starts on the next instant of the interpolator "
        f"(T_ipo {duration(run.scenario.machine.cycles.T_ipo)})."
    )
    note = f"and {more} more\n{note}" if more > 0 else note
    return Section("Motions", [Table("rllrr", ("No.", "Motion", "Path", "Start [s]", "End [s]"), rows, note)])


def loads_section(run: Run) -> Section | None:
    """What every load has done; None without one."""
    rows = [
        (str(work.load), work.words, work.input, f"{number(work.peak, 4)} {typeset(work.unit)}",
         *(number(value, 3) for value in (work.given, work.taken)))
        for work in run.loads
    ]  # fmt: skip
    heads = ("No.", "Where it acts", "Column", "Largest", "Work on the machine [J]", "Work taken from it [J]")
    note = "A load acts as its mean over each control cycle. A process takes work from the machine."
    return Section("Loads", [Table("rllrrr", heads, rows, note)]) if rows else None


def provenance(run: Run) -> Section:
    """Inputs, units, coupling, and the parameters of every axis."""
    scenario, machine = run.scenario, run.scenario.machine
    cycles, coupling = machine.cycles, scenario.coupling
    rows = [
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Set in the scenario", ", ".join(scenario.settings) or "nothing"),
        ("Set on the command line", ", ".join(scenario.overrides) or "nothing"),
        ("Machine", machine.name),
        *((f"Friction of {axis}", text) for axis, text in friction_origins(machine).items()),
        ("Cycles", ", ".join(f"{n} {duration(getattr(cycles, n))}" for n in ("T_c", "T_pos", "T_ipo"))),
        ("Recording", f"every {duration(scenario.recording.interval)}, {len(run.trace)} rows"),
        *([("Log", log_text(scenario.logging, run.log))] if scenario.logging is not None else []),
        (
            "Coupling",
            f"{coupling.scheme}, {counted(coupling.substeps, 'exchange step')} per control cycle"
            + (", inside one unit" if coupling.units == "one" else ""),
        ),
    ]
    used, parameters = sections.archives_table(run.units), sections.parameters_section(machine)
    return sections.provenance_section(rows, input_files(scenario), used, _coupling(run.coupling), parameters)


def _coupling(coupling: Mapping[str, float]) -> Section | None:
    rows = []
    for axis in dict.fromkeys(name.partition(".")[0] for name in coupling):
        work, residual = (coupling.get(f"{axis}.{name}", math.nan) for name in ("friction_work", "residual"))
        share = abs(residual / work) if work else math.nan
        rows.append((axis, *(number(value, 3) for value in (work, residual, share))))
    heads = ("Axis", "Friction work [J]", "Interface energy residual [J]", "Share")
    note = "The residual is the energy that the exchange between plant and friction creates or loses."
    return Section("Coupling", [Table("lrrr", heads, rows, note)]) if rows else None


def summary(
    run: Run, figures: Mapping[str, Figure], files: Sequence[str], causes: Mapping[str, Diagnosis] | None = None
) -> dict[str, Any]:
    """Content of summary.json; a figure that could not be determined has the value null."""
    causes = causes or {}
    scenario, machine = run.scenario, run.scenario.machine
    return {
        "format": FORMAT,
        "answer": answers(run, figures, causes),
        "warnings": [*run.warnings, *doubts(figures, causes)],
        "figures": figures_part(figures),
        "changes": changes_part(of_run(run, causes)),
        "circles": _circles(run, causes),
        "diagnosis": {prefix: diagnosis_part(diagnosis) for prefix, diagnosis in causes.items()},
        "scenario": {
            "name": scenario.name,
            "file": scenario.file.name,
            "note": scenario.note,
            "set": list(scenario.settings),
            "overrides": list(scenario.overrides),
            "duration": quantity(run.program.duration, "s"),
            "coupling": scenario.coupling.model_dump(),
            "recording_interval": quantity(scenario.recording.interval, "s"),
            "logging": logging_part(scenario.logging, run.log),
            "motions": [
                {
                    "description": segment.description,
                    "start": quantity(segment.start, "s"),
                    "end": quantity(segment.end, "s"),
                }
                for segment in run.program.segments
            ],
        },
        "loads": [
            {
                "acts": work.words,
                "input": work.input,
                "largest": quantity(work.peak, work.unit),
                "work_on_machine": quantity(work.given, "J"),
                "work_taken": quantity(work.taken, "J"),
                "motor_while_it_acts": None
                if work.drives is None
                else {
                    "work_in_run": quantity(work.drives.run, "J"),
                    "work_in_record": quantity(work.drives.record, "J"),
                },
            }
            for work in run.loads
        ],
        "machine": machine_part(machine),
        "pose": pose_part(run.pose),
        "inputs": inputs_part(input_files(scenario)),
        "units": {name: dict(unit) for name, unit in run.units.items()},
        "coupling": {
            name: {"value": value, "unit": "J", "meaning": COUPLING[name.partition(".")[2]]}
            for name, value in run.coupling.items()
        },
        "software": software(),
        "performance": {
            "wall_time": quantity(run.wall_time, "s"),
            "real_time_factor": quantity(real_time_factor(run), "1"),
            "cycle_loop": "native" if run.native else "Python",
        },
        "files": list(files),
    }


def _circles(run: Run, causes: Mapping[str, Diagnosis]) -> dict[str, Any]:
    """The turns that figures are of: who lays them over others needs no scenario."""
    found = [task for task in tasks(run.scenario, run.program) if task.prefix in causes] if causes else []
    return {
        task.prefix: [
            {
                "axes": list(turn.axes),
                "centre": quantity(list(turn.centre), "m"),
                "radius": quantity(turn.radius, "m"),
                "direction": DIRECTIONS[turn.sense],
                "begin": quantity(turn.begin, "s"),
                "end": quantity(turn.end, "s"),
            }
            for turn in task.turns
        ]
        for task in found
        if isinstance(task, CircleTask)
    }


def real_time_factor(run: Run) -> float | None:
    """Simulated time over the time that it took; above 1 is faster than real time."""
    return run.program.duration / run.wall_time if run.wall_time > 0 else None


def summary_line(run: Run, figures: Mapping[str, Figure]) -> str:
    """The run in one line: its leading figures, and how fast it was."""
    leading = [
        f"{name} {figure}"
        for name, figure in figures.items()
        if is_leading(name, LINE) and not _has_peak(name, figures)
    ]
    factor = real_time_factor(run)
    digits = ".0f" if factor is not None and factor >= 10 else ".2g"
    speed = f" ({factor:{digits}} x real time)" if factor is not None else ""
    return ", ".join([*leading, f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}"])


def is_leading(name: str, among: Sequence[str]) -> bool:
    """Whether a figure, named with its prefix, is one of ``among`` by the scales, or the quadrant glitch of an axis."""
    _, _, figure = name.partition(".")
    return figure in among or (figure.startswith(("glitch_", "peak_")) and figure[-1] not in "+-")


def logging_part(logging: Logging | None, log: Trace | None) -> dict[str, Any] | None:
    """Settings of a log in SI; None where there is none."""
    if logging is None:
        return None
    return {
        "interval": quantity(logging.interval, "s"),
        "columns": list(log) if log is not None else [],
        "noise": {
            signal: {"value": level.value, "unit": "of the RMS" if level.relative else _unit(signal, log)}
            for signal, level in logging.noise.given().items()
        },
        "quantisation": {
            signal: {"value": step, "unit": _unit(signal, log)} for signal, step in logging.quantisation.given().items()
        },
        "delay": {signal: quantity(delay, "s") for signal, delay in logging.delay.given().items()},
        "seed": logging.seed,
    }


def log_text(logging: Logging, log: Trace | None) -> str:
    """Settings of a log in a line, for a person."""
    parts = [f"log.csv: every {duration(logging.interval)}, {', '.join(log) if log is not None else 'nothing'}"]
    for name, given in (
        ("noise", {signal: _level(level, signal, log) for signal, level in logging.noise.given().items()}),
        ("steps", {signal: show(step, _unit(signal, log)) for signal, step in logging.quantisation.given().items()}),
        ("delay", {signal: duration(delay) for signal, delay in logging.delay.given().items()}),
    ):
        if given:
            parts.append(f"{name} {', '.join(f'{signal} {text}' for signal, text in given.items())}")
    return "; ".join([*parts, *([f"seed {logging.seed}"] if logging.noise.given() else [])])


def _level(level: Level, signal: str, log: Trace | None) -> str:
    return f"{level.value * 100:.6g} % of its RMS" if level.relative else show(level.value, _unit(signal, log))


def _unit(signal: str, log: Trace | None) -> str:
    return next((log.unit(name) for name in log or () if name.partition(".")[2] == signal), "") if log else ""
