"""poses.bin is checked before it is packed: every fault is told with its place."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from feedsim_packager import machine_tables, poses
from feedsim_packager.errors import InputError
from fmu.pose_file import AXES, Grid, table
from machine_helpers import modes_csv


def _swapped(rows: np.ndarray, where: tuple[int, int], value: float) -> np.ndarray:
    rows = rows.copy()
    rows[where] = value
    return rows


def _X(*numbers: float) -> list[list[float]]:
    return [[*numbers], [2, 2, 0, 0, 1, 0.5]]


FAULTS: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "does not begin with FSPOSES1"),
    "magic": (Grid(magic=b"FSPOSES2").content(), "does not begin with FSPOSES1"),
    "cut": (Grid().content()[:-3], "no multiple of 8: it was cut off"),
    "short": (Grid().content()[:-8], r"transfer from cell 4 .*36 numbers are needed, but the file ends after 35"),
    "header alone": (b"FSPOSES1", r"byte 8: number of axes .*1 numbers are needed, but the file ends after 0"),
    "long": (Grid(tail=bytes(16)).content(), "2 numbers too many"),
    "nan": (Grid(axes=math.nan).content(), "byte 8: nan is no finite number"),
    "infinite": (Grid(transfers=np.full((7, 6, 6), math.inf)).content(), "inf is no finite number"),
    "other axes": (Grid(axes=2).content(), r"byte 8: number of axes \(axes.csv has X, spindle_2, W\) is 2; .*: 3"),
    "no grid": (
        Grid(grid_axes=0).content(),
        "byte 16: number of grid axes is 0; allowed are whole numbers from 1 to 3",
    ),
    "half a grid": (Grid(grid_axes=1.5).content(), "number of grid axes is 1.5"),
    "axis twice": (
        Grid(directions=[_X(0, 1, 0, 0.5)[0], [0, 2, 0, 0, 1, 0.5]]).content(),
        "axis X is in the grid twice",
    ),
    "no such axis": (Grid(directions=_X(3, 1, 0, 0.5)).content(), "index of a grid axis is 3; .*from 0 to 2"),
    "no cell": (Grid(directions=_X(0, 0, 0)).content(), "number of cells along X is 0"),
    "too many cells": (Grid(directions=_X(0, 1e15, 0)).content(), "number of cells along X is 1e"),
    "hysteresis": (Grid(directions=_X(0, 1, -1e-6, 0.5)).content(), "hysteresis along X is -1e-06 m, allowed is 0 or"),
    "centres": (
        Grid(directions=_X(0, 3, 0, 0.1, 0.9, 0.5, 0.3, 0.7)).content(),
        "centre 2 along X is 0.5 m, allowed is more than 0.9 m",
    ),
    "boundary": (
        Grid(directions=_X(0, 3, 0, 0.1, 0.5, 0.9, 0.5, 0.7)).content(),
        "boundary 0 along X is 0.5 m, allowed is between its centres, 0.1 and 0.5 m",
    ),
    "most": (Grid(most=7).content(), "byte 24: largest number of modes of a cell is said to be 7, but is 6"),
    "too many modes": (Grid(counts=[6, 7, 6, 6, 6, 6]).content(), r"cell 1 \(X 0.1 m, W 1 m\): number of modes is 7"),
    "frequency": (Grid(rows=_swapped(table(AXES), (4, 0), -60)).content(), r"mode 4: frequency \[Hz\] is -60"),
    "damping": (Grid(rows=_swapped(table(AXES), (4, 1), -1)).content(), r"mode 4: damping ratio \[1\] is -1"),
    "damped rigid mode": (Grid(rows=_swapped(table(AXES), (0, 1), 0.1)).content(), "mode 0: damping ratio 0.1 at freq"),
    "still": (Grid(rows=table(AXES) * np.array([1, 1, 1, 0, 1, *[1] * 6])).content(), "n_spindle_2 is 0 in every mode"),
    "transfer": (
        Grid(transfers=np.array([np.eye(6)] * 6 + [1.1 * np.eye(6)])).content(),
        r"transfer from cell 4 \(X 0.9 m, W 0 m\) to cell 5: row 0 has the length 1.1",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_poses_are_refused(fault: str, tmp_path: Path) -> None:
    content, text = FAULTS[fault]
    (tmp_path / "axes.csv").write_text(machine_tables.axes_csv(dict.fromkeys(AXES, 0.0)).decode(), encoding="utf-8")
    (tmp_path / "modes.csv").write_text(modes_csv(AXES), encoding="utf-8")
    (tmp_path / "poses.bin").write_bytes(content)
    with pytest.raises(InputError, match=rf"poses\.bin: .*{text}"):
        machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv", tmp_path / "poses.bin")


def test_columns_of_a_transfer_are_checked_too() -> None:
    upright = np.zeros((6, 6))
    upright[:2, 0] = 0.9  # rows of length 0.9, a column of 1.27
    with pytest.raises(InputError, match=r"poses: byte \d+: .*column 0 has the length 1\.27"):
        poses.check(Grid(transfers=np.array([upright] * 7)).content(), AXES, "poses")


def test_poses_are_read_on_machines_of_the_other_byte_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """There array.byteswap() does it: numbers swapped in the file and swapped again are those of the file."""
    content = Grid().content()
    expected = poses.check(content, AXES, "poses")
    assert [(axis.name, tuple(axis.centres)) for axis in expected] == [("X", (0.1, 0.5, 0.9)), ("W", (0.0, 1.0))]
    swapped = content[:8] + np.frombuffer(content[8:], "<f8").astype(">f8").tobytes()
    monkeypatch.setattr(sys, "byteorder", {"little": "big", "big": "little"}[sys.byteorder])
    found = poses.check(swapped, AXES, "poses")
    assert [(axis.name, tuple(axis.centres)) for axis in found] == [
        (axis.name, tuple(axis.centres)) for axis in expected
    ]
