"""A table of setpoints for tests, and an archive that plays it."""

from fractions import Fraction
from pathlib import Path

import numpy as np

from feedsim_packager import setpoints
from feedsim_packager.machine import named
from feedsim_packager.repack import repack
from feedsim_packager.resources import File
from fmu.unpacked import Archive, unpack

NS = 1_000_000_000
AXES = ("Z", "X_1")  # not in the order of the alphabet
CYCLE = 1_000_000  # [ns]
ROWS = 57


def numbers(rows: int = ROWS) -> np.ndarray:
    """Columns of a table, (rows, 4); no value appears twice."""
    return np.random.default_rng(5).permutation(rows * 4).reshape(rows, 4) / 7.0 - 3.0


def text(cycle: int = CYCLE, first: int = 0, rows: int = ROWS) -> str:
    """A table whose row k is at first + k cycle [ns], by means of our own."""
    header = ",".join(["time [s]", *(f"{axis}.{name}" for axis in AXES for name in ("x_s [m]", "n_ffw [rad/s]"))])
    lines = [
        ",".join([repr(float(Fraction(first + k * cycle, NS))), *map(repr, row.tolist())])
        for k, row in enumerate(numbers(rows))
    ]
    return "\n".join([header, *lines, ""])


def pack(fmus: Path, folder: Path, content: str) -> Archive:
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / "setpoint.fmu"
    repack(fmus / "setpoint.fmu", setpoints.check(File("t.csv", content.encode())), named("Moves <1>", "Note"), out)
    return unpack("setpoint", folder, folder / "unpacked")
