"""poses.bin of a machine of three axes, written by its description alone, sound or with any one thing changed."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from machine_helpers import modes_csv

AXES = ("X", "spindle_2", "W")  # one that the tool follows, two that it does not


@dataclass
class Grid:
    """What poses.bin is made of; by default three times two poses of the same modes, which T = 1 carries over."""

    magic: bytes = b"FSPOSES1"
    axes: float = 3
    grid_axes: float = 2
    most: float = 6
    directions: list[list[float]] = field(
        default_factory=lambda: [
            [0, 3, 1e-4, 0.1, 0.5, 0.9, 0.3, 0.7],  # X: 3 cells, hysteresis, centres, boundaries
            [2, 2, 0.0, 0.0, 1.0, 0.5],  # W
        ]
    )
    counts: list[float] = field(default_factory=lambda: [6.0] * 6)
    rows: np.ndarray = field(default_factory=lambda: table(AXES))
    transfers: np.ndarray = field(default_factory=lambda: np.array([np.eye(6)] * (4 + 3)))
    tail: bytes = b""

    def content(self) -> bytes:
        cells = [value for count in self.counts for value in (count, *self.rows.ravel())]
        numbers = [self.axes, self.grid_axes, self.most, *chain(*self.directions), *cells, *self.transfers.ravel()]
        return self.magic + struct.pack(f"<{len(numbers)}d", *numbers) + self.tail


def table(axes: Sequence[str]) -> np.ndarray:
    """Rows of a mode table in the order of poses.bin: frequency, damping, n, tcp, x."""
    header, *lines = (line.split(",") for line in modes_csv(axes).splitlines())
    order = ["frequency [Hz]", "damping ratio [1]", *(f"n_{axis}" for axis in axes), "tcp_X", "tcp_Y", "tcp_Z"]
    order += [f"x_{axis}" for axis in axes]
    return np.array([[float(line[header.index(name)]) for name in order] for line in lines])
