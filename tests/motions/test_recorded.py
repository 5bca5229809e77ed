"""Recorded setpoints in place of the NC's: resampling, run-in and run-out, limits. Oracles are closed forms."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.files.trace import convert, read_csv
from feedsim.foundation.errors import InputError
from feedsim.motions import Column, MeasuredSetpoints, Move
from feedsim.simulation.nc import plan
from scenario_helpers import scenario

POSE = {"X": 0.8, "Y": 0.327, "Z": 0.1}
LEAD = 0.020 / (2 * math.pi)
JERK = 150.0
Array = NDArray[np.float64]


def write_recording(path: Path, shift: float = 0.0, duration: float = 2.0) -> Path:
    """Z [mm] = 100 + 10 (1 - cos(pi t)) at uneven instants some 5 ms apart."""
    rng = np.random.default_rng(3)
    t = np.append(np.arange(0, duration - 1e-3, 5e-3) + rng.uniform(0, 1e-3, size=round(duration / 5e-3)), duration)
    t[0] = 0.0
    z = 100 + shift + 10 * (1 - np.cos(math.pi * t))
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(t.tolist(), z.tolist(), strict=True))
    path.write_text("time [s],z [mm]\n" + rows, encoding="utf-8")
    return path


def setpoints(path: Path, *, relative: bool) -> MeasuredSetpoints:
    return MeasuredSetpoints(file=path, columns={"Z": Column(column="z")}, relative=relative)


@pytest.mark.parametrize(("relative", "shift"), [(False, 0.0), (True, 250.0)])
def test_recording_is_resampled_by_a_cubic_spline(tmp_path: Path, relative: bool, shift: float) -> None:
    motion = setpoints(write_recording(tmp_path / "z.csv", shift), relative=relative)
    program = plan(scenario(motion, Move(by={"Z": 0.01}, feed=0.05)))
    inside = program.time <= 2.0
    t = program.time[inside]
    # cubic spline at steps h < 6 ms of a sine: A (pi h)^4/384 = 3e-12 m inside, some 100 times more at the ends
    assert program.x_s["Z"][inside] == pytest.approx(0.1 + 0.01 * (1 - np.cos(math.pi * t)), abs=2e-9)
    assert program.n_ffw["Z"][inside] * LEAD == pytest.approx(0.01 * math.pi * np.sin(math.pi * t), abs=2e-6)
    assert np.all(program.x_s["X"] == POSE["X"])
    recording, move = program.segments
    assert recording.duration == pytest.approx(2.0, abs=1e-12)
    assert move.start == pytest.approx(2.0, abs=1e-12)
    assert program.x_s["Z"][-1] == pytest.approx(0.11, abs=1e-12)


def test_recording_that_begins_elsewhere_is_refused_unless_relative(tmp_path: Path) -> None:
    path = write_recording(tmp_path / "z.csv", shift=1.0)
    with pytest.raises(InputError, match=r"axis Z stands at 100 mm, its recording begins at 101 mm; .*relative: true"):
        plan(scenario(setpoints(path, relative=False)))
    plan(scenario(setpoints(path, relative=True)))


def test_recording_cut_in_motion_gets_run_in_and_run_out(tmp_path: Path) -> None:
    """Constant 20 mm/s from the first row to the last, 1.0005 s: from rest and to rest in 2 sqrt(v/j) each."""
    path = tmp_path / "z.csv"
    t = np.append(np.arange(0, 1.0, 5e-3), 1.0005)
    path.write_text("time [s],z [mm]\n" + "".join(f"{a!r},{20 * a!r}\n" for a in t.tolist()))
    program = plan(scenario(setpoints(path, relative=True)))
    ramp = 2 * math.sqrt(0.02 / JERK)
    before = math.ceil(ramp / 1e-3) * 1e-3
    assert program.segments[0].duration == pytest.approx(before + 1.0005 + ramp, abs=1e-9)
    v = program.n_ffw["Z"] * LEAD
    within = (program.time >= before - 1e-9) & (program.time <= before + 1.0005)
    assert v[within] == pytest.approx(0.02, rel=1e-9)
    assert v[0] == v[-1] == 0
    # from rest at the pose; a ramp that is symmetric in time covers half of speed times duration
    assert program.x_s["Z"][0] == 0.1
    assert program.x_s["Z"][-1] - 0.1 == pytest.approx(0.02 * (1.0005 + ramp), abs=1e-9)
    # no jump anywhere: the largest acceleration is sqrt(v j), the second difference sees no more
    assert np.abs(np.diff(program.x_s["Z"], 2)).max() / 1e-6 <= math.sqrt(0.02 * JERK) * (1 + 1e-6)


def test_limits_hold_for_recordings_too(tmp_path: Path) -> None:
    t = np.arange(0, 0.5, 1e-3)
    z = 600 * t**3  # mm; 450 mm/s and 1.8 m/s2 at the end
    path = tmp_path / "z.csv"

    def write(values: Array) -> None:
        path.write_text("time [s],z [mm]\n" + "".join(f"{a:.3f},{b:.9f}\n" for a, b in zip(t, values, strict=True)))

    write(z)
    motion = setpoints(path, relative=True)
    plan(scenario(motion))
    spike = z.copy()
    spike[250] += 0.1  # 0.1 mm in 1 ms and back: 300 m/s2 and 0.2 m/s by second and first difference
    write(spike)
    with pytest.raises(InputError, match=r"motions\.0 \(setpoints\): axis Z reaches an acceleration of 19\d\.\d+ m/s"):
        plan(scenario(motion))
    write(1.3 * z)
    with pytest.raises(InputError, match=r"axis Z reaches a speed of 34\.\d+ m/min; allowed at most 30 m/min"):
        plan(scenario(motion))


@pytest.mark.skipif("FEEDSIM_EMPS" not in os.environ, reason="FEEDSIM_EMPS names no DATA_EMPS.mat")
def test_reference_of_a_real_axis_drives_the_default_z_axis(tmp_path: Path) -> None:
    """It begins at 14 mm/s and ends at -42 mm/s: run-in and run-out are its own."""
    path = tmp_path / "emps.csv"
    convert(os.environ["FEEDSIM_EMPS"], [("t", "time", "s"), ("qg", "q", "m")], path)
    motion = MeasuredSetpoints(file=path, columns={"Z": Column(column="q")}, relative=True)
    program = plan(scenario(motion))
    recorded = read_csv(path)
    length = recorded.time[-1] - recorded.time[0]
    spare = program.segments[0].duration - length
    assert 0 < spare < 0.1
    x = program.x_s["Z"]
    # the run-in takes 2 sqrt(v/j), and whole position cycles; the speed by a one-sided difference of second order
    q, h = recorded["q"], 1e-3
    v = (-3 * q[0] + 4 * q[1] - q[2]) / (2 * h)
    before = math.ceil(2 * math.sqrt(v / JERK) / h)
    moved = x - x[before]
    t = program.time - program.time[before]
    within = (t >= 0) & (t <= length)
    at = np.interp(t[within], recorded.time - recorded.time[0], recorded["q"] - recorded["q"][0])
    # linear interpolation at 1 kHz of a path with 0.84 m/s2 errs by a h^2/8 = 1e-7 m
    assert moved[within] == pytest.approx(at, abs=2e-7)
