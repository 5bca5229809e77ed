"""Rings that hold a stretch of a run lose no row, wherever the run ends: held against one recorded without."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.scenario import Scenario
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import recording, schedule
from feedsim.simulation.nc import Program

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
# Every control cycle is a position cycle: a run may end at any.
CYCLES = [f"machine.cycles.{name}=125 us" for name in ("control", "position", "interpolation")]
MOTION = ["motions=[{kind: circle, plane: [X, Z], radius: 1 mm, feed: 3 m/min}]", "evaluate=[]"]
REPORTED_EVERY, RING = 12, 7
# A setting's rings: 2 * (12 // every + 1) rows, at the least 7.
RINGS = {1: 26, 2: 14, 3: 10, 5: 7, 8: 7, 40: 7}


def described(every: int, log: bool) -> Scenario:
    recorded = [f"recording.interval={125 * every} us", "recording.variables=[X.x_a, X.x_s, Z.M_s, Z.residual]"]
    return scenario.load(CIRCLE, [*CYCLES, *MOTION, *recorded, *(["logging={interval: 125 us, axes: [X]}"] * log)])


def begun(program: Program, cycles: int) -> Program:
    """The first so many cycles of a program."""
    parts = {name: {axis: x[: cycles + 1] for axis, x in getattr(program, name).items()} for name in ("x_s", "n_ffw")}
    return replace(program, time=program.time[: cycles + 1], segments=(), **parts)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("every", RINGS)
def test_every_row_is_that_of_an_unringed_recording(
    every: int, native: bool, fmus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = every == 5  # at the control cycle, beside the recording
    loaded = described(every, log)
    rows = RINGS[every]
    # Ends around those at which the rings are full for the second time and the third, and of short runs.
    totals = sorted({n * rows * every + more for n in (1, 2, 3) for more in range(-2, 3)} | set(range(1, 30, 4)))
    totals += [n * REPORTED_EVERY for n in range(1, 8)]
    program = nc.plan(loaded)
    whole = cosim.run(loaded, program=begun(program, max(totals)), fmus=fmus, native=native)
    assert len(whole.trace) <= schedule.RING, "the reference is not unringed"
    for room in (schedule, recording):
        monkeypatch.setattr(room, "RING", RING)
        monkeypatch.setattr(room, "REPORTED_EVERY", REPORTED_EVERY)
    for total in totals:
        run = cosim.run(loaded, program=begun(program, total), fmus=fmus, native=native)
        for one, other in [(run.trace, whole.trace), *([(run.fine, whole.fine)] if log else [])]:
            assert one is not None
            assert other is not None
            assert len(one) == total // (every if one is run.trace else 1) + 1
            np.testing.assert_array_equal(one.time, other.time[: len(one)], err_msg=f"{total} cycles")
            for name in one:
                np.testing.assert_array_equal(one[name], other[name][: len(one)], err_msg=f"{name}, {total} cycles")
