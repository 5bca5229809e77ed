"""The report of an identification: its page, friction.yaml and CSV files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from feedsim.estimation.identify import IdentifiedFriction, friction_file
from feedsim.estimation.identify.friction_file import FRICTION_FILE
from feedsim.estimation.identify.result import Balance, Correlation, Dynamic, Estimate, Identification, Stretch
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.report.chart import Axis, Chart, Curve, Grid, Level, Panel
from feedsim.report.content import (
    FOLDER,
    Bullets,
    Paragraph,
    Part,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    provenance_section,
    with_remark,
)
from feedsim.report.formatting import (
    ALTERNATIVE_COLOUR,
    BLUE,
    GREEN,
    MUTED,
    ORANGE,
    PURPLE,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    VERMILLION,
    Array,
    count_things,
    display_unit,
    minus,
    powers,
    typeset,
)
from feedsim.report.identify import stribeck_plots as quantities
from feedsim.report.identify.stribeck_plots import (
    SPEED_AXIS,
    TIME_AXIS,
    TORQUE_AXIS,
    ZERO,
    plateaus_picture,
    stribeck_picture,
)
from feedsim.report.identify.summary import open_loop_csv, plateaus_csv, residuals_csv
from feedsim.report.provenance import software
from feedsim.report.results import Content

# --- The pictures of a report on an identification; those of stage 1 are in stribeck_plots ----------------------------


MOST_LOOPS = 6
COLUMNS = 3
LONG_TRAVEL = 2e-3  # [m] of travel from which positions are shown in mm
COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, MUTED)
ZEROS = (ZERO, Level(0.0, upright=True, dash=""))
MOST_RECORDS = 3  # in open loop, side by side
STRONG = 0.9  # correlation that is printed bold
Abscissa = Literal["speed", "position"]


def pictures_of(identified: IdentifiedFriction) -> list[Picture]:
    """All pictures that the stages give."""
    identification = identified.found
    pictures: list[Picture | None] = []
    if (stage := identification.stationary) is not None:
        pictures += [
            stribeck_picture(identification, stage),
            plateaus_picture(identification, stage, identified.records),
        ]
    if (dynamic := identification.dynamic) is not None:
        pictures += [
            loops_picture(identification, dynamic, "speed"),
            loops_picture(identification, dynamic, "position"),
        ]
        pictures.append(residuals_picture(identification, dynamic))
    if identification.balance is not None:
        pictures.append(open_loop_picture(identification, identification.balance))
    pictures.append(correlation_picture(identification.axis, identification.correlation))
    return [picture for picture in pictures if picture is not None]


def loops_picture(identification: Identification, stage: Dynamic, over: Abscissa) -> Picture | None:
    """Measured and model torque of each move, over speed or over position; None where there is no stretch."""
    shown = _distinct(stage.stretches)
    if not shown:
        return None
    columns = 2 if len(shown) == 4 else min(COLUMNS, len(shown))
    remaining = len(stage.stretches) - len(shown)
    more = f" {count_things(remaining, 'further stretch is', 'further stretches are')} not shown." if remaining else ""
    about = ", about its middle" if over == "position" else ""
    caption = (
        f"Axis {identification.axis}: motor torque less inertia and known load{about}, with the friction model driven "
        f"by the recorded motion.{more}"
    )
    panels = []
    for stretch in shown:
        x, axis = _abscissa(stretch, identification.I_P, over)
        curves = [
            Curve("measured", x, stretch.measured, RECORDED_COLOUR, width=1.9, dots=True, most=2000),
            Curve("model", x, stretch.model, SIMULATED_COLOUR, width=1.2, most=2000),
        ]
        panels.append(Panel(describe(stretch, identification.I_P), axis, TORQUE_AXIS, curves, ZEROS))
    chart = Chart(panels, (1.0,) * columns)
    return Picture(f"loops-{over}", f"Friction torque over {over}", caption, chart)


def _abscissa(stretch: Stretch, I_P: float, over: Abscissa) -> tuple[Array, Axis]:
    if over == "speed":
        return stretch.speed, SPEED_AXIS
    scale, unit = _length([stretch], I_P)
    return _position(stretch, scale), Axis("position", unit)


def residuals_picture(identification: Identification, stage: Dynamic) -> Picture | None:
    """Measured less model: over time, over speed and over position."""
    stretches = [stretch for stretch in stage.stretches if len(stretch.time)]
    if not stretches:
        return None
    caption = (
        "What the friction model leaves over. Dashed: 95 % of the scatter that the fit reckoned with. Structure "
        "over speed or position is what the model does not know."
    )
    scale, unit = _length(stretches, identification.I_P)
    few = len(stretches) <= len(COLOURS)
    names = [describe(stretch, identification.I_P) if few else "stretches" for stretch in stretches]
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(stretches))]
    begin, over_time, levels, over_speed, over_position = 0.0, [], [ZERO], [], []
    residual = Axis("residual", "N·m")
    for stretch, name, colour in zip(stretches, names, colours, strict=True):
        remaining = stretch.measured - stretch.model
        time = stretch.time - stretch.time[0] + begin
        over_time.append(Curve(name, time, remaining, colour, width=0.9))
        for sign in (1, -1):
            level = sign * NORMAL_95 * stretch.weight
            levels.append(Level(level, ends=(float(time[0]), float(time[-1]))))
        over_speed.append(Curve(name, stretch.speed, remaining, colour, width=1.0, dots=True, most=1500))
        over_position.append(Curve(name, _position(stretch, scale), remaining, colour, width=1.0, dots=True, most=1500))
        begin = float(time[-1])
    time_axis = Axis("time, stretches one after another", "s")
    chart = Chart([
        Panel(f"Measured less model, {stage.rms:.2g} N·m rms", time_axis, residual, over_time, levels),
        Panel("Over speed", SPEED_AXIS, residual, over_speed, [ZERO]),
        Panel("Over position", Axis("position about the middle of the move", unit), residual, over_position, [ZERO]),
    ])  # fmt: skip
    return Picture("residuals", "Residuals", caption, chart)


def open_loop_picture(identification: Identification, balance: Balance) -> Picture | None:
    """Position and its error over time, before and after, a column per record; None where nothing was tried."""
    drifts = balance.drifts[:MOST_RECORDS]
    if not drifts:
        return None
    mm = 1e3 * identification.I_P
    before, end = (mm * rms for rms in balance.position)
    remaining = len(balance.drifts) - len(drifts)
    more = f" {count_things(remaining, 'further record is', 'further records are')} not shown." if remaining else ""
    fate = "" if balance.applied else " What was tried was not taken."
    caption = (
        f"Axis {identification.axis}: position from the start on, recorded and of a rigid axis that the recorded "
        f"torque drives against this friction: off by {before:.3g} mm rms before the step, {end:.3g} mm "
        f"{'after it' if balance.applied else 'with what it tried'}.{fate}{more}"
    )
    after = "open loop, after" if balance.applied else "open loop, tried"
    above, below = [], []
    for k, drift in enumerate(drifts):
        position = [
            Curve("recorded", drift.time, mm * drift.angle, RECORDED_COLOUR, width=1.6),
            Curve(
                "open loop, before", drift.time, mm * (drift.angle - drift.before), ALTERNATIVE_COLOUR, "dashed", 1.1
            ),
            Curve(after, drift.time, mm * (drift.angle - drift.after), SIMULATED_COLOUR, width=1.1),
        ]
        error = [
            Curve("open loop, before", drift.time, mm * drift.before, ALTERNATIVE_COLOUR, "dashed", 1.1),
            Curve(after, drift.time, mm * drift.after, SIMULATED_COLOUR, width=1.1),
        ]
        above.append(Panel(drift.record, TIME_AXIS, Axis("position", "mm"), position, linked=f"t{k}"))
        below.append(
            Panel("", TIME_AXIS, Axis("recorded less open loop", "mm"), error, [ZERO], linked=f"t{k}", height=0.8)
        )
    return Picture("open-loop", "Position in open loop", caption, Chart([*above, *below], (1.0,) * len(drifts)))


def correlation_picture(axis: str, correlation: Correlation) -> Picture | None:
    """The matrix, without its diagonal, which says nothing; None where nothing was estimated."""
    names = correlation.names
    if len(names) < 2:
        return None
    caption = (
        "Blue: two parameters err in the same direction, vermillion: in opposite ones. Close to ±1 (bold from "
        f"{STRONG:g}) the data determine a combination of both rather than each; the curve can be sure all "
        "the same. Empty: not known."
    )
    matrix = np.array(correlation.matrix, dtype=float)
    np.fill_diagonal(matrix, np.nan)
    title = f"Axis {axis}: correlation of the parameters"
    grid = Grid(title, names, names, matrix, (-1.0, 1.0), 2, np.abs(matrix) >= STRONG)
    return Picture("correlation", "Correlation matrix", caption, Chart([grid]))


def describe(stretch: Stretch, I_P: float) -> str:
    """ "20 µm, 5 Hz", or the range of a motion that is no sine."""
    amplitude = stretch.amplitude * I_P
    length = f"{amplitude * 1e6:.3g} µm" if amplitude < 1e-3 else f"{amplitude * 1e3:.3g} mm"
    if stretch.kind == "sine" and math.isfinite(stretch.frequency):
        return f"{length}, {stretch.frequency:.3g} Hz"
    return f"motion of ±{length}"


def _distinct(stretches: Sequence[Stretch]) -> list[Stretch]:
    """The first of each amplitude and frequency, sines first; MOST_LOOPS at most."""
    once: dict[tuple[str, float, float], Stretch] = {}
    for stretch in sorted(stretches, key=lambda s: s.kind != "sine"):
        frequency = round(stretch.frequency, 1) if math.isfinite(stretch.frequency) else 0.0
        once.setdefault((stretch.kind, float(f"{stretch.amplitude:.1g}"), frequency), stretch)
    return list(once.values())[:MOST_LOOPS]


def _position(stretch: Stretch, scale: float) -> Array:
    """About the middle of the move; scale: display unit per radian."""
    middle = (stretch.angle.max() + stretch.angle.min()) / 2
    return np.asarray((stretch.angle - middle) * scale)


def _length(stretches: Sequence[Stretch], I_P: float) -> tuple[float, str]:
    """Display unit of positions per radian, and its name: um, or mm for long moves."""
    longest = max(float(np.ptp(stretch.angle)) for stretch in stretches) * I_P
    return (1e6 * I_P, "µm") if longest < LONG_TRAVEL else (1e3 * I_P, "mm")


PLATEAUS, RESIDUALS, OPEN_LOOP = "plateaus.csv", "residuals.csv", "open_loop.csv"
FILES = (FRICTION_FILE, PLATEAUS, RESIDUALS, OPEN_LOOP)  # besides report.html and summary.json
REMARK_WIDTH, REMARK_LINES = 100, 3  # fits the narrowest figure
LEADING_PARAMETERS = ("F_C", "F_S", "sigma_0", "v_s", "F_log", "sigma_2", "sigma_1", "W", "gamma", "M_0", "J", "delay")
HEADS = ("Parameter", "Meaning", "Value", "Unit", "95 % interval", "±", "At the slide", "Unit", "Remark")
METHOD = (
    "Stage 1 fits the stationary friction to mean torques at constant speed; stage 2 drives the friction model with "
    "the recorded motion and fits its torque. Equations and sources: docs/identification.md."
)
OPEN_LOOP_METHOD = (
    "Driven by the recorded torque, a rigid axis with this friction drifts away from the recorded position: what is "
    "wrong all through the record shows there, and is lost in the residual of the torque. Constant load M_0 and "
    "Coulomb friction F_C are therefore taken from the position in open loop, F_S moves with F_C. The load may drift "
    "over a record: M_0 is that in the middle of it."
)


def files_of(identified: IdentifiedFriction) -> dict[str, Content]:
    """friction.yaml, plateaus.csv, residuals.csv and open_loop.csv, where there are any."""
    identification = identified.found
    files: dict[str, Content] = {FRICTION_FILE: friction_file.friction_yaml(identified, software())}
    if identification.stationary is not None:
        files[PLATEAUS] = plateaus_csv(identification)
    if identification.dynamic is not None:
        files[RESIDUALS] = residuals_csv(identification)
    if identification.balance is not None and identification.balance.drifts:
        files[OPEN_LOOP] = open_loop_csv(identification.balance)
    return files


def draw(identified: IdentifiedFriction) -> list[Picture]:
    """The pictures; each says what its numbers are worth."""
    return with_remark(pictures_of(identified), quantities.remark(identified), REMARK_WIDTH, REMARK_LINES)


def report_of(identified: IdentifiedFriction, pictures: Sequence[Picture]) -> Report:
    """Content of the report."""
    identification = identified.found
    machine = f"{identified.subject.machine.name} · " if identified.subject is not None else ""
    drifts = identification.balance is not None and identification.balance.drifts
    tables = ", ".join([PLATEAUS, RESIDUALS, *([OPEN_LOOP] if drifts else [])])
    return Report(
        f"Friction of axis {identification.axis}",
        f"{machine}identified from {', '.join(identified.traces)} · {identified.date}",
        answer=answers(identification),
        warnings=identified.warnings,
        notes=identified.notes,
        tiles=_tiles(identified),
        next_step=_next_step(identified),
        main=[
            _use(identification),
            Section("What further moves would determine", [_bullets(identification.advice)])
            if identification.advice
            else None,
            *pictures,
            _parameters(identification),
            _stage_1(identification),
            _open_loop(identification),
            _rigid(identification),
            _stretches(identification),
        ],
        provenance=_provenance(identified),
        footer=f"{METHOD} Values in full precision: summary.json; the parameters as files take them: {FRICTION_FILE}; "
        f"what the figures show: {tables}.",
    )


def _next_step(identified: IdentifiedFriction) -> Step:
    """A run with this friction: of the scenario that was named, else of the example with one axis."""
    subject, axis = identified.subject, identified.found.axis
    if subject is not None and subject.scenario is not None:
        key = f"machine.axes.{axis}.friction={FOLDER}/{FRICTION_FILE}"
        return Step(
            "Run the machine with this friction", "run", {"scenario": subject.file, "machine": None, "set": [key]}
        )
    example, on = ("z_positioning", "Z") if axis == "Z" else ("one_axis", "X")
    key = f"machine.axes.{on}.friction={FOLDER}/{FRICTION_FILE}"
    return Step(
        "Try the friction in an example; a machine file takes it as its key friction",
        "run",
        {"scenario": f"{example}.yaml", "machine": None, "set": [key]},
        f"feedsim example {example}",
    )


def _residual(percent: float) -> str:
    return "<0.001 %" if percent < 1e-3 else f"{percent:.2g} %"


def answers(identification: Identification) -> list[str]:
    """How well friction is known, what the records leave open, and what to do next."""
    lines = []
    if (stage := identification.stationary) is not None and quantities.is_curve(stage):
        alone = "" if identification.prior else " by stage 1 alone"
        lines.append(
            f"Friction over speed is known to +-{100 * quantities.curve_error(stage):.2g} % (95 %){alone}; "
            f"largest residual of a plateau: {_residual(100 * stage.worst_curve)}."
        )
    if identification.dynamic is not None:
        lines.append(f"The model leaves {identification.dynamic.rms:.3g} N.m rms of the recorded friction torque.")
    open_ones = [name for name, estimate in identification.estimates.items() if estimate.status == "undetermined"]
    if open_ones:
        lines.append(
            f"The records do not determine {', '.join(open_ones)}"
            + ("; which moves would is said below." if identification.advice else ".")
        )
    elif identification.dynamic is None:
        lines.append("Plateaus determine the curve alone: stiffness and damping of the bristles need sines.")
    return lines


def _tiles(identified: IdentifiedFriction) -> list[Tile]:
    """Parameters, those first that most is asked of, and behind them how near the model comes."""
    identification = identified.found
    tiles = []
    for name in LEADING_PARAMETERS:
        estimate = identification.estimates.get(name)
        if estimate is None or estimate.status not in ("estimated", "given"):
            continue
        factor, unit = quantities.shown_unit(estimate)
        relative = friction_file.relative_text(estimate)
        label = f"{name}, {estimate.meaning}" + (f" (±{relative})" if relative else "")
        value = f"{minus(powers(friction_file.value_text(estimate, factor)))} {display_unit(unit)}".strip()
        tiles.append(Tile(value, typeset(label), typeset(estimate.meaning)))
    return [*tiles, *_errors(identification)]


def _errors(identification: Identification) -> Iterator[Tile]:
    if (stage := identification.stationary) is not None:
        alone = "" if identification.prior else ", stage 1 alone"
        if quantities.is_curve(stage):
            text = f"±{100 * quantities.curve_error(stage):.2g} %"
            meaning = f"largest half width of the 95 % band of the Stribeck curve{alone}"
            yield Tile(text, f"error of the curve (95 %){alone}", meaning)
        else:
            count = count_things(quantities.speeds_of(stage), "speed")
            yield Tile("no curve", f"{count}, three make a curve", "distinct speeds of the plateaus")
        meaning = "largest relative deviation of a plateau's friction from the curve"
        yield Tile(f"{powers(f'{100 * stage.worst_curve:.2g}')} %", f"largest deviation of a plateau{alone}", meaning)
    if identification.dynamic is not None:
        meaning = "friction torque measured less that of the model, over all stretches"
        yield Tile(f"{identification.dynamic.rms:.3g} N·m", "residual of stage 2, rms", meaning)


def _use(identification: Identification) -> Section | None:
    hint = friction_file.constant_load_hint(identification)
    return Section("Constant load", [Paragraph(f"The {typeset(hint)}.")]) if hint else None


def _bullets(texts: Sequence[str]) -> Bullets:
    return Bullets([typeset(text) for text in texts])


def _parameters(identification: Identification) -> Section:
    note = (
        "Values count on the motor's side; at the slide with the lead I_P = pitch/(2π), "
        f"{identification.I_P * 1e3:.5g} mm/rad: forces F/I_P, stiffness σ₀/I_P², mass J/I_P². Intervals come from "
        "the model linearised at the optimum; they know scatter, not a wrong model."
    )
    rows = [_row(estimate, identification.I_P) for estimate in identification.estimates.values()]
    return Section("Parameters", [Table("ltrlrrrlt", HEADS, rows, note)], "parameters")


def _stage_1(identification: Identification) -> Section | None:
    """What stage 1 says of itself where the values do not rest on it; else that is among the warnings."""
    stage = identification.stationary
    if stage is None or identification.prior:
        return None
    parts: list[Part] = [
        Paragraph(
            "Both stages are of the same records, which must not count twice: the values above are those of stage 2 "
            "alone, the curve of stage 1 stands beside them."
        )
    ]
    if stage.warnings:
        parts += [
            Paragraph("Its own doubts, which are none about the values above:"),
            _bullets([str(warning) for warning in stage.warnings]),
        ]
    return Section("Stage 1", parts, "stage-1")


def _open_loop(identification: Identification) -> Section | None:
    """Applied or refused and why; position, torque and parameters before and after."""
    balance = identification.balance
    if balance is None:
        return None
    verdict = "Applied: the values above hold it." if balance.applied else f"Not applied: {balance.reason}."
    parts: list[Part] = [Paragraph(typeset(verdict))]
    if balance.drifts:
        per_slide = (("rad", 1e3 * identification.I_P, "mm"), ("N·m", 1 / identification.I_P, "N"))
        rows = [
            _change("Error of the position, rms", balance.position, *per_slide[0]),
            _change("Residual of the torque, rms", balance.torque, *per_slide[1]),
            *(_change(code(name), pair, *per_slide[1]) for name, pair in balance.changes.items()),
        ]
        last = "After" if balance.applied else "Tried"
        heads = ("", "Before", last, "Unit", "At the slide before", last.lower(), "Unit", "Change")
        parts.append(Table("lrrlrrlr", heads, rows))
    parts += [Paragraph(typeset(f"{text}.")) for text in friction_file.drift_texts(balance)]
    parts.append(Paragraph(OPEN_LOOP_METHOD, "muted"))
    return Section("Position in open loop", parts, "position-in-open-loop")


def _change(name: Text, pair: tuple[float, float], unit: str, factor: float, unit_there: str) -> tuple[Text, ...]:
    """A row: before and after on the motor's side and at the slide, and the change, in percent unless it is M_0."""
    change = f"{pair[1] - pair[0]:+.3g} N·m" if name == code("M_0") else friction_file.change_text(*pair)
    here = (minus(f"{value:.4g}") for value in pair)
    there = (minus(f"{factor * value:.4g}") for value in pair)
    return name, *here, unit, *there, unit_there, minus(change)


def _rigid(identification: Identification) -> Section | None:
    rows = [_row(estimate, identification.I_P) for estimate in identification.rigid.values()]
    note = (
        "M = J dn/dt + σ₂ n + F_C sgn n + M_0, linear least squares over all parts of the records in which the axis "
        "moves: a check of inertia, torque constant and signs. No friction model but the sign of the speed: its F_C "
        "and σ₂ are other quantities than those above."
    )
    return Section("Rigid axis with simple friction", [Table("ltrlrrrlt", HEADS, rows, note)]) if rows else None


def _row(estimate: Estimate, I_P: float) -> tuple[Text, ...]:
    factor, unit = quantities.shown_unit(estimate)
    slide = quantities.at_slide(estimate.name, I_P)
    here, unit_here = friction_file.value_text(estimate, factor), display_unit(unit)
    there = friction_file.value_text(estimate, slide[0]) if slide else ""
    unit_there = display_unit(slide[1]) if slide else ""
    interval, relative = friction_file.interval_text(estimate, factor), friction_file.relative_text(estimate)
    return (
        code(estimate.name), typeset(estimate.meaning), minus(powers(here)), unit_here, minus(powers(interval)),
        relative, minus(powers(there)), unit_there, typeset(friction_file.remark_text(estimate)),
    )  # fmt: skip


def _stretches(identification: Identification) -> Section | None:
    stage = identification.dynamic
    if stage is None or not stage.stretches:
        return None
    rows = [
        (
            stretch.record,
            describe(stretch, identification.I_P),
            f"{stretch.time[0]:.3f}",
            f"{stretch.time[-1]:.3f}",
            f"{stretch.rms:.3g}",
            f"{stretch.weight:.3g}",
        )
        for stretch in stage.stretches
    ]
    heads = ("Record", "Move", "Begin [s]", "End [s]", "Residual rms [N·m]", "Scatter reckoned with [N·m]")
    known = ""
    if stage.without_delay:
        parts = [
            f"{name} ±{100 * NORMAL_95 * sigma / abs(stage.estimates[name].value):.2g} %"
            for name, sigma in stage.without_delay.items()
            if name in stage.estimates and NORMAL_95 * sigma < abs(stage.estimates[name].value)  # else no share of it
        ]
        known = f"Were the delay known, the intervals would be {', '.join(parts)}."
    return Section("Stretches of stage 2", [Table("llrrrr", heads, rows, known)])


def _provenance(identified: IdentifiedFriction) -> Section:
    rows = []
    for name, source in zip(identified.traces, identified.sources, strict=True):
        columns = ", ".join(f"{role} from {column}" for role, column in source.columns.items())
        given = [f"pitch {source.pitch * 1e3:.9g} mm"] if source.pitch is not None else []
        given += [f"torque constant {source.torque_constant:.9g} N·m/A"] if source.torque_constant is not None else []
        rows.append((name, "; ".join([columns, *given])))
    if identified.subject is not None:
        subject = identified.subject
        rows.append((subject.kind.capitalize(), f"{subject.name} ({subject.file.name})"))
        rows.append(("Set on the command line", ", ".join(subject.overrides) or "nothing"))
    rows += [(f"--{name}", value) for name, value in identified.settings.items()]
    rows.append(("Duration", ", ".join(f"{step} {taken:.3g} s" for step, taken in identified.found.seconds.items())))
    return provenance_section(rows, quantities.input_files(identified))
