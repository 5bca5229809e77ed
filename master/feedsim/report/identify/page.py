"""report.html of an identification."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from feedsim.identify import Identified
from feedsim.identify.friction_file import (
    FRICTION,
    constant_load_hint,
    interval_text,
    relative_text,
    remark_text,
    value_text,
)
from feedsim.identify.result import NORMAL_95, Estimate, Identification
from feedsim.report.formatting import counted, minus, powers, typeset
from feedsim.report.frame import Tile, frame, picture_section
from feedsim.report.identify.loop_plots import describe
from feedsim.report.identify.open_loop import open_loop_section
from feedsim.report.identify.quantities import (
    at_slide,
    curve_error,
    input_files,
    is_curve,
    shown_unit,
    speeds_of,
    unit_text,
)
from feedsim.report.provenance import software
from feedsim.report.style import Picture
from feedsim.report.tables import files_table, pairs_table, table

LEADING = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "sigma_0", "sigma_1", "W", "gamma", "M_0", "J", "delay")
HEADS = [
    ("Parameter", False), ("Meaning", False), ("Value", True), ("Unit", False), ("95 % interval", True), ("±", True),
    ("At the slide", True), ("Unit", False), ("Remark", False),
]  # fmt: skip
METHOD = (
    "Stage 1 fits the stationary friction to mean torques at constant speed; stage 2 drives the friction model with "
    "the recorded motion and fits its torque. Equations and sources: docs/identification.md."
)


def page(identified: Identified, pictures: Sequence[Picture]) -> str:
    """HTML text of the report."""
    found = identified.found
    machine = f"{identified.subject.machine.name} · " if identified.subject is not None else ""
    traces = ", ".join(identified.traces)
    drifts = found.balance is not None and found.balance.drifts
    tables = ", ".join(["plateaus.csv", "residuals.csv", *(["open_loop.csv"] if drifts else [])])
    return frame(
        f"Friction of axis {found.axis}",
        f"{machine}identified from {traces} · {identified.date}",
        warnings=identified.warnings,
        notes=identified.notes,
        tiles=list(_tiles(identified)),
        main=[
            _use(identified),
            _advice(found.advice),
            *(picture_section(picture) for picture in pictures),
            _parameters(identified),
            _stage_1(found),
            open_loop_section(found),
            _rigid(identified),
            _stretches(identified),
            _provenance(identified),
        ],
        footer=f"{METHOD} Values in full precision: summary.json; the parameters as files take them: {FRICTION}; "
        f"what the figures show: {tables}.",
    )


def _tiles(identified: Identified) -> Iterator[Tile]:
    found = identified.found
    if (stage := found.stationary) is not None:
        alone = "" if found.prior else ", stage 1 alone"
        if is_curve(stage):
            text = f"±{100 * curve_error(stage):.2g} %"
            meaning = f"largest half width of the 95 % band of the Stribeck curve{alone}"
            yield Tile(text, f"error of the curve (95 %){alone}", meaning)
        else:
            count = counted(speeds_of(stage), "speed")
            yield Tile("no curve", f"{count}, three make a curve", "distinct speeds of the plateaus")
        deviation = f"{100 * stage.worst_curve:.2g} %"
        yield Tile(
            deviation, f"worst plateau{alone}", "largest relative deviation of a plateau's friction from the curve"
        )
    for name in LEADING:
        estimate = found.estimates.get(name)
        if estimate is None or estimate.status not in ("estimated", "given"):
            continue
        factor, unit = shown_unit(estimate)
        label = f"{name}, {estimate.meaning}" + (f" (±{relative_text(estimate)})" if relative_text(estimate) else "")
        value = f"{minus(powers(value_text(estimate, factor)))} {unit_text(unit)}".strip()
        yield Tile(value, typeset(label), typeset(estimate.meaning))
    if found.dynamic is not None:
        text = f"{found.dynamic.rms:.3g} N·m"
        yield Tile(
            text, "residual of stage 2, rms", "friction torque measured less that of the model, over all stretches"
        )


def _use(identified: Identified) -> str:
    axis = identified.found.axis
    command = f"feedsim run SCENARIO.yaml --set machine.axes.{axis}.friction={FRICTION}"
    hint = constant_load_hint(identified.found)
    tail = f"<p>The {escape(typeset(hint))}.</p>" if hint else ""
    return f"<h2>Use</h2>\n<p><code>{escape(command)}</code> (with the file's path)</p>{tail}"


def _advice(advice: Sequence[str]) -> str:
    items = "".join(f"<li>{escape(typeset(text))}</li>" for text in advice)
    return f"<h2>What further moves would tell</h2>\n<ul>{items}</ul>" if items else ""


def _parameters(identified: Identified) -> str:
    rows = [_row(estimate, identified.found.I_P) for estimate in identified.found.estimates.values()]
    note = (
        '<p class="muted">Values count on the motor\'s side; at the slide with the lead I_P = pitch/(2π), '
        f"{identified.found.I_P * 1e3:.5g} mm/rad: forces F/I_P, stiffness σ₀/I_P², mass J/I_P². Intervals come from "
        "the model linearised at the optimum; they know scatter, not a wrong model.</p>"
    )
    return '<h2 id="parameters">Parameters</h2>\n' + table(HEADS, rows) + note


def _stage_1(found: Identification) -> str:
    """What stage 1 says of itself where the values do not rest on it; else that is among the warnings."""
    stage = found.stationary
    if stage is None or found.prior:
        return ""
    items = "".join(f"<li>{escape(typeset(text))}</li>" for text in stage.warnings)
    doubts = f"<p>Its own doubts, which are none about the values above:</p>\n<ul>{items}</ul>" if items else ""
    return (
        '<h2 id="stage-1">Stage 1</h2>\n<p>Both stages are of the same records, which must not count twice: the values '
        f"above are those of stage 2 alone, the curve of stage 1 stands beside them.</p>{doubts}"
    )


def _rigid(identified: Identified) -> str:
    rows = [_row(estimate, identified.found.I_P) for estimate in identified.found.rigid.values()]
    if not rows:
        return ""
    note = (
        '<p class="muted">M = J dn/dt + σ₂ n + F_C sgn n + M_0, linear least squares over all parts of the records in '
        "which the axis moves: a check of inertia, torque constant and signs. No friction model but the sign of the "
        "speed: its F_C and σ₂ are other quantities than those above.</p>"
    )
    return "<h2>Rigid axis with simple friction</h2>\n" + table(HEADS, rows) + note


def _row(estimate: Estimate, I_P: float) -> str:
    factor, unit = shown_unit(estimate)
    slide = at_slide(estimate.name, I_P)
    there = (minus(powers(value_text(estimate, slide[0]))), unit_text(slide[1])) if slide else ("", "")
    texts = (value_text(estimate, factor), interval_text(estimate, factor))
    numbers = (*(minus(powers(text)) for text in texts), relative_text(estimate))
    value, interval, relative = (f'<td class="number">{text}</td>' for text in numbers)
    return (
        f"<tr><td><code>{escape(estimate.name)}</code></td><td>{escape(typeset(estimate.meaning))}</td>{value}"
        f"<td>{escape(unit_text(unit))}</td>{interval}{relative}"
        f'<td class="number">{there[0]}</td><td>{escape(there[1])}</td>'
        f"<td>{escape(typeset(remark_text(estimate)))}</td></tr>"
    )


def _stretches(identified: Identified) -> str:
    stage = identified.found.dynamic
    if stage is None or not stage.stretches:
        return ""
    rows = [
        f"<tr><td>{escape(stretch.record)}</td><td>{escape(describe(stretch, identified.found.I_P))}</td>"
        f'<td class="number">{stretch.time[0]:.3f}</td><td class="number">{stretch.time[-1]:.3f}</td>'
        f'<td class="number">{stretch.rms:.3g}</td><td class="number">{stretch.weight:.3g}</td></tr>'
        for stretch in stage.stretches
    ]
    heads = [
        ("Record", False), ("Move", False), ("Begin [s]", True), ("End [s]", True), ("Residual rms [N·m]", True),
        ("Scatter reckoned with [N·m]", True),
    ]  # fmt: skip
    known = ""
    if stage.without_delay:
        parts = [
            f"{name} ±{100 * NORMAL_95 * sigma / abs(stage.estimates[name].value):.2g} %"
            for name, sigma in stage.without_delay.items()
            if name in stage.estimates and stage.estimates[name].value
        ]
        known = f'<p class="muted">Were the delay known, the intervals would be {escape(", ".join(parts))}.</p>'
    return "<h2>Stretches of stage 2</h2>\n" + table(heads, rows) + known


def _provenance(identified: Identified) -> str:
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
    rows.append(("Software", ", ".join(f"{name} {text}" for name, text in software().items())))
    parts = [
        '<section class="provenance">\n<h2>Where the numbers come from</h2>',
        pairs_table(rows),
        files_table(input_files(identified)),
        "</section>",
    ]
    return "\n".join(parts)
