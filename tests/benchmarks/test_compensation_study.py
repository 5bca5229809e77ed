"""Machines of the study of compensations: they load, their loops have margins, and their motors move what is said."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from compensation_study import MACHINES, written  # noqa: E402

from feedsim.analysis.proposals import axis_lag, least_margins, loop_lag  # noqa: E402
from feedsim.design.tune.circles import practical  # noqa: E402
from feedsim.linear.judgement import judge  # noqa: E402
from feedsim.scenario import load  # noqa: E402
from feedsim.structure import checked_modes  # noqa: E402


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_of_the_study(name: str, tmp_path: Path) -> None:
    made = MACHINES[name]
    machine = load(written(made, tmp_path)).machine
    modes = checked_modes(machine)
    loops = judge(machine, modes)
    for axis, own in (("X", made.X), ("Z", made.Z)):
        gain, phase = least_margins(loops, axis)
        assert gain > 6, axis
        assert phase > 30, axis
        assert modes.J_tot(axis) == pytest.approx(own.rotor + own.mass * own.I_P**2, rel=1e-9)
        drive = machine.shipped_drive(axis, "a test")
        assert drive.T_sym == pytest.approx(loop_lag(drive, machine.cycles, modes.J_tot(axis)), rel=1e-3)
    lags = [axis_lag(machine.shipped_drive(axis, "a test")) for axis in machine.axes]
    assert lags[0] == pytest.approx(lags[1], rel=1e-9)
    assert len(practical(machine, ("X", "Z"))) >= 17
