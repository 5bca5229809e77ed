"""What a run's report says of the plant's pose: how far the motion leaves it, or how the plant followed it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from feedsim.cosim import PoseUse
from feedsim.report.tables import pairs_table, table
from feedsim.report.words import minus
from feedsim.structure.pose_change import LOOKED_AT, NEAR, SEEN, AxisChange, Compliance, ModeChange, PoseChange

HEADING = '<h2 id="pose">Pose of the plant</h2>\n'


def pose_section(pose: PoseUse | None) -> str:
    """The section of a report; nothing where nothing is known."""
    if pose is None:
        return ""
    parts = [HEADING, _followed(pose), _distances(pose.change), _unknown(pose.change)]
    parts += [_axis(axis) for axis in pose.change.axes if axis.modes]
    return "\n".join(part for part in parts if part)


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
                "first": _value(axis.limits[0], "m"),
                "last": _value(axis.limits[1], "m"),
                "hysteresis": _value(axis.hysteresis, "m"),
            }
            for axis in pose.grid
        ],
        "crossings": None
        if crossings is None
        else {
            "count": crossings.count,
            "E_kin_lost": _value(crossings.kinetic_lost, "J"),
            "E_el_lost": _value(crossings.elastic_lost, "J"),
            "held": _value(crossings.held, "m"),
            "jump_x_a": _value(crossings.jump_x_a, "m"),
            "jump_n_a": _value(crossings.jump_n_a, "rad/s"),
            "jump_tool": _value(crossings.jump_tool, "m"),
        },
        "one_pose": {axis.axis: _axis_part(axis) for axis in pose.change.axes},
        "unknown": pose.change.unknown,
    }


def _value(value: float, unit: str) -> dict[str, float | str]:
    return {"value": value, "unit": unit}


def _axis_part(axis: AxisChange) -> dict[str, Any]:
    return {
        "pose": _value(axis.pose, "m"),
        "lowest": _value(axis.low, "m"),
        "highest": _value(axis.high, "m"),
        "distance": _value(axis.distance, "m"),
        "modes": [_mode_part(mode) for mode in axis.modes],
        "static_compliance": [_compliance_part(item) for item in axis.compliances],
    }


def _mode_part(mode: ModeChange) -> Mapping[str, Any]:
    return {
        "at_pose": _value(mode.frequency, "Hz"),
        "at_lowest": _value(mode.ends[0], "Hz"),
        "at_highest": _value(mode.ends[1], "Hz"),
        "change": mode.change,
        "MAC": mode.mac,
        "moving": mode.moving,
    }


def _compliance_part(item: Compliance) -> Mapping[str, Any]:
    low, here, high = item.values
    return {"of": item.name, "unit": item.unit, "at_lowest": low, "at_pose": here, "at_highest": high}


def _followed(pose: PoseUse) -> str:
    if not pose.grid:
        return ""
    cells = ", ".join(
        f"{axis.axis}: {len(axis.centres)} cell{'s'[: len(axis.centres) != 1]}, centres {axis.limits[0] * 1e3:.5g} to "
        f"{axis.limits[1] * 1e3:.5g} mm"
        for axis in pose.grid
    )
    text = (
        f"<p>The plant follows the pose ({escape(cells)}): its modes are those of the cell that the axes stand in.</p>"
    )
    found = pose.crossings
    if found is None:
        return text
    rows = [
        ("Crossings", f"{found.count}"),
        ("Kinetic energy lost in all", f"{found.kinetic_lost:.3g} J"),
        ("Elastic energy lost in all (negative: gained)", f"{found.elastic_lost:.3g} J"),
        ("Largest jump of an axis position", f"{found.jump_x_a * 1e9:.2g} nm"),
        ("Largest jump of an axis position that was taken back", f"{found.held * 1e9:.3g} nm"),
        ("Largest jump of a motor speed", f"{found.jump_n_a:.2g} rad/s"),
        ("Largest jump of the tool", f"{found.jump_tool * 1e9:.3g} nm"),
    ]
    return text + pairs_table((name, minus(value)) for name, value in rows)


def _distances(change: PoseChange) -> str:
    if not change.axes:
        return ""
    if change.distance <= NEAR:
        return (
            f"<p>No axis that the plant does not follow moves more than {NEAR * 1e3:.3g} mm away from the pose that "
            "the modes belong to.</p>"
        )
    rows = [
        f'<tr><td>{escape(axis.axis)}</td><td class="number">{axis.pose * 1e3:.6g}</td>'
        f'<td class="number">{axis.low * 1e3:.6g}</td><td class="number">{axis.high * 1e3:.6g}</td>'
        f'<td class="number">{axis.distance * 1e3:.4g}</td><td class="number">{_largest(axis)}</td></tr>'
        for axis in change.axes
    ]
    heads = [
        ("Axis", False), ("Pose [mm]", True), ("Lowest [mm]", True), ("Highest [mm]", True), ("Distance [mm]", True),
        ("Largest change of a frequency", True),
    ]  # fmt: skip
    return (
        "<p>The modes belong to one pose. The axes leave it, and the modes would change, as follows (setpoints; each "
        "axis by itself, the others at the pose).</p>" + table(heads, rows)
    )


def _largest(axis: AxisChange) -> str:
    if axis.largest is None:
        return "below 0.1 %" if axis.distance <= NEAR else "not known"
    return minus(f"{100 * axis.largest.change:+.2g} %")


def _unknown(change: PoseChange) -> str:
    if not change.unknown:
        return ""
    return (
        f"<p>How much the modes change is not known: {escape(change.unknown)}. With a structure file of kind geometry "
        "(key structure of the machine file, docs/structure.md) the modes of any pose can be computed.</p>"
    )


def _axis(axis: AxisChange) -> str:
    rows = [
        f'<tr><td class="number">{mode.frequency:.4g}</td><td class="number">{mode.ends[0]:.4g}</td>'
        f'<td class="number">{mode.ends[1]:.4g}</td><td class="number">{minus(f"{100 * mode.change:+.2g}")}</td>'
        f'<td class="number">{mode.mac:.2f}</td><td>{escape(mode.moving)}</td></tr>'
        for mode in axis.modes
    ]
    heads = [
        ("At the pose [Hz]", True), (f"{axis.axis} {axis.low * 1e3:.5g} mm [Hz]", True),
        (f"{axis.axis} {axis.high * 1e3:.5g} mm [Hz]", True), ("Change [%]", True), ("MAC", True),
        ("What moves, at the pose", False),
    ]  # fmt: skip
    compliances = [
        f"<tr><td>{escape(item.name)}</td>"
        + "".join(f'<td class="number">{abs(value) * 1e9:.4g}</td>' for value in item.values)
        + f"<td>n{escape(item.unit.replace('.', '·'))}</td></tr>"
        for item in axis.compliances
    ]
    compliance_heads = [
        ("Static compliance", False), (f"{axis.axis} {axis.low * 1e3:.5g} mm", True), ("At the pose", True),
        (f"{axis.axis} {axis.high * 1e3:.5g} mm", True), ("Unit", False),
    ]  # fmt: skip
    note = (
        f"Modes up to {LOOKED_AT:g} Hz that hold {100 * SEEN:g} % or more of the static compliance of a drive, a scale "
        "or the tool; matched by MAC, which falls early where modes lie close to one another and mix."
    )
    return (
        f"<h3>Modes over the positions of {escape(axis.axis)}</h3>\n{table(heads, rows)}"
        f'<p class="muted">{note}</p>\n{table(compliance_heads, compliances)}'
    )
