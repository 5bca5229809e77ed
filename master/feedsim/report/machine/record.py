"""A machine's structure in figures: as content of a JSON file, and as text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from feedsim.report.provenance import hashed, inputs_part, quantity, software
from feedsim.scenario import Coupling
from feedsim.scenario.coupling import SCHEMES
from feedsim.structure.info import MachineInfo

FORMAT = 1
USUAL_EXCHANGE = SCHEMES[Coupling().scheme]
MEANINGS = {
    "lead": ("m/rad", "travel per radian of the motor"),
    "J_tot": ("kg.m2", "inertia of the axis as a whole, seen by its motor"),
    "J_inf": ("kg.m2", "inertia that a sudden torque meets: 1 / sum of n^2 over all modes"),
    "moving_mass": ("kg", "mass that travels with the axis"),
    "J_moving": ("kg.m2", "reflected inertia of the moving mass, mass x lead^2"),
    "coupling_limit": ("N.m.s/rad", "2 J_inf/h; the slope of friction over speed must stay well below"),
    "friction_slope": ("N.m.s/rad", "sigma_1 + sigma_2, the slope of friction that the exchange meets"),
}


def record(info: MachineInfo, files: Sequence[tuple[str, Path]]) -> dict[str, Any]:
    """Content of build.json. Figures that are not known are null."""
    solution = info.solution
    modes = info.modes
    return {
        "format": FORMAT,
        "name": info.name,
        "note": info.note,
        "warnings": list(info.warnings),
        "pose": {axis: {"value": position, "unit": "m"} for axis, position in info.pose.items()},
        "step": {"value": info.step, "unit": "s"},
        "total_mass": quantity(info.total_mass, "kg"),
        "axes": {
            axis.name: {
                key: quantity(getattr(axis, key), unit, meaning=meaning) for key, (unit, meaning) in MEANINGS.items()
            }
            for axis in info.axes
        },
        "modes": [
            {"mode": k, "frequency": quantity(f, "Hz"), "damping": quantity(d, "1"), "moves": info.moving[k]}
            for k, (f, d) in enumerate(zip(modes.frequency.tolist(), modes.damping.tolist(), strict=True))
        ],
        "solution": None
        if solution is None
        else {
            "degrees_of_freedom": int(solution.shapes.shape[0]),
            "method": solution.method,
            "verification": solution.verification,
            "cutoff": quantity(solution.cutoff / (2 * math.pi), "Hz"),
            "dropped_modes": solution.dropped,
            "next_frequencies_above": [quantity(f, "Hz") for f in solution.above[:5].tolist()],
            "pseudo_modes": solution.corrections,
            "J_inf_of_all_modes": {axis: quantity(J, "kg.m2") for axis, J in solution.J_inf_full.items()},
        },
        "inputs": inputs_part(hashed(list(files))),
        "software": software(),
    }


def text(info: MachineInfo, most: int | None = None) -> str:
    """The figures as a table for the terminal, with the first `most` modes (None: all)."""
    return "\n".join(_lines(info, most))


def _lines(info: MachineInfo, most: int | None) -> Iterator[str]:
    yield info.title
    if info.note:
        yield f"Note: {info.note}"
    if info.solution is not None:
        mass = f", total mass {info.total_mass:.2f} kg" if math.isfinite(info.total_mass) else ""
        yield f"{info.solution.shapes.shape[0]} degrees of freedom{mass}"
    else:
        yield "from its table of modes; masses and what moves need a structure file (key structure)"
    yield ""
    step = f"h = {info.step * 1e6:.6g} us"
    yield from _table(
        ("axis", "lead", "moving mass", "mass x lead^2", "J_tot", "J_inf", f"2 J_inf/h, {step}"),
        ("", "mm/rev", "kg", "kg.m2", "kg.m2", "kg.m2", "N.m.s/rad"),
        [
            (
                axis.name,
                f"{2e3 * math.pi * axis.lead:.6g}",
                *(_shown(value) for value in (axis.moving_mass, axis.J_moving, axis.J_tot, axis.J_inf)),
                _shown(axis.coupling_limit),
            )
            for axis in info.axes
        ],
    )
    yield from exchange(info)
    yield ""
    count = len(info.modes.frequency)
    shown = count if most is None else min(most, count)
    yield from _table(
        ("mode", "frequency", "damping", "what moves (share of the kinetic energy)"),
        ("", "Hz", "%", ""),
        [
            (
                str(k),
                f"{info.modes.frequency[k]:.3f}" if info.modes.frequency[k] else "0",
                f"{100 * info.modes.damping[k]:.3g}",
                moves(info, k),
            )
            for k in range(shown)
        ],
    )
    if shown < count:
        yield f"and {count - shown} more up to {info.modes.frequency[-1]:.1f} Hz"
    if info.solution is not None:
        yield from _dropped(info)


def exchange(info: MachineInfo) -> Iterator[str]:
    """Friction held against the limit of the explicit exchange."""
    for axis in info.axes:
        if math.isfinite(axis.friction_slope):
            slope, allowed = axis.friction_slope, USUAL_EXCHANGE.stable_share
            share = slope / axis.coupling_limit
            yield (
                f"{axis.name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad, {100 * share:.2g} % of 2 J_inf/h; "
                + (
                    f"the default exchange is stable up to {100 * allowed:.0f} %"
                    if share <= allowed
                    else f"UNSTABLE: the default exchange allows {100 * allowed:.0f} %; use more coupling.substeps"
                )
            )


def moves(info: MachineInfo, k: int) -> str:
    """What moves in mode k, with the shares of the kinetic energy."""
    pseudo = info.solution is not None and k >= len(info.modes.frequency) - info.solution.corrections
    return f"(static correction) {info.moving[k]}" if pseudo else info.moving[k]


def _dropped(info: MachineInfo) -> Iterator[str]:
    solution = info.solution
    assert solution is not None
    if solution.dropped > 0:
        next_ones = ", ".join(f"{f:.1f}" for f in solution.above[:3].tolist())
        yield (
            f"dropped: {solution.dropped} modes above {solution.cutoff / (2 * math.pi):.6g} Hz"
            f"{f' (next: {next_ones} Hz)' if next_ones else ''}; "
            + (
                f"{solution.corrections} pseudo-modes make up for their static compliance"
                if solution.corrections
                else "their static compliance is missing (--static-correction adds it)"
            )
        )
    for axis in info.axes:
        full = solution.J_inf_full.get(axis.name, math.nan)
        if math.isfinite(full):
            yield f"{axis.name}: J_inf with all modes of the model {full:.5g} kg.m2"


def _shown(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "-"


def _table(heads: Sequence[str], units: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Columns of equal width, numbers to the right; the last column runs on."""
    full = [heads, [f"[{unit}]" if unit else "" for unit in units], *rows]
    widths = [max(len(row[i]) for row in full) for i in range(len(heads))]
    for row in full:
        cells = [
            cell.ljust(width) if i in (0, len(heads) - 1) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()
