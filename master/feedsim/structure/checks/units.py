"""Whether mass, size and lowest frequency are those of a machine; a model in other units than it says shows there."""

from __future__ import annotations

import math

import numpy as np

from feedsim.structure.assembly import Assembly, Floats

LEAST_MASS, MOST_MASS = 20.0, 1e6  # [kg] a test bench, a portal machine
LEAST_SIZE, MOST_SIZE = 0.05, 100.0  # [m]
LEAST_FREQUENCY, MOST_FREQUENCY = 1.0, 2000.0  # [Hz] of the lowest elastic mode
MASS_UNITS = {"tonnes": ("t", 1000.0), "grams": ("g", 1e-3)}


def total_mass(assembly: Assembly) -> Floats | None:
    """Mass that translates in X, Y and Z (3,) [kg]; None where the model does not say which way it moves.

    Degrees of freedom that are constrained have left the model and count no more.
    """
    masses = np.zeros(3)
    for d, direction in enumerate(("ux", "uy", "uz")):
        if assembly.geometry is not None:
            columns = assembly.geometry.dofs[:, d]
            unit = np.zeros(len(assembly.labels))
            unit[columns[columns >= 0]] = 1
        else:
            unit = np.array([label.endswith(f" {direction}") for label in assembly.labels], dtype=np.float64)
        masses[d] = unit @ (assembly.mass @ unit)
    return masses if np.any(masses) else None


def unit_warnings(assembly: Assembly) -> list[str]:
    """What looks like another unit than the one that is stated."""
    warnings = []
    masses = total_mass(assembly)
    if masses is not None and not LEAST_MASS <= np.max(masses) <= MOST_MASS:
        mass = float(np.max(masses))
        text = f"the model's mass is {mass:.4g} kg; a machine has {LEAST_MASS:g} kg to {MOST_MASS:g} kg"
        fitting = [
            f"{mass:.4g} looks like {name}, units: {{mass: {unit}}}"
            for name, (unit, factor) in MASS_UNITS.items()
            if LEAST_MASS <= mass * factor <= MOST_MASS
        ]
        warnings.append("; ".join([text, *fitting]))
    geometry = assembly.geometry
    if geometry is not None and len(geometry.nodes) > 1:
        size = float(np.max(np.ptp(geometry.nodes, axis=0)))
        if not LEAST_SIZE <= size <= MOST_SIZE:
            text = f"the model measures {size:.4g} m; a machine measures {LEAST_SIZE:g} m to {MOST_SIZE:g} m"
            if LEAST_SIZE <= size / 1000 <= MOST_SIZE:
                text += f"; {size:.4g} looks like millimetres, units: {{length: mm}}"
            elif LEAST_SIZE <= size * 1000 <= MOST_SIZE:
                text += "; was it converted from millimetres twice?"
            warnings.append(text)
    return warnings


def frequency_warnings(omega: float) -> list[str]:
    """About the lowest elastic mode's angular frequency [rad/s], once it is known."""
    frequency = omega / (2 * math.pi)
    if LEAST_FREQUENCY <= frequency <= MOST_FREQUENCY:
        return []
    text = (
        f"the lowest elastic mode is at {frequency:.4g} Hz; a machine's is from {LEAST_FREQUENCY:g} Hz to "
        f"{MOST_FREQUENCY:g} Hz"
    )
    # Mass in kg beside stiffness in N/mm: too low by the root of 1000; mass in t beside N/m: too high by it.
    if frequency < LEAST_FREQUENCY:
        return [f"{text}; is the stiffness in N/mm beside a mass in kg, or something held by nearly nothing?"]
    return [f"{text}; is the mass in tonnes beside a stiffness in N/m?"]
