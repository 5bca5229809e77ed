"""What the tests of plant.fmu share: names of its ports, mode tables, inputs."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmi_helpers import Floats

H = 125e-6
AXES = ("X", "Y", "Z")
POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}
SPEEDS = tuple(f"{axis}.n_a" for axis in AXES)
POSITIONS = tuple(f"{axis}.x_a" for axis in AXES)
TOOL = tuple(f"tool.x_{axis}" for axis in AXES)
INPUTS = (
    *(f"{axis}.M_a" for axis in AXES), *(f"tool.F_{axis}" for axis in AXES), *(f"{axis}.F_a" for axis in AXES)
)  # fmt: skip
OUTPUTS = (*SPEEDS, *POSITIONS, *TOOL)
HEADER = [
    "mode",
    "frequency [Hz]",
    "damping ratio [1]",
    *(f"{port}_{axis}" for port in ("n", "x", "tcp") for axis in AXES),
]


@dataclass(frozen=True)
class Modes:
    """A mode table: omega, zeta (K,), shapes at the ports (K, 3) each."""

    omega: Floats
    zeta: Floats
    n: Floats
    x: Floats
    tcp: Floats

    @classmethod
    def read(cls, path: Path) -> Modes:
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        column = {name: np.array([float(row[name]) for row in rows]) for name in HEADER}
        ports = [np.stack([column[f"{port}_{axis}"] for axis in AXES], axis=1) for port in ("n", "x", "tcp")]
        return cls(2 * math.pi * column["frequency [Hz]"], column["damping ratio [1]"], *ports)


def write_modes(path: Path, rows: Sequence[Sequence[float | str]], header: Sequence[str] = HEADER) -> Path:
    """A mode table as a file; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([",".join(header), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


FREQUENCY, SHAPE = 87.0, {"n": (0.7, -2.5, 4.0), "x": (1e-3, -8e-3, 0.013), "tcp": (0.02, -0.05, 0.001)}


def single_mode(path: Path, zeta: float) -> Path:
    """A table of one mode of 87 Hz."""
    return write_modes(path, [[0, FREQUENCY, zeta, *SHAPE["n"], *SHAPE["x"], *SHAPE["tcp"]]])


def random_inputs(steps: int, seed: int) -> Floats:
    """Corner values of piecewise linear torques and forces, shape (steps + 1, INPUTS)."""
    scale = np.array([20.0] * 3 + [500.0] * 6)
    return scale * np.random.default_rng(seed).uniform(-1.0, 1.0, (steps + 1, len(INPUTS)))
