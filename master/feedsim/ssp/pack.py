"""Setpoints -> an archive of the setpoint unit, and back. Needs no compiler, as the plant does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.errors import InputError, OutputError
from feedsim.nc import Program

SETPOINTS_IN_ARCHIVE = "resources/setpoints.csv"
UNEVEN = 1e-6  # of a row, as in the unit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Setpoints that a unit plays: time (N,) [s], even; x_s, n_ffw: axis -> (N,) [m], [rad/s]."""

    time: Array
    cycle: float
    x_s: Mapping[str, Array]
    n_ffw: Mapping[str, Array]

    def rows(self, time: Array, step: float) -> NDArray[np.int64]:
        """Row that is played at each instant of an experiment that starts at 0 and is stepped by `step` [s].

        Held before the first and after the last. As in the unit, floor((t - t_0 + slack)/T) with the slack of
        setpoints_slack (src/setpoint_fmu/setpoints.c).
        """
        ulps = 16 * np.finfo(np.float64).eps * np.abs(time)
        rounding = np.maximum(1e-9 * np.abs(time), max(2e-9, 2 * UNEVEN * self.cycle))
        slack = np.maximum(ulps, np.minimum(rounding, 0.01 * min(step, self.cycle)))
        rows = np.floor((time - self.time[0] + slack) / self.cycle).astype(np.int64)
        held: NDArray[np.int64] = np.clip(rows, 0, len(self.time) - 1)
        return held


def pack_setpoints(base: Path, out: Path, program: Program, *, name: str, note: str) -> None:
    """Pack the setpoints of `program` into the archive `base` of the setpoint unit; write it to `out`.

    Raises:
        InputError: `base` is no such archive.
        OutputError: `out` cannot be written.
    """
    from feedsim_packager import errors, setpoints
    from feedsim_packager.machine import named
    from feedsim_packager.repack import repack
    from feedsim_packager.resources import File

    columns = {axis: (program.x_s[axis], program.n_ffw[axis]) for axis in program.x_s}
    try:
        given = setpoints.check(File("setpoints.csv", setpoints.write(program.time, columns)))
        repack(base, given, named(name, note), out, trial_run=False)
    except errors.OutputError as error:
        raise OutputError(str(error)) from error
    except errors.InputError as error:
        raise InputError(str(error), error.problems) from error


def read_setpoints(content: bytes, where: str) -> Table:
    """Setpoints of an archive's table. InputError: it is not what it should be."""
    from feedsim_packager import errors, setpoints
    from feedsim_packager.resources import File

    try:
        table = setpoints.read_columns(File(where, content))
    except errors.InputError as error:
        raise InputError(str(error), error.problems) from error
    return Table(
        time=np.array(table.time, dtype=np.float64),
        cycle=float(table.cycle),
        x_s={axis: np.array(x_s, dtype=np.float64) for axis, (x_s, _) in table.axes.items()},
        n_ffw={axis: np.array(n_ffw, dtype=np.float64) for axis, (_, n_ffw) in table.axes.items()},
    )
