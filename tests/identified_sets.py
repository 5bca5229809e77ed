"""Friction files with intervals, written as feedsim identify friction writes them."""

from __future__ import annotations

from pathlib import Path

import yaml

CIRCLE = Path(__file__).resolve().parents[1] / "scenarios" / "xz_circle.yaml"
VALUES = {
    "sigma_0": (300.0, "N.m/rad"), "sigma_1": (0.8, "N.m.s/rad"), "sigma_2": (0.006, "N.m.s/rad"),
    "F_C": (1.6, "N.m"), "F_S": (2.1, "N.m"), "v_s": (0.6, "rad/s"), "W": (0.04, "rad"), "gamma": (0.35, ""),
}  # fmt: skip


def quantity(value: float, unit: str) -> str | float:
    return f"{value!r} {unit}" if unit else value


def write_set(
    folder: Path, sigma: float = 0.02, correlation: float = 0.3, *, load: float | None = None,
    name: str = "friction.yaml", **set_to: str,
) -> Path:  # fmt: skip
    """A set with relative standard deviations `sigma`, and one correlation, of F_C and sigma_0."""
    half = 1.959964 * sigma
    content: dict[str, object] = {key: quantity(value, unit) for key, (value, unit) in VALUES.items()}
    parameters = {
        key: {"status": "estimated", "interval": [quantity(value * (1 + sign * half), unit) for sign in (-1, 1)]}
        for key, (value, unit) in VALUES.items()
    }
    for key, text in set_to.items():
        number, _, unit = text.partition(" ")
        ends = [quantity(float(number) + sign * 1e-6, unit) for sign in (-1, 1)]
        parameters[key]["interval"] = ends
    identified: dict[str, object] = {
        "axis": "Z",
        "parameters": parameters,
        "correlation": {"names": ["F_C", "sigma_0", "delay"],
                        "matrix": [[1.0, correlation, 0.0], [correlation, 1.0, 0.0], [0.0, 0.0, 1.0]]},
    }  # fmt: skip
    if load is not None:
        identified["constant_load"] = {"value": f"{load} N.m", "interval": [f"{load - 0.1} N.m", f"{load + 0.1} N.m"]}
    file = folder / name
    file.write_text(yaml.safe_dump({**content, "identified": identified}))
    return file
