"""What a run's report says of the plant's pose: how far the motion leaves it, or how the plant followed it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feedsim.report.content import Paragraph, Part, Section, Table, pairs_table
from feedsim.report.formatting import counted, minus
from feedsim.report.provenance import quantity
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
    return Section("Pose of the plant", [*_followed(pose), *_distances(change), _unknown(change), *axes], "pose")


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


def _followed(pose: PoseUse) -> list[Part]:
    if not pose.grid:
        return []
    cells = ", ".join(
        f"{axis.axis}: {counted(len(axis.centres), 'cell')}, centres {axis.limits[0] * 1e3:.5g} to "
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
         _largest(axis))
        for axis in change.axes
    ]  # fmt: skip
    return [Paragraph(text), Table("lrrrrr", heads, rows)]


def _largest(axis: AxisChange) -> str:
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
