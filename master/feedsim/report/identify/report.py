"""The report of an identification: its page, friction.yaml and CSV files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from feedsim.estimation.interval import NORMAL_95
from feedsim.identify import Identified, friction_file
from feedsim.identify.friction_file import FRICTION_FILE
from feedsim.identify.result import Estimate, Identification
from feedsim.report.content import FOLDER, Bullets, Paragraph, Part, Report, Section, Table, Text, Tile, code
from feedsim.report.formatting import counted, display_unit, minus, powers, typeset
from feedsim.report.identify import quantities
from feedsim.report.identify.plots import describe, pictures_of
from feedsim.report.identify.summary import open_loop_csv, plateaus_csv, residuals_csv
from feedsim.report.picture import Picture
from feedsim.report.provenance import software
from feedsim.report.results import Content
from feedsim.report.sections import provenance_section
from feedsim.report.style import remarked

PLATEAUS, RESIDUALS, OPEN_LOOP = "plateaus.csv", "residuals.csv", "open_loop.csv"
FILES = (FRICTION_FILE, PLATEAUS, RESIDUALS, OPEN_LOOP)  # besides report.html and summary.json
REMARK_WIDTH, REMARK_LINES = 100, 3  # fits the narrowest figure
LEADING = ("F_C", "F_S", "sigma_0", "v_s", "F_log", "sigma_2", "sigma_1", "W", "gamma", "M_0", "J", "delay")
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


def files_of(identified: Identified) -> dict[str, Content]:
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


def draw(identified: Identified) -> list[Picture]:
    """The pictures; each says what its numbers are worth."""
    with remarked(quantities.remark(identified), REMARK_WIDTH, REMARK_LINES):
        return list(pictures_of(identified))


def report_of(identified: Identified, pictures: Sequence[Picture]) -> Report:
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
        next_step=(
            "Run the machine with this friction:\n",
            code(
                f"feedsim run SCENARIO.yaml --set machine.axes.{identification.axis}.friction={FOLDER}/{FRICTION_FILE}"
            ),
        ),
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


def answers(identification: Identification) -> list[str]:
    """How well friction is known, what the records leave open, and what to do next."""
    lines = []
    if (stage := identification.stationary) is not None and quantities.is_curve(stage):
        alone = "" if identification.prior else " by stage 1 alone"
        lines.append(
            f"Friction over speed is known to +-{100 * quantities.curve_error(stage):.2g} % (95 %){alone}; "
            f"no plateau is further from the curve than {100 * stage.worst_curve:.2g} %."
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


def _tiles(identified: Identified) -> list[Tile]:
    """Parameters, those first that most is asked of, and behind them how near the model comes."""
    identification = identified.found
    tiles = []
    for name in LEADING:
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
            count = counted(quantities.speeds_of(stage), "speed")
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
        parts += [Paragraph("Its own doubts, which are none about the values above:"), _bullets(stage.warnings)]
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


def _provenance(identified: Identified) -> Section:
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
