"""What the units are driven through on every platform: inputs that are numbers, not formulas, so that all get the same.

A case takes a unit through its branches: friction through sliding, reversals and pre-sliding; the controller through a
move with its torque limit reached; the plant through torques on all axes and forces on the tool. A unit without a case
of its own is stepped with its inputs at their start values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

H = 125e-6  # control cycle [s]
STEPS = 8000  # 1 s
T = np.arange(STEPS + 1) * H

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """Inputs by name (STEPS + 1,), linear between the instants; Real parameters by name; all in SI units."""

    unit: str
    name: str
    inputs: Mapping[str, Floats] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)


def _blend(start: float, end: float) -> Floats:
    """0 until `start`, 1 from `end` [s], a polynomial of degree 7 between them (smooth to the third derivative)."""
    s = np.clip((T - start) / (end - start), 0, 1)
    return s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)


def _friction() -> Floats:
    """Speed [rad/s]: rapid traverse and back within 0.5 s, then slow reversals, then pre-sliding, then rest."""
    fast = 200 * np.sin(2 * np.pi * 2 * T) * (T < 0.5)
    slow = 2 * np.sin(2 * np.pi * 8 * T) * ((T >= 0.5) & (T < 0.75))
    small = 0.02 * np.sin(2 * np.pi * 20 * T) * ((T >= 0.75) & (T < 0.95))
    return fast + slow + small


def _controller() -> dict[str, Floats]:
    """A move of 10 mm that the axis follows late, and a blow against it that takes the torque to its limit."""
    lead = 0.02 / (2 * np.pi)
    x_s = 0.01 * _blend(0.05, 0.35)
    x_a = 0.01 * _blend(0.054, 0.358) + 2e-6 * np.sin(2 * np.pi * 40 * T)
    n_a = np.gradient(x_a, H) / lead + 30 * (_blend(0.6, 0.61) - _blend(0.65, 0.66))
    return {"x_s": x_s, "n_ffw": np.gradient(x_s, H) / lead, "x_a": x_a, "n_a": n_a}


def _plant() -> dict[str, Floats]:
    """Torques that swing every axis through its first modes, friction's share of them, and a force on the tool."""
    inputs: dict[str, Floats] = {}
    for i, axis in enumerate("XYZ"):
        sweep = np.sin(2 * np.pi * (20 + 10 * i + 80 * T) * T)
        inputs[f"{axis}.M_a"] = (2 - 0.5 * i) * sweep
        inputs[f"{axis}.M_fr"] = 0.3 * np.sign(sweep)
        inputs[f"tool.F_{axis}"] = 100 * (_blend(0.3, 0.31) - _blend(0.4, 0.41)) * (i + 1)
    return inputs


CASES = (
    Case("friction", "sliding, reversals, pre-sliding", {"n_fr": _friction()}),
    Case("friction_gms", "sliding, reversals, pre-sliding", {"n_fr": _friction()}, {"beta": 1.7, "skew": 0.3}),
    Case("friction", "Stribeck exponent 1.7, no engaging model", {"n_fr": _friction()}, {"beta": 1.7, "W": 0.0}),
    Case("controller", "move, torque limit", _controller()),
    Case("controller", "two more filters, lag", _controller(), {"T_ref": 1e-4, "T_dyn": 1.4e-3, "filter_1.f": 500.0}),
    Case("plant", "torques and tool forces", _plant()),
)


def cases(units: tuple[str, ...]) -> tuple[Case, ...]:
    """The cases of these units."""
    bare = tuple(Case(unit, "as it starts") for unit in units if unit not in {case.unit for case in CASES})
    return tuple(case for case in CASES if case.unit in units) + bare
