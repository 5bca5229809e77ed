"""What a reduction to some modes costs: the structure's responses by several mode tables, and how far they are apart.

The structure alone, continuous: motors give their torque whatever the speed, nothing is sampled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feedsim.analysis.figures import Figure
from feedsim.files.trace.response import FrequencyResponse
from feedsim.foundation.errors import InputError
from feedsim.linear import loops
from feedsim.linear.plant import TOOL_DIRECTIONS, Floats, ModalPlant
from feedsim.scenario.structure import Structure
from feedsim.structure import Modes
from feedsim.structure.build import assemble
from feedsim.structure.solve import solve

# What lies within this share of the cut-off is the reduced model's own; next to it, the dropped modes show.
TRUSTED_FREQUENCY_SHARE = 0.9

FULL, REDUCED, CORRECTED = "full", "reduced", "with static correction"
# All modes of a model are full matrices: 2000 degrees of freedom take some seconds, which a comparison may cost.
MAX_MODES_IN_FULL = 2000
AXIS_QUANTITIES = ("n_M", "x_M")  # of an axis


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

    None where the model has no modes above the cut-off.

    Raises:
        InputError: more than MAX_MODES_IN_FULL degrees of freedom, and what build.assemble and solve.solve refuse.
        FeedsimError: as solve.solve.
    """
    assembly, _ = assemble(structure, pose)
    size = assembly.mass.shape[0]
    if size > MAX_MODES_IN_FULL:
        raise InputError(
            f"{assembly.name}: all modes of {size} degrees of freedom would be needed; it is done up to "
            f"{MAX_MODES_IN_FULL}"
        )
    corrected = solve(
        assembly, cutoff=structure.cutoff, damping=structure.damping, static_correction=True, described=False
    )
    if not corrected.dropped:
        return None
    full = solve(assembly, cutoff=math.inf, damping=structure.damping, described=False)
    kept = len(corrected.modes.frequency) - corrected.corrections  # the pseudo-modes come last
    tables = {FULL: full.modes, REDUCED: _first_modes(corrected.modes, kept), CORRECTED: corrected.modes}
    return Truncation(tables, structure.cutoff / (2 * math.pi))


def figures(
    result: Truncation, axes: Sequence[str], frequency: Floats, *, shown: Sequence[str] | None = None, tool: bool = True
) -> dict[str, Figure]:
    """Largest deviations of the reduced tables from the full one over `frequency` (F,) [Hz]; see deviations().

    Args:
        axes: of the machine, in its order.
        shown: those of them that are reported; None: all.
        tool: with the compliance at the tool.
    """
    chosen = [loops.LOOP_QUANTITIES[key][0].format(axis) for axis in shown or axes for key in AXIS_QUANTITIES]
    if tool:
        chosen += [loops.COMPLIANCE.format(direction) for direction in TOOL_DIRECTIONS]
    responses = {
        name: structure_responses(modes, axes, frequency).select(chosen) for name, modes in result.tables.items()
    }
    full = responses.pop(FULL)
    return deviations(responses, full, result.cutoff)


def structure_responses(modes: Modes, axes: Sequence[str], frequency: Floats) -> FrequencyResponse:
    """n_a/M_a and x_a/M_a of every axis, and the compliance at the tool, at `frequency` (F,) [Hz]."""
    s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
    ports = ModalPlant.of(modes, axes).ports(s, 1.0, "continuous")  # of a continuous input the cycle does not matter
    count = len(axes)
    columns = {}
    for i, axis in enumerate(axes):
        columns[f"{axis}.n_a/{axis}.M_a"] = ports[:, i, i]
        columns[f"{axis}.x_a/{axis}.M_a"] = ports[:, count + i, i]
    for i, direction in enumerate(TOOL_DIRECTIONS):
        columns[loops.COMPLIANCE.format(direction)] = ports[:, 2 * count + i, count + i]
    return FrequencyResponse(frequency, columns, {name: loops.unit_of(name) for name in columns})


def deviation(response: FrequencyResponse, full: FrequencyResponse, name: str) -> Floats:
    """(F,) magnitude of a response over that of the full model [dB]."""
    return np.asarray(20 * np.log10(np.abs(response[name]) / np.abs(full[name])))


def deviations(responses: Mapping[str, FrequencyResponse], full: FrequencyResponse, cutoff: float) -> dict[str, Figure]:
    """Largest deviations from the full model in dB, below TRUSTED of the cut-off [Hz] and up to it.

    Names are "Z.n_M.truncation_below" and "Z.n_M.truncation" of the reduced table, "Z.n_M.truncation_below_corrected"
    and "Z.n_M.truncation_corrected" of that with static correction, "tool.compliance_X.truncation" at the tool.
    """
    result = {}
    for model, response in responses.items():
        for name in full:
            size = np.abs(deviation(response, full, name))
            for key, limit in (("truncation_below", TRUSTED_FREQUENCY_SHARE * cutoff), ("truncation", cutoff)):
                within = full.frequency <= limit
                largest = float(size[within].max()) if within.any() else np.nan
                result[f"{loops.figure_key(name)}.{key}{_suffix(model)}"] = Figure(
                    largest, "dB", f"largest deviation of {name}, {model}, from the full model up to {limit:g} Hz"
                )
    return result


def _suffix(model: str) -> str:
    known = {REDUCED: "", CORRECTED: "_corrected"}
    return known.get(model, f"_{model.replace(' ', '_')}")


def _first_modes(modes: Modes, count: int) -> Modes:
    """The first `count` modes of a table."""
    ports = {port: shape[:count] for port, shape in modes.ports.items()}
    return replace(modes, frequency=modes.frequency[:count], damping=modes.damping[:count], ports=ports)
