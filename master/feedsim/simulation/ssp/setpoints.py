"""Setpoints of a program and those of an SSP: packed into an archive of the setpoint unit, which needs no compiler, and
read back; what is left of motions and evaluation where the experiment stops at another time than they do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.motions.circular import Circular
from feedsim.motions.positioning_cycle import Visits
from feedsim.motions.program import ProgrammedGeometry
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.scenario import CircleTest, ContourTest, Positioning, PositioningAccuracy, Scenario
from feedsim.simulation.nc import Program, Segment
from feedsim.structure.pack import pack_unit, setpoint_table, translate_packager_errors

EVALUATION_NAMES = {"contour": "contour error", "circle": "circularity", "positioning_accuracy": "positioning accuracy"}
SETPOINTS_IN_ARCHIVE = "resources/setpoints.csv"
ROW_TOLERANCE = 1e-6  # of a row, as in the unit
EVALUATED_REST = 0.050  # s, behind a motion whose positioning is evaluated (feedsim.analysis)

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
        rounding = np.maximum(1e-9 * np.abs(time), max(2e-9, 2 * ROW_TOLERANCE * self.cycle))
        slack = np.maximum(ulps, np.minimum(rounding, 0.01 * min(step, self.cycle)))
        rows = np.floor((time - self.time[0] + slack) / self.cycle).astype(np.int64)
        return np.asarray(np.clip(rows, 0, len(self.time) - 1), dtype=np.int64)


def pack_setpoints(base: Path, out: Path, program: Program, *, name: str, note: str) -> None:
    """Pack the setpoints of `program` into the archive `base` of the setpoint unit; write it to `out`.

    Raises:
        InputError: `base` is no such archive.
        OutputError: `out` cannot be written.
    """
    with translate_packager_errors():
        pack_unit(base, out, setpoint_table(program), name=name, note=note, trial=False)


def read_setpoints(content: bytes, where: str) -> Table:
    """Setpoints of an archive's table. InputError: it is not what it should be."""
    from feedsim_packager import setpoints
    from feedsim_packager.resources import File

    with translate_packager_errors():
        table = setpoints.read_columns(File(where, content))
    return Table(
        time=np.array(table.time, dtype=np.float64),
        cycle=float(table.cycle),
        x_s={axis: np.array(x_s, dtype=np.float64) for axis, (x_s, _) in table.axes.items()},
        n_ffw={axis: np.array(n_ffw, dtype=np.float64) for axis, (_, n_ffw) in table.axes.items()},
    )


def setpoints_agree(planned: Mapping[str, Array], table: Mapping[str, Array]) -> bool:
    """Whether setpoints (N,) and (M,) are the same as long as both last, and the axes of a longer table then rest."""
    if set(planned) != set(table):
        return False
    for axis, x in planned.items():
        common = min(len(x), len(table[axis]))
        if not np.array_equal(x[:common], table[axis][:common]) or np.any(table[axis][common:] != x[-1]):
            return False
    return True


def segments(planned: Program, program: Program) -> tuple[Segment, ...]:
    """The segments of `planned` up to the end of `program`, the last one cut where it lasts longer."""
    if len(program.time) >= len(planned.time):
        return planned.segments
    end = program.duration
    slack = 1e-6 * (program.time[1] - program.time[0])  # exact ends carry rounding errors
    kept = [segment for segment in planned.segments if segment.start < end - slack]
    if kept and kept[-1].end > end + slack:
        reached = {axis: float(x_s[-1]) for axis, x_s in program.x_s.items()}
        reported = f"{kept[-1].description}, cut at the stop time"
        kept[-1] = replace(kept[-1], end=end, description=reported, target=reached, geometry=None)
    return tuple(kept)


def evaluation(scenario: Scenario, planned: Program, program: Program) -> tuple[Scenario, list[str]]:
    """The scenario without what can no longer be evaluated, and what that is."""
    kept, lost = [], []
    for i, item in enumerate(scenario.evaluate):
        needed = _required_end(item, planned)
        if needed is None or needed <= program.duration + 1e-9:
            kept.append(item)  # where nothing is found the evaluation itself says why
        else:
            what = f"positioning of {item.axis}" if isinstance(item, Positioning) else EVALUATION_NAMES[item.kind]
            lost.append(f"evaluate.{i} ({what}, to {needed:.6g} s)")
    return (scenario.model_copy(update={"evaluate": tuple(kept)}), lost) if lost else (scenario, [])


def _required_end(item: Positioning | CircleTest | PositioningAccuracy | ContourTest, planned: Program) -> float | None:
    """Until when the motions must run for an evaluation [s]; None where they have nothing for it."""
    chosen = planned.segments if item.motion is None else planned.segments[item.motion : item.motion + 1]
    if isinstance(item, Positioning):
        moved = [segment.end for segment in chosen if segment.origin[item.axis] != segment.target[item.axis]]
        return min(moved[-1] + EVALUATED_REST, planned.duration) if moved else None
    if isinstance(item, PositioningAccuracy):
        cycles = [segment.end for segment in chosen if isinstance(segment.geometry, Visits)]
        return min(cycles[-1], planned.duration) if cycles else None
    if isinstance(item, ContourTest):
        programs = [segment.end for segment in chosen if isinstance(segment.geometry, ProgrammedGeometry)]
        return min(programs[-1], planned.duration) if programs else None
    circles = [segment.end for segment in chosen if isinstance(segment.geometry, Circular | RecordedGeometry)]
    return min(circles[-1], planned.duration) if circles else None
