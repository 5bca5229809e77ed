"""Machines one after the other on the same units: each run is that of units which were opened for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.replay.machine_files import ElasticMode, with_modes
from feedsim.files.trace import Trace
from feedsim.foundation.errors import SimulationError
from feedsim.scenario import Machine, load_machine
from feedsim.scenario.axis_units import Measuring
from feedsim.simulation.cosim import Follower, follow
from feedsim.simulation.nc import Program
from machine_helpers import rigid_copy

MACHINES = Path(__file__).resolve().parents[2] / "scenarios" / "machines"
COLUMNS = ("X.x_a", "X.M_a", "X.M_fr")


def program(machine: Machine) -> Program:
    """A move of X by 2 mm within 40 ms, a sine of the speed."""
    time = machine.cycles.T_pos * np.arange(round(0.06 / machine.cycles.T_pos) + 1)
    phase = np.clip(time / 0.04, 0.0, 1.0)
    way = 2e-3 * (phase - np.sin(2 * np.pi * phase) / (2 * np.pi))
    speed = 2e-3 / 0.04 * (1 - np.cos(2 * np.pi * phase))
    x_s = {axis: np.full(len(time), machine.pose[axis]) for axis in machine.axes}
    n_ffw = {axis: np.zeros(len(time)) for axis in machine.axes}
    return Program(time, x_s | {"X": machine.pose["X"] + way}, n_ffw | {"X": speed / machine.axes["X"].I_P})


def same(one: Trace, other: Trace) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in COLUMNS)


@pytest.mark.parametrize("name", ["one_axis", "test_centre"])
def test_units_that_served_before_leave_the_same_bits(name: str, tmp_path: Path) -> None:
    """Another gain, other friction, other modes, and the first machine again; one axis is packed, three are not."""
    first = load_machine(rigid_copy(MACHINES / name, tmp_path / "rigid"))
    axis = first.axes["X"]
    drive = axis.drive.model_copy(update={"K_p": 0.7 * axis.drive.K_p})
    friction = axis.friction.model_copy(update={"F_C": 1.3 * axis.friction.F_C, "F_S": 1.5 * axis.friction.F_S})
    other = axis.model_copy(update={"drive": drive, "friction": friction, "constant_load": 0.4})
    second = first.model_copy(update={"axes": first.axes | {"X": other}})
    third = with_modes(second, "X", [ElasticMode(60.0, 0.03, 0.3, -0.2)])
    given = program(first)
    alone = [follow(machine, given, COLUMNS, 1e-3) for machine in (first, second, third)]
    assert not same(alone[0], alone[1])
    assert not same(alone[1], alone[2])
    with Follower() as follower:
        for k in (0, 1, 2, 0, 2):
            machine = (first, second, third)[k]
            assert same(follower.follow(machine, given, COLUMNS, 1e-3), alone[k]), k


def test_a_failed_run_leaves_nothing_behind(tmp_path: Path) -> None:
    """A setpoint that is no number ends in an error of a unit; the next run is as if nothing had been."""
    machine = load_machine(rigid_copy(MACHINES / "one_axis", tmp_path / "rigid"))
    given = program(machine)
    broken = {**given.x_s, "X": np.where(given.time < 0.03, given.x_s["X"], np.nan)}
    with Follower() as follower:
        before = follower.follow(machine, given, COLUMNS, 1e-3)
        with pytest.raises(SimulationError):
            follower.follow(machine, Program(given.time, broken, given.n_ffw), COLUMNS, 1e-3)
        assert same(follower.follow(machine, given, COLUMNS, 1e-3), before)


@pytest.mark.parametrize("native", [True, False])
def test_a_loop_that_served_before_leaves_the_same_bits(native: bool, tmp_path: Path) -> None:
    """Other setpoints, as many and fewer, other rows, a drive that shows more, and all of it again."""
    first = load_machine(rigid_copy(MACHINES / "one_axis", tmp_path / "rigid"))
    axis = first.axes["X"]
    measuring = axis.drive.model_copy(update={"measuring": Measuring(indirect=True)})
    second = first.model_copy(update={"axes": {"X": axis.model_copy(update={"drive": measuring})}})
    way = program(first)
    back = Program(way.time, {"X": 2 * first.pose["X"] - way.x_s["X"]}, {"X": -way.n_ffw["X"]})
    rows = len(way.time) // 2
    short = Program(way.time[:rows], {"X": way.x_s["X"][:rows]}, {"X": way.n_ffw["X"][:rows]})
    energies = (*COLUMNS, "X.x_s", "X.residual")
    asked = [
        (first, way, COLUMNS, 1e-3), (first, back, COLUMNS, 1e-3), (second, back, energies, 1e-3),
        (second, way, energies, 1e-3), (second, short, energies, 1e-3), (first, short, COLUMNS, 125e-6),
        (first, way, ("X.*",), 1e-3), (second, way, ("X.*",), 1e-3),
    ]  # fmt: skip
    alone = [follow(*each, native=native) for each in asked]
    with Follower(native=native) as follower:
        for k in (0, 1, 0, 2, 3, 2, 4, 4, 5, 5, 0, 6, 7, 6):
            found = follower.follow(*asked[k])
            assert [*found.columns] == [*alone[k].columns], k
            assert all(np.array_equal(found[name], alone[k][name]) for name in found.columns), k
