"""Monolithic reference of the coupled feed drives: no FMI, continuous plant and friction, sampled control.

Structure and friction of all axes are one system of differential equations, integrated by the classical Runge-Kutta
method with steps of 1-2.5 us; the controllers work at their sample instants. Written from the equations alone, so that
agreement with the units means something. ``simulate`` builds and runs the C program and returns arrays.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .machine import DRIVE_KEYS, FRICTION_KEYS, Machine, frictionless, held, machine, pure_lugre
from .nc import Setpoints, circle, move

__all__ = ["Machine", "Setpoints", "circle", "frictionless", "held", "machine", "move", "pure_lugre", "simulate"]

HERE = Path(__file__).parent
BUILD = HERE.parents[2] / "build" / "monolithic"
SOURCES = ("main.c", "control.c", "system.c")
# the reference may round as it likes: its error budget is 0.05 nm, rounding is 1e-6 nm
FLAGS = (
    "-std=c99",
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-fassociative-math",
    "-fno-signed-zeros",
    "-fno-trapping-math",
)
AXIS_COLUMNS = ("x_a", "n_a", "M_a", "M_fr", "z", "c", "x_e", "n_s", "n_ref", "M_s", "i_d", "i_q")


def build() -> Path:
    """Path of the program, compiled anew when a source or the flags changed. Environment: CC."""
    compiler = os.environ.get("CC", "cc")
    texts = b"".join((HERE / name).read_bytes() for name in (*SOURCES, "control.h", "system.h"))
    key = hashlib.sha256(texts + " ".join((compiler, *FLAGS)).encode()).hexdigest()[:16]
    program = BUILD / f"monolithic-{key}"
    if not program.exists():
        BUILD.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=BUILD) as scratch:
            fresh = Path(scratch) / "monolithic"
            sources = [str(HERE / name) for name in SOURCES]
            subprocess.run([*compiler.split(), *FLAGS, *sources, "-lm", "-o", str(fresh)], check=True)
            fresh.replace(program)
    return program


def _input(machine: Machine, setpoints: Setpoints, cycles: int, steps: int) -> bytes:
    count = len(next(iter(setpoints.x_s.values())))
    modes = np.column_stack([machine.frequency, machine.damping, machine.n, machine.x, machine.tcp])
    parts: list[list[float]] = []
    parts.append([len(machine.axes), len(modes), count, steps, cycles, machine.T_c, machine.T_pos])
    parts.append(modes.ravel().tolist())
    parts.append([float(len(machine.mounts)), *machine.mounts.ravel().tolist()])
    for name, axis in machine.axes.items():
        parts.append([axis.x_0, axis.M_0, *axis.contact])
        parts.append([axis.friction[key] for key in FRICTION_KEYS] + [axis.drive[key] for key in DRIVE_KEYS])
        parts.append([*setpoints.x_s[name].tolist(), *setpoints.n_ffw[name].tolist()])
    return "".join("\n".join(repr(v) for v in part) + "\n" for part in parts).encode()


def simulate(
    machine: Machine, setpoints: Setpoints, duration: float | None = None, step: float = 2.5e-6
) -> dict[str, NDArray[np.float64]]:
    """Run the coupled system from rest at the pose.

    `duration` [s] (default: as long as the setpoints), `step`: largest integration step [s]. Returns arrays over the
    control cycle: ``time`` [s], per axis ``A.x_a`` [m], ``A.n_a`` [rad/s], ``A.M_a``, ``A.M_fr`` [N.m], ``A.z``,
    ``A.c`` [rad], ``A.i_d``, ``A.i_q`` [A] at that instant and ``A.x_e`` [m], ``A.n_s``, ``A.n_ref`` [rad/s], ``A.M_s``
    [N.m] of the sample taken there; ``tool.x_X`` .. [m], ``mounts.E`` [J].
    """
    if duration is None:
        duration = (len(next(iter(setpoints.x_s.values()))) - 1) * machine.T_pos
    cycles = round(duration / machine.T_c)
    steps = max(1, int(np.ceil(machine.T_c / step - 1e-9)))
    program, text = build(), _input(machine, setpoints, cycles, steps)
    with tempfile.TemporaryDirectory(dir=BUILD) as scratch:
        source, output = Path(scratch) / "input", Path(scratch) / "output"
        source.write_bytes(text)
        subprocess.run([str(program), str(source), str(output)], check=True)
        values = np.fromfile(output, dtype=np.float64)
    names = [f"{a}.{name}" for a in machine.axes for name in AXIS_COLUMNS]
    names += [*(f"tool.x_{d}" for d in "XYZ"), "mounts.E"]
    rows = values.reshape(cycles + 1, len(names))
    result = {"time": np.arange(cycles + 1, dtype=np.float64) * machine.T_c}
    return result | dict(zip(names, rows.T, strict=True))
