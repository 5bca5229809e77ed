"""The synthetic machines that growth with modes and axes is measured on: they run, and do the same at every size."""

from __future__ import annotations

from pathlib import Path

import machines
import numpy as np
import pytest

from feedsim import scenario
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim.structure import checked_modes


@pytest.mark.parametrize(("axes", "count"), [(1, 2), (1, 10), (3, 10), (3, 300), (12, 30)])
def test_every_size_runs(axes: int, count: int, tmp_path: Path, fmus: Path) -> None:
    file = machines.write(tmp_path, axes, count)
    loaded = scenario.load(file)
    modes = checked_modes(loaded.machine)
    assert len(modes.frequency) == count
    for axis in loaded.machine.axes:
        # The elastic motion is shared out among the modes, none of it lost: exact but for rounding.
        assert modes.J_tot(axis) == pytest.approx(machines.J_1 + machines.J_2, rel=1e-12)
        assert modes.J_inf(axis) == pytest.approx(machines.J_1, rel=1e-12)
    run = judge_run(cosim.run(loaded, fmus=fmus))
    # They are made to measure time: that their position loops are tight is told, and nothing else.
    assert {finding.code for finding in run.warnings} <= {"loop-margins-thin"}
    assert list(loaded.machine.axes) == list(machines.NAMES[:axes])
    for axis in loaded.machine.axes:
        x_a = run.trace[f"{axis}.x_a"] - machines.POSE
        # To and fro over 5 mm; at rest again where it began, within what friction holds of a settled position loop.
        assert x_a.max() == pytest.approx(5e-3, abs=1e-4)
        assert x_a.min() > -1e-4
        assert abs(x_a[-1]) < 3e-6


def test_same_seed_same_table() -> None:
    one, other = machines.modes(3, 93), machines.modes(3, 93)
    assert all(np.array_equal(one.ports[port], other.ports[port]) for port in one.ports)


def test_too_few_modes() -> None:
    with pytest.raises(ValueError, match="3 axes need 6 modes at least, not 5"):
        machines.modes(3, 5)
