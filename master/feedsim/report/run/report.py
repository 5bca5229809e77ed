"""The report of a run: result.csv, log.csv, summary.json, report.html and figures, written whole or not at all."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from feedsim.analysis import (
    AccuracyTask,
    CircleTask,
    ContourTask,
    Diagnosis,
    Figure,
    Figures,
    PositioningTask,
    contours,
    doubt_figures,
    explain_circle,
    program_notes,
    tasks,
)
from feedsim.analysis.circle import actionable_causes
from feedsim.analysis.proposals import Proposal, waits_for_ringing
from feedsim.files.trace import Trace
from feedsim.foundation.units import show
from feedsim.report import content
from feedsim.report.changes import action, change_words, changes_section, control_section
from feedsim.report.chart import Chart, Panel
from feedsim.report.content import (
    FOLDER,
    Paragraph,
    Picture,
    Report,
    Section,
    Span,
    Step,
    Table,
    Tile,
    tile_value,
    with_remark,
)
from feedsim.report.content import TILES as TILES_SHOWN
from feedsim.report.formatting import NARROW, count_things, duration, number, two_digits, typeset
from feedsim.report.provenance import (
    friction_origins,
    input_files,
)
from feedsim.report.run import sheet
from feedsim.report.run.axis_plots import (
    OVERSHOOT_TITLE,
    accuracy_picture,
    accuracy_section,
    contour_picture,
    overview_picture,
    positioning_picture,
    torque_picture,
)
from feedsim.report.run.contour import contour_pictures, contour_section, contour_words
from feedsim.report.run.pose import cause_tile, diagnosis_section, pose_section
from feedsim.scenario import Drive, Level, Logging
from feedsim.simulation.judge import JudgedRun, wrong_findings

# --- What a stop and a positioning cycle come to, in a sentence or two: the answer, its meaning, what to do next ------


# Of A, what repeats is worth compensating from this share of it on.
SYSTEMATIC = 0.5
STIRRED_TRAVEL_SHARE = 0.02  # share of the largest travel, up to which an axis has been stirred rather than moved


def stop_words(figures: Figures, band: float, remedy: str = "") -> str:
    """Of a motion that ends at rest: overshoot, settling time, what rings, and the remedy.

    figures: without prefix; band: about the target [m]. remedy: what the machine file points at, in words.
    """
    overshoot, settled = figures["overshoot"], figures["settling_time"]
    within = f"+-{band * 1e6:g} um"
    ringing = figures.get("ringing_frequency")
    frequency = ringing.value if ringing is not None else math.nan
    advice = f" Remedy: {remedy}." if remedy else ""
    if math.isfinite(overshoot.value) and not math.isfinite(settled.value) and math.isfinite(frequency):
        return (
            f"is not yet at rest within {within} at the end: it oscillates at {frequency:.3g} Hz, up to "
            f"{two_digits(overshoot.value)} um past its target.{advice}"
        )
    if not math.isfinite(overshoot.value) or not math.isfinite(settled.value):
        return f"may have settled within {within} or not: too little of the rest is recorded. Add a dwell."
    settles = (
        f"settles within {within} in {two_digits(settled.value)} ms"
        if settled.value > 0
        else f"is settled within {within} at the end of the motion"
    )
    said = f"overshoots by {two_digits(overshoot.value)} um and {settles}."
    if (mounts := figures.get("settling_of_mounts")) is not None and math.isfinite(mounts.value):
        said += f" On mounts that hold still it settles in {two_digits(settled.value - mounts.value)} ms"
        said += f": the mounts make {100 * mounts.value / settled.value:.0f} % of it." if mounts.value > 0 else "."
    if waits_for_ringing(settled.value * 1e-3, frequency):
        said += f" It rings at {frequency:.3g} Hz{'.' if remedy else '; lower the jerk.'}"
    return f"{said}{advice}"


def accuracy_words(figures: Figures) -> str:
    """Of a positioning cycle after ISO 230-2."""
    A, R, E, B = (figures[name].value for name in "AREB")
    if not math.isfinite(A):
        return "accuracy of positioning not determined."
    first = f"accuracy of positioning A {A:.2f} um, repeatability R {R:.2f} um, systematic deviation E {E:.2f} um"
    if E < SYSTEMATIC * A:
        return f"{first}: most of it scatters from approach to approach, which no table of compensation takes away."
    if B > SYSTEMATIC * E:
        return f"{first}: most of it repeats and changes with the direction: backlash, reversal value B {B:.2f} um."
    return f"{first}: most of it repeats at each target: compensation of the pitch can take it away."


def next_step(run: JudgedRun, causes: Mapping[str, Diagnosis], proposals: Sequence[Proposal]) -> Step | None:
    """What to do with a run, by what it has shown first."""
    scenario = run.scenario
    if scenario.file.suffix == ".ssp":
        return None
    if wrong := wrong_findings(run):
        setting = wrong[0].remedy if wrong[0].code == "loop-unstable" else ""
        stable = {"scenario": scenario.file, "set": [*scenario.overrides, setting], "out": f"{FOLDER}_stable"}
        return Step("Run it with a gain that is stable", "run", stable) if setting else None
    first = next(iter(proposals), None)
    if first is not None and first.proposed is not None:
        return Step(f"Try {change_words(first)}", "tune proposals", {"out": FOLDER})
    named = [term.key for diagnosis in causes.values() for term in actionable_causes(diagnosis)[:1]]
    if named[:1] == ["peaks"]:
        return Step("See what friction compensation gains", "tune feedforward")
    for error in contours(run).values():
        index, plan = error.segment.index, error.main_share("scale")[0] == "plan"
        tighter = f"motions.{index}.tolerance={error.overall('scale')[0] * 0.5e6:.2g} um"
        setting = tighter if plan else f"motions.{index}.feed_override=50 %"
        other = f"{FOLDER}_{'tighter' if plan else 'slower'}"
        words = f"Run it with {'half of the tolerance' if plan else 'half of the feed'}, for feedsim diff"
        return Step(words, "run", {"scenario": scenario.file, "set": [*scenario.overrides, setting], "out": other})
    todo = tasks(scenario, run.program)
    for task in todo:
        axis = task.approach.axis if isinstance(task, PositioningTask) else ""
        if axis and isinstance(scenario.machine.axes[axis].drive, Drive):
            return Step("Find values of the drive with which it stops better", "tune drive", {"axes": axis})
    for k, entry in enumerate(scenario.evaluate):
        if getattr(entry, "sheet", "none") is None:
            sheet_asked = [*scenario.overrides, f"evaluate.{k}.sheet={{}}"]
            return Step(
                "Write the acceptance sheet", "run", {"scenario": scenario.file, "set": sheet_asked, "out": FOLDER}
            )
    moved = [name for name in travels(run.trace) if run.log is not None and f"{name}.M_a" in run.log]
    if moved and not todo:
        logged = {"traces": [f"{FOLDER}/{LOG}"], "machine": scenario.file, "axes": moved[0]}
        return Step(f"Identify the friction of {moved[0]} from the log", "identify friction", logged)
    if scenario.machine.foreign_units:
        return None
    return Step("See how each axis answers", "frf", {"subject": scenario.file})


def travels(trace: Trace) -> dict[str, float]:
    """Axis -> its travel [m], of those that have been moved rather than stirred; the largest first."""
    result = {name.partition(".")[0]: float(np.ptp(y)) for name, y in trace.columns.items() if name.endswith(".x_a")}
    result = {axis: travel for axis, travel in result.items() if travel > STIRRED_TRAVEL_SHARE * max(result.values())}
    return dict(sorted(result.items(), key=lambda entry: -entry[1]))


def moved_words(trace: Trace) -> list[str]:
    """Of a run without figures: how far each axis has moved and was behind, and that nothing is evaluated."""
    result = []
    for axis, travel in travels(trace).items():
        lag = trace.columns.get(f"{axis}.x_e")
        behind = "" if lag is None else f", following error up to {1e6 * float(np.abs(lag).max()):.3g} um"
        result.append(f"{axis} moves within {1e3 * travel:.4g} mm{behind}.")
    return [*result, "The scenario has nothing that is evaluated (a stop, a circle, a positioning cycle): no figures."]


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
    "largest": "largest deviation from the path",
    "rms": "deviation from the path, rms",
    "p95": "95 % of the positions are within",
    "speed": "mean speed along the path",
}
OF_REVERSALS = {"peak": "reversal peak", "glitch": "quadrant glitch"}  # of an axis: peak_X
MOST_MOTIONS = 200
LINE = ("overshoot", "settling_time", "peak_torque", "G", "A", "R", "B", "largest", "p95")
FIRST_FIGURES = ("overshoot", "settling_time", "ringing_frequency", "G", "peak", "A", "R", "B", "largest", "rms", "p95")
HEADER = (
    *LINE,
    "duration",
    "ringing_frequency",
    "plateau_torque",
    "rest_torque",
    "F_max",
    "F_min",
    "mean",
    "E",
    "M",
    "rms",
    "speed",
)
COUPLING_MEANINGS = {
    "residual": "interface energy residual: what the plant gave to the friction bond less what friction took from it",
    "residual_peak": "largest magnitude of the interface energy residual during the run",
    "friction_work": "work of the friction torque, to hold the residual against",
}


TRY_IT = Paragraph(
    (Span("Try it: turn the knobs of this machine", "file", PAGE), ", and see what becomes of the pictures below.")
)


def sheets_line(run: JudgedRun) -> Paragraph | None:
    """Links to the acceptance sheets; None where none was asked for."""
    if not sheet.sheets_of(run):
        return None
    files = [("as CSV", sheet.CSV), *([("as a workbook", sheet.XLSX)] if sheet.in_workbook(run.scenario) else [])]
    others = [part for text, name in files for part in (", ", Span(text, "file", name))]
    return Paragraph(
        (Span("Acceptance sheet for print", "file", sheet.HTML), *others, ": readings, conditions, limits.")
    )


def report_of(
    run: JudgedRun,
    figures: Mapping[str, Figure],
    pictures: Sequence[Picture],
    causes: Mapping[str, Diagnosis],
    proposals: Sequence[Proposal],
    *,
    page: bool = False,
) -> Report:
    """Content of the report.

    causes: prefix of a circle's figures -> why it is not round. proposals: what to change. page: there is a machine
    page beside it.
    """
    scenario, machine = run.scenario, run.scenario.machine
    unstable = bool(wrong_findings(run))
    causes = {} if unstable else causes
    footer = f"Values in full precision: summary.json; time series: result.csv. {speed_line(run).capitalize()}."
    return Report(
        scenario.name,
        f"{machine.name} · {count_things(len(scenario.motions), 'motion')}, {run.program.duration:.4g} s",
        answer=answers(run, figures, causes, proposals) or ([] if unstable else moved_words(run.trace)),
        action=action(first_proposals(proposals, causes), machine),
        warnings=run.warnings
        if unstable
        else (*run.warnings, *doubt_figures(figures, causes), *program_notes(run.program)),
        notes=(machine.note, scenario.note),
        tiles=[] if unstable else [*cause_tiles(causes), *tiles(figures, sheet.limits_of(run), list(causes)[:1])],
        lead=lead_picture(run, pictures),
        next_step=next_step(run, causes, proposals),
        main=[
            TRY_IT if page else None,
            sheets_line(run),
            changes_section(proposals, machine, scenario.file),
            *pictures,
            *(diagnosis_section(prefix, diagnosis) for prefix, diagnosis in causes.items()),
            *(contour_section(prefix, error) for prefix, error in contours(run).items()),
            *accuracy_sections(run),
            content.figures_section(figures),
            motions_section(run),
            loads_section(run),
            pose_section(run.pose),
            control_section(machine),
        ],
        provenance=provenance(run),
        footer=content.figures_footer(footer) if figures else footer,
    )


def accuracy_sections(run: JudgedRun) -> list[Section]:
    """Every positioning cycle, by the scale and by the tool point."""
    asked = [task for task in tasks(run.scenario, run.program) if isinstance(task, AccuracyTask)]
    return [
        accuracy_section(task.prefix, accuracy, place.rstrip("."))
        for task in asked
        for place, accuracy in task.accuracies(run.trace).items()
    ]


def first_proposals(proposals: Sequence[Proposal], causes: Mapping[str, Diagnosis]) -> Sequence[Proposal]:
    """The proposals where the first one is for the main cause of the first circle, or for a stop; else none."""
    named = [term.key for diagnosis in list(causes.values())[:1] for term in actionable_causes(diagnosis)[:1]]
    return proposals if [entry.of[0] for entry in proposals[:1] if entry.of[0]] == named else []


def answers(
    run: JudgedRun,
    figures: Mapping[str, Figure],
    causes: Mapping[str, Diagnosis],
    proposals: Sequence[Proposal],
) -> list[str]:
    """What circles, stops and positioning cycles are, why, and what to do: a line each; none of a run that is wrong."""
    if wrong_findings(run):
        return []
    first = first_proposals(proposals, causes)
    remedies = {prefix: first[0].what for prefix in list(causes)[:1] if first}
    result = [
        f"{prefix}: {explain_circle(diagnosis, remedies.get(prefix, ''))}" for prefix, diagnosis in causes.items()
    ]
    for task in tasks(run.scenario, run.program):
        own = {
            name.removeprefix(f"{task.prefix}."): f for name, f in figures.items() if name.startswith(f"{task.prefix}.")
        }
        if isinstance(task, ContourTask):
            result += [f"{task.prefix}: {words}" for words in contour_words(contours(run)[task.prefix])]
        elif own and isinstance(task, PositioningTask):
            cause = f"stops of {task.approach.axis}"
            remedy = next((entry.what for entry in proposals if entry.cause == cause), "")
            result.append(f"{task.prefix.replace('#', ' no. ')} {stop_words(own, task.band, remedy)}")
        elif own and not isinstance(task, CircleTask):
            result.append(f"{task.prefix}: {accuracy_words(own)}")
    return [*filter(None, map(sheet.verdict_line, sheet.sheets_of(run))), *result]


def cause_tiles(causes: Mapping[str, Diagnosis]) -> list[Tile]:
    """The first three causes of the first circle; none without causes."""
    first = next(iter(causes.values()), None)
    return [] if first is None else [cause_tile(first, term) for term in actionable_causes(first)[:TILES_SHOWN]]


def tiles(
    figures: Mapping[str, Figure], limits: Mapping[str, float] | None = None, diagnosed: Sequence[str] = ()
) -> list[Tile]:
    """Leading figures, those first that answer what is asked. limits: of figures by their names [um].

    diagnosed: prefixes of circles whose causes have tiles, peaks among them.

    A reversal has one height: over the fitted rest of the circle where that is known, else the quadrant glitch.
    """
    named = [
        name for name in figures
        if is_leading(name, HEADER) and not _has_peak(name, figures)
        and not (".peak_" in name and name.partition(".")[0] in diagnosed)
    ]  # fmt: skip

    def place(name: str) -> tuple[int, int]:
        key = re.sub("^(peak|glitch)_.*", "peak", name.partition(".")[2])
        size = abs(figures[name].value) if key == "peak" else 0
        return FIRST_FIGURES.index(key) if key in FIRST_FIGURES else len(FIRST_FIGURES), -round(
            1e3 * size
        ) if math.isfinite(size) else 0

    return [tile(name, figures[name], (limits or {}).get(name)) for name in sorted(named, key=place)]


def _has_peak(name: str, figures: Mapping[str, Figure]) -> bool:
    """Whether a figure is a glitch whose height over the fitted rest is known, too."""
    return ".glitch_" in name and name.replace(".glitch_", ".peak_") in figures


def lead_picture(run: JudgedRun, pictures: Sequence[Picture]) -> Picture | None:
    """The picture of the first screen, where it is not the first one: a stop without the way to it."""
    for task in tasks(run.scenario, run.program)[:1]:
        if isinstance(task, PositioningTask) and pictures and (chart := pictures[0].chart) is not None:
            panel = next(
                (panel for panel in chart.panels if isinstance(panel, Panel) and panel.title == OVERSHOOT_TITLE), None
            )
            if panel is not None:
                title = f"Axis {task.approach.axis} about its target"
                shown = Chart([replace(panel, title="", height=1.9)])
                return replace(pictures[0], stem=f"{pictures[0].stem}-first", title=title, shows=shown)
    return None


def tile(name: str, figure: Figure, limit: float | None = None) -> Tile:
    """A figure with its name in words, and its limit [um] where it has one."""
    prefix, _, key = name.partition(".")
    what, _, axis = key.partition("_")
    label = TILES.get(key, f"{OF_REVERSALS[what]}, {axis} reverses" if what in OF_REVERSALS and axis else key)
    allowed = "" if limit is None else f" (limit {limit:g} µm)"
    return Tile(tile_value(figure), f"{prefix.replace('#', ' no. ')}: {label}{allowed}", typeset(figure.meaning))


def draw(run: JudgedRun, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis] | None = None) -> list[Picture]:
    """The figures of a report: those of every evaluation, and an overview of all axes. causes: as of report_of()."""
    machine = run.scenario.machine
    return with_remark(_draw_tasks(run, figures, causes or {}), f"{machine.name}. {machine.note}", *NARROW)


def _draw_tasks(run: JudgedRun, figures: Mapping[str, Figure], causes: Mapping[str, Diagnosis]) -> list[Picture]:
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
                contour_picture(run.trace, task.turn, f"contour-{stem}", task.back, causes.get(task.prefix))
            )
            torques = torque_picture(run.trace, task.turn, signs, f"torque-{stem}")
            pictures += [torques] if torques is not None else []
        elif isinstance(task, ContourTask):
            pictures += contour_pictures(task.prefix, contours(run)[task.prefix], stem)
        else:
            pictures.append(accuracy_picture(task.prefix, task.accuracies(run.trace)[""], f"accuracy-{stem}"))
    overview = overview_picture(run.trace, list(run.scenario.machine.axes), signs, "overview")
    return [*pictures, overview] if overview is not None else pictures


def motions_section(run: JudgedRun) -> Section:
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


def loads_section(run: JudgedRun) -> Section | None:
    """What every load has done; None without one."""
    rows = [
        (str(work.load), work.words, work.input, f"{number(work.peak, 4)} {typeset(work.unit)}",
         *(number(value, 3) for value in (work.given, work.taken)))
        for work in run.loads
    ]  # fmt: skip
    heads = ("No.", "Where it acts", "Column", "Largest", "Work on the machine [J]", "Work taken from it [J]")
    note = "A load acts as its mean over each control cycle. A process takes work from the machine."
    return Section("Loads", [Table("rllrrr", heads, rows, note)]) if rows else None


def provenance(run: JudgedRun) -> Section:
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
            f"{coupling.scheme}, {count_things(coupling.steps(machine), 'exchange step')} per control cycle"
            + (", inside one unit" if coupling.units == "one" else ""),
        ),
    ]
    used, parameters = content.archives_table(run.units), content.parameters_section(machine)
    return content.provenance_section(rows, input_files(scenario), used, _coupling_section(run.coupling), parameters)


def _coupling_section(coupling: Mapping[str, float]) -> Section | None:
    rows = []
    for axis in dict.fromkeys(name.partition(".")[0] for name in coupling):
        work, residual = (coupling.get(f"{axis}.{name}", math.nan) for name in ("friction_work", "residual"))
        share = abs(residual / work) if work else math.nan
        rows.append((axis, *(number(value, 3) for value in (work, residual, share))))
    heads = ("Axis", "Friction work [J]", "Interface energy residual [J]", "Share")
    note = "The residual is the energy that the exchange between plant and friction creates or loses."
    return Section("Coupling", [Table("lrrr", heads, rows, note)]) if rows else None


def real_time_factor(run: JudgedRun) -> float | None:
    """Simulated time over the time that it took; above 1 is faster than real time."""
    return run.program.duration / run.wall_time if run.wall_time > 0 else None


def speed_line(run: JudgedRun) -> str:
    """How long the simulated time is, and how fast it was: "12 s simulated in 0.095 s (130 times real time)"."""
    factor = real_time_factor(run)
    times = "" if factor is None else f" ({float(f'{factor:.2g}'):g} times real time)"
    return f"{run.program.duration:.4g} s simulated in {run.wall_time:.2g} s{times}"


def summary_line(run: JudgedRun, figures: Mapping[str, Figure]) -> str:
    """The run in one line: its leading figures, and how fast it was."""
    shown = [] if wrong_findings(run) else [f"{name} {figures[name]}" for name in leading_names(figures)]
    return ", ".join([*shown, speed_line(run)])


def leading_names(figures: Mapping[str, Figure]) -> list[str]:
    """Names of the figures that say most, a reversal by one height."""
    return [name for name in figures if is_leading(name, LINE) and not _has_peak(name, figures)]


def is_leading(name: str, among: Sequence[str]) -> bool:
    """Whether a figure, named with its prefix, is one of ``among`` by the scales, or the quadrant glitch of an axis."""
    _, _, figure = name.partition(".")
    return figure in among or (figure.startswith(("glitch_", "peak_")) and figure[-1] not in "+-")


def log_text(logging: Logging, log: Trace | None) -> str:
    """Settings of a log in a line, for a person."""
    parts = [f"log.csv: every {duration(logging.interval)}, {', '.join(log) if log is not None else 'nothing'}"]
    for name, given in (
        ("noise", {signal: _level(level, signal, log) for signal, level in logging.noise.given().items()}),
        (
            "steps",
            {signal: show(step, signal_unit(signal, log)) for signal, step in logging.quantisation.given().items()},
        ),
        ("delay", {signal: duration(delay) for signal, delay in logging.delay.given().items()}),
    ):
        if given:
            parts.append(f"{name} {', '.join(f'{signal} {text}' for signal, text in given.items())}")
    return "; ".join([*parts, *([f"seed {logging.seed}"] if logging.noise.given() else [])])


def _level(level: Level, signal: str, log: Trace | None) -> str:
    return f"{level.value * 100:.6g} % of its RMS" if level.relative else show(level.value, signal_unit(signal, log))


def signal_unit(signal: str, log: Trace | None) -> str:
    return next((log.unit(name) for name in log or () if name.partition(".")[2] == signal), "") if log else ""
