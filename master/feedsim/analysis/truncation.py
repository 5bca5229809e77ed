"""What a reduction to some modes costs: the structure's responses by several mode tables, and how far they are apart.

The structure alone, continuous: motors give their torque whatever the speed, nothing is sampled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.figures import Figure
from feedsim.analysis.linear.plant import TOOL_DIRECTIONS, ModalPlant
from feedsim.scenario import Structure
from feedsim.structure import Modes
from feedsim.structure.build import assemble
from feedsim.structure.solve import FULL as LARGEST
from feedsim.structure.solve import solve
from feedsim.trace.response import FrequencyResponse

Floats = NDArray[np.float64]

# What lies within this share of the cut-off is the reduced model's own; next to it, the dropped modes show.
TRUSTED = 0.9

FULL, REDUCED, CORRECTED = "full", "reduced", "with static correction"


@dataclass(frozen=True, eq=False)
class Truncation:
    """A structure with all its modes and with some.

    Attributes:
        tables: FULL, REDUCED and CORRECTED -> modes.
        cutoff: frequency above which modes are dropped [Hz].
    """

    tables: Mapping[str, Modes]
    cutoff: float


def truncation(structure: Structure, pose: Mapping[str, float]) -> Truncation | None:
    """A structure's modes at a pose (axis -> position [m]): all, up to the cut-off, and with static correction.

    None where the model is too large for all of its modes, or has none above the cut-off.
    """
    assembly, _ = assemble(structure, pose)
    if assembly.mass.shape[0] > LARGEST:
        return None
    reduced = solve(assembly, cutoff=structure.cutoff, damping=structure.damping)
    if not reduced.dropped:
        return None
    corrected = solve(assembly, cutoff=structure.cutoff, damping=structure.damping, static_correction=True)
    full = solve(assembly, cutoff=math.inf, damping=structure.damping)
    tables = {FULL: full.modes, REDUCED: reduced.modes, CORRECTED: corrected.modes}
    return Truncation(tables, structure.cutoff / (2 * math.pi))


def figures(found: Truncation, axes: Sequence[str], frequency: Floats) -> dict[str, Figure]:
    """Largest deviations of the reduced tables from the full one over `frequency` (F,) [Hz]; see deviations()."""
    responses = {name: structure_responses(modes, axes, frequency) for name, modes in found.tables.items()}
    full = responses.pop(FULL)
    return deviations(responses, full, found.cutoff)


def structure_responses(modes: Modes, axes: Sequence[str], frequency: Floats) -> FrequencyResponse:
    """n_a/M_a and x_a/M_a of every axis, and the compliance at the tool, at `frequency` (F,) [Hz]."""
    s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
    ports = ModalPlant.of(modes, axes).ports(s, 1.0, "continuous")  # of a continuous input the cycle does not matter
    count = len(axes)
    columns, units = {}, {}
    for i, axis in enumerate(axes):
        columns[f"{axis}.n_a/{axis}.M_a"] = ports[:, i, i]
        units[f"{axis}.n_a/{axis}.M_a"] = "(rad/s)/(N.m)"
        columns[f"{axis}.x_a/{axis}.M_a"] = ports[:, count + i, i]
        units[f"{axis}.x_a/{axis}.M_a"] = "m/(N.m)"
    for i, direction in enumerate(TOOL_DIRECTIONS):
        columns[f"tool.x_{direction}/tool.F_{direction}"] = ports[:, 2 * count + i, count + i]
        units[f"tool.x_{direction}/tool.F_{direction}"] = "m/N"
    return FrequencyResponse(frequency, columns, units)


def deviation(response: FrequencyResponse, full: FrequencyResponse, name: str) -> Floats:
    """(F,) magnitude of a response over that of the full model [dB]."""
    return np.asarray(20 * np.log10(np.abs(response[name]) / np.abs(full[name])))


def deviations(responses: Mapping[str, FrequencyResponse], full: FrequencyResponse, cutoff: float) -> dict[str, Figure]:
    """Largest deviations from the full model in dB, below TRUSTED of the cut-off [Hz] and up to it.

    Names are "RESPONSE MODEL.below" and "RESPONSE MODEL.to_cutoff", such as "Z.n_a/Z.M_a reduced.below".
    """
    found = {}
    for model, response in responses.items():
        for name in full:
            size = np.abs(deviation(response, full, name))
            for key, limit in (("below", TRUSTED * cutoff), ("to_cutoff", cutoff)):
                within = full.frequency <= limit
                largest = float(size[within].max()) if within.any() else np.nan
                found[f"{name} {model}.{key}"] = Figure(
                    largest, "dB", f"largest deviation of {name}, {model}, from the full model up to {limit:g} Hz"
                )
    return found
