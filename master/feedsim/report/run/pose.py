"""What a run's report says of the plant's pose: how far the motion leaves it, or how the plant followed it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from feedsim.analysis.circle import (
    Diagnosis,
    Peak,
    Term,
    cause_sentence,
    describe_vibrations,
    explain_circle,
    separating_radius,
    suggest_circles,
    term_name,
)
from feedsim.analysis.evaluate import FIGURE_UNITS
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report.content import Paragraph, Part, Section, Table, Tile, pairs_table
from feedsim.report.formatting import count_things, minus, number, three_digits, typeset
from feedsim.report.provenance import finite, quantity
from feedsim.simulation.judge import PoseUse
from feedsim.structure.pose_change import (
    COMPLIANCE_SHARE,
    MAX_MODE_FREQUENCY,
    MIN_POSE_DISTANCE,
    AxisChange,
    Compliance,
    ModeChange,
    PoseChange,
)


def pose_section(pose: PoseUse | None) -> Section | None:
    """The section of a report; none where nothing is known."""
    if pose is None:
        return None
    change = pose.change
    axes = [_axis(axis) for axis in change.axes if axis.modes]
    return Section("Pose of the plant", [*_describe_cells(pose), *_distances(change), _unknown(change), *axes], "pose")


def pose_part(pose: PoseUse | None) -> dict[str, Any] | None:
    """The part of summary.json; null where nothing is known."""
    if pose is None:
        return None
    crossings = pose.crossings
    return {
        "follows": [
            {
                "axis": axis.axis,
                "cells": len(axis.centres),
                "first": quantity(axis.limits[0], "m"),
                "last": quantity(axis.limits[1], "m"),
                "hysteresis": quantity(axis.hysteresis, "m"),
            }
            for axis in pose.grid
        ],
        "crossings": None
        if crossings is None
        else {
            "count": crossings.count,
            "E_kin_lost": quantity(crossings.kinetic_lost, "J"),
            "E_el_lost": quantity(crossings.elastic_lost, "J"),
            "held": quantity(crossings.held, "m"),
            "jump_x_a": quantity(crossings.jump_x_a, "m"),
            "jump_n_a": quantity(crossings.jump_n_a, "rad/s"),
            "jump_tool": quantity(crossings.jump_tool, "m"),
        },
        "one_pose": {axis.axis: _axis_part(axis) for axis in pose.change.axes},
        "unknown": pose.change.unknown,
    }


def _axis_part(axis: AxisChange) -> dict[str, Any]:
    return {
        "pose": quantity(axis.pose, "m"),
        "lowest": quantity(axis.low, "m"),
        "highest": quantity(axis.high, "m"),
        "distance": quantity(axis.distance, "m"),
        "modes": [_mode_part(mode) for mode in axis.modes],
        "static_compliance": [_compliance_part(item) for item in axis.compliances],
    }


def _mode_part(mode: ModeChange) -> Mapping[str, Any]:
    return {
        "at_pose": quantity(mode.frequency, "Hz"),
        "at_lowest": quantity(mode.ends[0], "Hz"),
        "at_highest": quantity(mode.ends[1], "Hz"),
        "change": mode.change,
        "MAC": mode.mac,
        "moving": mode.moving,
    }


def _compliance_part(item: Compliance) -> Mapping[str, Any]:
    low, here, high = item.values
    return {"of": item.name, "unit": item.unit, "at_lowest": low, "at_pose": here, "at_highest": high}


def _describe_cells(pose: PoseUse) -> list[Part]:
    if not pose.grid:
        return []
    cells = ", ".join(
        f"{axis.axis}: {count_things(len(axis.centres), 'cell')}, centres {axis.limits[0] * 1e3:.5g} to "
        f"{axis.limits[1] * 1e3:.5g} mm"
        for axis in pose.grid
    )
    text = Paragraph(f"The plant follows the pose ({cells}): its modes are those of the cell that the axes stand in.")
    result = pose.crossings
    if result is None:
        return [text]
    rows = [
        ("Crossings", f"{result.count}"),
        ("Kinetic energy lost in all", f"{result.kinetic_lost:.3g} J"),
        ("Elastic energy lost in all (negative: gained)", f"{result.elastic_lost:.3g} J"),
        ("Largest jump of an axis position", f"{result.jump_x_a * 1e9:.2g} nm"),
        ("Largest jump of an axis position that was taken back", f"{result.held * 1e9:.3g} nm"),
        ("Largest jump of a motor speed", f"{result.jump_n_a:.2g} rad/s"),
        ("Largest jump of the tool", f"{result.jump_tool * 1e9:.3g} nm"),
    ]
    return [text, pairs_table([(name, minus(value)) for name, value in rows])]


def _distances(change: PoseChange) -> list[Part]:
    if not change.axes:
        return []
    if change.distance <= MIN_POSE_DISTANCE:
        text = (
            f"No axis that the plant does not follow moves more than {MIN_POSE_DISTANCE * 1e3:.3g} mm away from the "
            "pose that the "
            "modes belong to."
        )
        return [Paragraph(text)]
    text = (
        "The modes belong to one pose. The axes leave it, and the modes would change, as follows (setpoints; each "
        "axis by itself, the others at the pose)."
    )
    heads = ("Axis", "Pose [mm]", "Lowest [mm]", "Highest [mm]", "Distance [mm]", "Largest change of a frequency")
    rows = [
        (axis.axis, *(f"{at * 1e3:.6g}" for at in (axis.pose, axis.low, axis.high)), f"{axis.distance * 1e3:.4g}",
         _largest_change(axis))
        for axis in change.axes
    ]  # fmt: skip
    return [Paragraph(text), Table("lrrrrr", heads, rows)]


def _largest_change(axis: AxisChange) -> str:
    if axis.largest is None:
        return "below 0.1 %" if axis.distance <= MIN_POSE_DISTANCE else "not known"
    return f"{_percent(axis.largest.change)} %"


def _percent(share: float) -> str:
    text = f"{100 * share:+.1f}"
    return minus(text) if float(text) else "0.0"


def _unknown(change: PoseChange) -> Paragraph | None:
    if not change.unknown:
        return None
    return Paragraph(
        f"How much the modes change is not known: {change.unknown}. With a structure file of kind geometry (key "
        "structure of the machine file, docs/structure.md) the modes of any pose can be computed."
    )


def _axis(axis: AxisChange) -> Section:
    lowest, highest = (f"{axis.axis} {at * 1e3:.5g} mm" for at in (axis.low, axis.high))
    modes = [
        (*(f"{f:.4g}" for f in (mode.frequency, *mode.ends)), _percent(mode.change), f"{mode.mac:.2f}",
         mode.moving)
        for mode in axis.modes
    ]  # fmt: skip
    heads = ("At the pose [Hz]", f"{lowest} [Hz]", f"{highest} [Hz]", "Change [%]", "MAC", "What moves, at the pose")
    note = (
        f"Modes up to {MAX_MODE_FREQUENCY:g} Hz that hold {100 * COMPLIANCE_SHARE:g} % or more of the static "
        "compliance of a drive, a scale "
        "or the tool; matched by MAC, which falls early where modes lie close to one another and mix."
    )
    compliances = [
        (item.name, *(f"{abs(value) * 1e9:.4g}" for value in item.values), f"n{item.unit.replace('.', '·')}")
        for item in axis.compliances
    ]
    return Section(
        f"Modes over the positions of {axis.axis}",
        [
            Table("rrrrrp", heads, modes, note),
            Table("trrrl", ("Static compliance", lowest, "At the pose", highest, "Unit"), compliances),
        ],
    )


# --- Why a circle is not round, as a section of a report and as part of summary.json ----------------------------------


def diagnosis_section(prefix: str, diagnosis: Diagnosis) -> Section:
    """Every cause with its interval, what it makes alone, its share of G and what it means; and the reversal peaks."""
    rows = [
        (
            term_name(term)[:1].upper() + term_name(term)[1:],
            _value(term),
            _um(term.size),
            _share(term),
            typeset(cause_sentence(diagnosis, term)),
        )
        for term in diagnosis.terms
    ]
    note = (
        "± is half of an interval of 95 %. Alone: from peak to valley of the radial deviation that the cause makes "
        "alone. Share of G: what it contributes where the deviation is largest, less where it is smallest; the shares "
        "add up to 100 %, and one that makes G smaller is negative."
    )
    if diagnosis.left_out:
        axes = " and ".join(diagnosis.left_out)
        note += (
            f"\nA circle of {1e3 * separating_radius(diagnosis.circle, diagnosis.left_out):.3g} mm or more separates "
            f"errors that repeat with the pitch of {axes}; this one is too small."
        )
    if words := describe_vibrations(diagnosis):
        note += f"\n{typeset(words)}"
    note += "".join(f"\n{typeset(words)}" for words in suggest_circles(diagnosis))
    heads = ("Cause", "Amount", "Alone [µm]", "Share of G [%]", "What it means, where to look")
    peaks = [(minus(peak.name), SENSE_WORDS[peak.sense], *_peak(peak)) for peak in diagnosis.peaks]
    peak_heads = ("Reversal at", "Direction", "Peak [µm]", "±", "Width at half the height [ms]", "Falls to 1/e in [ms]")
    peak_note = "Peaks stand over the fitted rest of the circle; 0: nothing stands out of the noise."
    tables = [Table("lrrrp", heads, rows, note)]
    if peaks:  # none on an arc without reversals
        tables.append(Table("llrrrr", peak_heads, peaks, peak_note))
    return Section(f"{prefix}: why the circle is not round", tables)


def cause_tile(diagnosis: Diagnosis, term: Term) -> Tile:
    """A cause by its amount: the height of a peak, the time of a mismatch."""
    own = [peak.height for peak in diagnosis.peaks if term.key == "peaks" and peak.axis == term.axis]
    factor, unit = FIGURE_UNITS[term.unit]
    value = 1e6 * max(own, key=abs) if own else factor * abs(term.value)
    label = f"reversal peak, {term.axis} reverses" if own else term_name(term)
    return Tile(f"{three_digits(value)} {typeset(unit)}", label, typeset(cause_sentence(diagnosis, term)))


def diagnosis_part(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis in summary.json, in SI."""
    return {
        "answer": explain_circle(diagnosis),
        "directions": [SENSE_WORDS[sense] for sense in diagnosis.senses],
        **({"G": quantity(diagnosis.G, "m")} if diagnosis.arc is None else {"arc_range": quantity(diagnosis.G, "m")}),
        "causes": [
            {
                "name": term_name(term),
                **quantity(term.value, term.unit),
                "half_interval": finite(term.half),
                "alone": quantity(term.size, "m"),
                "share": term.share,
                "told_from_zero": term.shows,
                "meaning": cause_sentence(diagnosis, term),
            }
            for term in diagnosis.terms
        ],
        "peaks": [
            {
                "at": peak.name,
                "direction": SENSE_WORDS[peak.sense],
                "height": quantity(peak.height, "m"),
                "half_interval": finite(peak.half),
                "width": quantity(peak.width, "s"),
                "decay": quantity(peak.decay, "s"),
            }
            for peak in diagnosis.peaks
        ],
        "vibrations": [
            {
                "axis": vibration.axis,
                "frequency": quantity(vibration.frequency, "Hz"),
                "amplitude": quantity(vibration.amplitude, "m"),
                "half_interval": finite(vibration.half),
            }
            for vibration in diagnosis.vibrations
        ],
        **_of_records(diagnosis),
        "path_lag": None if diagnosis.lag is None else quantity(diagnosis.lag, "m"),
        "form": {str(order): quantity(amplitude, "m") for order, amplitude in diagnosis.form.items()},
        "noise": quantity(diagnosis.noise, "m"),
    }


def _of_records(diagnosis: Diagnosis) -> dict[str, Any]:
    """What there is besides where an instrument has measured."""
    if diagnosis.angles is None:
        return {}
    return {
        "angle_offset": {
            **quantity(diagnosis.angles.angle, "rad"),
            "standard_deviation": diagnosis.angles.deviation,
            "seen": diagnosis.angles.seen,
        },
        "further": suggest_circles(diagnosis),
    }


def _value(term: Term) -> str:
    """To the digits that its interval leaves it."""
    if not term.determined:
        return "not determined"
    factor, unit = FIGURE_UNITS[term.unit]
    value, half = factor * term.value, factor * term.half
    if not math.isfinite(half) or half <= 0:
        return f"{minus(number(value, 3))} {typeset(unit)}"
    places = max(0, 1 - math.floor(math.log10(half)))
    return f"{minus(f'{value:.{places}f}')} ± {half:.{places}f} {typeset(unit)}"


def _um(value: float) -> str:
    return minus(f"{value * 1e6:.2f}")


def _share(term: Term) -> str:
    return minus(f"{100 * term.share:.1f}").replace("−0.0", "0.0")


def _peak(peak: Peak) -> tuple[str, str, str, str]:
    def ms(value: float) -> str:
        return f"{value * 1e3:.1f}" if math.isfinite(value) else "–"

    return _um(peak.height), _um(peak.half) if math.isfinite(peak.half) else "–", ms(peak.width), ms(peak.decay)
