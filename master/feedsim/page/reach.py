"""What a page needs to say how far a motion leaves the pose of its plant, or the grid of poses, as a run says it.

How the modes change there takes the structure, which a page has not: their frequencies at some positions of every axis
are carried along, and the page takes cubics through them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from feedsim.judge.pose import left_grid
from feedsim.nc import Program
from feedsim.page.knobs import REACH
from feedsim.scenario import Machine
from feedsim.structure.pack import POSES_IN_ARCHIVE
from feedsim.structure.pose_change import LARGE_SHIFT, MIN_POSE_DISTANCE, over_axis, pose_change, warnings
from feedsim.structure.poses_file import GridAxis, read_grid

# Distance of positions at which modes are carried along [m]: up to some times what the program reaches, and beyond.
# Between close ones a cubic is right to some 1e-5 of a frequency.
CLOSE_DISTANCE, WIDE_DISTANCE, REACH_FACTOR = 0.02, 0.06, 1.6
# Where no mode changes by more than this share of what is worth a warning as far as sliders reach, none are carried.
NEGLIGIBLE_CHANGE = 0.5


def reached(machine: Machine, program: Program) -> dict[str, tuple[float, float]]:
    """Positions between which an axis may move while sliders turn [m]: the program's, farther by a slider's reach."""
    result = {}
    for axis in program.x_s:
        low, high = program.reached(axis)
        pose, travel = machine.pose[axis], machine.axes[axis].travel
        ends = pose - REACH * max(pose - low, 0.0), pose + REACH * max(high - pose, 0.0)
        result[axis] = max(ends[0], travel[0]), min(ends[1], travel[1])
    return result


def described(machine: Machine, program: Program, resources: Path) -> dict[str, Any]:
    """Per axis what the page needs: "grid", first and last position of its cells; "over", modes over its positions."""
    grid = _grid(machine, resources)
    return {
        "grid": {axis.axis: list(axis.reach) for axis in grid if len(axis.centres) > 1},
        "over": dict(_over(machine, program, {axis.axis for axis in grid})), "near": MIN_POSE_DISTANCE,
        "large": LARGE_SHIFT,
    }  # fmt: skip


def sentences(machine: Machine, program: Program, resources: Path) -> list[str]:
    """What a run says of the positions that the program reaches: the page says it in place of it."""
    grid = {axis.axis: axis for axis in _grid(machine, resources)}
    ranges = {axis: program.reached(axis) for axis in program.x_s}
    outside = [name for axis in grid if axis in ranges for name in left_grid(grid[axis], ranges[axis], machine)]
    return [*outside, *warnings(pose_change(machine, {a: r for a, r in ranges.items() if a not in grid}))]


def _grid(machine: Machine, resources: Path) -> tuple[GridAxis, ...]:
    file = resources.parent / POSES_IN_ARCHIVE
    return read_grid(file, tuple(machine.axes)) if file.is_file() else ()


def _over(machine: Machine, program: Program, followed: set[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for axis, (low, high) in reached(machine, program).items():
        pose = machine.pose[axis]
        if axis in followed or max(pose - low, high - pose) <= MIN_POSE_DISTANCE:
            continue
        ends = over_axis(machine, axis, [low, high])
        if ends is None:
            continue
        if ends.largest < NEGLIGIBLE_CHANGE * LARGE_SHIFT:
            yield axis, {"low": low, "high": high}
            continue
        here = program.reached(axis)
        sides = (pose - low, pose - here[0], -1), (high - pose, here[1] - pose, 1)
        positions = sorted({pose, *(pose + sense * at for far, near, sense in sides for at in _steps(far, near))})
        table = over_axis(machine, axis, positions)
        assert table is not None
        words = [moving.partition(",")[0] for moving in table.moving]
        rounded = [[float(f"{f:.9g}") for f in row] for row in table.there.tolist()]
        frequency = table.frequency.tolist()
        yield axis, {"low": low, "high": high, "position": [round(x, 4) for x in positions], "there": rounded,
                     "frequency": frequency, "moving": words}  # fmt: skip


def _steps(far: float, near: float) -> list[float]:
    """Distances from the pose on one side [m], up to `far`; close together up to REACH_FACTOR times `near`."""
    if far <= MIN_POSE_DISTANCE:
        return []
    close = min(REACH_FACTOR * max(near, 0.0), far)
    count, wide = max(math.ceil(close / CLOSE_DISTANCE), 1), math.ceil((far - close) / WIDE_DISTANCE)
    return [
        *(k * close / count for k in range(1, count + 1)),
        *(close + k * (far - close) / wide for k in range(1, wide + 1)),
    ]
